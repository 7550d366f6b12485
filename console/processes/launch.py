"""From the options of a command to the configuration of each platform process."""

import os
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from dyknow.agents.capabilities.flight.options import FlightOptions
from dyknow.agents.exchange.options import TranslationOptions
from dyknow.agents.monitoring.options import MonitoringOptions
from dyknow.agents.options import BASE
from dyknow.console.command import Call
from dyknow.documents.durations import duration_us
from dyknow.federation.keys import unit as unit_name
from dyknow.model.errors import TextError, WrongCall, did_you_mean
from dyknow.runtime.configuration import config
from dyknow.runtime.configuration.instants import instant_us
from dyknow.runtime.configuration.local_endpoints import free_ports, with_local_endpoint
from dyknow.runtime.configuration.reach import trust_files, wire_of
from dyknow.runtime.configuration.run_directory import run_directory
from dyknow.runtime.configuration.settings import Settings, UnitFile
from dyknow.runtime.configuration.toml import wrong_values

_NOTHING = UnitFile()


class FleetPlan(NamedTuple):
    """The processes that `dyknow up` starts.

    Attributes:
        units: the number of platforms with numbers as names; the federation's file may name more.
        seed: of wind, noise and routes.
        speed: how many times faster than the wall the federation's clock runs.
        only: start only these platforms here.
        duration_us: after this long they end by themselves.
        start_us: federation time at which routes begin; None: when the process starts.
        each: the settings of each platform, where the federation's file has none of its own.
    """

    units: int
    scenario: str
    seed: int = 1
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
    settings, own = call.settings, own.over(call.settings.for_all())
    _check_texts(call, own)
    fields = {
        "unit": unit,
        "wire": with_local_endpoint(wire_of(settings, unit, own)),
        "clock": clock,
        "trust": trust_files(settings, unit),
        "trusted": {name: each.trust for name, each in settings.by_unit.items() if each.trust < 1.0},
        "vehicle": vehicle,
        "journal": journal_of(settings.journal, unit, vehicle),
        "ontology": settings.ontology,
        "hosts": hosts_of(call, unit),
        "extensions": settings.extensions,
        **own.texts(config.NodeConfig.MODELS),
        **more,
    }
    try:
        return config.NodeConfig.model_validate(fields, context={BASE: Path.cwd()})
    except ValidationError as error:
        raise WrongCall(wrong_values(error)) from None


def fleet_of(call: Call, plan: FleetPlan, now_us: int) -> list[config.NodeConfig]:
    """The platforms of `dyknow up`: `units` of them by number, and those that the file names besides; raises WrongCall."""
    special = dict(call.settings.by_unit)
    names = [str(number) for number in range(plan.units)]
    names += [name for name in special if name not in names]
    each = plan.each.over(call.settings.for_all())
    special = {name: own.over(each) for name, own in _meshed(call, names, special).items()}
    simulated = [name for name in names if not _is_real(special.get(name, each))]
    clock = clock_of(call.settings, plan.speed, now_us)
    lasts_s = None if plan.duration_us is None else plan.duration_us / 1e6
    configs = []
    for name in only_these(names, plan.only):
        own = special.get(name, each)
        vehicle = _vehicle(name, own, simulated, plan, now_us)
        configs.append(platform_config(call, name, vehicle, clock, own, duration_s=lasts_s))
    return configs


def _is_real(own: UnitFile) -> bool:
    """Whether it has a vehicle or a recording, and so no simulated UAV."""
    return bool(own[config.EndpointOptions].mavlink or own[config.ReplayOptions].replay)


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
    if own[config.EndpointOptions].mavlink:
        return mavlink_vehicle(own, place=f"[unit.{unit}] mavlink")
    recorded, simulation = own[config.ReplayOptions], own[config.SimulatedOptions]
    if recorded.replay:
        return replayed(recorded.replay, recorded.from_, recorded.epoch or "now", now_us, place=f"[unit.{unit}]")
    return config.SimulatedVehicleConfig(
        scenario=plan.scenario,
        index=simulated.index(unit),
        count=len(simulated),
        seed=plan.seed,
        persona=simulation.persona,
        gcs=_address(simulation.gcs),
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
    link = own[config.MavlinkOptions]
    if link.forward is not None and own[config.EndpointOptions].mavlink is None:
        raise WrongCall(f"{place}: forward belongs to mavlink: there is no vehicle whose messages could be forwarded.")
    if link.forward is None and (link.forward_commands or link.forward_beyond):
        raise WrongCall(f"{place}: there is no ground station; name one with forward, udp://127.0.0.1:14550.")


def mavlink_vehicle(own: UnitFile, *, place: str) -> config.MavlinkVehicle:
    """A vehicle that speaks MAVLink, its endpoint and its key looked at; raises WrongCall."""
    from dyknow.proxies.mavlink.endpoints import parse_endpoint
    from dyknow.proxies.mavlink.signing import insist_on_key, read_key
    from dyknow.proxies.outward.outlets import parse_destination

    text, link = own[config.EndpointOptions].mavlink or "", own[config.MavlinkOptions]
    try:
        endpoint = parse_endpoint(text)
    except TextError as error:
        raise WrongCall(f"{place}: {text!r}: {error.message}; write {error.repair}.") from None
    if link.signing_key is not None:
        read_key(link.signing_key)
    has_key = link.signing_key is not None
    insist_on_key(endpoint, place, control=bool(link.control), has_key=has_key, unsigned=link.unsigned)
    if link.forward is not None:
        to = parse_destination(link.forward, beyond=link.forward_beyond, kinds=("udp",))
        if to.port == endpoint.number and endpoint.kind == "udpin":
            raise WrongCall(
                f"{place}: forward: {to} is where the vehicle is heard; the ground station needs a port of its own."
            )
    return config.MavlinkVehicle.model_validate(
        {"endpoint": str(endpoint), **link.model_dump()}, context={BASE: Path.cwd()}
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
    elevation = own[FlightOptions].elevation
    if elevation is not None:
        from dyknow.runtime.configuration.elevation_files import read_elevation

        read_elevation(elevation)
    translation, profiles = own[TranslationOptions].translation, own[MonitoringOptions].profiles
    if translation is None and profiles is None:
        return
    from dyknow.runtime.configuration.ontologies import ontology_of
    from dyknow.runtime.configuration.resolved import read_profiles, read_translation

    if translation is not None:
        read_translation(ontology_of(call.settings.extensions, call.settings.ontology), translation)
    if profiles is not None:
        read_profiles(profiles)


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
    from dyknow.proxies.recordings.formats import open_recording

    lasting_us = open_recording(file).lasting_us(from_us)
    if lasting_us < from_us:
        raise WrongCall(
            f"{place} from: {file} ends {lasting_us // 1_000_000} s after its first position; begin before that."
        )
