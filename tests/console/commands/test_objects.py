"""`dyknow objects`: what platforms see, on platforms that run."""

from collections.abc import Callable
from typing import Any

import pytest

from dyknow.agents.effects import Fed
from dyknow.console.command import Call
from dyknow.console.commands.objects import objects as command
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import Output
from dyknow.runtime.client import Client
from tests.box import Box

Lines = Callable[[], list[dict[str, Any]]]
SPECIFICATION = """
sort car(symbol in text, x_m in m, y_m in m, end in bool)
source car seen
strmgen cars = seen
sort ship(symbol in text, type in text, length_m in m)
source ship radar
strmgen ships = radar
"""


def see(world: Box, source: str, *state: object, unit: str = "0") -> None:
    world._reach(world.nodes[unit], Fed(world.now_us, source, world.now_us, state))
    world.run(0.01)


@pytest.fixture
def harbour(world: Box) -> Box:
    world.specify("0", SPECIFICATION)
    world.run(0.1)
    see(world, "seen", "car1", 1.0, 2.0, False)
    see(world, "seen", "car2", 3.0, 4.0, False)
    see(world, "radar", "s1", "ferry", 80.0)
    return world


def ask(call: Call, type_: str | None = None, *, follow: bool = False) -> int:
    found: int = command.objects(call, type_=type_, unit=None, follow=follow)
    return found


def test_each_object_is_listed_with_its_platform_its_type_and_its_newest_state(
    harbour: Box, call: Call, lines: Lines
) -> None:
    see(harbour, "seen", "car1", 1.5, 2.0, False)
    see(harbour, "seen", "car2", 0.0, 0.0, True)
    assert ask(call) == DONE
    first, second = lines()
    assert (first["unit"], first["symbol"], first["type"], first["stream"], first["x_m"]) == (
        0,
        "car1",
        "car",
        "cars",
        1.5,
    )
    assert (second["symbol"], second["type"], second["length_m"]) == ("s1", "ferry", 80.0)
    assert harbour.now_us - first["valid_us"] < 1_000_000


def test_objects_of_one_type_only(harbour: Box, call: Call, lines: Lines) -> None:
    assert ask(call, "car") == DONE
    assert [each["symbol"] for each in lines()] == ["car1", "car2"]
    assert ask(call, "ferry") == DONE
    assert [each["symbol"] for each in lines()] == ["s1"]
    assert ask(call, "ships") == DONE, "also by its stream"
    assert [each["symbol"] for each in lines()] == ["s1"]
    assert ask(call, "lorry") == NO


def test_where_there_is_none_of_a_type_those_that_are_there_are_named(
    harbour: Box, call: Call, capsys: pytest.CaptureFixture[str]
) -> None:
    assert harbour
    assert ask(Call(call.settings, Output(json_lines=False)), "lorry") == NO
    assert "no platform sees an object of lorry; there are objects of car, cars, ferry, ships" in " ".join(
        capsys.readouterr().err.split()
    )


def test_where_none_is_seen_it_is_said_how_one_would_be(
    world: Box, call: Call, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ask(Call(call.settings, Output(json_lines=False))) == NO
    assert "symbol in text" in capsys.readouterr().err


def test_the_table_has_a_line_for_each(harbour: Box, call: Call, capsys: pytest.CaptureFixture[str]) -> None:
    assert ask(Call(call.settings, Output(json_lines=False))) == DONE
    out = capsys.readouterr().out
    rows = [line.split() for line in out.splitlines() if line.strip()]
    assert [row[1] for row in rows[2:]] == ["car1", "car2", "s1"]
    assert "x_m 1, y_m 2" in out


def test_what_appears_moves_and_vanishes_is_told_as_it_happens(
    harbour: Box, call: Call, lines: Lines, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps = iter(
        [
            lambda: see(harbour, "seen", "car1", 2.0, 2.0, False),
            lambda: see(harbour, "seen", "car2", 3.0, 4.0, True),
            lambda: see(harbour, "seen", "car3", 9.0, 9.0, False),
        ]
    )

    waits = Client.wait_for

    def wait_for(self: Client, condition: Callable[[], bool], timeout_s: float) -> bool:
        if timeout_s != command.EVERY_S:
            return waits(self, condition, timeout_s)
        step = next(steps, None)
        if step is None:
            raise KeyboardInterrupt
        step()
        return False

    monkeypatch.setattr(command, "EVERY_S", 0.123)
    monkeypatch.setattr(Client, "wait_for", wait_for)
    with pytest.raises(KeyboardInterrupt):
        ask(call, "car", follow=True)
    told = [(each["symbol"], each.get("event"), each["x_m"]) for each in lines()]
    assert told == [
        ("car1", "appeared", 1.0),
        ("car2", "appeared", 3.0),
        ("car1", None, 2.0),
        ("car2", "vanished", 3.0),
        ("car3", "appeared", 9.0),
    ]


def test_a_stream_that_is_exported_to_others_only_is_not_listed(harbour: Box, call: Call, lines: Lines) -> None:
    harbour.specify(
        "0",
        f'label seen-cars : car "cars that are seen"\n{SPECIFICATION}export private seen-cars = cars\n',
    )
    harbour.run(0.5)
    see(harbour, "radar", "s1", "ferry", 80.0)
    assert ask(call) == DONE
    assert {each["stream"] for each in lines()} == {"ships"}
