"""Keys and certificates at the start: those that are not the roster's, or that others may read, are refused with a remedy."""

import secrets
import time
from pathlib import Path

import pytest

from dyknow.federation.security.tls import authority_certificate, platform_certificate, tls_key
from dyknow.federation.security.trust import Roster, RosterMember, Signer
from dyknow.model.errors import RosterError, WrongCall
from dyknow.runtime.configuration.credentials import checked_certificate, checked_key

UNITS = ("0", "1", "obs")
DAY_US = 86_400_000_000


@pytest.fixture
def roster(tmp_path: Path) -> Roster:
    """0, 1 and obs, with a key of each in a file of its own; 1 is revoked."""
    members = {}
    for unit in UNITS:
        seed = secrets.token_bytes(32)
        write(tmp_path / f"{unit}.key", seed)
        role = "observer" if unit == "obs" else "uav"
        members[unit] = RosterMember(unit, Signer(seed, "").public_key, role)  # type: ignore[arg-type]
    write(tmp_path / "made-up.key", secrets.token_bytes(32))
    return Roster(members).revoked("1")


def write(path: Path, seed: bytes) -> None:
    path.write_text(seed.hex())
    path.chmod(0o600)


@pytest.mark.parametrize("unit", ["obs", "obs-4711"])
def test_the_key_of_a_member_is_taken_for_its_names(roster: Roster, tmp_path: Path, unit: str) -> None:
    path = tmp_path / "obs.key"
    assert checked_key(roster, unit, path).hex() == path.read_text()


@pytest.mark.parametrize(
    ("unit", "file", "why"),
    [
        ("0", "obs", "is not the key of 0: it is that of obs"),
        ("obs", "made-up", "is not the key of obs: the roster does not have it"),
        ("1", "1", "1 is revoked in the roster"),
        ("7", "0", "7 is not in the roster"),
        ("0-1", "0", "0-1 is not in the roster"),
    ],
)
def test_a_key_that_is_not_the_rosters_is_refused(
    roster: Roster, tmp_path: Path, unit: str, file: str, why: str
) -> None:
    with pytest.raises(RosterError, match="(?s)" + why):
        checked_key(roster, unit, tmp_path / f"{file}.key")


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o601])
def test_a_key_that_others_may_read_is_refused(roster: Roster, tmp_path: Path, mode: int) -> None:
    path = tmp_path / "0.key"
    path.chmod(mode)
    with pytest.raises(RosterError, match="can be read by others; make it yours alone"):
        checked_key(roster, "0", path)


@pytest.mark.parametrize(
    ("made_out_to", "number", "days", "mode", "why"),
    [
        ("0", 0, 1.0, 0o600, ""),
        ("0", 1, 1.0, 0o600, "is made out to 0.1, the roster has 0"),
        ("1", 0, 1.0, 0o600, "is made out to 1, the roster has 0"),
        ("0", 0, -1.0, 0o600, "has expired"),
        ("0", 0, 1.0, 0o644, "can be read by others"),
    ],
    ids=["right", "another of its certificates", "that of another", "expired", "readable by others"],
)
def test_a_certificate_that_does_not_fit_or_whose_key_others_may_read_is_refused(
    roster: Roster, tmp_path: Path, made_out_to: str, number: int, days: float, mode: int, why: str
) -> None:
    authority_key, own_key = tls_key(b"a" * 48), tls_key(b"b" * 48)
    made_us = time.time_ns() // 1000 - 2 * DAY_US
    authority = authority_certificate(authority_key, "test", made_us)
    path = tmp_path / "certificate.pem"
    made = platform_certificate(made_out_to, own_key, authority_key, authority, made_us, days=2 + days, number=number)
    path.write_bytes(made)
    path.with_suffix(".key").write_bytes(own_key)
    path.with_suffix(".key").chmod(mode)
    if not why:
        checked_certificate(roster.members["0"], path)
        return
    with pytest.raises((WrongCall, RosterError), match=why):
        checked_certificate(roster.members["0"], path)
