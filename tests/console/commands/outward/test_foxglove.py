"""`dyknow foxglove` as it is called: what it says, where it listens, and what it refuses."""

import pytest

pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")

from dyknow.console.command import Call
from dyknow.console.commands.outward.foxglove import foxglove
from dyknow.console.errors import DONE
from dyknow.model.errors import WrongCall
from tests.console.commands.recordings.encounter import encounter, in_world
from tests.console.conftest import Lines


def test_it_says_where_it_serves_and_what_it_has_served(
    call: Call, lines: Lines, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_world(monkeypatch, encounter())
    assert foxglove(call, port=0, duration="2s") == DONE
    begun, ended = lines()
    assert begun["event"] == "serving"
    assert begun["url"].startswith("ws://127.0.0.1:")
    assert (ended["units"], ended["lost"]) == (["0", "1"], 0)
    assert ended["messages"] > 100


@pytest.mark.parametrize("host", ["0.0.0.0", "10.0.0.1", "example.org", "::"])
def test_no_other_machine_is_let_in_unless_that_is_asked_for(call: Call, host: str) -> None:
    with pytest.raises(WrongCall, match="--host"):
        foxglove(call, host=host)
