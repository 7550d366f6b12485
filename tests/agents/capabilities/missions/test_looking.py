"""What an action is to have done is looked at before the action has ended: where it is seen counts, and not to see it is a failure."""

from typing import Any, cast

import numpy as np
import pytest

from dyknow.agents.capabilities.missions.locating import UnitSights
from dyknow.agents.capabilities.missions.looking import FIRST_LOOK, RESTS_US, SETTLED_US, EffectLooks
from dyknow.navigation.searching.search import PlacedPercept
from dyknow.planning.execution.events import ActionEnded, StartAction
from dyknow.planning.search.plans import PlannedAction
from tests.agents.capabilities.missions.test_locating import LABELS, SECOND, Sights, Unit

ANY = cast(PlannedAction, None)


class Below(Sights):
    """What is below the unit, which is 10 m east of the origin; `from_above`: only from above the percept is in view."""

    def __init__(self, *seen: PlacedPercept, from_above: bool = False, blind: bool = False) -> None:
        super().__init__(blind=blind)
        self._all, self._from_above, self.is_above = list(seen), from_above, False

    def place(self, unit: str) -> tuple[float, float]:
        del unit
        return 10.0, 0.0

    def looks(self, unit: str, from_us: int, to_us: int) -> list[Any]:
        found = super().looks(unit, from_us, to_us)
        return [
            (at_us, view_m + np.array([10.0, 0.0]), self._all if self.is_above or not self._from_above else [])
            for at_us, view_m, _ in found
        ]


def looked(sights: Below, unit: Unit | None = None, **values: Any) -> ActionEnded | None:
    """What an action that puts b1 down comes to within 40 s."""
    unit = unit or Unit()
    looks = EffectLooks(cast(UnitSights, sights), {"u1": unit})
    known = {f"{name[0]}[{name[1:]}]": one for name, one in values.items() if name != "colour"}
    known |= {"colour[b1]": values["colour"]} if "colour" in values else {}
    looks.on_started(StartAction(7, "u1", ANY, LABELS, known), 0)
    assert sights.watched == [("u1", True)]
    assert looks.on_performed(7, "", 0, 0) is None
    for now_us in range(0, 40 * SECOND, 200_000):
        for ended in looks.step(now_us, now_us):
            assert sights.watched == [("u1", True), ("u1", False)] and now_us >= RESTS_US + SECOND
            return ended
        if len(unit.does) > 1 and not sights.is_above:
            sights.is_above = True
            looks.on_performed(unit.does[-1][0], "", now_us, now_us)
    return None


def test_what_is_seen_below_the_unit_counts_instead_of_what_the_effects_say() -> None:
    unit = Unit()
    ended = looked(Below(PlacedPercept("p1", 10.4, 0.3, 0.2)), unit, xb1=10.0, yb1=0.0)
    assert ended == ActionEnded(7, succeeded=True, seen={"x[b1]": 10.4, "y[b1]": 0.3})
    assert unit.does == [(FIRST_LOOK, ["look-down"])]


def test_what_is_not_in_view_from_below_is_seen_from_above() -> None:
    unit = Unit()
    ended = looked(Below(PlacedPercept("p1", 17.0, 0.0, 0.2), from_above=True), unit)
    assert ended is not None and ended.succeeded and ended.seen["x[b1]"] == 17.0
    assert unit.does == [(FIRST_LOOK, ["look-down"]), (FIRST_LOOK + 1, ["look-down", "goto"])]


@pytest.mark.parametrize(
    ("percepts", "values"),
    [
        ((), {}),
        ((PlacedPercept("p1", 10.5, 0.3, 0.2),), {"xb2": 10.4, "yb2": 0.2}),
        ((PlacedPercept("p1", 10.5, 0.3, 0.2, "blue"),), {"colour": "red"}),
        ((PlacedPercept("p1", 40.0, 0.3, 0.2),), {}),
    ],
)
def test_nothing_another_thing_another_colour_and_what_is_too_far_away_are_not_what_was_put_down(
    percepts: tuple[PlacedPercept, ...], values: dict[str, Any]
) -> None:
    ended = looked(Below(*percepts), **values)
    assert ended == ActionEnded(7, succeeded=False, reason="b1 is not seen where it was put down: no percept")


def test_of_two_percepts_the_nearer_one_is_it() -> None:
    ended = looked(Below(PlacedPercept("p2", 13.0, 0.0, 0.2), PlacedPercept("p1", 10.5, 0.0, 0.2)))
    assert ended is not None and ended.seen["x[b1]"] == 10.5


def test_a_unit_without_images_says_so_and_one_that_its_pilot_has_looks_no_more() -> None:
    ended = looked(Below(blind=True))
    assert ended is not None and not ended.succeeded
    assert ended.reason == "b1 is not seen where it was put down: no images come"
    unit = Unit()
    unit.waits = "its pilot flies"
    sights = Below()
    looks = EffectLooks(cast(UnitSights, sights), {"u1": unit})
    looks.on_started(StartAction(7, "u1", ANY, LABELS), 0)
    looks.on_performed(7, "", 0, 0)
    (left,) = looks.step(SETTLED_US, SETTLED_US)
    assert left.reason == "u1: its pilot flies" and looks.step(SECOND, SECOND) == []


def test_an_action_that_fails_or_has_nothing_to_look_at_ends_at_once_and_an_aborted_one_is_not_looked_at() -> None:
    sights = Below()
    looks = EffectLooks(cast(UnitSights, sights), {"u1": Unit()})
    looks.on_started(StartAction(6, "u1", ANY), 0)
    assert sights.watched == []
    assert looks.on_performed(6, "", 0, 0) == ActionEnded(6, succeeded=True)
    for step in (7, 8):
        looks.on_started(StartAction(step, "u1", ANY, LABELS), 0)
    assert looks.on_performed(7, "magnet: no answer", 0, 0) == ActionEnded(
        7, succeeded=False, reason="magnet: no answer"
    )
    looks.abort(8, 0)
    assert looks.on_performed(8, "", 0, 0) == ActionEnded(8, succeeded=True)
    assert looks.step(SECOND, SECOND) == []


def test_labels_that_are_not_the_place_of_one_thing_cannot_be_looked_at() -> None:
    looks = EffectLooks(cast(UnitSights, Below()), {"u1": Unit()})
    looks.on_started(StartAction(7, "u1", ANY, ("height[b1]",)), 0)
    ended = looks.on_performed(7, "", 0, 0)
    assert ended is not None and ended.reason == "height[b1]: not metres east and north"
