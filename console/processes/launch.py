"""From the options of a command to the configuration of each platform process."""

import os
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from console.command import Call
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.model.errors import TextError, WrongCall, did_you_mean
from federation.keys import unit as unit_name
from runtime.configuration import config
from runtime.configuration.instants import instant_us
from runtime.configuration.local_endpoints import free_ports, with_local_endpoint
from runtime.configuration.reach import trust_files, wire_of
from runtime.configuration.run_directory import run_directory
from runtime.configuration.settings import Persona, Settings, UnitFile

_NOTHING = UnitFile()
_LIMITS = ("floor_m", "ceiling_m", "range_m")


class FleetPlan(NamedTuple):
    """The processes that `dyknow up` starts.

    Attributes:
        units: the number of platforms with numbers as names; the federation's file may name more.
        seed: of wind, noise and routes.
        gcs: a ground station's HOST:PORT that every autopilot also speaks MAVLink to.
        speed: how many times faster than the wall the federation's clock runs.
        only: start only these platforms here.
        duration_us: after this long they end by themselves.
        start_us: federation time at which routes begin; None: when the process starts.
        each: the specification of each platform, but of those for which the federation's file has one.
    """

    units: int
    scenario: str
    seed: int = 1
    persona: Persona = "ardupilot"
    gcs: str | None = None
    avoidance: bool = True
    speed: float = 1.0
    only: tuple[str, ...] = ()
    duration_us: int | None = None
    start_us: int | None = None
    each: UnitFile = _NOTHING


def _meshed(call: Call, names: Sequence[str], special: Mapping[str, UnitFile]) -> Mapping[str, UnitFile]:
    """Without multicast and without endpoints every platform gets a port of its own, and dials those before it."""
    settings = call.settings
    told = settings.listen or settings.connect or any(own.listen or own.connect for own in special.values())
    if settings.discover != "none" or told:
        return special
    protocol = "tls" if settings.roster else "tcp"
    endpoints = [f"{protocol}/127.0.0.1:{port}" for port in free_ports(len(names))]
    return {
        name: special.get(name, _NOTHING).model_copy(
            update={"listen": (endpoints[at],), "connect": tuple(endpoints[:at])}
        )
        for at, name in enumerate(names)
    }


def clock_of(settings: Settings, speed: float | None, now_us: int) -> config.ClockConfig:
    """The federation's clock. A clock that runs faster begins now, unless the file has an epoch."""
    chosen = speed or settings.clock.speed
    if settings.clock.epoch is not None:
        return config.ClockConfig(
            epoch_us=instant_us(settings.clock.epoch, now_us, option="[clock] epoch"), speed=chosen
        )
    return config.ClockConfig(epoch_us=None if chosen == 1.0 else now_us, speed=chosen)


def journal_of(journal: Path | None, unit: str, vehicle: Any) -> Path | None:
    """Where the platform keeps its journal, if there is a directory for journals.

    Raises:
        WrongCall: nothing can be written there, or the flight to be replayed would be overwritten.
    """
    if journal is None:
        return None
    try:
        journal.mkdir(parents=True, exist_ok=True)
        is_writable = os.access(journal, os.W_OK | os.X_OK)
    except OSError:
        is_writable = False
    if not is_writable:
        raise WrongCall(f"journal: {journal} is no directory that can be written; name another.")
    found = journal.resolve() / f"{unit}.mcap"
    if isinstance(vehicle, config.ReplayedVehicle) and vehicle.file == found:
        raise WrongCall(f"journal: {found} is what platform {unit} replays, and would be overwritten; name another.")
    return found


def _absolute(path: Path | None) -> Path | None:
    """The platform is a process of its own, wherever that runs."""
    return None if path is None else path.absolute()


def _found_anywhere(module: str) -> str:
    """A module that is named as a file is found from any working directory."""
    return str(Path(module).absolute()) if module.endswith(".py") else module


def platform_config(
    call: Call, unit: str, vehicle: config.Vehicle, clock: config.ClockConfig, own: UnitFile = _NOTHING, **more: Any
) -> config.NodeConfig:
    """The configuration of one platform's process; raises WrongCall that names the option that does not fit.

    Args:
        call: the options of all platforms.
        unit: the platform's name.
        vehicle: its vehicle.
        clock: the federation's.
        own: its own entry in the federation's file.
        more: further fields of NodeConfig.
    """
    unit_name(unit)
    _check_texts(call, own)
    fields = {
        "unit": unit,
        "wire": with_local_endpoint(wire_of(call.settings, unit, own)),
        "clock": clock,
        "trust": trust_files(call.settings, unit),
        "trusted": {name: each.trust for name, each in call.settings.by_unit.items() if each.trust < 1.0},
        "vehicle": vehicle,
        "journal": journal_of(call.settings.journal, unit, vehicle),
        "encounters": _absolute(call.settings.encounters),
        "ontology": None if call.settings.ontology is None else call.settings.ontology.absolute(),
        "translation": own.translation,
        "profiles": own.profiles,
        "hosts": hosts_of(call, unit),
        "spec": _absolute(own.spec),
        "units": [_found_anywhere(name) for name in own.modules],
        "learnt": _absolute(own.learnt),
        "feed": _absolute(own.feed),
        "roads": _absolute(own.roads),
        "elevation": _absolute(own.elevation),
        "admit": own.admit or "refuse",
        "shedding": own.shedding,
        "govern_ms": duration_us(own.govern, option="govern", least_us=SHORTEST_US) / 1e3 if own.govern else None,
        **{name: value for name in _LIMITS if (value := getattr(own, name)) is not None},
        "extensions": [_found_anywhere(name) for name in call.settings.extensions],
        **more,
    }
    try:
        return config.NodeConfig.model_validate(fields)
    except ValidationError as error:
        wrong = [f"{'.'.join(str(p) for p in e['loc'])}: {e['msg']} (got {e['input']!r})." for e in error.errors()]
        raise WrongCall("\n".join(wrong)) from None


