"""Keys of MAVLink signing, and where a vehicle may be commanded without one."""

import hashlib
import stat
from pathlib import Path

from dyknow.model.errors import WrongCall
from dyknow.proxies.files.named_files import bounded_bytes
from dyknow.proxies.mavlink.endpoints import Endpoint

_KEY_BYTES, _SHORTEST_PASSPHRASE, _LONGEST_FILE = 32, 8, 4096


def read_key(path: Path) -> bytes:
    """The 32 bytes of a key file: as they are, as 64 hexadecimal digits, or the SHA-256 of a passphrase.

    Mission Planner, QGroundControl and MAVProxy make their keys of a passphrase in the same way.

    Raises:
        WrongCall: the file cannot be read, others may read it, or it holds no key; with the remedy.
    """
    try:
        mode, data = path.stat().st_mode, bounded_bytes(path, _LONGEST_FILE)
    except OSError as error:
        raise WrongCall(
            f"signing key {path}: cannot be read ({error.strerror}); check the path and its rights."
        ) from None
    if mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise WrongCall(f"signing key {path}: other users may read it; run chmod 600 {path}.")
    if len(data) == _KEY_BYTES:
        return data
    try:
        text = data.decode("utf-8").strip()
    except UnicodeDecodeError:
        text = ""
    is_hexadecimal = bool(text) and all(digit in "0123456789abcdefABCDEF" for digit in text)
    if is_hexadecimal and len(text) == 2 * _KEY_BYTES:
        return bytes.fromhex(text)
    if len(text) < _SHORTEST_PASSPHRASE or (is_hexadecimal and len(text) > _KEY_BYTES):
        raise WrongCall(
            f"signing key {path}: {len(data)} bytes are no key; write 32 bytes, 64 hexadecimal digits, or a passphrase "
            f"of {_SHORTEST_PASSPHRASE} characters and more."
        )
    return hashlib.sha256(text.encode("utf-8")).digest()


def insist_on_key(endpoint: Endpoint, place: str, *, control: bool, has_key: bool, unsigned: bool) -> None:
    """A vehicle that is commanded over a network signs what it says, unless its operator gives that up.

    Raises:
        WrongCall: otherwise every host that reaches the endpoint could speak for the vehicle, and command it.
    """
    if control and not (has_key or unsigned or endpoint.is_local):
        raise WrongCall(
            f"{place}: {endpoint} lies beyond this machine, and without a key every host that reaches it can speak for the "
            "vehicle that is to be commanded; give --signing-key FILE (signing_key), or --unsigned (unsigned) to do "
            "without."
        )
