"""`dyknow join`: one platform on a MAVLink vehicle or a recorded flight, in a child process of this command."""

import time
from pathlib import Path
from typing import Any

from console.brought_forth import tell_record
from console.client import connected
from console.command import Call
from console.errors import DONE, INTERRUPTED, FederationFailed, WrongCall
from console.instants import SHORTEST_US, duration_us, instant_us
from console.launch import clock_of, configured, hosts_of, journal_of, mavlink_endpoint, replayed, trust_of, wire_of
from console.output import unit_json
from console.processes import Fleet, interruptible, run_directory, uninterrupted
from console.specifications import read_text
from console.up import READY_S, Gathering, tell_notes
from federation.keys import unit as unit_name
from proxies.named_files import beside
from runtime.config import ClockConfig, MavlinkVehicle, NodeConfig, NoVehicle, ReplayedVehicle

_LOOK_S = 0.7
_POLL_S = 0.1


def join(call: Call, *, unit: str, duration: str | None, **chosen: Any) -> int:
    """Run the platform until its duration is over, it fails, or somebody interrupts."""
    unit_name(unit)
    config = _config(call, unit, duration, chosen)
    _fits_in(call, config)
    fleet = Fleet(run_directory(call.settings.federation), lifeline=True)
    gathering = Gathering([unit])
    with interruptible():
        try:
            fleet.start(unit, config.model_dump_json())
            early: list[dict[str, Any]] = []

            def on_heard(who: str, said: dict[str, Any]) -> None:
                gathering.on_heard(who, said)
                early.append(said)

            with call.out.waiting(f"platform {unit} is starting"):
                if not fleet.follow(gathering.all_joined, on_heard, READY_S):
                    raise FederationFailed(
                        f"platform {unit} did not join in {READY_S:.0f} s.\n{fleet.last_words(unit)}"
                    )
            labels = gathering.labels[unit]
            offers = f" offers {', '.join(labels) or 'no labels yet'}" if labels or chosen["spec"] is None else ""
            call.out.say(
                f"[green]joined[/green]: platform {unit}{offers}",
                event="joined",
                unit=unit_json(unit),
                labels=labels,
            )
            needed = config.vehicle.kind == "none"
            _check_specified(early, needed=needed)
            tell_notes(call, gathering)
            code = _followed(call, fleet, unit, early, needed=needed)
        except KeyboardInterrupt:
            return INTERRUPTED
        finally:
            with uninterrupted():
                fleet.end()
    if code:
        raise FederationFailed(f"platform {unit} ended with code {code}.\n{fleet.last_words(unit)}")
    return DONE


def _followed(call: Call, fleet: Fleet, unit: str, early: list[dict[str, Any]], *, needed: bool) -> int:
    """Show what the specification brings forth until the platform ends; its exit code."""
    heard = [said for said in early if said.get("event") != "note"]  # those are told
    while True:
        ended = fleet.ended()
        heard += [said for _, said in fleet.heard()]
        _check_specified(heard, needed=needed)
        for said in heard:
            tell_record(call, said)
        heard = []
        if unit in ended:
            return ended[unit]
        time.sleep(_POLL_S)


def _check_specified(heard: list[dict[str, Any]], *, needed: bool) -> None:
    """Without a vehicle and a specification a platform has nothing to do; raises WrongCall with all that is wrong.

    What lacks only streams that a host may yet offer waits for one; the platform says so.
    """
    for said in heard:
        if said.get("event") == "not-specified" and needed and not said["runs"] and not said["awaits"]:
            raise WrongCall(str(said["said"]))


def _milliseconds(limit: str | None) -> float | None:
    return None if limit is None else duration_us(limit, option="--govern", least_us=SHORTEST_US) / 1000


def _check_files(spec: Path | None, feed: Path | None) -> None:
    """What the platform will read can be read; raises WrongCall and TextErrors."""
    from console.specification_runs import read_fed
    from kpl import parse_specification

    if spec is not None:
        parse_specification(read_text(spec), str(spec), beside(spec))
    elif feed is not None:
        raise WrongCall("--feed: samples are for the sources of a specification; give it with --spec FILE.kpl.")
    if feed is not None:
        read_fed(feed)


