"""What `up` and `join` say of the platforms that they have started."""

import pytest

from console.command import Call
from console.output import Output
from console.settings import Settings
from console.up import Gathering, tell_notes

OPEN = "open federation: acts are not signed"


@pytest.fixture
def gathering() -> Gathering:
    """Of two platforms that say the same."""
    found = Gathering(["0", "1"])
    for unit in ("0", "1"):
        found.on_heard(unit, {"event": "note", "unit": unit, "text": OPEN, "at_us": 1})
        found.on_heard(unit, {"event": "joined", "unit": unit, "labels": [], "at_us": 2})
        found.on_heard(unit, {"event": "directory", "units": ["0", "1"], "at_us": 3})
    return found


def test_what_all_of_them_note_is_told_once(gathering: Gathering, capsys: pytest.CaptureFixture[str]) -> None:
    assert gathering.all_found()
    tell_notes(Call(Settings(federation="test"), None, Output(json_lines=False)), gathering)
    caught = capsys.readouterr()
    assert (caught.out, caught.err) == ("", f"{OPEN}\n")


def test_json_lines_hold_no_notes(gathering: Gathering, capsys: pytest.CaptureFixture[str]) -> None:
    tell_notes(Call(Settings(federation="test", dyknow_json=True), None, Output(json_lines=True)), gathering)
    caught = capsys.readouterr()
    assert (caught.out, caught.err) == ("", "")
