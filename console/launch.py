"""From what a person asked to what each platform process is configured with."""

import os
import re
import socket
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from console.command import Call
from console.errors import WrongCall, did_you_mean
from console.federations import FederationFile, UnitFile
from console.instants import duration_us, instant_us
from console.processes import read_state, run_directory
from dyknow.errors import TextError
from federation.keys import unit as unit_name
from runtime.config import (
    ClockConfig,
    MavlinkVehicle,
    NodeConfig,
    ReplayedVehicle,
    SimulatedVehicle,
    TrustConfig,
    WireConfig,
)

COMMAND_CENTRE = "cc"
"""The member of a roster as which the commands of `dyknow` speak; each process adds its number."""
_NOTHING = UnitFile()
_PROTOCOLS = ("tcp", "tls", "udp", "quic", "ws")
_ENDPOINT = re.compile(rf"(?:{'|'.join(_PROTOCOLS)})/[^/\s]+:[0-9]{{1,5}}(?:[?#]\S*)?|unixsock-stream/\S+")


def wire_of(call: Call, unit: str, special: UnitFile = _NOTHING) -> WireConfig:
    """How the process of `unit` finds the others. With endpoints to connect to there is no multicast.

    Where an endpoint begins with `tls/`, both sides show the certificates that belong to the roster.

    Raises:
        WrongCall: an endpoint that is none, an interface that is not there; such an endpoint without a roster, or
            without a certificate for `unit`.
    """
    settings = call.settings
    _checked_wire(settings.listen or (), settings.connect or (), settings.interface)
    _checked_wire(special.listen or (), special.connect or (), None)
    connect = special.connect if special.connect is not None else settings.connect or ()
    listen = special.listen if special.listen is not None else settings.listen or ()
    security = None
    if any(endpoint.startswith("tls/") for endpoint in (*connect, *listen)):
        security = _of_roster(settings.roster, f"{unit}.wire.json")
        if security is None:
            raise WrongCall(
                f"endpoints that begin with tls/ need a roster with a certificate for {unit}; "
                f"make one with dyknow roster init (or add {unit}), and name it with --roster."
            )
    return WireConfig.model_validate(
        {
            "federation": settings.federation,
            "listen": listen,
            "connect": connect,
            "discover": settings.discover or ("none" if connect else "multicast"),
            "interface": settings.interface or "lo",
            "security": security,
        }
    )


def _checked_wire(listen: Sequence[str], connect: Sequence[str], interface: str | None) -> None:
    """Raises WrongCall for what no session could be opened with."""
    for option, endpoints in (("--listen", listen), ("--connect", connect)):
        for endpoint in endpoints:
            if not _ENDPOINT.fullmatch(endpoint):
                raise WrongCall(
                    f"{option}: {endpoint!r} is no endpoint; write protocol/host:port, e.g. tcp/127.0.0.1:7447 "
                    f"(protocols: {', '.join(_PROTOCOLS)})."
                )
    if interface is None:
        return
    import psutil

    present = psutil.net_if_addrs()
    if not any(address.family == socket.AF_INET for address in present.get(interface, [])):
        raise WrongCall(
            f"--interface: {interface!r} has no IPv4 address on this machine; there are {', '.join(sorted(present))}."
        )


def commands_wire(call: Call) -> WireConfig:
    """How a command finds the platforms: as they find each other, or where `dyknow up` noted that they listen."""
    noted = read_state(run_directory(call.settings.federation)).endpoints
    if noted and not call.settings.connect:
        settings = call.settings.model_copy(update={"connect": noted, "listen": None, "discover": "none"})
        call = replace(call, settings=settings)
    return wire_of(call, COMMAND_CENTRE)


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


def free_ports(count: int) -> list[int]:
    """Ports of this machine that nobody listens on just now."""
    with ExitStack() as kept:
        probes = [kept.enter_context(socket.socket(socket.AF_INET, socket.SOCK_STREAM)) for _ in range(count)]
        for probe in probes:
            probe.bind(("127.0.0.1", 0))
        return [int(probe.getsockname()[1]) for probe in probes]


def trust_of(call: Call, unit: str) -> TrustConfig:
    """The roster and the unit's own key, which lies beside it.

    Raises:
        WrongCall: if there is a roster but no key for `unit`.
    """
    roster = call.settings.roster
    if roster is None:
        return TrustConfig()
    key = _of_roster(roster, f"keys/{unit}.key")
    if key is None:
        raise WrongCall(
            f"--roster {roster}: there is no key for {unit} beside it (keys/{unit}.key); "
            f"make one: dyknow roster add {unit} --roster {roster}"
        )
    return TrustConfig(roster=roster, key=key)


def _of_roster(roster: Path | None, name: str) -> Path | None:
    """A file that belongs to the roster, if it is there."""
    found = roster.parent / name if roster is not None else None
    return found if found is not None and found.exists() else None


def clock_of(file: FederationFile | None, speed: float | None, now_us: int) -> ClockConfig:
    """The federation's clock. One that runs faster begins now, unless the file says when."""
    chosen = speed or (file.clock.speed if file else 1.0)
    given = file.clock.epoch if file else None
    if given is not None:
        return ClockConfig(epoch_us=instant_us(given, now_us, option="[clock] epoch"), speed=chosen)
    return ClockConfig(epoch_us=None if chosen == 1.0 else now_us, speed=chosen)