def _absolute(path: Path | None) -> Path | None:
    """The platform is a process of its own, wherever that runs."""
    return None if path is None else path.absolute()


def _fits_in(call: Call, config: NodeConfig) -> None:
    """Two platforms of one name would be taken for one, and two clocks are two federations; raises WrongCall."""
    unit, speed = config.unit, config.clock.speed
    with connected(call) as client:
        there = {seen.unit: seen for seen in client.settle(_LOOK_S)}
        if unit in there:
            raise WrongCall(
                f"--unit: there is a platform {unit} in federation {call.settings.federation} already; choose another name."
            )
        known = any(seen.entry is not None and seen.entry.version for seen in there.values())
        runs = client.centre.clock.speed
        if known and runs != speed:
            remedy = f"join with --speed {runs:g}" if config.vehicle.kind == "replay" else "join another federation"
            raise WrongCall(
                f"--speed: federation {call.settings.federation} runs {runs:g} times as fast as the wall, "
                f"this platform would run {speed:g} times as fast; {remedy}."
            )


def _config(call: Call, unit: str, duration: str | None, chosen: dict[str, Any]) -> NodeConfig:
    mavlink, replay = chosen["mavlink"], chosen["replay"]
    if mavlink is not None and replay is not None:
        raise WrongCall("a platform has one vehicle: give --mavlink or --replay, not both.")
    if mavlink is None and replay is None and chosen["spec"] is None:
        raise WrongCall(
            "give the platform a vehicle, --mavlink udpin:127.0.0.1:14550 or --replay FILE for a recorded flight, "
            "or a specification of what it knows, --spec FILE.kpl."
        )
    _check_files(chosen["spec"], chosen["feed"])
    now_us = time.time_ns() // 1000
    speed = chosen["speed"] or 1.0
    vehicle: MavlinkVehicle | ReplayedVehicle | NoVehicle
    if replay is None:
        vehicle = NoVehicle() if mavlink is None else _mavlink(chosen, mavlink, speed)
        clock = clock_of(call.file, None, now_us)
    else:
        if chosen["control"] or chosen["sysid"] is not None:
            raise WrongCall("--control and --sysid belong to --mavlink: a recording cannot be commanded.")
        epoch = None if chosen["epoch"] == "now" else chosen["epoch"]
        vehicle = replayed(replay, chosen["from_"], epoch or "now", now_us, place="--replay")
        if epoch is None:
            # Now is when the process is there, in the time of the federation that it finds.
            vehicle = vehicle.model_copy(update={"epoch_us": None})
        clock = clock_of(call.file, chosen["speed"], now_us)
        if clock.speed != 1.0 and (call.file is None or call.file.clock.epoch is None):
            # Recordings that share an epoch share the clock that begins there, if none is running yet.
            begins_us = None if epoch is None else instant_us(epoch, now_us, option="--epoch")
            clock = ClockConfig(epoch_us=begins_us, speed=clock.speed, yields=True)
    return configured(
        {
            "unit": unit,
            "wire": wire_of(call, unit),
            "clock": clock,
            "trust": trust_of(call, unit),
            "vehicle": vehicle,
            "journal": journal_of(call.file, unit, vehicle),
            "avoidance": chosen["avoidance"],
            "translation": chosen["translation"],
            "spec": _absolute(chosen["spec"]),
            "units": [str(_absolute(Path(name))) if name.endswith(".py") else name for name in chosen["modules"] or ()],
            "feed": _absolute(chosen["feed"]),
            "hosts": hosts_of(call, unit),
            "admit": chosen["admit"],
            "govern_ms": _milliseconds(chosen["govern"]),
            "duration_s": duration_us(duration, option="--duration", least_us=SHORTEST_US) / 1e6 if duration else None,
        }
    )


def _mavlink(chosen: dict[str, Any], endpoint: str, speed: float) -> MavlinkVehicle:
    if speed != 1.0 or chosen["epoch"] is not None or chosen["from_"] != "0s":
        raise WrongCall("--speed, --epoch and --from belong to --replay: a vehicle's own clock cannot be driven.")
    endpoint = mavlink_endpoint(endpoint, place="--mavlink")
    return MavlinkVehicle(endpoint=endpoint, sysid=chosen["sysid"], control=chosen["control"])