def fleet_of(call: Call, plan: FleetPlan, now_us: int) -> list[config.NodeConfig]:
    """The platforms of `dyknow up`: `units` of them by number, and those that the file names besides; raises WrongCall."""
    special = dict(call.settings.by_unit)
    names = [str(number) for number in range(plan.units)]
    names += [name for name in special if name not in names]
    special = {name: specified(own, plan.each) for name, own in _meshed(call, names, special).items()}
    nothing = specified(_NOTHING, plan.each)
    simulated = [name for name in names if not (s := special.get(name, _NOTHING)).mavlink and not s.replay]
    clock = clock_of(call.settings, plan.speed, now_us)
    return [
        platform_config(
            call,
            name,
            _vehicle(name, own := special.get(name, nothing), simulated, plan, now_us),
            clock,
            own,
            avoidance=plan.avoidance if own.avoidance is None else own.avoidance,
            duration_s=None if plan.duration_us is None else plan.duration_us / 1e6,
        )
        for name in only_these(names, plan.only)
    ]


def with_metrics(configs: Sequence[config.NodeConfig], port: int | None) -> list[config.NodeConfig]:
    """The platforms with a port each for their figures, the first of them `port`; as they are without one.

    Raises:
        WrongCall: there is no library that serves them.
    """
    if port is not None and find_spec("prometheus_client") is None:
        raise WrongCall(
            "--metrics needs prometheus-client, which is not installed; install the extra: "
            "pip install 'dyknow-federation[metrics]'"
        )
    return [each if port is None else each.model_copy(update={"metrics": port + at}) for at, each in enumerate(configs)]


def specified(own: UnitFile, each: UnitFile) -> UnitFile:
    """A platform with the specification for each, unless the file has one of its own."""
    names = ("spec", "modules", "feed", "roads", "govern", "admit")
    found = {name: getattr(own, name) or getattr(each, name) for name in names}
    return own.model_copy(update=found | {"floor_m": each.floor_m if own.floor_m is None else own.floor_m})


def hosts_of(call: Call, unit: str) -> Path:
    """Where hosts of this machine register with a platform."""
    return run_directory(call.settings.federation) / f"{unit}.hosts"


def _how_many(name: str) -> str:
    """What to write if a platform is beyond the number of them."""
    return f" For more platforms write how many there are: dyknow up {int(name) + 1}." if name.isdigit() else ""


def only_these(names: Sequence[str], only: Sequence[str]) -> Sequence[str]:
    """The platforms to start here; the federation's others run elsewhere. Raises WrongCall for an unknown one."""
    for name in only:
        if name not in names:
            raise WrongCall(
                f"--only: this federation has no platform {name!r}.{did_you_mean(name, names)}{_how_many(name)}"
            )
    return only or names


def _vehicle(
    unit: str, own: UnitFile, simulated: list[str], plan: FleetPlan, now_us: int
) -> config.SimulatedVehicleConfig | config.MavlinkVehicle | config.ReplayedVehicle:
    """The vehicle of the platform: the file's vehicle or recording, else a simulated UAV."""
    check_forward(own, place=f"[unit.{unit}]")
    if own.mavlink:
        return mavlink_vehicle(own, place=f"[unit.{unit}] mavlink")
    if own.replay:
        return replayed(own.replay, own.from_ or "0s", own.epoch or "now", now_us, place=f"[unit.{unit}]")
    return config.SimulatedVehicleConfig(
        scenario=plan.scenario,
        index=simulated.index(unit),
        count=len(simulated),
        seed=plan.seed,
        persona=own.persona or plan.persona,
        gcs=_address(own.gcs or plan.gcs),
        start_us=plan.start_us,
    )


def _address(text: str | None) -> str | None:
    """A ground station's `HOST:PORT`; raises WrongCall."""
    if text is None:
        return None
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit() or not 0 < int(port) < 65_536:
        raise WrongCall(f"--gcs: {text!r} is no address; write HOST:PORT, e.g. 127.0.0.1:14550.")
    return text


