"""`dyknow up` and `dyknow down`: platform processes started, shown and ended."""

import time
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import typer

from dyknow.agents.capabilities.flight.options import FlightOptions
from dyknow.agents.specification.options import RunOptions, SpecificationOptions
from dyknow.console.arguments import Duration, Metrics, Speed
from dyknow.console.command import Call, command
from dyknow.console.commands.members.ls import ls
from dyknow.console.commands.texts.specification_files import check_specified
from dyknow.console.errors import DONE, FAILED, INTERRUPTED, NO
from dyknow.console.output.output import unit_json
from dyknow.console.output.shown import line, styled
from dyknow.console.processes.launch import FleetPlan, clock_of, fleet_of, together, with_metrics
from dyknow.console.processes.scheduled import with_faults
from dyknow.console.processes.standing import forget, missing, note_state, running_units, started_units
from dyknow.console.processes.supervision import GRACE_S, Fleet, end, interruptible, outlasting, uninterrupted
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.members.directory import unit_order
from dyknow.model.errors import FederationFailed, Refused, TextError, WrongCall, did_you_mean
from dyknow.runtime.configuration import run_directory
from dyknow.runtime.configuration.config import NodeConfig, SimulatedVehicleConfig
from dyknow.runtime.configuration.settings import UnitFile

READY_S = 60.0
_LEAD_US = 3_000_000
_LEAD_PER_UNIT_US = 200_000
_FLOORS_M = {"emergency": 2.0, "logistics": 2.0}
"""Where work is done lower than platforms usually fly."""


class FleetStart:
    """Events of platforms that start: which joined, which found all others, and their notes, each once.

    Attributes:
        notes: which platforms noted it, by text.
        rejected: why platforms run nothing of their specification, by unit; platforms that wait for a host are left
            out.

    Args:
        units: the platforms that start.
        present: the platforms that run already.
        specified: the platforms that start with a specification, which they take or reject.
    """

    def __init__(self, units: Iterable[str], present: Iterable[str] = (), specified: Iterable[str] = ()) -> None:
        self.units = set(units)
        self._all = self.units.union(present)
        self.joined_us: dict[str, int] = {}
        self.labels: dict[str, list[str]] = {}
        self.complete_us: dict[str, int] = {}
        self.notes: dict[str, list[str]] = {}
        self.rejected: dict[str, str] = {}
        self._reading = set(specified)

    def on_heard(self, unit: str, said: dict[str, Any]) -> None:
        if said.get("event") in {"specified", "not-specified"}:
            self._reading.discard(unit)
        if said.get("event") == "joined":
            self.joined_us[unit] = int(said["at_us"])
            self.labels[unit] = [str(label) for label in said.get("labels", ())]
        elif said.get("event") == "directory":
            found = {str(name) for name in said["units"]} | {unit}
            if found >= self._all:
                self.complete_us.setdefault(unit, int(said["at_us"]))
        elif said.get("event") == "not-specified" and not said["runs"] and not said["awaits"]:
            self.rejected[unit] = str(said["said"])
        elif said.get("event") == "note" and unit not in (noting := self.notes.setdefault(str(said["text"]), [])):
            noting.append(unit)

    def all_joined(self) -> bool:
        return self.joined_us.keys() >= self.units

    def all_found(self) -> bool:
        """Every platform has joined, has found every other and has read its specification."""
        return (
            self.all_joined() and not self._reading and (len(self._all) == 1 or self.complete_us.keys() >= self.units)
        )

    @property
    def discovery_ms(self) -> int:
        """From the last platform's joining until the last directory was complete."""
        last = max(self.joined_us.values())
        return max(0, max(self.complete_us.values(), default=last) - last) // 1000


def _scenarios() -> list[str]:
    from dyknow.sim_uavs.dynamics.scenarios import NAMES

    return list(NAMES)


Scenario: TypeAlias = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help="crossing, emergency, encounter, hover, logistics, patrol, swarm or traffic.",
        autocompletion=_scenarios,
    ),
]
Seed: TypeAlias = Annotated[int, typer.Option(metavar="K", min=0, help="Wind, noise and routes follow from it.")]
Faults: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(metavar="FAULT", help="A fault that begins by itself: '0 dropped-box at load+4s' (repeatable)."),
]
FaultSeed: TypeAlias = Annotated[int | None, typer.Option(metavar="K", min=0, help="A fault for each, drawn from K.")]
Detach: TypeAlias = Annotated[
    bool, typer.Option("--detach", "-d", help="Return when all are ready; end them with down.")
]
Only: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(metavar="U", help="Start only this one here; the others run elsewhere (repeatable)."),
]
SpecificationOfEach: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE.kpl", help="The specification of each platform: its streams, exports, imports and monitors."
    ),
]


