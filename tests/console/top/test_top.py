"""What a reader of `dyknow top` sees on the screen, and what the keys do."""

import asyncio
import re
import sys
import xml.etree.ElementTree as ET
from collections.abc import Awaitable, Callable
from html import unescape
from typing import Any

import pytest

from dyknow.console.command import Call
from dyknow.console.output.output import Output
from dyknow.console.top.gathered import TABLES, Gatherer, Row, TopSnapshot
from dyknow.console.top.top import top
from dyknow.federation.messages.contents import ActLog, Alarm
from dyknow.model.errors import WrongCall
from dyknow.runtime.client import Client, command_centre
from dyknow.runtime.configuration.settings import Settings
from tests.box import Box
from tests.console.commands.recordings.encounter import encounter

pytest.importorskip("textual")

from textual.widgets import DataTable

from dyknow.console.top.screen import TopApp

EVIL = "[red]\x1b]0;owned\x07[/red]\u202e[link=file:///etc]"


def seen(app: TopApp) -> str:
    """The screen as it is read, line by line."""
    svg = ET.fromstring(app.export_screenshot())
    lines: dict[float, list[tuple[float, str]]] = {}
    for text in svg.iter("{http://www.w3.org/2000/svg}text"):
        words = "".join(text.itertext()).replace("\xa0", " ")
        lines.setdefault(float(text.get("y", 0)), []).append((float(text.get("x", 0)), words))
    return "\n".join("".join(word for _, word in sorted(parts)) for _, parts in sorted(lines.items()))


async def shows(app: TopApp, pilot: Any, wanted: str) -> bool:
    """Whether it is on the screen, once what was asked for is drawn: a busy machine takes more than one round."""
    for _ in range(50):
        await pilot.pause()
        if wanted in seen(app):
            return True
    return False


def drive(snapshot: Callable[[], TopSnapshot], steps: Callable[[TopApp, Any], Awaitable[None]]) -> None:
    """Do these steps on the screen."""

    async def driven() -> None:
        app = TopApp(snapshot)
        async with app.run_test(size=(120, 30)) as pilot:
            await pilot.pause()
            await steps(app, pilot)

    asyncio.run(driven())


@pytest.fixture(scope="module")
def looks() -> list[TopSnapshot]:
    """A federation in which two came close, looked at while an alarm is open."""
    world = encounter()
    centre = Client(world.client_ports(), command_centre(Settings(), "cc-9"))
    gatherer = Gatherer(centre, "test")
    found = [gatherer.look()]
    centre.wait_for(lambda: False, 9.0)
    found.append(gatherer.look())
    world.vehicle("1").is_silent = True
    centre.wait_for(lambda: False, 3.0)
    found.append(gatherer.look())
    gatherer.close()
    return found


def rows(snapshot: TopSnapshot, table: str) -> dict[str, tuple[str, ...]]:
    return {row.key: row.cells for row in snapshot.tables[table]}


def test_all_tables_have_what_the_commands_show(looks: list[TopSnapshot]) -> None:
    _, close, silent = looks
    assert rows(close, "platforms")["0"][:4] == ("0", "alive", "80%", "60 m")
    streams = rows(close, "streams")
    assert streams["0 heli-position"][2] == "10 Hz"
    assert float(streams["0 heli-position"][3].split()[0]) == pytest.approx(10, abs=1)
    assert streams["0 heli-position"][5:] == ("1", "0", "0")
    assert {row.level for row in close.tables["monitors"] if row.cells[3] == "alarm"} == {"bad"}
    assert {(row.cells[1], row.cells[2]) for row in close.tables["alarms"]} >= {("opened", "proximity")}
    assert any(row.cells[4:6] == ("inform", "alarm") for row in close.tables["acts"])
    assert "6 open alarms" in close.title
    assert {row.cells[3] for row in silent.tables["monitors"]} == {"unknown"}
    assert next(row for row in silent.tables["streams"] if row.key == "1 heli-position").level == "bad"
    assert all(
        len(row.cells) == len(row.order) == len(TABLES[name])
        for name, all_rows in close.tables.items()
        for row in all_rows
    )


