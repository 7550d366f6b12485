"""Keys of MAVLink signing as files, and where none is needed."""

import hashlib
from pathlib import Path

import pytest

from dyknow.model.errors import WrongCall
from dyknow.proxies.mavlink.endpoints import parse_endpoint
from dyknow.proxies.mavlink.signing import insist_on_key, read_key

KEY = bytes(range(32))


@pytest.mark.parametrize(
    ("content", "key"),
    [
        (KEY, KEY),
        (KEY.hex().encode() + b"\n", KEY),
        (b"correct horse\n", hashlib.sha256(b"correct horse").digest()),
    ],
)
def test_a_key_is_bytes_digits_or_a_passphrase(tmp_path: Path, content: bytes, key: bytes) -> None:
    file = tmp_path / "key"
    file.write_bytes(content)
    file.chmod(0o600)
    assert read_key(file) == key


@pytest.mark.parametrize("content", [b"", b"short", b"\xff" * 31, KEY.hex()[:-1].encode(), KEY.hex().encode() + b"00"])
def test_what_is_no_key_is_refused_with_what_to_write(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "key"
    file.write_bytes(content)
    file.chmod(0o600)
    with pytest.raises(WrongCall, match="64 hexadecimal digits"):
        read_key(file)


def test_a_key_that_others_may_read_or_that_is_not_there_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "key"
    file.write_bytes(KEY)
    file.chmod(0o640)
    with pytest.raises(WrongCall, match="run chmod 600"):
        read_key(file)
    with pytest.raises(WrongCall, match="cannot be read"):
        read_key(tmp_path / "none")


@pytest.mark.parametrize(
    ("text", "control", "has_key", "unsigned", "refused"),
    [
        ("udpin:0.0.0.0:14550", True, False, False, True),
        ("tcp:192.168.1.4:5760", True, False, False, True),
        ("udpin:0.0.0.0:14550", False, False, False, False),
        ("udpin:0.0.0.0:14550", True, True, False, False),
        ("udpin:0.0.0.0:14550", True, False, True, False),
        ("udpin:127.0.0.1:14550", True, False, False, False),
        ("serial:/dev/ttyUSB0:57600", True, False, False, False),
    ],
)
def test_who_commands_over_a_network_signs_or_says_that_it_does_not(text, control, has_key, unsigned, refused) -> None:
    endpoint = parse_endpoint(text)
    if refused:
        with pytest.raises(WrongCall, match="--signing-key FILE"):
            insist_on_key(endpoint, "--mavlink", control=control, has_key=has_key, unsigned=unsigned)
    else:
        insist_on_key(endpoint, "--mavlink", control=control, has_key=has_key, unsigned=unsigned)
