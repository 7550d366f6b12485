"""What a platform accepted outlives it, however it ends."""

import threading
from pathlib import Path

import pytest

from dyknow.federation.security.trust import Roster, Verifier
from dyknow.model.errors import RosterError
from dyknow.runtime import accepted_acts
from dyknow.runtime.accepted_acts import AHEAD_US, AcceptedActs, accepted_path, read_accepted


def accepting(verifier: Verifier, unit: str, created_us: int) -> None:
    verifier.accepted += 1
    verifier.accepted_us[unit] = created_us


def test_what_was_accepted_is_there_after_a_crash_and_exact_after_an_end(tmp_path: Path) -> None:
    key = tmp_path / "0.key"
    assert read_accepted(key) == {}
    verifier, failed = Verifier(Roster(), "default", 0), list[str]()
    kept = AcceptedActs(key, verifier, failed.append)
    accepting(verifier, "cc", 5)
    written = threading.Event()
    write = kept._write

    def writing() -> bool:
        try:
            return write()
        finally:
            written.set()

    kept._write = writing  # type: ignore[method-assign]
    kept.step()
    assert written.wait(20)
    assert read_accepted(key) == {"cc": 5 + AHEAD_US}, "a crash now opens no window"
    accepting(verifier, "1", 7)
    kept.close()
    assert read_accepted(key) == {"cc": 5, "1": 7}
    assert failed == []


def test_a_disk_that_cannot_be_written_is_told_once_and_ends_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(accepted_acts.os, "fsync", full)
    verifier, failed = Verifier(Roster(), "default", 0), list[str]()
    kept = AcceptedActs(tmp_path / "0.key", verifier, failed.append)
    for created_us in range(3):
        accepting(verifier, "cc", created_us)
        kept.step()
    kept.close()
    assert len(failed) == 1
    assert "No space left on device" in failed[0]
    assert "replayed" in failed[0]


@pytest.mark.parametrize("text", ["", "[]", '{"cc": "now"}', '{"cc": 1.5}', "\0"])
def test_a_file_that_does_not_read_is_not_taken_for_an_empty_one(tmp_path: Path, text: str) -> None:
    key = tmp_path / "0.key"
    accepted_path(key).write_text(text)
    with pytest.raises(RosterError, match="remove it"):
        read_accepted(key)
