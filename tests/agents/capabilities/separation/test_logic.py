"""The rule, flown by vehicles that have nothing else: drawn meetings of two to six, and each line of its state table."""

from itertools import combinations
from math import cos, hypot, pi, sin
from random import Random

import pytest

from dyknow.agents.capabilities.separation.situation import Fly, GoOn, LeaveTo, MeetingState, Neither
from dyknow.navigation.intents.path import FlatMotion, FlatPlace
from tests.agents.capabilities.separation.vehicles import Airspace, Flyer

NEAR_M = 10.0


def flyer(unit: str, start: tuple[float, float, float], goal: tuple[float, float, float], speed: float = 5.0) -> Flyer:
    away = hypot(goal[0] - start[0], goal[1] - start[1]) or 1.0
    north, east = ((goal[at] - start[at]) / away * speed for at in (0, 1))
    return Flyer(unit, FlatMotion(*start, north, east, 0.0), FlatPlace(*goal), speed)


def head_on(*, gap_m: float = 0.0) -> tuple[Flyer, Flyer]:
    return (
        flyer("0", (-100.0, 0.0, 60.0), (100.0, 0.0, 60.0)),
        flyer("1", (100.0, gap_m, 60.0), (-100.0, gap_m, 60.0)),
    )


def decided(one: Flyer, kind: type) -> int:
    return sum(isinstance(step, kind) for _, step in one.steps)


def drawn(seed: int) -> Airspace:
    """Two to six that make for each other, from all sides, at all levels and speeds."""
    random = Random(f"airspace {seed}")
    flyers: list[Flyer] = []
    while len(flyers) < 2 + seed % 5:
        bearing, speed, level = (
            random.uniform(0, 2 * pi),
            random.uniform(1.5, 12.0),
            random.choice((40.0, 60.0, 60.0, 66.0)),
        )
        before, after = random.uniform(10, 16) * speed, random.uniform(8, 20) * speed
        aside = random.uniform(-8, 8)
        start = (-before * cos(bearing) - aside * sin(bearing), -before * sin(bearing) + aside * cos(bearing), level)
        goal = (after * cos(bearing) - aside * sin(bearing), after * sin(bearing) + aside * cos(bearing), level)
        if random.random() < 0.15:
            start, goal = (random.uniform(-15, 15), random.uniform(-15, 15), level), (0.0, 0.0, level)
            goal = start
        made = flyer(str(len(flyers)), start, goal, speed)
        apart = [
            (
                hypot(start[0] - f.motion.north_m, start[1] - f.motion.east_m),
                hypot(goal[0] - f.goal.north_m, goal[1] - f.goal.east_m),
            )
            for f in flyers
        ]
        if all(a > 45.0 and b > 30.0 for a, b in apart):
            flyers.append(made)
    return Airspace(flyers)


@pytest.mark.parametrize(
    "seed", [*range(40), *(pytest.param(seed, marks=pytest.mark.full) for seed in range(40, 1000))]
)
def test_drawn_meetings_keep_apart_and_all_arrive(seed: int) -> None:
    space = drawn(seed)
    space.run(150.0)
    assert space.least_m >= NEAR_M, space.least_m
    assert len(space.arrived_s) == len(space.flyers), {
        f.unit: f.motion for f in space.flyers if f.unit not in space.arrived_s
    }


def test_of_two_the_later_by_name_yields_and_flies_on() -> None:
    zero, one = head_on()
    space = Airspace([zero, one])
    space.run(90.0)
    assert not decided(zero, Fly)
    assert decided(one, GoOn) == 1
    assert space.least_m > NEAR_M
    assert len(space.arrived_s) == 2


def test_one_that_cannot_be_commanded_has_right_of_way_whatever_its_name() -> None:
    zero, one = head_on()
    one.cannot = "mode AUTO"
    space = Airspace([zero, one])
    space.run(90.0)
    assert decided(zero, Fly)
    assert not decided(one, Fly)
    assert space.least_m > NEAR_M


def test_one_whose_autopilot_refuses_leaves_it_to_the_other() -> None:
    zero, one = head_on()
    one.refuses = True
    space = Airspace([zero, one])
    space.run(90.0)
    assert decided(one, LeaveTo) >= 1
    assert decided(zero, Fly)
    assert space.least_m > NEAR_M


def test_one_that_is_silent_is_kept_away_from() -> None:
    zero, one = head_on()
    zero.silent_s = 3.0
    space = Airspace([zero, one])
    space.run(60.0)
    assert decided(one, Fly)
    assert space.least_m > NEAR_M


