"""The example of an extension in real processes: its action, its stream and its command."""

from collections.abc import Iterator
from pathlib import Path

import pytest

import dyknow as library
from tests.live.command_line.command import Dyknow

pytestmark = pytest.mark.live
NAME = "examples.extension"
FOLDER = Path(__file__).parents[3] / "examples" / "extension"


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Dyknow]:
    found = Dyknow(tmp_path_factory.mktemp("run"))
    try:
        [ready] = found.run("up", "2", "--scenario", "hover", "--extension", NAME, "--detach")
        assert ready["event"] == "ready"
        found.until("query", "battery", "--unit", "0", unit=0)
        yield found
    finally:
        found.close()


def test_it_is_one_folder_of_at_most_a_hundred_lines() -> None:
    assert sum(len(path.read_text().splitlines()) for path in FOLDER.glob("*.py")) <= 100


def test_its_command_calls_a_platform_and_a_peer_queries_its_stream(fleet: Dyknow) -> None:
    [rung] = fleet.run("ring", "0", "--times", "2", "--extension", NAME)
    assert rung == {"unit": 0, "answer": "rung 2 times"}
    [sample] = fleet.run("query", "beacon-rings", "--unit", "0")
    assert sample["value"] == {"count": 2.0}


def test_its_action_is_typed_and_its_stream_watched(fleet: Dyknow) -> None:
    agreed, done = fleet.run("delegate", "ring-beacon", "times=3", "--to", "1", "--wait", "--extension", NAME)
    assert (agreed["performative"], done["content"]) == ("agree", '(done text: "rung 3 times")')
    _, err = fleet.raw("delegate", "ring-beacon", "--to", "1", code=2)
    assert "unknown task 'ring-beacon'" in err
    federation = fleet.federation
    with library.connect(federation, extensions=NAME) as fed, fed.watch("beacon-rings", unit=1, every="100ms") as rings:
        fed.delegate("ring-beacon", to=1)
        assert next(rings).value in ({"count": 3.0}, {"count": 4.0})


def test_a_platform_without_it_does_not_understand(fleet: Dyknow) -> None:
    with library.join("plain", federation=fleet.federation):
        fleet.until("ls", state="alive")
        _, err = fleet.raw("ring", "plain", "--extension", NAME, code=2)
    assert "no service of this platform understands (ring-beacon ...)" in err