def check_forward(own: UnitFile, *, place: str) -> None:
    """Raise WrongCall if something is to be forwarded, and there is no vehicle or no ground station."""
    if own.forward is not None and own.mavlink is None:
        raise WrongCall(f"{place}: forward belongs to mavlink: there is no vehicle whose messages could be forwarded.")
    if own.forward is None and (own.forward_commands or own.forward_beyond):
        raise WrongCall(f"{place}: there is no ground station; name one with forward, udp://127.0.0.1:14550.")


def mavlink_vehicle(own: UnitFile, *, place: str) -> config.MavlinkVehicle:
    """A vehicle that speaks MAVLink, its endpoint and its key looked at; raises WrongCall."""
    from proxies.mavlink.endpoints import parse_endpoint
    from proxies.mavlink.signing import insist_on_key, read_key
    from proxies.outward.outlets import parse_destination

    text, key = own.mavlink or "", own.signing_key
    try:
        endpoint = parse_endpoint(text)
    except TextError as error:
        raise WrongCall(f"{place}: {text!r}: {error.message}; write {error.repair}.") from None
    if key is not None:
        read_key(key)
    insist_on_key(endpoint, place, control=bool(own.control), has_key=key is not None, unsigned=own.unsigned)
    if own.forward is not None:
        to = parse_destination(own.forward, beyond=own.forward_beyond, kinds=("udp",))
        if to.port == endpoint.number and endpoint.kind == "udpin":
            raise WrongCall(
                f"{place}: forward: {to} is where the vehicle is heard; the ground station needs a port of its own."
            )
    return config.MavlinkVehicle(
        endpoint=str(endpoint),
        sysid=own.sysid,
        compid=own.compid,
        control=own.control,
        signing_key=None if key is None else key.absolute(),
        unsigned=own.unsigned,
        forward=own.forward,
        forward_commands=own.forward_commands,
    )


def together(configs: Sequence[config.NodeConfig]) -> list[list[config.NodeConfig]]:
    """The platforms that run in one process each: an endpoint is opened once, for all vehicles that speak there.

    Raises:
        WrongCall: vehicles of one endpoint that are not distinguished by their system ids.
    """
    groups: dict[str, list[config.NodeConfig]] = {}
    for each in configs:
        vehicle = each.vehicle
        place = vehicle.endpoint if isinstance(vehicle, config.MavlinkVehicle) else f"unit {each.unit}"
        groups.setdefault(place, []).append(each)
    for place, group in groups.items():
        vehicles = [each.vehicle for each in group if isinstance(each.vehicle, config.MavlinkVehicle)]
        ids = [vehicle.sysid for vehicle in vehicles]
        if len(group) > 1 and (None in ids or len(set(ids)) < len(ids)):
            units = ", ".join(each.unit for each in group)
            raise WrongCall(
                f"{place}: platforms {units} share it: give each vehicle its system id (sysid), no two the same."
            )
        if len({vehicle.signing_key for vehicle in vehicles}) > 1:
            raise WrongCall(f"{place}: all vehicles there are signed with one key (signing_key).")
    return list(groups.values())


def _check_texts(call: Call, own: UnitFile) -> None:
    """Raise WrongCall or TextError for files that the platform's process could not read."""
    if own.elevation is not None:
        from runtime.configuration.elevation_files import read_elevation

        read_elevation(own.elevation)
    if own.translation is None and own.profiles is None:
        return
    from runtime.configuration.ontologies import ontology_of
    from runtime.configuration.resolved import read_profiles, read_translation

    if own.translation is not None:
        read_translation(ontology_of(call.settings.extensions, call.settings.ontology), own.translation)
    if own.profiles is not None:
        read_profiles(own.profiles)


def replayed(file: Path, from_: str, epoch: str, now_us: int, *, place: str) -> config.ReplayedVehicle:
    """A recorded flight whose first position plus `from_` is played at `epoch`; raises WrongCall and DecodeError."""
    known = {".tlog", ".bin", ".ulg", ".mcap"}
    if file.suffix.lower() not in known:
        raise WrongCall(f"{place}: {file} is no recording that can be replayed; known: {', '.join(sorted(known))}.")
    if not file.is_file():
        raise WrongCall(f"{place}: there is no file {file}; check the path.")
    from_us = duration_us(from_, option=f"{place} from")
    _check_recording(file, from_us, place)
    return config.ReplayedVehicle(
        file=file.resolve(),
        from_us=from_us,
        epoch_us=instant_us(epoch, now_us, option=f"{place} epoch"),
    )


def _check_recording(file: Path, from_us: int, place: str) -> None:
    """Raise DecodeError for a file that is no recording, and WrongCall if it ends before `from_us`."""
    from proxies.recordings.formats import open_recording

    lasting_us = open_recording(file).lasting_us(from_us)
    if lasting_us < from_us:
        raise WrongCall(
            f"{place} from: {file} ends {lasting_us // 1_000_000} s after its first position; begin before that."
        )