def test_each_table_has_a_key_and_a_row_can_be_opened(looks: list[TopSnapshot]) -> None:
    async def steps(app: TopApp, pilot: Any) -> None:
        shown = seen(app)
        assert "2 of 2 platforms" in shown
        assert re.search(r"0 +alive +80% +60 m", shown)
        for key, wanted in (("2", "heli-velocity"), ("3", "proximity-warn"), ("4", "opened"), ("5", "inform")):
            await pilot.press(key)
            assert await shows(app, pilot, wanted), key
        await pilot.press("4", "enter")
        await pilot.pause()
        assert "because xy_dist[0, 1] >= 15.0 is false" in seen(app).replace("1, 0", "0, 1")
        await pilot.press("escape")
        await pilot.pause()
        assert "because" not in seen(app)

    drive(lambda: looks[1], steps)


def test_rows_are_sorted_turned_filtered_and_held_still(looks: list[TopSnapshot]) -> None:
    current = [looks[1]]

    async def steps(app: TopApp, pilot: Any) -> None:
        await pilot.press("2", "s", "s")
        assert "label ▲" in seen(app)
        labels = re.findall(r"(battery|heli-\w+)", seen(app))
        assert labels == sorted(labels)
        await pilot.press("r")
        labels = re.findall(r"(battery|heli-\w+)", seen(app))
        assert labels == sorted(labels, reverse=True)
        await pilot.press("slash", *"alt", "enter")
        assert {*re.findall(r"(battery|heli-\w+)", seen(app))} == {"heli-altitude"}
        assert "12 rows filtered" in seen(app)
        await pilot.press("escape")
        assert "battery" in seen(app)
        await pilot.press("1", "space")
        current[0] = TopSnapshot("nothing", {})
        app.look()
        assert "alive" in seen(app)
        assert "paused" in seen(app)
        await pilot.press("space")
        app.look()
        await pilot.pause()
        assert "alive" not in seen(app)

    drive(lambda: current[0], steps)


def test_the_cursor_stays_on_its_row_when_others_come_and_go() -> None:
    def snapshot(names: str) -> TopSnapshot:
        return TopSnapshot(
            "x", {"platforms": [Row(name, (name,) * 7, (name,) * 7, f"details of {name}") for name in names]}
        )

    current = [snapshot("bcd")]

    async def steps(app: TopApp, pilot: Any) -> None:
        await pilot.press("down")
        current[0] = snapshot("abcd")
        app.look()
        await pilot.press("enter")
        await pilot.pause()
        assert "details of c" in seen(app)

    drive(lambda: current[0], steps)


def test_words_of_others_are_text_on_the_screen() -> None:
    row = Row(EVIL, (EVIL,) * 7, (EVIL,) * 7, EVIL)

    async def steps(app: TopApp, pilot: Any) -> None:
        for _ in range(2):
            shown = unescape(seen(app))
            assert "[red]\\x1b]0;owned\\x07[/red]\\u202e[link=file:///etc]" in shown
            assert "\x1b" not in app.export_screenshot()
            await pilot.press("enter")
            await pilot.pause()

    drive(lambda: TopSnapshot(EVIL, {"platforms": [row]}), steps)


def test_a_tick_that_comes_while_the_screen_is_closed_draws_nothing() -> None:
    async def steps(app: TopApp, pilot: Any) -> None:
        await app.query_one(DataTable).remove()
        before = len(taken)
        app.look()
        assert len(taken) == before

    def snapshot() -> TopSnapshot:
        taken.append(None)
        return TopSnapshot("none", {"platforms": []})

    taken: list[None] = []
    drive(snapshot, steps)
    assert taken


def test_what_platforms_say_of_others_is_not_shown_and_what_is_kept_is_bounded(world: Box) -> None:
    gatherer = Gatherer(Client(world.client_ports(), command_centre(Settings(), "cc-9")), "test")
    gatherer._take("0", Alarm(id="a", event="opened", monitor="m", by="1", units=("1",), valid_us=1, detected_us=1))
    assert not gatherer._alarms
    for at in range(2000):
        alarm = Alarm(id=f"a{at}", event="opened", monitor="m", by="1", units=("1",), valid_us=1, detected_us=1)
        gatherer._take("1", alarm)
        gatherer._take("1", ActLog(at_us=at, direction="in", peer="0", outcome="accepted", act="(broken"))
    assert len(gatherer._alarms) == len(gatherer._acts) == len(gatherer._open) == 500


def test_without_textual_the_extra_is_named_and_there_is_no_json(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(WrongCall, match="ls, imports"):
        top(call)
    monkeypatch.setitem(sys.modules, "dyknow.console.top.screen", None)
    with pytest.raises(WrongCall, match=r"dyknow-federation\[top\]"):
        top(Call(Settings(), Output(json_lines=False)))
