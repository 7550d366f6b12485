"""A process' access to a federation: the session's options, and its trust, with their files read."""

import json
import re
from ipaddress import ip_address
from pathlib import Path
from typing import NamedTuple

from dyknow.federation.security.trust import Roster, Trust
from dyknow.model.errors import RosterError
from dyknow.proxies.files.named_files import bounded_text
from dyknow.proxies.zenoh.configuration import LOOPBACK, ZenohOptions
from dyknow.runtime.accepted_acts import read_accepted
from dyknow.runtime.configuration.config import TrustConfig, WireConfig
from dyknow.runtime.configuration.credentials import checked_key

INSECURE_WIRE = "DYKNOW_INSECURE_WIRE"
"""Set to 1 in tests: a federation with a roster goes without TLS."""
_FILES = [f"{side}_{what}" for side in ("listen", "connect") for what in ("private_key", "certificate")]
_FILES.append("root_ca_certificate")


def reaches_beyond(wire: WireConfig) -> str:
    """The first endpoint or interface that is not loopback; empty if there is none."""
    for endpoint in (*wire.listen, *wire.connect):
        if not _is_loopback(host_of(endpoint)):
            return endpoint
    meets = not wire.listen or (wire.discover == "multicast" and not wire.connect)
    return wire.interface if meets and wire.interface != LOOPBACK else ""


def host_of(endpoint: str) -> str:
    """The host of `tls/192.168.1.10:7447`."""
    return re.split("[?#]", endpoint.partition("/")[2])[0].rpartition(":")[0].strip("[]")


def _is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False


class Unprotected(NamedTuple):
    """The missing protection of a federation: in a line, and, where strangers reach it, the danger and the remedy."""

    note: str
    danger: str
    remedy: str


def unprotected(wire: WireConfig, *, has_roster: bool) -> Unprotected | None:
    """The missing protection of this wire; None if all is protected, by mutual TLS."""
    remedy = "or set DYKNOW_OPEN=1 to allow it all the same"
    if not has_roster:
        return Unprotected(
            "open federation: acts are not signed",
            "This federation has no roster: every host there could command it.",
            f"Make one with `dyknow roster init`, {remedy}",
        )
    if wire.security is None:
        return Unprotected(
            f"{INSECURE_WIRE}=1, so only acts are protected: samples, heartbeats and clocks can be forged and read",
            "Of what passes there only acts would be signed: every host could forge positions, and aircraft would "
            "give way to them.",
            f"Unset {INSECURE_WIRE}, so that all links are mutual TLS, {remedy}",
        )
    return None


def wire_options(wire: WireConfig) -> ZenohOptions:
    """The session's options; the security file is read here.

    Raises:
        RosterError: it is not the JSON that `dyknow roster` writes.
    """
    security = None
    if wire.security is not None:
        try:
            security = json.loads(bounded_text(wire.security))
            files = security["transport"]["link"]["tls"]
            security.get("scouting", {}).pop("multicast", None)  # links need certificates, however they were found
            files |= {key: str(wire.security.parent.resolve() / files[key]) for key in _FILES}
        except (OSError, ValueError, LookupError, TypeError) as wrong:
            raise RosterError(f"{wire.security}: {wrong}; make it again with `dyknow roster`") from None
    return ZenohOptions(
        **{**wire.model_dump(exclude={"open"}), "security": security, "roster": wire.roster if security else None}
    )


def read_roster(path: Path, federation: str) -> Roster:
    """The roster of a federation.

    Raises:
        RosterError: it does not read, or is for another federation.
        OSError: it cannot be read.
    """
    try:
        roster = Roster.parse(bounded_text(path))
        roster.check_federation(federation)
    except RosterError as wrong:
        raise RosterError(f"--roster {path}: {wrong}") from None
    return roster


def load_trust(files: TrustConfig, federation: str, started_us: int, unit: str) -> Trust | None:
    """The roster and the key of `unit`, read; None without a roster.

    Raises:
        RosterError: one is there without the other, does not read, or does not fit the unit.
    """
    if files.roster is None:
        return None
    if files.key is None:
        raise RosterError(f"{files.roster} is a roster, but this platform was given no key: set trust.key")
    try:
        roster = read_roster(files.roster, federation)
        seed = checked_key(roster, unit, files.key)
    except OSError as error:
        raise RosterError(f"--roster: {error.filename} cannot be read ({error.strerror}); check the path.") from None
    return Trust.of(roster, seed, federation, started_us, read_accepted(files.key))
