import json
import shutil
import stat
import subprocess
from pathlib import Path

import pytest
from cryptography import x509

from dyknow.federation.security.tls import hosts_of
from dyknow.federation.security.trust import Roster, Signer
from dyknow.model.errors import WrongCall
from dyknow.runtime.configuration.config import WireConfig
from dyknow.runtime.configuration.reach import wire_of
from dyknow.runtime.configuration.session import wire_options
from dyknow.runtime.configuration.settings import Settings
from tests.console.conftest import Run


@pytest.fixture
def path(tmp_path: Path, dyknow: Run) -> Path:
    found = tmp_path / "trust" / "roster.toml"
    assert dyknow("roster", "init", "0", "1", "--roster", str(found), "--federation", "alpha").returncode == 0
    return found


def folder(path: Path) -> Path:
    return path.parent / "roster.d"


def _lines(done: "subprocess.CompletedProcess[str]") -> list[dict[str, object]]:
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_a_new_roster_has_the_platforms_and_a_command_centre(path: Path) -> None:
    members = Roster.parse(path.read_text()).members
    assert {unit: member.role for unit, member in members.items()} == {"0": "uav", "1": "uav", "cc": "command-centre"}


def test_each_private_key_belongs_to_its_member_and_is_its_owners_alone(path: Path) -> None:
    for unit, member in Roster.parse(path.read_text()).members.items():
        key = folder(path) / "keys" / f"{unit}.key"
        assert stat.S_IMODE(key.stat().st_mode) == 0o600
        assert Signer(bytes.fromhex(key.read_text()), "alpha").public_key == member.key
        assert stat.S_IMODE((folder(path) / "pki" / f"{unit}.key").stat().st_mode) == 0o600


def test_certificates_carry_the_units_name_and_are_signed_by_the_authority(path: Path) -> None:
    pki = folder(path) / "pki"
    authority = x509.load_pem_x509_certificate((pki / "ca.pem").read_bytes())
    for unit in ("0", "1", "cc"):
        certificate = x509.load_pem_x509_certificate((pki / f"{unit}.pem").read_bytes())
        certificate.verify_directly_issued_by(authority)
        assert certificate.subject.rfc4514_string() == f"CN={unit}"


def test_a_member_that_is_added_is_known_to_the_wire_settings_of_all(path: Path, dyknow: Run) -> None:
    done = dyknow("roster", "add", "7", "--roster", str(path), "--federation", "alpha", "--json")
    [told] = _lines(done)
    assert (told["unit"], told["revoked"]) == (7, False)
    assert str(told["key"]).startswith("ed25519:")
    for unit in ("0", "1", "cc", "7"):
        wire = json.loads((folder(path) / f"{unit}.wire.json").read_text())
        assert {s["id"] for s in wire["access_control"]["subjects"]} == {"0", "1", "cc", "7"}


def test_a_revoked_member_is_marked_and_no_session_listens_to_it(path: Path, dyknow: Run) -> None:
    [told] = _lines(dyknow("roster", "revoke", "1", "--roster", str(path), "--federation", "alpha", "--json"))
    assert (told["unit"], told["revoked"]) == (1, True)
    wire = json.loads((folder(path) / "0.wire.json").read_text())
    [subject] = [s for s in wire["access_control"]["subjects"] if s["id"] == "1"]
    assert subject["cert_common_names"] == [f"1.{number}" for number in range(1, 10)], "those that nobody has yet"
    assert not (folder(path) / "1.wire.json").exists()


def test_a_revoked_member_may_come_back_with_a_new_key(path: Path, dyknow: Run) -> None:
    before_generation = Roster.parse(path.read_text()).generation
    before = Roster.parse(path.read_text()).members["1"].key
    dyknow("roster", "revoke", "1", "--roster", str(path))
    assert dyknow("roster", "add", "1", "--roster", str(path)).returncode == 0
    after = Roster.parse(path.read_text()).members["1"]
    assert after.key != before
    assert not after.revoked
    assert (before_generation + 2, after.certificate) == (Roster.parse(path.read_text()).generation, 1)
    certificate = x509.load_pem_x509_certificate((folder(path) / "pki" / "1.pem").read_bytes())
    assert certificate.subject.rfc4514_string() == "CN=1.1"
    wire = (folder(path) / "0.wire.json").read_text()
    assert "dyknow/alpha/" in wire, "without --federation a roster keeps its own"
    assert "dyknow/default/" not in wire


