"""`dyknow join`: a platform on a MAVLink vehicle or a recorded flight, or several on the vehicles of one endpoint.

They run in one child process of this command.
"""

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from dyknow.agents.specification.options import SpecificationOptions
from dyknow.console.arguments import Duration, LogLevel, Metrics, Speed
from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.commands.fleet.up import READY_S, FleetStart, tell_notes
from dyknow.console.commands.texts.run_output import tell_record
from dyknow.console.commands.texts.specification_files import check_specified
from dyknow.console.errors import DONE, INTERRUPTED
from dyknow.console.output.output import unit_json
from dyknow.console.output.shown import line, styled
from dyknow.console.processes.launch import (
    check_forward,
    clock_of,
    mavlink_vehicle,
    platform_config,
    replayed,
    together,
    with_metrics,
)
from dyknow.console.processes.supervision import Fleet, interruptible, outlasting, uninterrupted
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.model.errors import FederationFailed, WrongCall
from dyknow.runtime.configuration.config import (
    ClockConfig,
    EndpointOptions,
    MavlinkOptions,
    MavlinkVehicle,
    NodeConfig,
    NoVehicle,
    ReplayOptions,
    Vehicle,
)
from dyknow.runtime.configuration.instants import instant_us
from dyknow.runtime.configuration.local_endpoints import noted_local
from dyknow.runtime.configuration.run_directory import JOINED, ProcessState, run_directory, this_process, write_state
from dyknow.runtime.configuration.settings import UnitFile
from dyknow.runtime.records import is_at_least

_LOOK_S = 0.7
_POLL_S = 0.1


@command(example="dyknow join --unit 3 --mavlink udpin:127.0.0.1:14550 --control")
def join(
    call: Call,
    *,
    unit: Annotated[
        list[str], typer.Option(metavar="U", help="Its name in the federation (repeatable, with --sysid).")
    ],
    sysid: Annotated[
        list[int] | None,
        typer.Option(metavar="S", min=1, max=255, help="Which vehicle, when several send there; one for each --unit."),
    ] = None,
    own: UnitFile,
    speed: Speed = 1.0,
    duration: Duration = None,
    metrics: Metrics = None,
    log_level: LogLevel = "info",
) -> int:
    """One platform on any MAVLink vehicle, on a recorded flight, or on a specification alone."""
    lasts_us = duration_us(duration, option="--duration", least_us=SHORTEST_US) if duration else None
    configs = []
    for name, each in _units(unit, sysid or [], own):
        vehicle, clock = _vehicle(call, each, speed or 1.0)
        lasts_s = None if lasts_us is None else lasts_us / 1e6
        configs.append(platform_config(call, name, vehicle, clock, each, duration_s=lasts_s))
    configs = with_metrics(configs, metrics)
    together(configs)
    fits_in(call, configs)
    return _run(call, configs, log_level)


def _units(names: list[str], sysids: list[int], own: UnitFile) -> list[tuple[str, UnitFile]]:
    """The platforms with their options, each with a vehicle of its own; raises WrongCall and TextErrors."""
    if len(set(names)) < len(names) or (len(names) > 1 and own[EndpointOptions].mavlink is None):
        raise WrongCall("--unit: several platforms join the vehicles of one --mavlink endpoint, each by its own name.")
    if sysids and len(sysids) != len(names):
        raise WrongCall("--sysid: give one for each --unit, in the same order: --unit a --sysid 1 --unit b --sysid 2.")
    _check_sources(own)
    each = [own.having(MavlinkOptions(sysid=sysid)) for sysid in sysids] or [own] * len(names)
    return list(zip(names, each, strict=True))


def _run(call: Call, configs: list[NodeConfig], log_level: str) -> int:
    """Run the platforms until their duration is over, one fails, or they are interrupted."""
    units, needed = [config.unit for config in configs], configs[0].vehicle.kind == "none"
    named = f"platform{'s' if len(units) > 1 else ''} {', '.join(units)}"
    fleet = Fleet(run_directory(call.settings.federation), lifeline=True)
    gathering = FleetStart(units)
    early: list[dict[str, Any]] = []
    noted: Path | None = None

    def on_heard(who: str, event: dict[str, Any]) -> None:
        gathering.on_heard(who, event)
        early.append(event)

    with interruptible():
        try:
            fleet.start_together({config.unit: config.model_dump_json() for config in configs})
            running = (*fleet.running.values(), this_process())
            state = ProcessState(running, local=noted_local(config.wire for config in configs))
            noted = write_state(fleet.directory / JOINED, state, f"{units[0]}.json")
            with call.out.waiting(f"{named}: starting"):
                if not fleet.follow(gathering.all_joined, on_heard, READY_S):
                    raise FederationFailed(f"{named} did not join in {READY_S:.0f} s.\n{fleet.last_words(units[0])}")
            outlasting(call.out)
            for config in configs:
                _say_joined(call, config, gathering.labels[config.unit])
            _check_specified(early, needed=needed)
            tell_notes(call, gathering)
            code = _followed(call, fleet, units, early, log_level, needed=needed)
        except KeyboardInterrupt:
            return INTERRUPTED
        finally:
            with uninterrupted():
                fleet.end()
                if noted is not None:
                    noted.unlink(missing_ok=True)
    if code:
        raise FederationFailed(f"{named} ended with code {code}.\n{fleet.last_words(units[0])}")
    return DONE


