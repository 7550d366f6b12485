"""Tables in terminals of every width."""

import io
import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from dyknow.console.centre import client
from dyknow.console.command import Call
from dyknow.console.commands.members.acts import acts
from dyknow.console.commands.members.delegate import delegate, tasks
from dyknow.console.commands.members.ls import ls
from dyknow.console.commands.members.monitors import monitors
from dyknow.console.errors import DONE
from dyknow.console.output.output import Output
from dyknow.console.output.tables import LONG, Column, print_table
from dyknow.runtime.configuration.settings import Settings
from tests.box import Box

WORD = st.text("abcdefgh-", min_size=1, max_size=LONG)
CELL = st.lists(st.lists(WORD, max_size=4).map(" ".join), max_size=3).map("\n".join)


def printed(width: int, columns: list[Column], rows: list[list[str]]) -> str:
    console = Console(width=width, file=io.StringIO(), highlight=False)
    print_table(console, "", columns, rows)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


@given(st.integers(30, 200), st.lists(st.lists(CELL, min_size=3, max_size=3), min_size=1, max_size=4))
def test_in_no_width_is_a_word_broken_or_a_line_too_long(width: int, rows: list[list[str]]) -> None:
    shown = printed(width, [Column("one", wraps=True), Column("two", wraps=True), Column("three")], rows)
    assert max(map(len, shown.splitlines())) <= width
    assert all(line == line.rstrip() for line in shown.splitlines())
    said = sorted(word for row in rows for cell in row for word in cell.split())
    titles = {"one", "two", "three"}
    assert sorted(word for word in shown.split() if word not in titles and set(word) - {"\u2500"}) == said


def test_only_columns_that_may_wrap_do_so() -> None:
    rows = [["alpha beta", "gamma delta", "epsilon zeta"]]
    columns = [Column("one"), Column("two", wraps=True), Column("three")]
    assert "alpha beta   gamma delta   epsilon zeta" in printed(60, columns, rows)
    assert [line.strip() for line in printed(35, columns, rows).splitlines() if line.strip()][-2:] == [
        "alpha beta   gamma   epsilon zeta",
        "delta",
    ]
    assert "alpha beta  two gamma delta" in printed(34, columns, rows), "a record"


def test_where_there_is_none_each_row_is_a_record_of_its_named_cells() -> None:
    columns = [Column("by"), Column("monitor"), Column("units"), Column("inputs")]
    rows = [["0", "proximity-warn", "0, 1", "missing\nheli-position[1]"], ["1", "proximity-warn", "", "fresh"]]
    assert printed(30, columns, rows).splitlines() == [
        "by 0  monitor proximity-warn",
        "units 0, 1",
        "inputs",
        "  missing",
        "  heli-position[1]",
        "",
        "by 1  monitor proximity-warn",
        "inputs fresh",
        "",
    ]


def test_what_is_too_long_for_any_terminal_is_folded_unless_it_is_to_be_copied() -> None:
    key = "ed25519:" + "0123456789abcdef" * 4
    folded = printed(50, [Column("unit"), Column("key", wraps=True)], [["1", key]])
    assert max(map(len, folded.splitlines())) <= 50
    assert key in printed(50, [Column("unit"), Column("key", is_whole=True)], [["1", key]])


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Box:
    """Three platforms that watch their distances; one of them stands still."""
    found = Box()
    for number in range(3):
        found.fly(str(number), 0.0, 200.0 * number, 2.0)
    monkeypatch.setattr(client, "_client_ports", lambda _call: found.client_ports())
    found.run(2.0)
    asking = Call(Settings(federation="test", json_lines=True), Output(json_lines=True))
    assert delegate(asking, "monitor-proximity", [], to="0", wait=False) == DONE
    json.loads(capsys.readouterr().out)
    found.run(2.0)
    found.freeze("2")
    found.run(3.5)
    return found


@pytest.mark.parametrize("width", [40, 60, 80, 100])
def test_the_lists_of_a_federation_are_readable_in_any_width(
    world: Box, width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    call = Call(Settings(federation="test"), Output(json_lines=False))

    def shown(command: Any, **options: Any) -> set[str]:
        assert command(call, **options) == DONE
        out = capsys.readouterr().out
        assert all(len(line) <= width for line in out.splitlines()), out
        return set(out.replace(",", " ").split())

    whole = {"alive", "gone", "heli-position", "monitor-coordination", "services"}
    assert whole <= shown(ls, all_kinds=False, long=True)
    assert {"0", "1", "2", "alive", "gone", "80%", "60", "40", "m"} <= shown(ls, all_kinds=False)
    assert {"monitor-proximity", "running", "conversation"} <= shown(tasks)
    assert {"proximity-warn", "undecided", "missing", "heli-velocity[2]", "unknown"} <= shown(monitors, long=True)
    assert {"proximity:", "proximity-warn:", "2", "ok", "unknown", "(2)"} <= shown(monitors)
    assert {"request", "->"} <= shown(acts)