def test_a_roster_names_its_federation_and_is_refused_in_another(path: Path, dyknow: Run) -> None:
    assert Roster.parse(path.read_text()).federation == "alpha"
    assert "federation alpha" in dyknow("roster", "show", "--roster", str(path)).stdout
    assert {line["federation"] for line in _lines(dyknow("roster", "show", "--roster", str(path), "--json"))} == {
        "alpha"
    }
    before = path.read_text()
    for arguments in (
        ("roster", "add", "9", "--federation", "beta"),
        ("ls", "--federation", "beta"),
        ("ls",),
        ("join", "--unit", "0", "--spec", "examples/first.kpl"),
        ("up", "2"),
    ):
        done = dyknow(*arguments, "--roster", str(path))
        assert done.returncode == 2, arguments
        assert "the roster is for federation alpha, this is" in " ".join(done.stderr.split()), done.stderr
    assert path.read_text() == before


def test_no_key_is_overwritten_by_another_roster(path: Path, dyknow: Run) -> None:
    key = (folder(path) / "keys" / "0.key").read_text()
    other = path.with_name("other.toml")
    assert dyknow("roster", "init", "0", "--roster", str(other), "--federation", "beta").returncode == 0
    assert (folder(path) / "keys" / "0.key").read_text() == key
    same = dyknow("roster", "init", "0", "--roster", str(path.with_suffix(".old")), "--federation", "beta")
    assert same.returncode == 2
    assert "no key is overwritten" in " ".join(same.stderr.split())
    assert (folder(path) / "keys" / "0.key").read_text() == key


def test_a_roster_without_a_federation_is_not_changed_before_it_names_one(path: Path, dyknow: Run) -> None:
    text = path.read_text()
    path.write_text(text.replace('federation = "alpha"\n', ""))
    done = dyknow("roster", "add", "7", "--roster", str(path))
    assert done.returncode == 2
    assert 'write federation = "NAME"' in done.stderr.replace("\n", " ")
    assert dyknow("roster", "show", "--roster", str(path)).returncode == 0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("init", "0"), "exists already; add to it with dyknow roster add"),
        (("add", "0"), "is in .* already; to give it a new key revoke it first"),
        (("add", "a/b"), "cannot be a unit"),
        (("revoke", "9"), "9 is not in the roster, which has 0, 1, cc"),
    ],
)
def test_a_wrong_call_is_told_with_its_remedy(path: Path, dyknow: Run, arguments: tuple[str, ...], said: str) -> None:
    import re

    done = dyknow("roster", *arguments, "--roster", str(path))
    assert done.returncode == 2
    assert re.search(said, done.stderr.replace("\n", " "))


def test_a_roster_that_is_not_there_is_told_with_its_remedy(tmp_path: Path, dyknow: Run) -> None:
    done = dyknow("roster", "show", "--roster", str(tmp_path / "none.toml"))
    assert done.returncode == 2
    assert "dyknow roster init" in done.stderr


def test_no_member_takes_the_authoritys_files(path: Path, dyknow: Run) -> None:
    key = (folder(path) / "pki" / "ca.key").read_bytes()
    done = dyknow("roster", "add", "ca", "--roster", str(path), "--federation", "alpha")
    assert done.returncode == 2
    assert "authority" in done.stderr
    assert (folder(path) / "pki" / "ca.key").read_bytes() == key


def test_certificates_are_for_the_addresses_that_platforms_listen_at(tmp_path: Path, dyknow: Run) -> None:
    path = tmp_path / "roster.toml"
    given = ("--host", "192.168.1.10", "--host", "uav0.local")
    assert dyknow("roster", "init", "0", *given, "--roster", str(path)).returncode == 0
    certificate = (folder(path) / "pki" / "0.pem").read_bytes()
    assert hosts_of(certificate) == ("127.0.0.1", "localhost", "192.168.1.10", "uav0.local")


def test_an_address_that_the_certificate_is_not_for_is_refused_with_what_makes_another_one(
    path: Path, dyknow: Run
) -> None:
    roster = ("--federation", "alpha", "--roster", str(path))
    settings = Settings(federation="alpha", roster=path, discover="none", listen=("tls/192.168.1.10:7447",))
    with pytest.raises(WrongCall) as refused:
        wire_of(settings, "0")
    assert "the certificate of 0 is for 127.0.0.1, localhost" in str(refused.value)
    assert "dyknow roster revoke 0, dyknow roster add 0 --host 192.168.1.10" in str(refused.value)
    assert dyknow("roster", "revoke", "0", *roster).returncode == 0
    assert dyknow("roster", "add", "0", "--host", "192.168.1.10", *roster).returncode == 0
    assert wire_of(settings, "0").listen == settings.listen


def test_a_rosters_folder_can_be_copied_to_where_it_is_used(path: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "another" / "machine"
    shutil.move(path.parent, elsewhere)
    wire = WireConfig(listen=("tls/127.0.0.1:0",), security=elsewhere / "roster.d" / "1.wire.json")
    security = wire_options(wire).security
    assert security is not None
    files = [value for name, value in security["transport"]["link"]["tls"].items() if name.endswith(("key", "cate"))]
    assert len(files) == 5
    assert all(Path(file).is_absolute() and Path(file).is_relative_to(elsewhere) for file in files)
    assert all(Path(file).exists() for file in files)
