"""`dyknow up`, `dyknow join` and `dyknow down`: platform processes started, shown and ended."""

import time
from pathlib import Path
from typing import Any

import psutil

from console.command import Call
from console.errors import DONE, FAILED, INTERRUPTED, NO, FederationFailed, WrongCall, did_you_mean
from console.instants import SHORTEST_US, duration_us
from console.launch import clock_of, fleet_of
from console.ls import ls
from console.output import unit_json
from console.processes import (
    GRACE_S,
    STATE_FILE,
    Fleet,
    Running,
    State,
    end,
    interruptible,
    noted_state,
    read_state,
    run_directory,
    uninterrupted,
    write_state,
)
from dyknow.errors import TextError
from federation.clock import FederationClock
from federation.directory import unit_order
from runtime.config import NodeConfig, SimulatedVehicle

READY_S = 60.0
_LEAD_US = 3_000_000
_LEAD_PER_UNIT_US = 200_000


class Gathering:
    """What the platforms have said so far: who joined, whom each has found, and what they note, each remark once."""

    def __init__(self, units: list[str]) -> None:
        self.units = set(units)
        self.joined_us: dict[str, int] = {}
        self.labels: dict[str, list[str]] = {}
        self.complete_us: dict[str, int] = {}
        self.notes: list[str] = []

    def on_heard(self, unit: str, said: dict[str, Any]) -> None:
        if said.get("event") == "joined":
            self.joined_us[unit] = int(said["at_us"])
            self.labels[unit] = [str(label) for label in said.get("labels", ())]
        elif said.get("event") == "directory":
            found = {str(name) for name in said["units"]} | {unit}
            if found >= self.units:
                self.complete_us.setdefault(unit, int(said["at_us"]))
        elif said.get("event") == "note" and (text := str(said["text"])) not in self.notes:
            self.notes.append(text)

    def all_joined(self) -> bool:
        return self.joined_us.keys() >= self.units

    def all_found(self) -> bool:
        """Every platform has joined and has found every other."""
        return self.all_joined() and (len(self.units) == 1 or self.complete_us.keys() >= self.units)

    @property
    def discovery_ms(self) -> int:
        """From the last platform's joining until the last directory was complete."""
        last = max(self.joined_us.values())
        return max(0, max(self.complete_us.values(), default=last) - last) // 1000


def up(call: Call, *, detach: bool, **chosen: Any) -> int:
    """Start the platforms, wait until they have found each other, and stay with them unless detached."""
    configs = planned(call, **chosen)
    fleet = Fleet(_vacant(call), lifeline=not detach)
    is_left = False
    with interruptible():
        try:
            gathering = gathered(call, fleet, configs)
            _note_state(fleet, configs, stays=not detach)
            _say_ready(call, fleet, gathering)
            if detach:
                is_left = True
                return DONE
            return _stay(call, fleet)
        except KeyboardInterrupt:
            return INTERRUPTED
        finally:
            if not is_left:
                ended(fleet)
                units = sorted(fleet.running, key=unit_order)
                call.out.say("stopped", event="stopped", units=[unit_json(unit) for unit in units])


def _note_state(fleet: Fleet, configs: list[NodeConfig], *, stays: bool) -> None:
    """Note for other commands who runs and where; a supervisor that stays is to be ended first."""
    running = [*fleet.running.values()]
    if stays:
        mine = psutil.Process()
        running.append(Running("", mine.pid, mine.create_time()))
    endpoints = [endpoint for config in configs for endpoint in config.wire.listen]
    write_state(fleet.directory, State(tuple(running), tuple(endpoints)))


def planned(
    call: Call,
    *,
    units: int,
    scenario: str,
    seed: int,
    duration: str | None = None,
    gcs: str | None = None,
    persona: str = "ardupilot",
    avoidance: bool = True,
    speed: float = 1.0,
    only: list[str] | None = None,
) -> list[NodeConfig]:
    """The configurations of the platforms to start; raises WrongCall."""
    now_us = time.time_ns() // 1000
    chosen: dict[str, Any] = {
        "units": units,
        "scenario": scenario,
        "seed": seed,
        "gcs": gcs,
        "persona": persona,
        "avoidance": avoidance,
        "speed": speed,
        "only": only,
        "duration_us": duration_us(duration, option="--duration", least_us=SHORTEST_US) if duration else None,
    }
    chosen["start_us"] = None if only else _start_us(call, chosen, now_us)
    configs = fleet_of(call, chosen, now_us)
    simulated = next((c.vehicle.count for c in configs if isinstance(c.vehicle, SimulatedVehicle)), None)
    if simulated is not None:
        _checked_scenario(scenario, simulated)
    return configs


