"""`dyknow imports`: what comes in where, on platforms that run."""

from collections.abc import Callable
from typing import Any

import pytest

from dyknow.agents.effects import Pressed
from dyknow.console.command import Call
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import Output
from dyknow.federation.messages.contents import MonitorProximity
from tests.box import Box

Lines = Callable[[], list[dict[str, Any]]]


@pytest.fixture
def monitored(world: Box) -> Box:
    """The three UAVs receive each other's positions; one message of platform 1 is lost, and found again."""
    world.centre()
    world.run(0.5)
    world.asked("cc", "0", MonitorProximity())
    world.run(3.0)
    lost: list[object] = []

    def drop(_by: str, to: str, put: Any) -> bool:
        if not lost and to == "0" and put.key.startswith("x/1/"):
            lost.append(put)
            return True
        return False

    world.wire.drop = drop
    world.run(2.0)
    assert lost
    return world


def test_every_stream_is_listed_where_it_comes_in_with_what_became_of_its_samples(
    monitored: Box, call: Call, lines: Lines
) -> None:
    from dyknow.console.commands.members.imports import imports

    assert imports(call, unit=None) == DONE
    shown = lines()
    assert {(each["unit"], each["of"]) for each in shown} == {(a, b) for a in range(3) for b in range(3) if a != b}
    assert {each["label"] for each in shown} == {"heli-position", "heli-altitude", "heli-velocity", "intent"}
    assert all(
        each["received"] > (3 if each["label"] == "intent" else 10)
        and (each["lost"], each["missing"], each["every"]) == (0, 0, 1)
        for each in shown
    )
    found = {(each["unit"], each["of"]) for each in shown if each["recovered"] and each["label"] != "intent"}
    assert found == {(0, 1)}, "the first intent of a unit may be on its way before its stream is expected"
    assert imports(call, unit="2") == DONE
    assert {each["unit"] for each in lines()} == {2}


def test_the_table_says_what_is_sent_less_often_and_who_does_not_answer(
    monitored: Box, call: Call, capsys: pytest.CaptureFixture[str]
) -> None:
    from dyknow.console.commands.members.imports import imports

    monitored.happens("1", Pressed(monitored.now_us, 0.9))
    monitored.run(2.0)
    monitored.freeze("2")
    assert imports(Call(call.settings, Output(json_lines=False)), unit=None) == DONE
    shown = capsys.readouterr()
    rows = [line.split() for line in shown.out.splitlines() if "heli-position" in line]
    assert [(row[0], row[2], row[-3:]) for row in rows] == [
        ("0", "1", ["one", "of", "2"]),
        ("0", "2", ["0", "0", "all"]),
        ("1", "0", ["0", "0", "all"]),
        ("1", "2", ["0", "0", "all"]),
    ]
    assert "platform 2:" in " ".join(shown.err.split())


def test_where_nothing_is_imported_the_way_to_it_is_shown(
    world: Box, call: Call, capsys: pytest.CaptureFixture[str]
) -> None:
    from dyknow.console.commands.members.imports import imports

    assert imports(Call(call.settings, Output(json_lines=False)), unit=None) == NO
    assert "no platform imports a stream" in capsys.readouterr().err
