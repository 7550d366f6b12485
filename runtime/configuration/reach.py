"""How a process reaches its federation, and as whom it signs: from options to the session's configuration."""

import re
import socket
from collections.abc import Sequence
from pathlib import Path

from dyknow.model.errors import WrongCall
from runtime.configuration.config import TrustConfig, WireConfig
from runtime.configuration.local_endpoints import dialled
from runtime.configuration.run_directory import noted_state, read_state, run_directory
from runtime.configuration.session import host_of, read_roster
from runtime.configuration.settings import Settings, UnitFile

COMMAND_CENTRE = "cc"
"""The member of a roster that commands and Python programs speak as; each process adds its number."""
_NOTHING = UnitFile()
_ALL_ADDRESSES = ("0.0.0.0", "::")  # noqa: S104 - what is written there cannot be compared with a certificate
_PROTOCOLS = ("tcp", "tls", "udp", "quic", "ws")
_ENDPOINT = re.compile(rf"(?:{'|'.join(_PROTOCOLS)})/[^/\s]+:[0-9]{{1,5}}(?:[?#]\S*)?|unixsock-stream/\S+")


def wire_of(settings: Settings, unit: str, special: UnitFile = _NOTHING) -> WireConfig:
    """How the process of `unit` finds the others. With endpoints to connect to there is no multicast.

    Where an endpoint begins with `tls/`, both sides show the certificates that belong to the roster.

    Raises:
        WrongCall: an endpoint that is none, an interface that is not there; such an endpoint without a roster, or
            without a certificate for `unit`.
    """
    _checked_wire(settings.listen or (), settings.connect or (), settings.interface)
    _checked_wire(special.listen or (), special.connect or (), None)
    connect = special.connect if special.connect is not None else settings.connect or ()
    listen = special.listen if special.listen is not None else settings.listen or ()
    security = None
    if any(endpoint.startswith("tls/") for endpoint in (*connect, *listen)):
        security = _beside_roster(settings.roster, f"{unit}.wire.json")
        if security is None:
            raise WrongCall(
                f"endpoints that begin with tls/ need a roster with a certificate for {unit}; "
                f"make one with dyknow roster init (or add {unit}), and name it with --roster."
            )
        _checked_certificate(security, unit, listen)
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


def _checked_certificate(security: Path, unit: str, listen: Sequence[str]) -> None:
    """Raises WrongCall for an address to listen at that the certificate of `unit` is not for."""
    certificate = security.with_name("pki") / f"{unit}.pem"
    asked = [host_of(each) for each in listen if each.startswith("tls/") and host_of(each) not in _ALL_ADDRESSES]
    if not asked or not certificate.exists():
        return
    from federation.security.tls import hosts_of

    hosts = hosts_of(certificate.read_bytes())
    for host in asked:
        if host not in hosts:
            raise WrongCall(
                f"--listen: no platform could connect to {host}, the certificate of {unit} is for {', '.join(hosts)}; "
                f"make another one: dyknow roster revoke {unit}, dyknow roster add {unit} --host {host}"
            )


def client_wire(settings: Settings, unit: str = COMMAND_CENTRE) -> WireConfig:
    """How a program finds the platforms: as they find each other, or at the endpoints noted by `dyknow up`.

    Platforms of this machine are dialled at their local endpoints, if they have any.
    """
    directory = run_directory(settings.federation)
    if not settings.connect and noted_state(directory).endpoints and (noted := read_state(directory).endpoints):
        settings = settings.model_copy(update={"connect": noted, "listen": None, "discover": "none"})
    if settings.connect:
        settings = settings.model_copy(update={"connect": dialled(directory, settings.connect)})
    return wire_of(settings, unit)


def trust_files(settings: Settings, unit: str, key: Path | None = None) -> TrustConfig:
    """The roster, and the unit's own key: `key`, or `keys/UNIT.key` in the roster's folder.

    Raises:
        RosterError: the roster is for another federation, or does not read.
        WrongCall: it cannot be read, or there is no key for `unit`.
    """
    roster = settings.roster
    if roster is None:
        return TrustConfig()
    try:
        read_roster(roster, settings.federation)
    except OSError as error:
        raise WrongCall(f"--roster: {roster} cannot be read ({error.strerror}); check the path.") from None
    key = key or _beside_roster(roster, f"keys/{unit}.key")
    if key is None:
        raise WrongCall(
            f"--roster {roster}: there is no key for {unit} ({roster_folder(roster)}/keys/{unit}.key); "
            f"make one: dyknow roster add {unit} --roster {roster}"
        )
    return TrustConfig(roster=roster, key=key)


def roster_folder(roster: Path) -> Path:
    """Where the keys, certificates and wire settings of a roster are: `roster.d` next to `roster.toml`."""
    return roster.with_name(f"{roster.stem}.d")


def _beside_roster(roster: Path | None, name: str) -> Path | None:
    """A file that belongs to the roster, if it is there; rosters without a folder have theirs next to them."""
    folders = () if roster is None else (roster_folder(roster), roster.parent)
    return next((folder / name for folder in folders if (folder / name).exists()), None)