def _start_us(call: Call, chosen: dict[str, Any], now_us: int) -> int:
    """When routes begin, for all at once: as soon as everybody can be expected to be there (federation time)."""
    clock = clock_of(call.file, chosen["speed"], now_us)
    running = FederationClock(now_us if clock.epoch_us is None else clock.epoch_us, clock.speed)
    return running.federation_us(now_us + _LEAD_US + _LEAD_PER_UNIT_US * int(chosen["units"]))


def _checked_scenario(name: str, simulated: int) -> None:
    """Raises WrongCall for a scenario that there is not, or not with so few vehicles."""
    from sim_uavs.scenarios import NAMES, scenario

    if name not in NAMES:
        raise WrongCall(f"--scenario: there is no scenario {name!r}.{did_you_mean(name, NAMES)}")
    try:
        scenario(name, simulated)
    except TextError as error:
        raise WrongCall(f"--scenario: {error.message}.") from None


def _vacant(call: Call) -> Path:
    """The run directory, if no platforms of this federation run here already."""
    directory = run_directory(call.settings.federation)
    if running := read_state(directory).running:
        units = ", ".join(found.unit for found in running if found.unit)
        raise WrongCall(
            f"--federation {call.settings.federation}: its platforms {units} are running on this machine already; "
            "end them with dyknow down, or choose another name."
        )
    return directory


def gathered(call: Call, fleet: Fleet, configs: list[NodeConfig]) -> Gathering:
    """Start them and wait until each has found all others; raises FederationFailed."""
    gathering = Gathering([config.unit for config in configs])
    for config in configs:
        fleet.start(config.unit, config.model_dump_json())
    with call.out.waiting(f"{len(configs)} platforms are looking for each other"):
        if not fleet.follow(gathering.all_found, gathering.on_heard, READY_S):
            late = sorted(gathering.units - (gathering.complete_us.keys() & gathering.joined_us.keys()))
            raise FederationFailed(
                f"after {READY_S:.0f} s the platforms {', '.join(late)} have not found all others; "
                f"run dyknow doctor, and look at the logs in {fleet.directory}"
            )
    return gathering


def _say_ready(call: Call, fleet: Fleet, gathering: Gathering) -> None:
    units = sorted(gathering.units, key=unit_order)
    call.out.say(
        f"[green]ready[/green]: platforms {', '.join(units)} found each other in {gathering.discovery_ms} ms",
        event="ready",
        units=[unit_json(unit) for unit in units],
        pids={unit: fleet.running[unit].pid for unit in units},
        discovery_ms=gathering.discovery_ms,
    )
    tell_notes(call, gathering)


def tell_notes(call: Call, gathering: Gathering) -> None:
    """What people should know of those that have started, such as that anybody may command them."""
    if not call.out.json_lines:
        for text in gathering.notes:
            call.out.note(text, style="dim")


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
        (fleet.directory / STATE_FILE).unlink(missing_ok=True)


def down(call: Call) -> int:
    """End the platforms of this federation that `up` started on this machine, by their ids."""
    directory = run_directory(call.settings.federation)
    noted = noted_state(directory).running
    running = [found for found in noted if found.process() is not None]
    platforms = [found.unit for found in running if found.unit]
    before = sorted((found.unit for found in noted if found.unit and found not in running), key=unit_order)
    # A supervisor that stayed ends its own platforms, which takes its grace; the others are ended here.
    end([found for found in running if not found.unit], grace_s=3 * GRACE_S)
    end([found for found in running if found.unit])
    (directory / STATE_FILE).unlink(missing_ok=True)
    units = sorted(platforms, key=unit_order)
    if units:
        text = f"stopped: platforms {', '.join(units)}"
    else:
        text = f"nothing that up --detach started runs in federation {call.settings.federation}"
    record: dict[str, Any] = {"event": "stopped", "units": [unit_json(unit) for unit in units]}
    if before:
        text += f"; platform{'s' if len(before) > 1 else ''} {', '.join(before)} had ended before"
        record["ended_before"] = [unit_json(unit) for unit in before]
    call.out.say(text, **record)
    return DONE if running else NO