def test_one_that_falls_silent_before_it_has_yielded_is_kept_away_from() -> None:
    zero, one = head_on()
    one.silent_s = 5.0
    space = Airspace([zero, one])
    space.run(60.0)
    assert decided(zero, Fly)
    assert space.least_m > NEAR_M


def test_where_neither_can_both_are_told_with_the_seconds_that_are_left() -> None:
    zero, one = head_on()
    zero.cannot = one.cannot = "mode AUTO"
    space = Airspace([zero, one])
    space.run(40.0)
    for unit in "01":
        (at_s, told), *_ = space.told(unit)
        assert told.seconds > 8.0
        assert at_s < 12.0
    assert isinstance(told, Neither)


def test_one_that_is_silent_and_one_that_cannot_is_told_at_once() -> None:
    zero, one = head_on()
    zero.silent_s, one.cannot = 1.0, "its pilot took over"
    space = Airspace([zero, one])
    space.run(40.0)
    (_, told), *_ = space.told("1")
    assert told.reasons == ("its pilot took over", "it is silent")


def test_under_a_low_ceiling_they_pass_apart_and_arrive() -> None:
    zero, one = head_on()
    zero.ceiling_m = one.ceiling_m = 62.0
    for each in (zero, one):
        each.motion, each.goal = each.motion._replace(altitude_m=20.0), each.goal._replace(altitude_m=20.0)
    space = Airspace([zero, one])
    space.run(120.0)
    assert space.least_m > NEAR_M
    assert len(space.arrived_s) == 2


@pytest.mark.parametrize("speed", [3.0, 10.0])
def test_three_at_one_point_low_over_the_ground_keep_apart_and_arrive(speed: float) -> None:
    flyers = [
        flyer(str(at), (-12 * speed * cos(b), -12 * speed * sin(b), 20.0), (12 * speed * cos(b), 12 * speed * sin(b), 20.0), speed)
        for at, b in enumerate((0.0, 2.1, 4.2))
    ]  # fmt: skip
    space = Airspace(flyers)
    space.run(150.0)
    assert space.least_m > NEAR_M
    assert len(space.arrived_s) == 3


@pytest.mark.parametrize(("other", "later_s"), [("1", 1.0), ("3", 0.0)])
def test_of_two_that_make_room_at_one_place_the_earlier_flies_on_first(other: str, later_s: float) -> None:
    """So that two whose ways become free at once do not meet again."""
    flies_on_s = list[float]()
    for is_there in (False, True):
        zero = flyer("0", (-100.0, 0.0, 60.0), (100.0, 0.0, 60.0))
        two = flyer("2", (100.0, 0.0, 60.0), (-100.0, 0.0, 60.0))
        stands = Flyer(other, FlatMotion(20.0, 60.0, 30.0, 0.0, 0.0, 0.0), FlatPlace(20.0, 60.0, 30.0))
        stands.flown = (stands.goal,)
        Airspace([zero, two, stands] if is_there else [zero, two]).run(60.0)
        flies_on_s += [at_s for at_s, step in two.steps if isinstance(step, GoOn)]
    without_s, with_it_s = flies_on_s
    assert with_it_s - without_s == pytest.approx(later_s, abs=0.25)


def test_lanes_and_crossing_well_behind_are_no_meeting() -> None:
    lanes = [flyer("0", (-150.0, 0.0, 60.0), (150.0, 0.0, 60.0)), flyer("1", (150.0, 50.0, 60.0), (-150.0, 50.0, 60.0))]
    behind = flyer("2", (0.0, -150.0 - 8 * 5.0, 60.0), (0.0, 150.0, 60.0))
    space = Airspace([*lanes, behind])
    space.run(80.0)
    assert not any(decided(each, Fly) for each in space.flyers)


def test_a_meeting_is_expected_of_the_later_one_and_over_when_it_has_yielded() -> None:
    zero, one = head_on()
    space = Airspace([zero, one])
    states = set()
    while space.now_s < 40.0:
        space._step()
        states |= {(f.unit, m.state) for f in (zero, one) for m in f.logic.meetings.values()}
    assert ("1", MeetingState.MINE) in states
    assert ("0", MeetingState.MINE) not in states
    assert not zero.logic.meetings
    assert all(not f.logic.meetings for f, _ in combinations((zero, one), 2))
