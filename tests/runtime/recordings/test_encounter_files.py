"""Files of encounters: one recording each, bounded, under names that others cannot choose."""

from pathlib import Path

import pytest

from dyknow.agents.effects import EncounterMessage, KeepEncounter
from dyknow.runtime.recordings import encounter_files
from dyknow.runtime.recordings.encounter_files import keep_encounter

S = 1_000_000
SINCE_US = 1_700_000_000 * S


def record(other: str = "1", since_us: int = SINCE_US) -> KeepEncounter:
    value = {"latitude_deg": 58.0, "longitude_deg": 15.0}
    sample = {"unit": "0", "label": "heli-position", "valid_us": since_us, "available_us": since_us, "value": value}
    return KeepEncounter(
        other, since_us, (EncounterMessage("/0/heli-position", "dyknow.Sample", sample, since_us, since_us),)
    )


def test_it_is_a_recording_that_is_read_back(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    notes: list[str] = []
    keep_encounter(tmp_path / "kept", "0", record(), notes.append)
    (path,) = (tmp_path / "kept").iterdir()
    assert path.name == "0-1-20231114T221320.000.mcap"
    assert notes == [f"encounter with 1: {path}"]
    with path.open("rb") as file:
        ((_, channel, message),) = make_reader(file).iter_messages()
    assert (channel.topic, message.log_time) == ("/0/heli-position", SINCE_US * 1000)


@pytest.mark.parametrize("other", ["../../etc/passwd", "a/b", "\x1b[0m", "é" * 80, ""])
def test_names_of_others_lead_nowhere(tmp_path: Path, other: str) -> None:
    notes: list[str] = []
    keep_encounter(tmp_path, "0", record(other), notes.append)
    (path,) = tmp_path.rglob("*.mcap")
    assert path.parent == tmp_path


def test_the_oldest_of_a_platform_make_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(encounter_files, "MOST_FILES", 3)
    for number in range(6):
        keep_encounter(tmp_path, "0", record(since_us=SINCE_US + number * S), lambda _text: None)
    keep_encounter(tmp_path, "2", record(), lambda _text: None)
    assert len(list(tmp_path.glob("0-*.mcap"))) == 3
    assert len(list(tmp_path.glob("2-*.mcap"))) == 1


def test_what_cannot_be_written_is_noted(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    notes: list[str] = []
    keep_encounter(tmp_path / "taken", "0", record(), notes.append)
    assert notes[0].startswith("the encounter with 1 is not kept: ")
    keep_encounter(None, "0", record(), notes.append)
    assert len(notes) == 1
