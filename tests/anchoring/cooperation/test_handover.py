"""An overtake that begins in one area and ends in another, at each level of sharing; and who shares what."""

import os

import numpy as np
import pytest

from bench.cooperation.handover import counted, is_right, outcome
from dyknow.anchoring.cooperation.manoeuvres import PairEvents, PairRelation, PairRelations, as_relation
from dyknow.anchoring.cooperation.rows import PictureRow
from dyknow.anchoring.cooperation.sharing import LEVELS, Partner, chosen_level, kbit_s, right_neighbour, wanted_of
from dyknow.anchoring.links.states import ObjectState, diagonal

FULL = bool(os.environ.get("DYKNOW_FULL"))
SHARED = [level for level in LEVELS if level != "none"]
ALL = frozenset(LEVELS)


@pytest.mark.timeout(1200 if FULL else 240)
@pytest.mark.parametrize("level", SHARED)
def test_an_overtake_over_two_areas_is_recognised_at_each_level_of_sharing(level) -> None:
    if FULL:
        assert counted(level) >= 190
    else:
        assert is_right(3, level)


@pytest.mark.timeout(1200 if FULL else 240)
def test_without_sharing_it_is_not_recognised() -> None:
    assert not any(outcome(seed, "none").recognised for seed in range(200 if FULL else 1))


def state(x_m: float, vx_m_s: float, y_m: float = 0.0) -> ObjectState:
    return ObjectState(0, x_m, y_m, vx_m_s, 0.0, diagonal(0.5, 0.5))


def test_the_neighbour_into_whose_area_a_car_drives_is_the_right_one() -> None:
    west, east = Partner("1", ALL, x_m=-200.0, y_m=0.0), Partner("2", ALL, x_m=200.0, y_m=0.0)
    assert right_neighbour(state(0.0, 15.0), [west, east]) == "2"
    assert right_neighbour(state(0.0, -15.0), [west, east]) == "1"
    assert right_neighbour(state(0.0, 1.0), [west, east]) is None
    assert right_neighbour(state(0.0, 15.0), [Partner("3", ALL)]) is None
    assert wanted_of({"a": state(0.0, 15.0), "b": state(0.0, -15.0)}, [west, east]) == {"2": {"a"}, "1": {"b"}}


def test_the_level_is_chosen_by_bandwidth_load_and_abilities() -> None:
    assert chosen_level(Partner("1", ALL), 4) == "states"
    assert chosen_level(Partner("1", frozenset({"percepts"})), 4) == "percepts"
    assert chosen_level(Partner("1", ALL, kbit_s=kbit_s("relations", 4)), 4) == "relations"
    assert chosen_level(Partner("1", ALL, kbit_s=kbit_s("events", 4)), 4) == "events"
    assert chosen_level(Partner("1", ALL, kbit_s=0.0), 4) == "none"
    assert chosen_level(Partner("1", ALL), 4, is_busy=True) == "relations"
    assert chosen_level(Partner("1", ALL, is_busy=True, kbit_s=1.0), 4) == "none"
    assert chosen_level(Partner("1", frozenset()), 4) == "none"


@pytest.mark.parametrize("objects", [1, 10, 100])
def test_each_level_needs_more_than_the_one_below(objects) -> None:
    needs = [kbit_s(level, objects) for level in LEVELS]
    assert needs == sorted(needs)
    assert len({*needs}) == len(LEVELS)


def test_relations_are_of_objects_that_are_seen_and_move_and_are_shared_when_they_change() -> None:
    pairs = PairRelations()
    shared: list[PairRelation] = []
    for step in range(20):
        at_us = 200_000 * step
        rows = [
            PictureRow(name, state(x_m + 3.0 * step, 15.0), at_us, ("0",) if name != "unseen" else (), ())
            for name, x_m in (("a", 0.0), ("b", 30.0), ("unseen", 10.0), ("far", 500.0))
        ]
        shared += pairs.news(
            pairs.step([row._replace(state=row.state._replace(valid_us=at_us)) for row in rows], at_us)
        )
    assert {each.pair for each in shared} == {("a", "b"), ("b", "a")}
    assert len(shared) < 12
    behind = next(each for each in shared if each.pair == ("a", "b"))
    assert behind.record[0]
    assert not behind.record[2]


def test_an_event_of_another_is_the_relation_that_began() -> None:
    events = PairEvents()
    record = np.zeros(7, dtype=bool)
    steps = [record.copy() for _ in range(3)]
    steps[1][2] = True
    found = events.news([PairRelation(at, ("a", "b"), tuple(map(bool, each))) for at, each in enumerate(steps)])
    assert [(each.valid_us, each.kind) for each in found] == [
        (0, "turns-along"),
        (0, "goes-away"),
        (1, "comes-in-front"),
    ]
    assert as_relation(found[2]).record == (False, False, True, False, False, None, None)
    assert as_relation(found[0]).record == (None,) * 5 + (False, None)