@command(example="dyknow up 3 --scenario crossing --detach")
def up(
    call: Call,
    units: Annotated[int, typer.Argument(metavar="[N]", min=1, max=250, help="How many UAVs.")] = 3,
    *,
    scenario: Scenario = "patrol",
    seed: Seed = 1,
    duration: Duration = None,
    spec: SpecificationOfEach = None,
    each: UnitFile,
    speed: Speed = 1.0,
    fault: Faults = None,
    fault_seed: FaultSeed = None,
    detach: Detach = False,
    only: Only = None,
    metrics: Metrics = None,
) -> int:
    """Start simulated UAVs, one process each, and wait until they have found each other.

    Over the streets of the scenario traffic, without --spec, each links cars and recognises their turns.
    Where some of them run already, those that are missing are started, one that has died as it was before.
    """
    each = _with_specification(each, spec, scenario)
    for own in (each, *(own.over(each) for own in call.settings.by_unit.values())):
        check_specified(own)
    plan = FleetPlan(units, scenario, seed, speed, tuple(only or ()), each=each)
    directory = run_directory.run_directory(call.settings.federation)
    present = sorted(running_units(directory), key=unit_order)
    faulty = with_faults(planned(call, plan, duration), fault or (), fault_seed)
    configs = missing(directory, with_metrics(faulty, metrics))
    if not present:
        (directory / run_directory.HANDLINGS_FILE).unlink(missing_ok=True)
    if not configs:
        _say_present(call, present)
        return DONE
    fleet = Fleet(directory, lifeline=not detach)
    _say_faults(call, configs)
    return _run(call, fleet, configs, present, detach=detach)


def _with_specification(each: UnitFile, spec: Path | None, scenario: str) -> UnitFile:
    """The options with the specification that was given, else with the ready one of the scenario, if any."""
    from dyknow.sim_uavs.monitoring.specifications import READY

    if scenario in _FLOORS_M:
        each = each.having(FlightOptions(floor_m=_FLOORS_M[scenario]))
    ready = READY.get(scenario)
    if spec is not None:
        return each.having(SpecificationOptions(spec=spec))
    if ready is None:
        return each
    modules = (*each[RunOptions].modules, *ready.modules)
    return each.having(SpecificationOptions(spec=ready.file), RunOptions(modules=modules))


def _run(call: Call, fleet: Fleet, configs: list[NodeConfig], present: list[str], *, detach: bool) -> int:
    """Start what is configured, and stay with it until it ends, unless it is left alone."""
    is_left = False
    with interruptible():
        try:
            gathering = gathered(call, fleet, configs, started_units(fleet.directory))
            if gathering.rejected.keys() >= gathering.units:
                first = min(gathering.rejected, key=unit_order)
                raise Refused(f"every platform rejects the specification:\n{gathering.rejected[first]}", "text")
            note_state(fleet, configs, stays=not detach)
            if not detach:
                outlasting(call.out)
            _say_ready(call, fleet, gathering, present)
            if detach:
                is_left = True
                return DONE
            return _stay(call, fleet)
        except KeyboardInterrupt:
            return INTERRUPTED
        finally:
            if not is_left:
                ended(fleet)
                names = sorted(fleet.running, key=unit_order)
                call.out.say("stopped", event="stopped", units=[unit_json(name) for name in names])


def planned(call: Call, plan: FleetPlan, duration: str | None = None) -> list[NodeConfig]:
    """The configurations of the platforms to start; raises WrongCall."""
    now_us = time.time_ns() // 1000
    lasts_us = duration_us(duration, option="--duration", least_us=SHORTEST_US) if duration else None
    start_us = None if plan.only else _start_us(call, plan, now_us)
    configs = fleet_of(call, plan._replace(duration_us=lasts_us, start_us=start_us), now_us)
    simulated = next((c.vehicle.count for c in configs if isinstance(c.vehicle, SimulatedVehicleConfig)), None)
    if simulated is not None:
        _checked_scenario(plan.scenario, simulated)
    return configs


def _start_us(call: Call, plan: FleetPlan, now_us: int) -> int:
    """When routes begin, for all at once: as soon as all can be expected to be ready (federation time)."""
    clock = clock_of(call.settings, plan.speed, now_us)
    running = FederationClock(now_us if clock.epoch_us is None else clock.epoch_us, clock.speed)
    return running.federation_us(now_us + _LEAD_US + _LEAD_PER_UNIT_US * plan.units)


def _checked_scenario(name: str, simulated: int) -> None:
    """Raises WrongCall for a scenario that there is not, or not with so few vehicles."""
    from dyknow.sim_uavs.dynamics.scenarios import NAMES, scenario

    if name not in NAMES:
        raise WrongCall(f"--scenario: there is no scenario {name!r}.{did_you_mean(name, NAMES)}")
    try:
        scenario(name, simulated)
    except TextError as error:
        raise WrongCall(f"--scenario: {error.message}; write {error.repair}.") from None


