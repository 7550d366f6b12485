"""Whether a key and a certificate are those of the unit that is to speak by them: looked at before it joins."""

import time
from pathlib import Path

from dyknow.federation.security.trust import Roster, RosterMember, Signer
from dyknow.model.errors import RosterError, WrongCall
from dyknow.proxies.files.named_files import bounded_bytes, bounded_text

_OTHERS = 0o077
LONGEST_FILE = 65_536
"""Bytes of a key or a certificate."""


def private_key(path: Path) -> bytes:
    """A member's own key, 32 bytes, of a file that no other user may read.

    Raises:
        RosterError: it does not read, or others may read it.
        OSError: it cannot be read.
    """
    _checked_mode(path)
    try:
        seed = bytes.fromhex(bounded_text(path, LONGEST_FILE).strip())
    except ValueError as wrong:
        raise RosterError(f"{path}: {wrong}; a private key is 64 hexadecimal digits") from None
    Signer(seed, "")
    return seed


def checked_key(roster: Roster, unit: str, path: Path) -> bytes:
    """The key in `path`, which is that of `unit` in the roster.

    Raises:
        RosterError: it is not, is revoked, or others may read it; with the remedy.
        OSError: it cannot be read.
    """
    seed, member = private_key(path), roster.member(unit)
    if member is None:
        raise RosterError(f"{unit} is not in the roster; add it: dyknow roster add {unit}")
    if member.revoked:
        raise RosterError(f"{unit} is revoked in the roster; to have it back: dyknow roster add {unit}")
    public = Signer(seed, "").public_key
    if public != member.key:
        other = roster.speaker(public)
        whose = f"it is that of {other.unit}" if other else "the roster does not have it"
        raise RosterError(
            f"{path} is not the key of {unit}: {whose}; give that of {unit}, or another for it: "
            f"dyknow roster revoke {unit}, dyknow roster add {unit}"
        )
    return seed


def checked_certificate(member: RosterMember, certificate: Path) -> None:
    """Raises WrongCall for a certificate that is not the present one of the member, and its key if others may read it."""
    from dyknow.federation.security.tls import named_until

    unit = member.unit
    remedy = f"make another one: dyknow roster revoke {unit}, dyknow roster add {unit}"
    try:
        name, ends_us = named_until(bounded_bytes(certificate, LONGEST_FILE))
        _checked_mode(certificate.with_suffix(".key"))
    except OSError as error:
        raise WrongCall(f"{error.filename} cannot be read ({error.strerror}); {remedy}") from None
    except ValueError as wrong:
        raise WrongCall(f"{certificate} is no certificate ({wrong}); {remedy}") from None
    if name != member.common_name:
        raise WrongCall(
            f"{certificate} is made out to {name}, the roster has {member.common_name}; copy the present one from where "
            f"the roster is kept, or {remedy}"
        )
    if ends_us <= time.time_ns() // 1000:
        raise WrongCall(f"{certificate} has expired; {remedy}")


def _checked_mode(path: Path) -> None:
    if path.stat().st_mode & _OTHERS:
        raise RosterError(f"{path} can be read by others; make it yours alone: chmod 600 {path}, and renew it")