def journal_of(file: FederationFile | None, unit: str, vehicle: Any) -> Path | None:
    """Where the platform keeps its journal, if the federation's file wants journals.

    Raises:
        WrongCall: nothing can be written there, or the flight to be replayed would be overwritten.
    """
    if file is None or file.journal is None:
        return None
    try:
        file.journal.mkdir(parents=True, exist_ok=True)
        is_writable = os.access(file.journal, os.W_OK | os.X_OK)
    except OSError:
        is_writable = False
    if not is_writable:
        raise WrongCall(f"journal: {file.journal} is no directory that can be written; name another.")
    found = file.journal.resolve() / f"{unit}.mcap"
    if isinstance(vehicle, ReplayedVehicle) and vehicle.file == found:
        raise WrongCall(f"journal: {found} is what platform {unit} replays, and would be overwritten; name another.")
    return found


def configured(fields: Mapping[str, Any]) -> NodeConfig:
    """A NodeConfig; raises WrongCall that names the option that does not fit."""
    try:
        return NodeConfig.model_validate(dict(fields))
    except ValidationError as error:
        said = [f"{'.'.join(str(p) for p in e['loc'])}: {e['msg']} (got {e['input']!r})." for e in error.errors()]
        raise WrongCall("\n".join(said)) from None


def fleet_of(call: Call, chosen: Mapping[str, Any], now_us: int) -> list[NodeConfig]:
    """The platforms of `dyknow up`: `units` of them by number, and those that the file names besides.

    Args:
        call: with the federation's file, if there is one.
        chosen: units, scenario, seed, persona, gcs, avoidance, speed, only, duration_us, start_us.
        now_us: the wall clock.
    """
    special = dict(call.file.unit) if call.file else {}
    names = [str(number) for number in range(chosen["units"])]
    names += [name for name in special if name not in names]
    special = dict(_meshed(call, names, special))
    simulated = [name for name in names if not (s := special.get(name, _NOTHING)).mavlink and not s.replay]
    clock = clock_of(call.file, chosen["speed"], now_us)
    duration = chosen["duration_us"]
    found = []
    for name in only_these(names, chosen["only"]):
        unit_name(name)
        own = special.get(name, _NOTHING)
        vehicle = _vehicle(name, own, simulated, chosen, now_us)
        fields = {
            "unit": name,
            "wire": wire_of(call, name, own),
            "clock": clock,
            "trust": trust_of(call, name),
            "avoidance": chosen["avoidance"] if own.avoidance is None else own.avoidance,
            "vehicle": vehicle,
            "journal": journal_of(call.file, name, vehicle),
            "translation": own.translation,
            "profiles": own.profiles,
            "hosts": hosts_of(call, name),
            "duration_s": duration / 1e6 if duration is not None else None,
        }
        found.append(configured(fields))
    return found


def hosts_of(call: Call, unit: str) -> Path:
    """Where hosts of this machine register with a platform."""
    return run_directory(call.settings.federation) / f"{unit}.hosts"


def only_these(names: list[str], only: list[str] | None) -> list[str]:
    """The platforms to start here; the federation's others run elsewhere. Raises WrongCall for an unknown one."""
    for name in only or ():
        if name not in names:
            raise WrongCall(f"--only: this federation has no platform {name!r}.{did_you_mean(name, names)}")
    return only or names


def _vehicle(
    unit: str, own: UnitFile, simulated: list[str], chosen: Mapping[str, Any], now_us: int
) -> SimulatedVehicle | MavlinkVehicle | ReplayedVehicle:
    """What the platform flies: the file's vehicle or recording, else a simulated UAV."""
    if own.mavlink:
        return MavlinkVehicle(
            endpoint=mavlink_endpoint(own.mavlink, place=f"[unit.{unit}] mavlink"), sysid=own.sysid, control=own.control
        )
    if own.replay:
        return replayed(own.replay, own.from_ or "0s", own.epoch or "now", now_us, place=f"[unit.{unit}]")
    return SimulatedVehicle(
        scenario=chosen["scenario"],
        index=simulated.index(unit),
        count=len(simulated),
        seed=chosen["seed"],
        persona=own.persona or chosen["persona"],
        gcs=_address(own.gcs or chosen["gcs"]),
        start_us=chosen["start_us"],
    )


def _address(text: str | None) -> str | None:
    """A ground station's `HOST:PORT`; raises WrongCall."""
    if text is None:
        return None
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit() or not 0 < int(port) < 65_536:
        raise WrongCall(f"--gcs: {text!r} is no address; write HOST:PORT, e.g. 127.0.0.1:14550.")
    return text


def mavlink_endpoint(text: str, *, place: str) -> str:
    """An endpoint at which vehicles speak; raises WrongCall."""
    from proxies.mavlink_port import parse_endpoint

    try:
        parse_endpoint(text)
    except TextError as error:
        raise WrongCall(f"{place}: {text!r}: {error.message}; write {error.repair}.") from None
    return text


def replayed(file: Path, from_: str, epoch: str, now_us: int, *, place: str) -> ReplayedVehicle:
    """A recorded flight whose first position plus `from_` is played at `epoch`; raises WrongCall."""
    known = {".tlog", ".bin", ".ulg", ".mcap"}
    if file.suffix.lower() not in known:
        raise WrongCall(f"{place}: {file} is no recording that can be replayed; known: {', '.join(sorted(known))}.")
    if not file.is_file():
        raise WrongCall(f"{place}: there is no file {file}; check the path.")
    from_us = duration_us(from_, option=f"{place} from")
    if from_us:
        _reaches(file, from_us, place)
    return ReplayedVehicle(
        file=file.resolve(),
        from_us=from_us,
        epoch_us=instant_us(epoch, now_us, option=f"{place} epoch"),
    )


def _reaches(file: Path, from_us: int, place: str) -> None:
    """Raises WrongCall if nothing of the recording is left at `from_us`."""
    from proxies.recordings import Recording

    lasting_us = Recording.open(file).lasting_us(from_us)
    if lasting_us < from_us:
        raise WrongCall(
            f"{place} from: {file} ends {lasting_us // 1_000_000} s after its first position; begin before that."
        )
