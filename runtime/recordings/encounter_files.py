"""Files of encounters: one recording each, in a directory of the operator's, the oldest of a platform making room for the newest."""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from dyknow.agents.effects import KeepEncounter
from dyknow.model.errors import WrongCall
from dyknow.runtime.recordings.recording_file import RecordingFile

MOST_BYTES: Final = 8_000_000
MOST_FILES: Final = 100
"""Of one platform."""


def keep_encounter(directory: Path | None, unit: str, effect: KeepEncounter, note: Callable[[str], None]) -> None:
    """Write the record of an encounter, where the platform has a directory for that; a failure is noted."""
    if directory is None:
        return
    at = datetime.fromtimestamp(effect.since_us / 1e6, UTC)
    path = directory / f"{unit}-{_in_a_name(effect.other)}-{at:%Y%m%dT%H%M%S}.{effect.since_us // 1000 % 1000:03d}.mcap"
    try:
        directory.mkdir(parents=True, exist_ok=True)
        _make_room(directory, unit)
        about = {"federation": f"encounter of {unit} and {effect.other}", "by": unit, "other": effect.other}
        with RecordingFile(path, about, lambda: effect.since_us, most_bytes=MOST_BYTES) as file:
            for topic, schema, message, at_us, valid_us in effect.messages:
                file.add(topic, schema, message, at_us, valid_us)
        lost = f"; {file.lost} messages had no room" if file.lost else ""
        note(f"encounter with {effect.other}: {path}{lost}")
    except (OSError, WrongCall) as wrong:
        note(f"the encounter with {effect.other} is not kept: {wrong}")


def _make_room(directory: Path, unit: str) -> None:
    held = sorted(directory.glob(f"{unit}-*.mcap"), key=lambda path: path.stat().st_mtime)
    for path in held[: max(0, len(held) - MOST_FILES + 1)]:
        path.unlink(missing_ok=True)


def _in_a_name(unit: str) -> str:
    """A name that others chose, as a part of a file's name."""
    return "".join(each if each.isalnum() or each == "_" else "_" for each in unit)[:40]