def gathered(call: Call, fleet: Fleet, configs: list[NodeConfig], present: Iterable[str] = ()) -> FleetStart:
    """Start them and wait until each has found all others, those `present` included; raises FederationFailed."""
    reading = [config.unit for config in configs if config[SpecificationOptions].spec is not None]
    gathering = FleetStart([config.unit for config in configs], present, reading)
    for group in together(configs):
        fleet.start_together({config.unit: config.model_dump_json() for config in group})
    with call.out.waiting(f"{len(configs)} platforms are looking for each other"):
        if not fleet.follow(gathering.all_found, gathering.on_heard, READY_S):
            late = sorted(gathering.units - (gathering.complete_us.keys() & gathering.joined_us.keys()))
            raise FederationFailed(
                f"after {READY_S:.0f} s the platforms {', '.join(late)} have not found all others; "
                f"run dyknow doctor, and look at the logs in {fleet.directory}"
            )
    return gathering


def _say_present(call: Call, present: list[str]) -> None:
    """Report that all requested platforms run already."""
    call.out.say(
        f"platforms {', '.join(present)} run already, nothing is missing; dyknow down ends them.",
        event="running",
        units=[unit_json(unit) for unit in present],
    )


def _say_faults(call: Call, configs: Iterable[NodeConfig]) -> None:
    for each in configs:
        for text in each.vehicle.faults if isinstance(each.vehicle, SimulatedVehicleConfig) else ():
            call.out.say(f"fault of {each.unit}: {text}", event="fault", unit=unit_json(each.unit), fault=text)


def _say_ready(call: Call, fleet: Fleet, gathering: FleetStart, present: list[str]) -> None:
    units = sorted(gathering.units, key=unit_order)
    said = f": platforms {', '.join(units)} found each other in {gathering.discovery_ms} ms"
    if present:
        one = len(units) == 1
        said = (
            f": platform{'' if one else 's'} {', '.join(units)} {'was' if one else 'were'} missing, and found "
            f"{', '.join(present)}, which ran already, in {gathering.discovery_ms} ms"
        )
    call.out.say(
        line(styled("ready", "green"), said),
        event="ready",
        **({"present": [unit_json(unit) for unit in present]} if present else {}),
        units=[unit_json(unit) for unit in units],
        pids={unit: fleet.running[unit].pid for unit in units},
        discovery_ms=gathering.discovery_ms,
    )
    tell_notes(call, gathering)


def tell_notes(call: Call, gathering: FleetStart) -> None:
    """Print the notes of platforms that have started, and whose they are, such as that the federation is open."""
    for text, units in gathering.notes.items() if not call.out.json_lines else ():
        names = f"platform{'' if len(units) == 1 else 's'} {', '.join(sorted(units, key=unit_order))}: "
        call.out.note(f"{names if len(gathering.units) > 1 else ''}{text}", style="dim")


def _stay(call: Call, fleet: Fleet) -> int:
    """Show the directory, then stay until all platforms have ended."""

    def tell(unit: str, code: int) -> None:
        call.out.say(f"platform {unit} ended with code {code}", event="ended", unit=unit_json(unit), code=code)

    if not call.out.json_lines:
        ls(call, all_kinds=False)
        name = "" if call.settings.federation == "default" else f" --federation {call.settings.federation}"
        call.out.note(f"Ctrl-C ends them. In another terminal: dyknow delegate monitor-proximity{name}")
    return FAILED if any(fleet.wait(tell).values()) else DONE


def ended(fleet: Fleet) -> None:
    """End the fleet, whatever is pressed meanwhile."""
    with uninterrupted():
        fleet.end()
        forget(fleet)


@command(example="dyknow down")
def down(call: Call) -> int:
    """End the platforms of the federation that up and join started on this machine; exit 1 if none runs."""
    directory = run_directory.run_directory(call.settings.federation)
    joined = run_directory.joined_states(directory)
    noted = [each for state in (run_directory.noted_state(directory), *joined.values()) for each in state.running]
    running = [found for found in noted if found.process() is not None]
    platforms = [found.unit for found in running if found.unit]
    before = sorted((found.unit for found in noted if found.unit and found not in running), key=unit_order)
    # A supervisor that stayed ends its own platforms, which takes its grace; the others are ended here.
    end([found for found in running if not found.unit], grace_s=3 * GRACE_S)
    end([found for found in running if found.unit])
    for file in (directory / run_directory.STATE_FILE, *joined):
        file.unlink(missing_ok=True)
    units = sorted(platforms, key=unit_order)
    if units:
        text = f"stopped: platforms {', '.join(units)}"
    else:
        text = f"no platform of federation {call.settings.federation} runs on this machine"
    record: dict[str, Any] = {"event": "stopped", "units": [unit_json(unit) for unit in units]}
    if before:
        text += f"; platform{'s' if len(before) > 1 else ''} {', '.join(before)} had ended before"
        record["ended_before"] = [unit_json(unit) for unit in before]
    call.out.say(text, **record)
    return DONE if running else NO
