"""`dyknow explain` and `dyknow events`: what happened to objects on platforms that run."""

from collections.abc import Callable
from typing import Any

import pytest

from dyknow import Label, Sort
from dyknow.agents.effects import Fed
from dyknow.agents.specification.specification_part import SpecificationPart
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import ObjectLinkage, Percept
from dyknow.anchoring.ready import VISION, ready_specification
from dyknow.console.command import Call
from dyknow.console.commands.objects import events as command
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import Output
from dyknow.network.processes import OnDemand
from dyknow.runtime.client import Client
from tests.box import Box

Lines = Callable[[], list[dict[str, Any]]]
SECOND = 1_000_000


class Linked(OnDemand):
    """A process that knows links."""

    def __init__(self) -> None:
        super().__init__()
        self.linkage = ObjectLinkage(ready_specification())


@pytest.fixture
def links(world: Box) -> Linked:
    process = Linked()
    network = world.platform("0").part(SpecificationPart).instance.network
    network.add_process(Label("cars"), Sort("car", is_open=True), process)
    return process


def see(links: Linked, at_us: int, *, ends: bool = False) -> None:
    state = None if ends else ObjectState(at_us, at_us / 1e6, 0.0, 1.0, 0.0, diagonal(1.0, 1.0))
    links.linkage.on_percepts(at_us, [Percept("vp1", VISION, state)])


def drive(links: Linked, until_us: int = 2 * SECOND) -> None:
    for at_us in range(0, until_us, 100_000):
        see(links, at_us)


def test_why_an_object_is_what_it_is_is_told_with_the_conditions(
    world: Box, links: Linked, call: Call, lines: Lines
) -> None:
    drive(links)
    see(links, 2 * SECOND, ends=True)
    symbol = next(iter(links.linkage.objects("world")))
    assert command.explain(call, symbol, unit=None) == DONE
    first, second = lines()
    assert (first["unit"], first["t_ms"], first["event"], first["from"], first["to"]) == (
        0,
        1000,
        "established",
        "vp1",
        symbol,
    )
    assert first["because"].startswith("establish holds, eventually[1s, oo] true")
    assert (second["event"], second["because"]) == ("unlinked", "the percept ended")
    assert command.explain(call, "car99", unit=None) == NO


def test_what_is_private_is_not_explained(world: Box, links: Linked, call: Call, lines: Lines) -> None:
    drive(links)
    assert command.explain(call, "vp1", unit="1") == NO


def test_events_are_listed_in_the_order_of_time_and_followed_each_once(
    world: Box, links: Linked, call: Call, lines: Lines, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive(links)
    waits, steps = Client.wait_for, iter([lambda: see(links, 2 * SECOND, ends=True), lambda: None])

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
        command.events(call, unit=None, follow=True)
    assert [(each["event"], each["t_ms"]) for each in lines()] == [("established", 1000), ("unlinked", 2000)]


def test_recognised_chronicles_are_events_of_their_objects(
    world: Box, call: Call, capsys: pytest.CaptureFixture[str], tmp_path: Any
) -> None:
    text = (
        "sort car(symbol in text, colour in text)\nsource car seen\nstrmgen cars = seen\n"
        'chronicle file "paint.chr" with max delay 100\n'
    )
    chronicle = "chronicle painted[?c] { event(cars.colour[?c]:(red, blue), t1) event(cars.colour[?c]:(blue, white), t2) t1 < t2 }\n"
    from dyknow.agents.effects import Specify

    world._reach(world.nodes["0"], Specify(world.now_us, text, "a.kpl", (("paint.chr", chronicle),)))
    for colour in ("red", "blue", "white"):
        world._reach(world.nodes["0"], Fed(world.now_us, "seen", world.now_us, ("car1", colour)))
        world.run(0.3)
    assert command.events(Call(call.settings, Output(json_lines=False)), unit=None, follow=False) == DONE
    out = capsys.readouterr().out
    assert "painted[car1]" in out
    assert "recognised: t1 300 ms before" in " ".join(out.split())


def test_where_nothing_has_happened_it_is_said_so(world: Box, call: Call, capsys: pytest.CaptureFixture[str]) -> None:
    assert command.events(Call(call.settings, Output(json_lines=False)), unit=None, follow=False) == NO
    assert "nothing has happened to objects" in capsys.readouterr().err
