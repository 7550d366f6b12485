"""`dyknow roster`: the file of platforms and keys with which acts are signed, and what belongs to it.

In `roster.d/` next to `roster.toml`: `keys/<unit>.key` (Ed25519 seed in hexadecimal, mode 0600), `pki/` (a certificate per platform and the authority that
signed them), and `<unit>.wire.json`, the mTLS and access-control settings of each platform's Zenoh session. A platform
needs the roster, its own key, its own certificate and `pki/ca.pem`; the authority's key stays where units are added.
"""

import json
import os
import secrets
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from dyknow.console.command import Call, command
from dyknow.console.errors import DONE
from dyknow.console.output.output import unit_json
from dyknow.console.output.shown import styled
from dyknow.federation.keys import unit as unit_name
from dyknow.federation.security.tls import (
    Paths,
    authority_certificate,
    platform_certificate,
    tls_key,
    zenoh_security_config,
)
from dyknow.federation.security.trust import KEY_BYTES, Role, Roster, RosterMember, Signer
from dyknow.model.errors import RosterError, WrongCall
from dyknow.proxies.files.named_files import bounded_text
from dyknow.runtime.configuration.reach import COMMAND_CENTRE, roster_folder

DEFAULT_FILE = Path("roster.toml")
AUTHORITY = "ca"
"""The file names of the certificate authority, next to those of the members."""
LOOPBACK = ("127.0.0.1", "localhost")

Hosts: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--host",
        metavar="ADDRESS",
        help="Address at which platforms listen, for their certificates, next to 127.0.0.1 (repeatable).",
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
    roster = Roster(federation=call.settings.federation, identity=secrets.token_hex(8))
    for unit in dict.fromkeys(platforms):
        roster = _added(roster, _member(path, roster, unit, "uav", hosts))
    roster = _added(roster, _member(path, roster, COMMAND_CENTRE, "command-centre", hosts))
    _write(path, roster)
    return _shown(call, roster, list(roster.members.values()))


@command(example="dyknow roster add 3 --roster keys/roster.toml")
def add(
    call: Call,
    unit: UnitArgument,
    role: Annotated[Role, typer.Option(help="Its rights.")] = "uav",
    hosts: Hosts = None,
) -> int:
    """One more platform, with a new key and certificate."""
    path = _path(call)
    roster = _read(path, call)
    known = roster.members.get(unit)
    if known is not None and not known.revoked:
        raise WrongCall(
            f"{unit} is in {path} already; to give it a new key revoke it first: dyknow roster revoke {unit}"
        )
    member = _member(path, roster, unit, role, hosts)
    _write(path, _added(roster, member))
    return _shown(call, roster, [member])


@command(example="dyknow roster revoke 2 --roster keys/roster.toml")
def revoke(call: Call, unit: UnitArgument) -> int:
    """Mark a platform as no longer trusted: running platforms close their links to it within a second."""
    path = _path(call)
    try:
        roster = _read(path, call).revoked(unit)
    except RosterError as error:
        raise WrongCall(f"{path}: {error}") from None
    _write(path, roster)
    if not call.out.json_lines:
        call.out.note("Processes that read this file close their links now; copy it to the other machines.")
    return _shown(call, roster, [roster.members[unit]])


@command(example="dyknow roster show --roster keys/roster.toml")
def show(call: Call) -> int:
    """The members of a roster."""
    roster = _read(_path(call))
    return _shown(call, roster, list(roster.members.values()))


def _path(call: Call) -> Path:
    return call.settings.roster or DEFAULT_FILE


def _read(path: Path, to_change: Call | None = None) -> Roster:
    """The roster; a roster that is to be changed names its federation, which must be the one of the settings."""
    try:
        roster = Roster.parse(bounded_text(path))
        if to_change is not None and "federation" in to_change.settings.model_fields_set:
            roster.check_federation(to_change.settings.federation)
    except OSError as error:
        raise WrongCall(
            f"{path}: cannot be read ({error.strerror}); make one: dyknow roster init 0 1 --roster {path}"
        ) from None
    except RosterError as error:
        raise WrongCall(f"{path}: {error}") from None
    if to_change is not None and roster.federation is None:
        raise WrongCall(f'{path} does not name its federation: write federation = "NAME" in its first line.')
    return roster