def _say_joined(call: Call, config: NodeConfig, labels: list[str]) -> None:
    unit, vehicle = config.unit, config.vehicle
    offers = (
        f" offers {', '.join(labels) or 'no labels yet'}" if labels or config[SpecificationOptions].spec is None else ""
    )
    if isinstance(vehicle, MavlinkVehicle):
        whose = "" if vehicle.sysid is None else f"system {vehicle.sysid} at "
        offers += f" when it hears {whose}{vehicle.endpoint}"
    call.out.say(
        line(styled("joined", "green"), f": platform {unit}{offers}"),
        event="joined",
        unit=unit_json(unit),
        labels=labels,
    )


def _followed(
    call: Call, fleet: Fleet, units: list[str], early: list[dict[str, Any]], log_level: str, *, needed: bool
) -> int:
    """Show what the specification brings forth until the platforms end; the exit code."""
    heard = [said for said in early if said.get("event") != "note" or call.out.json_lines]  # as text they are shown
    while True:
        ended = fleet.ended()
        heard += [said for _, said in fleet.heard()]
        _check_specified(heard, needed=needed)
        for said in heard:
            if is_at_least(said, log_level):
                tell_record(call, said)
        heard = []
        if units[0] in ended:
            return ended[units[0]]
        time.sleep(_POLL_S)


def _check_specified(heard: list[dict[str, Any]], *, needed: bool) -> None:
    """Without a vehicle and a specification a platform has nothing to do; raises WrongCall with all that is wrong.

    A specification that lacks only streams which a host may yet offer waits for one; the platform notifies the user.
    """
    for said in heard:
        if said.get("event") == "not-specified" and needed and not said["runs"] and not said["awaits"]:
            raise WrongCall(str(said["said"]))


def _check_sources(own: UnitFile) -> None:
    """Whether there is something to run, and the files can be read; raises WrongCall and TextErrors."""
    mavlink, replay = own[EndpointOptions].mavlink, own[ReplayOptions].replay
    if mavlink is not None and replay is not None:
        raise WrongCall("a platform has one vehicle: give --mavlink or --replay, not both.")
    if mavlink is None and replay is None and own[SpecificationOptions].spec is None:
        raise WrongCall(
            "give the platform a vehicle, --mavlink udpin:127.0.0.1:14550 or --replay FILE for a recorded flight, "
            "or a specification of what it knows, --spec FILE.kpl."
        )
    check_specified(own)


def fits_in(call: Call, configs: list[NodeConfig]) -> None:
    """Two platforms of one name would be taken for one, and two clocks are two federations; raises WrongCall."""
    speed = configs[0].clock.speed
    with connected(call) as client:
        there = {seen.unit: seen for seen in client.settle(_LOOK_S)}
        for unit in [config.unit for config in configs if config.unit in there]:
            raise WrongCall(
                f"--unit: there is a platform {unit} in federation {call.settings.federation} already; choose another name."
            )
        known = any(seen.entry is not None and seen.entry.version for seen in there.values())
        runs = client.centre.clock.speed
        if known and runs != speed:
            remedy = f"join with --speed {runs:g}" if configs[0].vehicle.kind == "replay" else "join another federation"
            raise WrongCall(
                f"--speed: federation {call.settings.federation} runs {runs:g} times as fast as the wall, "
                f"this platform would run {speed:g} times as fast; {remedy}."
            )


def _vehicle(call: Call, own: UnitFile, speed: float) -> tuple[Vehicle, ClockConfig]:
    """The vehicle of the platform, and the federation's clock as it needs it; raises WrongCall."""
    now_us = time.time_ns() // 1000
    check_forward(own, place="--forward")
    recorded, link = own[ReplayOptions], own[MavlinkOptions]
    if recorded.replay is None:
        if own[EndpointOptions].mavlink is None:
            return NoVehicle(), clock_of(call.settings, None, now_us)
        if speed != 1.0 or recorded.epoch is not None or recorded.from_ != "0s":
            raise WrongCall("--speed, --epoch and --from belong to --replay: a vehicle's own clock cannot be driven.")
        return mavlink_vehicle(own, place="--mavlink"), clock_of(call.settings, None, now_us)
    if (
        link.control
        or link.sysid is not None
        or link.compid is not None
        or link.signing_key is not None
        or link.unsigned
    ):
        raise WrongCall(
            "--control, --sysid, --compid, --signing-key and --unsigned belong to --mavlink: a recording cannot be commanded."
        )
    epoch = None if recorded.epoch == "now" else recorded.epoch
    replay = replayed(recorded.replay, recorded.from_, epoch or "now", now_us, place="--replay")
    if epoch is None:
        # Now is when the process is there, in the time of the federation that it finds.
        replay = replay.model_copy(update={"epoch_us": None})
    clock = clock_of(call.settings, speed, now_us)
    if clock.speed != 1.0 and call.settings.clock.epoch is None:
        # Recordings that share an epoch share the clock that begins there, if none is running yet.
        begins_us = None if epoch is None else instant_us(epoch, now_us, option="--epoch")
        clock = ClockConfig(epoch_us=begins_us, speed=clock.speed, yields=True)
    return replay, clock
