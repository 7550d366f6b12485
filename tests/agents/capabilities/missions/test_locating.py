"""Searches of a mission for what it has lost: who looks, what is not taken for it, and what becomes of a search that cannot go on."""

from typing import Any, cast

import numpy as np
import pytest

from dyknow import Value
from dyknow.agents.capabilities.missions.locating import (
    BLIND_US,
    FIRST_STEP,
    RESTS_US,
    SETTLED_US,
    Locating,
    UnitSights,
)
from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.searching.landing import Drop
from dyknow.navigation.searching.search import PlacedPercept
from dyknow.planning.execution import events

SECOND = 1_000_000
LABELS = ("x[b1]", "y[b1]")


class Unit:
    """Notes what it is to do."""

    def __init__(self) -> None:
        self.waits = self.lost = ""
        self.is_ready = True
        self.does: list[Any] = []

    def perform(self, step: int, action: str, commands: tuple[Any, ...], now_us: int) -> None:
        del action, now_us
        self.does.append((step, [each.name for each in commands]))

    def hold(self, how: str, now_us: int) -> None:
        del now_us
        self.does.append(how)


class Sights:
    """Ground of 15 m around the origin, and one percept in it."""

    frame = LocalFrame(55.0, 13.0, 0.0)

    def __init__(self, seen: PlacedPercept | None = None, *, blind: bool = False) -> None:
        self._seen, self._blind = seen, blind
        self.watched: list[tuple[str, bool]] = []

    def look(self, unit: str, now_us: int, *, wanted: bool) -> None:
        del now_us
        self.watched.append((unit, wanted))

    def drop(self, unit: str, federation_us: int) -> Drop | None:
        del unit, federation_us
        return Drop(0.0, 0.0, 5.0)

    def looks(self, unit: str, from_us: int, to_us: int) -> list[Any]:
        del unit
        view_m = np.array([[-15.0, -15.0], [15.0, -15.0], [15.0, 15.0], [-15.0, 15.0]])
        percepts = [] if self._seen is None else [self._seen]
        return [] if self._blind or to_us <= from_us else [(to_us, view_m, percepts)]


def looked(
    sights: Sights, units: dict[str, Unit], labels: tuple[str, ...] = LABELS, **values: Value
) -> tuple[Locating, list[events.MissionEvent]]:
    """What a search comes to within 20 s."""
    locating = Locating(cast(UnitSights, sights), units)
    locating.locate(
        events.Locate(("b1",), labels, 0, "", {f"{name[0]}[{name[1:]}]": one for name, one in values.items()}), 0
    )
    for now_us in range(0, BLIND_US + 5 * SECOND, 200_000):
        found = locating.step(now_us, now_us)
        if found:
            return locating, found
    return locating, []


def test_what_was_seen_for_a_second_is_a_state_of_both_labels() -> None:
    units = {"u1": Unit()}
    _, (state,) = looked(Sights(PlacedPercept("p1", 1.0, 2.0, 0.3)), units)
    assert isinstance(state, events.StateSampled)
    assert state.values == {"x[b1]": 1.0, "y[b1]": 2.0}
    assert state.valid_us >= RESTS_US + SECOND + SETTLED_US
    assert units["u1"].does == [(FIRST_STEP, ["look-down", "take-off", "goto"])]


@pytest.mark.parametrize(
    ("seen", "values"),
    [
        (PlacedPercept("p1", 1.0, 2.0, 0.3), {"xb2": 1.5, "yb2": 2.0}),
        (PlacedPercept("p1", 1.0, 2.0, 0.3, "blue"), {"colour": "red"}),
        (PlacedPercept("p1", 300.0, 2.0, 0.3), {}),
    ],
)
def test_another_thing_another_colour_and_a_place_where_it_cannot_lie_are_not_it(
    seen: PlacedPercept, values: dict[str, Value]
) -> None:
    locating = Locating(cast(UnitSights, Sights(seen)), {"u1": Unit()})
    known = {f"{name[0]}[{name[1:]}]": one for name, one in values.items() if name != "colour"}
    known |= {"colour[b1]": values["colour"]} if "colour" in values else {}
    locating.locate(events.Locate(("b1",), LABELS, 0, "", known), 0)
    assert not any(locating.step(now_us, now_us) for now_us in range(0, 14 * SECOND, 200_000))


def test_a_unit_that_shows_no_images_hands_over_and_the_last_one_says_why() -> None:
    units = {"u1": Unit(), "u2": Unit()}
    locating, _ = looked(Sights(blind=True), units)
    assert units["u2"].does
    found: list[events.MissionEvent] = []
    for now_us in range(BLIND_US, 3 * BLIND_US, 200_000):
        found = found or locating.step(now_us, now_us)
    assert found[:1] == [events.NotLocated("b1 was not found: u2: no images come for 15 s")]


def test_what_has_no_two_labels_cannot_be_looked_for() -> None:
    _, (told,) = looked(Sights(), {"u1": Unit()}, ("place[b1]",))
    assert isinstance(told, events.NotLocated) and "its labels are place[b1]" in told.reason


def test_without_a_unit_that_can_look_it_says_so() -> None:
    unit = Unit()
    unit.lost = "silent"
    _, (told,) = looked(Sights(), {"u1": unit})
    assert isinstance(told, events.NotLocated) and told.reason == "b1 cannot be looked for: no unit can look"


def test_a_flight_that_fails_hands_over_and_a_pause_leaves_the_pilots_vehicle_alone() -> None:
    units, sights = {"u1": Unit(), "u2": Unit()}, Sights()
    locating = Locating(cast(UnitSights, sights), units)
    locating.locate(events.Locate(("b1",), LABELS, 0, "", {}), 0)
    locating.step(0, 0)
    assert not locating.on_performed(3, "a step of a plan") and locating.on_performed(FIRST_STEP, "beyond the fence")
    for now_us in (200_000, 400_000):
        locating.step(now_us, now_us)
    assert len(units["u1"].does) == len(units["u2"].does) == 1
    units["u2"].waits = "its pilot flies"
    locating.pause(500_000)
    assert len(units["u2"].does) == 1 and not locating.is_looking
    assert sights.watched == [("u1", True), ("u1", False), ("u2", True), ("u2", False)]
    locating.locate(events.Locate(("b1",), LABELS, 0, "", {}), 600_000)
    assert locating.step(600_000, 600_000) == []
    units["u2"].waits = ""
    locating.step(700_000, 700_000)
    assert units["u2"].does[-1] == (FIRST_STEP + 2, ["look-down", "take-off", "goto"])


def test_what_has_no_colour_is_said_to_be_uncertain() -> None:
    locating = Locating(cast(UnitSights, Sights()), {"u1": Unit()})
    locating.locate(events.Locate(("b1",), LABELS, 0, "", {}), 0)
    assert locating.vague == ["b1"]
    locating.locate(events.Locate(("b1",), LABELS, 0, "", {"colour[b1]": "red"}), 0)
    assert locating.vague == []