def _added(roster: Roster, member: RosterMember) -> Roster:
    try:
        return roster.added(member)
    except RosterError as error:
        raise WrongCall(str(error)) from None


def _folder(path: Path) -> Path:
    """Where the roster's keys are; those of older rosters are next to them."""
    folder = roster_folder(path)
    return path.parent if not folder.exists() and (path.parent / "pki" / f"{AUTHORITY}.key").exists() else folder


def write_private(path: Path, content: bytes) -> None:
    """Write a secret with mode 0600 from the beginning; an existing file is replaced."""
    path.unlink(missing_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as secret:
        secret.write(content)


def _member(path: Path, roster: Roster, unit: str, role: Role, hosts: Sequence[str] | None) -> RosterMember:
    """A member with a new key, kept in the roster's folder, and a certificate; only a revoked key is replaced."""
    unit_name(unit)
    federation = str(roster.federation)
    if unit == AUTHORITY:
        raise WrongCall(f"{unit}: the certificate authority's files have this name; choose another for the platform.")
    keys, pki = _folder(path) / "keys", _folder(path) / "pki"
    known = roster.members.get(unit)
    if (keys / f"{unit}.key").exists() and (known is None or not known.revoked):
        raise WrongCall(f"{keys}/{unit}.key is there already, and no key is overwritten: move {_folder(path)} away.")
    for directory in (keys, pki):
        directory.mkdir(mode=0o700, parents=True, exist_ok=True)
    seed = secrets.token_bytes(KEY_BYTES)
    write_private(keys / f"{unit}.key", f"{seed.hex()}\n".encode())
    number = 0 if known is None else known.certificate + 1
    _certify(pki, unit, f"dyknow {federation}", dict.fromkeys((*LOOPBACK, *(hosts or ()))), number)
    return RosterMember(unit, Signer(seed, federation).public_key, role, certificate=number)


def _certify(pki: Path, unit: str, authority: str, hosts: Iterable[str], number: int) -> None:
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
        number=number,
    )
    write_private(pki / f"{unit}.key", key)
    (pki / f"{unit}.pem").write_bytes(signed)


def _write(path: Path, roster: Roster) -> None:
    """The roster, whole or not at all, and the wire settings of every member, which name all the others."""
    new = path.with_name(f"{path.name}.new")
    new.write_text(str(roster), encoding="utf-8")
    new.replace(path)
    folder = _folder(path)
    pki = Path("pki")  # relative to the file, which is copied to other machines with its folder
    for unit, member in roster.members.items():
        wire = folder / f"{unit}.wire.json"
        if member.revoked:
            wire.unlink(missing_ok=True)
            continue
        paths = Paths(str(pki / f"{AUTHORITY}.pem"), str(pki / f"{unit}.pem"), str(pki / f"{unit}.key"))
        settings = zenoh_security_config(roster, unit, paths, str(roster.federation))
        wire.write_text(json.dumps(settings, indent=2) + "\n", encoding="utf-8")


def _shown(call: Call, roster: Roster, members: list[RosterMember]) -> int:
    if call.out.json_lines:
        for member in members:
            call.out.line(
                {
                    "unit": unit_json(member.unit),
                    "key": member.key_text,
                    "role": member.role,
                    "revoked": member.revoked,
                    "federation": roster.federation,
                    "generation": roster.generation,
                }
            )
        return DONE
    rows = [(m.unit, styled("revoked", "red") if m.revoked else m.role, m.key_text) for m in members]
    call.out.table(f"federation {roster.federation or '-'}", ("unit", "role", "key"), rows, wraps=("key",))
    return DONE
