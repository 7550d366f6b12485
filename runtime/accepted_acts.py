"""The acts that a platform has accepted of each member, kept next to its key: a restart makes no recorded act valid.

Its clock may be set back while it is off, as that of a board without a battery is; then the age of an act is no evidence.
"""

import json
import os
import threading
from collections.abc import Callable
from pathlib import Path

from dyknow.federation.security.trust import Verifier
from dyknow.model.errors import RosterError

BETWEEN_S = 1.0
"""How long after it was written the file is written again at the earliest."""
AHEAD_US = 2_000_000
"""How much newer than the newest act an entry is while the platform runs: a crash between two writes opens no window."""


def accepted_path(key: Path) -> Path:
    """The file of the platform whose private key is in `key`."""
    return key.with_suffix(".accepted")


def read_accepted(key: Path) -> dict[str, int]:
    """By member, the instant up to which acts are refused, on the member's node clock; empty in the first life.

    Raises:
        RosterError: the file does not read.
    """
    path = accepted_path(key)
    try:
        kept = json.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as wrong:
        raise RosterError(f"{path}: {wrong}; it protects against replayed commands: restore it, or remove it") from None
    if not isinstance(kept, dict) or not all(type(instant_us) is int for instant_us in kept.values()):
        raise RosterError(f"{path}: not instants by member; it protects against replayed commands: remove it")
    return kept


class AcceptedActs:
    """Writes that file, in a thread of its own, whenever acts were accepted.

    Args:
        key: the platform's private key.
        verifier: judges its acts.
        on_failed: called once, from that thread, with why the file cannot be written.
    """

    def __init__(self, key: Path, verifier: Verifier, on_failed: Callable[[str], None]) -> None:
        self._path, self._verifier, self._on_failed = accepted_path(key), verifier, on_failed
        self._seen = 0
        self._due, self._ended = threading.Event(), threading.Event()
        self._kept: dict[str, int] = {}
        self._thread = threading.Thread(target=self._keep, name="accepted-acts", daemon=True)
        self._thread.start()

    def step(self) -> None:
        """Look for news; call it after each step of the platform."""
        if self._verifier.accepted != self._seen:
            self._seen = self._verifier.accepted
            self._leave(AHEAD_US)

    def close(self) -> None:
        """Write what was accepted, exactly: nothing more is."""
        self._ended.set()
        self._leave(0)
        self._thread.join()

    def _leave(self, ahead_us: int) -> None:
        self._kept = {unit: at_us + ahead_us for unit, at_us in self._verifier.accepted_us.items()}
        self._due.set()

    def _keep(self) -> None:
        while True:
            self._due.wait()
            is_last = self._ended.is_set()
            if not self._write() or is_last:
                return
            self._ended.wait(BETWEEN_S)

    def _write(self) -> bool:
        self._due.clear()
        part = self._path.with_suffix(".accepted-part")
        try:
            with part.open("w", encoding="utf-8") as file:
                json.dump(self._kept, file)
                file.flush()
                os.fsync(file.fileno())
            part.replace(self._path)
        except OSError as wrong:
            self._on_failed(
                f"{self._path} cannot be written ({wrong.strerror}): commands of this life could be replayed after a restart"
            )
            return False
        return True
