"""Objects that others have looked for: refused with reasons, found, told of, listed, explained, cancelled."""

import pytest

from dyknow.agents.capabilities.attention.wanting import MOST_OF_ONE, Wanting
from dyknow.agents.effects import Fed
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import ObjectEvents, ObjectList, TaskList, Tasks, WantObject
from dyknow.federation.messages.dialogue import Dialogue
from tests.agents.capabilities.attention.chase import Chase, said

SEEN = """
sort vision-object(symbol in text, x_m in m, y_m in m, colour in text, end in bool)
sort car(symbol in text, x_m in m, y_m in m, colour in text, anchored in bool, end in bool)
source vision-object camera
compunit car WorldObject(vision-object)
strmgen percepts = camera
strmgen cars = link(percepts, WorldObject,
  eventually [1000, oo] true, eventually [0, 1000] xy_dist[from, to] < thresh, true)
"""
RED = 'colour[suspect] = "red"'


class Street(Chase):
    """A platform whose camera sees coloured cars that stand."""

    def __init__(self) -> None:
        super().__init__(SEEN, cameras=None)

    def see(self, seconds: float, **colours: str) -> None:
        """Each percept has a place of its own, 40 m from the next."""
        for _ in range(round(seconds * 10)):
            now_us = self.world.now_us
            for number, (name, colour) in enumerate(sorted(colours.items())):
                self.happens(Fed(now_us + number, "camera", now_us + number, (name, 40.0 * number, 0.0, colour, False)))
            self.world.run_for(0.1)

    def want(self, description: str = RED, symbol: str = "suspect", type_: str = "cars") -> Dialogue:
        return self.ask(WantObject(symbol=symbol, type=type_, description=description), 1.0)

    def objects(self) -> dict[str, dict[str, object]]:
        ((_, listed),) = self.ask(ObjectList(), 1.0).said
        assert isinstance(listed, ObjectList)
        return {each.symbol: dict(each.attributes) for each in listed.objects or ()}

    def events(self, symbol: str) -> list[tuple[str, str]]:
        ((_, listed),) = self.ask(ObjectEvents(symbol=symbol), 1.0).said
        assert isinstance(listed, ObjectEvents)
        return [(each.event, each.because) for each in listed.events or ()]

    def tasks(self) -> list[str]:
        ((_, listed),) = self.ask(Tasks(), 1.0).said
        assert isinstance(listed, TaskList)
        return [each.state for each in listed.tasks]


def test_it_is_found_when_it_comes_into_view_and_its_requester_is_told_what_becomes_of_it() -> None:
    street = Street()
    asked = street.want()
    assert said(asked) == [("agree", "")]
    street.see(2.0, a="blue")
    assert street.tasks() == ["looks for suspect"]
    assert street.objects()["suspect"] == {"wanted": RED}
    street.see(2.5, a="blue", b="red")
    street.world.run_for(2.0)
    found, tracked, lost = (text for _, text in said(asked)[1:])
    assert found == f"suspect is found by b: wanted holds, eventually {RED}, with colour[suspect] = red"
    assert tracked.startswith("suspect is tracked: in view for")
    assert lost.startswith("suspect is lost: looked for: no sample for")
    assert street.objects()["suspect"]["colour"] == "red"
    kinds = [kind for kind, _ in street.events("suspect")]
    assert kinds == ["wanted", "reestablished", "find", "track", "unlinked", "lost"]
    assert street.tasks() == ["suspect is lost: looked for"]


def test_cancelled_it_is_looked_for_no_more_and_nothing_is_linked_for_it() -> None:
    street = Street()
    asked = street.want()
    street.see(1.0, a="blue")
    street.world.cancel("cc", "0", asked.conversation)
    street.see(1.0, a="blue")
    street.see(2.0, a="blue", b="red")
    assert street.tasks() == []
    assert "suspect" not in street.objects()
    assert street.events("suspect") == []
    assert street.platform.part(Wanting).deadline_us is None
    assert said(street.want())[0] == ("agree", "")


@pytest.mark.parametrize(
    ("symbol", "type_", "description", "reason"),
    [
        ("suspect", "car", RED, ""),
        ("suspect", "trucks", RED, "no objects of type 'trucks' are linked here. "),
        ("suspect", "cars", 'colour[suspect] = "red', "description: 1:19: this string is never closed"),
        ("suspect", "cars", 'color[suspect] = "red"', "objects of cars have no color"),
        ("suspect", "cars", "x[suspect] > 1\nstream x = cars", "description: 2:1: expected the end"),
        ("suspect", "cars", "not " * 200 + "true", "nested more than 200 deep"),
        ("0", "cars", "x[0] > 1", "0 is a unit"),
        ("a b", "cars", RED, "symbol: 'a b' names no object"),
    ],
)
def test_what_cannot_be_looked_for_is_refused_with_its_reason(
    symbol: str, type_: str, description: str, reason: str
) -> None:
    street = Street()
    performative, text = said(street.want(description, symbol, type_))[0]
    assert performative == ("refuse" if reason else "agree")
    assert reason in text
    assert bool(street.tasks()) is not bool(reason)


def test_one_member_has_so_many_looked_for_and_no_more() -> None:
    street = Street()
    answers = [said(street.want(f"x[w{n}] > 1", f"w{n}"))[0] for n in range(MOST_OF_ONE + 1)]
    assert [each for each, _ in answers] == ["agree"] * MOST_OF_ONE + ["refuse"]
    assert f"has {MOST_OF_ONE} objects looked for here already, w0, w1" in answers[-1][1]


def test_what_is_lost_and_found_all_the_time_is_told_once_a_second() -> None:
    street = Street()
    asked = street.want()
    for number in range(30):
        street.see(0.1, **{f"b{number}": "red"})
        now_us = street.world.now_us
        street.happens(Fed(now_us, "camera", now_us, (f"b{number}", 0.0, 0.0, "red", True)))
        street.world.run_for(0.1)
    told = [act for act, _ in asked.said if act.performative is Performative.INFORM]
    assert 5 <= len(told) <= 8
