"""How a process reaches its federation, and as whom it signs: from options to the session's configuration."""

import os
import re
import socket
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from dyknow.federation.security.trust import Signer
from dyknow.model.errors import RosterError, WrongCall
from dyknow.proxies.files.named_files import bounded_bytes
from dyknow.runtime.configuration.config import TrustConfig, WireConfig
from dyknow.runtime.configuration.credentials import LONGEST_FILE, checked_certificate, checked_key, private_key
from dyknow.runtime.configuration.local_endpoints import dialled
from dyknow.runtime.configuration.run_directory import noted_state, read_state, run_directory
from dyknow.runtime.configuration.session import INSECURE_WIRE, host_of, read_roster
from dyknow.runtime.configuration.settings import Settings, UnitFile

COMMAND_CENTRE = "cc"
"""The member of a roster that commands and Python programs speak as without a key; each process adds its number."""
_NOTHING = UnitFile()
_ALL_ADDRESSES = ("0.0.0.0", "::")  # noqa: S104 - what is written there cannot be compared with a certificate
_PROTOCOLS = ("tcp", "tls", "udp", "quic", "ws")
_ENDPOINT = re.compile(rf"(?:{'|'.join(_PROTOCOLS)})/[^/\s]+:[0-9]{{1,5}}(?:[?#]\S*)?|unixsock-stream/\S+")


def wire_of(settings: Settings, unit: str, special: UnitFile = _NOTHING) -> WireConfig:
    """How the process of `unit` finds the others. With endpoints to connect to there is no multicast.

    With a roster all links are mutual TLS: both sides show the certificates that belong to it.

    Raises:
        WrongCall: an endpoint that is none, an interface that is not there; such an endpoint without a roster, or
            without a certificate for `unit`.
    """
    _checked_wire(settings.listen or (), settings.connect or (), settings.interface)
    _checked_wire(special.listen or (), special.connect or (), None)
    connect = special.connect if special.connect is not None else settings.connect or ()
    listen = special.listen if special.listen is not None else settings.listen or ()
    security = None
    is_tls = settings.roster is not None and os.environ.get(INSECURE_WIRE) != "1"
    for endpoint in (*connect, *listen) if is_tls else ():
        if not endpoint.startswith("tls/"):
            raise WrongCall(
                f"{endpoint}: with a roster all links are mutual TLS; write tls/{endpoint.partition('/')[2]}"
            )
    if is_tls or any(endpoint.startswith("tls/") for endpoint in (*connect, *listen)):
        security = _beside_roster(settings.roster, f"{unit}.wire.json")
        if security is None:
            raise WrongCall(
                f"mutual TLS needs a roster with a certificate for {unit}; "
                f"make one with dyknow roster init (or add {unit}), and name it with --roster."
            )
        _checked_certificate(settings, security, unit, listen)
    return WireConfig.model_validate(
        {
            "federation": settings.federation,
            "listen": listen,
            "connect": connect,
            "discover": settings.discover or ("none" if connect or (is_tls and listen) else "multicast"),
            "interface": settings.interface or "lo",
            "security": security,
            "roster": None if security is None else settings.roster,
        }
    )


def _checked_wire(listen: Sequence[str], connect: Sequence[str], interface: str | None) -> None:
    """Raise WrongCall for endpoints and interfaces with which no session could be opened."""
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


def _checked_certificate(settings: Settings, security: Path, unit: str, listen: Sequence[str]) -> None:
    """Raises WrongCall for a certificate that is not that of `unit`, or not for an address to listen at."""
    certificate = security.with_name("pki") / f"{unit}.pem"
    roster = None if settings.roster is None else read_roster(settings.roster, settings.federation)
    member = None if roster is None else roster.member(unit)
    if member is None or member.revoked:
        raise WrongCall(f"{unit} is {'revoked' if member else 'not in the roster'}: dyknow roster add {unit}")
    checked_certificate(member, certificate)
    asked = [host_of(each) for each in listen if each.startswith("tls/") and host_of(each) not in _ALL_ADDRESSES]
    if not asked:
        return
    from dyknow.federation.security.tls import hosts_of

    hosts = hosts_of(bounded_bytes(certificate, LONGEST_FILE))
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
        read = read_roster(roster, settings.federation)
    except OSError as error:
        raise WrongCall(f"--roster: {roster} cannot be read ({error.strerror}); check the path.") from None
    key = key or settings.key or _beside_roster(roster, f"keys/{unit}.key")
    if key is None:
        raise WrongCall(
            f"--roster {roster}: there is no key for {unit} ({roster_folder(roster)}/keys/{unit}.key); "
            f"make one: dyknow roster add {unit} --roster {roster}"
        )
    try:
        checked_key(read, unit, key)
    except OSError as error:
        raise WrongCall(f"--key: {key} cannot be read ({error.strerror}); check the path.") from None
    return TrustConfig(roster=roster, key=key)


class Speaker(NamedTuple):
    """The unit that a program speaks as. A member of which several processes may run adds the number of each."""

    unit: str
    is_many: bool = True

    def named(self, number: object) -> str:
        return f"{self.unit}-{number}" if self.is_many else self.unit


def speaks_as(settings: Settings, key: Path | None = None) -> Speaker:
    """The member of the roster whose key this is, or the settings'; without one the command centre.

    Raises:
        RosterError: it is no member's, or does not read.
    """
    key = key or settings.key
    if settings.roster is None or key is None:
        return Speaker(COMMAND_CENTRE)
    try:
        member = read_roster(settings.roster, settings.federation).speaker(Signer(private_key(key), "").public_key)
    except OSError as error:
        raise RosterError(f"--key: {error.filename} cannot be read ({error.strerror}); check the path.") from None
    if member is None:
        raise RosterError(f"--key {key}: no member of {settings.roster} has this key; give that of a member.")
    return Speaker(member.unit, member.role != "uav" and not member.unit.isdecimal())


def roster_folder(roster: Path) -> Path:
    """Where the keys, certificates and wire settings of a roster are: `roster.d` next to `roster.toml`."""
    return roster.with_name(f"{roster.stem}.d")


def _beside_roster(roster: Path | None, name: str) -> Path | None:
    """A file that belongs to the roster, if it is there; rosters without a folder have theirs next to them."""
    folders = () if roster is None else (roster_folder(roster), roster.parent)
    return next((folder / name for folder in folders if (folder / name).exists()), None)
