"""`dyknow roster`: the file of platforms and keys with which acts are signed, and what belongs to it.

Next to `roster.toml`: `keys/<unit>.key` (Ed25519 seed in hexadecimal, mode 0600), `pki/` (a certificate per platform and the authority that
signed them), and `<unit>.wire.json`, the mTLS and access-control settings of each platform's Zenoh session. A platform
needs the roster, its own key, its own certificate and `pki/ca.pem`; the authority's key stays where units are added.
"""

import json
import os
import secrets
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from console.command import Call, command
from console.errors import DONE
from console.output.output import unit_json
from dyknow.model.errors import RosterError, WrongCall
from federation.keys import unit as unit_name
from federation.security.tls import Paths, authority_certificate, platform_certificate, tls_key, zenoh_security_config
from federation.security.trust import KEY_BYTES, Role, Roster, RosterMember, Signer
from runtime.configuration.reach import COMMAND_CENTRE

DEFAULT_FILE = Path("roster.toml")
AUTHORITY = "ca"
"""What the files of the certificate authority are called, next to those of the members."""
LOOPBACK = ("127.0.0.1", "localhost")

Hosts: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--host",
        metavar="ADDRESS",
        help="Address or name in the certificate (repeatable). [default: 127.0.0.1, localhost]",
    ),
]
UnitArgument: TypeAlias = Annotated[str, typer.Argument(metavar="UNIT", help="The platform.")]


@command(example="dyknow roster init 0 1 2 --roster keys/roster.toml")
def init(
    call: Call,
    platforms: Annotated[list[str], typer.Argument(metavar="UNIT...", help="The platforms.")],
    hosts: Hosts = None,
) -> int:
    """A new roster, with keys and certificates for a command centre and these platforms."""
    path = _path(call)
    if path.exists():
        raise WrongCall(f"{path} exists already; add to it with dyknow roster add UNIT, or name another with --roster.")
    path.parent.mkdir(parents=True, exist_ok=True)
    roster = Roster()
    for unit in dict.fromkeys(platforms):
        roster = roster.added(_member(path, call, unit, "uav", hosts))
    roster = roster.added(_member(path, call, COMMAND_CENTRE, "command-centre", hosts))
    _write(path, call, roster)
    return _shown(call, list(roster.members.values()))


@command(example="dyknow roster add 3 --roster keys/roster.toml")
def add(
    call: Call,
    unit: UnitArgument,
    role: Annotated[Role, typer.Option(help="What it may do.")] = "uav",
    hosts: Hosts = None,
) -> int:
    """One more platform, with a new key and certificate."""
    path = _path(call)
    roster = _read(path)
    known = roster.members.get(unit)
    if known is not None and not known.revoked:
        raise WrongCall(
            f"{unit} is in {path} already; to give it a new key revoke it first: dyknow roster revoke {unit}"
        )
    member = _member(path, call, unit, role, hosts)
    _write(path, call, roster.added(member))
    return _shown(call, [member])


@command(example="dyknow roster revoke 2 --roster keys/roster.toml")
def revoke(call: Call, unit: UnitArgument) -> int:
    """Mark a platform as no longer trusted: others refuse it once they are restarted."""
    path = _path(call)
    try:
        roster = _read(path).revoked(unit)
    except RosterError as error:
        raise WrongCall(f"{path}: {error}") from None
    _write(path, call, roster)
    if not call.out.json_lines:
        call.out.note("Platforms read the roster when they start: restart those that run.")
    return _shown(call, [roster.members[unit]])


@command(example="dyknow roster show --roster keys/roster.toml")
def show(call: Call) -> int:
    """The members of a roster."""
    return _shown(call, list(_read(_path(call)).members.values()))


def _path(call: Call) -> Path:
    return call.settings.roster or DEFAULT_FILE


def _read(path: Path) -> Roster:
    try:
        return Roster.parse(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise WrongCall(f"{path}: cannot be read ({error.strerror}); make one with dyknow roster init.") from None
    except RosterError as error:
        raise WrongCall(f"{path}: {error}") from None


def write_private(path: Path, content: bytes) -> None:
    """Write a secret with mode 0600 from the beginning; an existing file is replaced."""
    path.unlink(missing_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as secret:
        secret.write(content)


def _member(path: Path, call: Call, unit: str, role: Role, hosts: Sequence[str] | None) -> RosterMember:
    """A member with a new key, kept next to the roster, and a certificate."""
    unit_name(unit)
    if unit == AUTHORITY:
        raise WrongCall(f"{unit}: the certificate authority's files have this name; choose another for the platform.")
    keys, pki = path.parent / "keys", path.parent / "pki"
    for directory in (keys, pki):
        directory.mkdir(mode=0o700, exist_ok=True)
    seed = secrets.token_bytes(KEY_BYTES)
    write_private(keys / f"{unit}.key", f"{seed.hex()}\n".encode())
    _certify(pki, unit, f"dyknow {call.settings.federation}", hosts or LOOPBACK)
    return RosterMember(unit, Signer(seed, call.settings.federation).public_key, role)


def _certify(pki: Path, unit: str, authority: str, hosts: Sequence[str]) -> None:
    """A key and a certificate for `unit`, signed by the authority, which is made when it is not there."""
    now_us = time.time_ns() // 1000
    if not (pki / f"{AUTHORITY}.key").exists():
        write_private(pki / f"{AUTHORITY}.key", tls_key(secrets.token_bytes(48)))
        (pki / f"{AUTHORITY}.pem").write_bytes(
            authority_certificate((pki / f"{AUTHORITY}.key").read_bytes(), authority, now_us)
        )
    key = tls_key(secrets.token_bytes(48))
    signed = platform_certificate(
        unit,
        key,
        (pki / f"{AUTHORITY}.key").read_bytes(),
        (pki / f"{AUTHORITY}.pem").read_bytes(),
        now_us,
        hosts=tuple(hosts),
    )
    write_private(pki / f"{unit}.key", key)
    (pki / f"{unit}.pem").write_bytes(signed)


def _write(path: Path, call: Call, roster: Roster) -> None:
    """The roster, whole or not at all, and the wire settings of every member, which name all the others."""
    new = path.with_name(f"{path.name}.new")
    new.write_text(str(roster), encoding="utf-8")
    new.replace(path)
    pki = (path.parent / "pki").resolve()
    for unit, member in roster.members.items():
        wire = path.parent / f"{unit}.wire.json"
        if member.revoked:
            wire.unlink(missing_ok=True)
            continue
        paths = Paths(str(pki / f"{AUTHORITY}.pem"), str(pki / f"{unit}.pem"), str(pki / f"{unit}.key"))
        settings = zenoh_security_config(roster, unit, paths, call.settings.federation)
        wire.write_text(json.dumps(settings, indent=2) + "\n", encoding="utf-8")


def _shown(call: Call, members: list[RosterMember]) -> int:
    if call.out.json_lines:
        for member in members:
            call.out.line(
                {"unit": unit_json(member.unit), "key": member.key_text, "role": member.role, "revoked": member.revoked}
            )
        return DONE
    rows = [(m.unit, "[red]revoked[/red]" if m.revoked else m.role, m.key_text) for m in members]
    call.out.table("", ("unit", "role", "key"), rows, wraps=("key",))
    return DONE
