"""Cars are put on a road that leads anywhere; what the units say of them is what was arranged."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dyknow import NO_VALUE, Sample, variant
from dyknow.compunits import CAR, NO_LINK, ROAD_RELATIONS, Subjects
from dyknow.compunits.motion import turn_deg
from tests.compunits.units import outputs, process, stream, value_of, values
from tests.kpl.instances import Running

ROADS = st.floats(0, 359)
AREAS = ("l1", "no_crossing")


def place(road_deg: float, along_m: float, right_m: float = 0.0):
    road = math.radians(road_deg)
    sine, cosine = math.sin(road), math.cos(road)
    return along_m * sine + right_m * cosine, along_m * cosine - right_m * sine


def car(symbol: str, forward_deg: float, along_m: float, right_m: float = 0.0, areas=AREAS):
    return (symbol, *place(forward_deg, along_m, right_m), forward_deg, *areas)


@given(ROADS, st.booleans(), st.floats(1, 30))
def test_8_7_5_a_car_drives_along_its_road_segment_or_against_it(road_deg, is_along, speed_m_s) -> None:
    way = 1 if is_along else -1
    seen = [(at, ("c", *place(road_deg, way * at * speed_m_s), road_deg, *AREAS)) for at in range(41)]
    made = outputs("CarOnRoad", stream(*seen))
    first = next(at for at, each in enumerate(made) if each is not None)
    assert first * speed_m_s >= 5.0 - 1e-6
    assert (first - 1) * speed_m_s - 1e-6 <= 20.0
    for sample in made[first:]:
        assert abs(turn_deg(sample.value[3], road_deg if is_along else road_deg + 180)) < 1e-6
    assert CAR.check(made[-1].value) is None


def test_an_error_of_five_metres_turns_no_car_round_but_one_whose_motion_is_its_last_step() -> None:
    off = [(7 * at % 11 - 5) for at in range(100)]  # every metre from -5 to 5
    seen = [(at / 10, ("c", at * 1.5 + off[at], 0.0, 90.0, *AREAS)) for at in range(100)]
    turned = {
        unit: sum(1 for made in outputs(unit, stream(*seen)) if made is not None and made.value[3] != 90.0)
        for unit in ("CarOnRoad", "CarByStep")
    }
    assert turned["CarOnRoad"] == 0
    assert turned["CarByStep"] > 20


@pytest.mark.parametrize("seed", range(30))
def test_a_slow_car_has_a_direction_before_it_has_moved_by_twenty_metres_and_one_that_stands_has_none(seed) -> None:
    rng = np.random.default_rng(seed)
    for speed_m_s in (0.0, -2.0, 2.0):
        seen = [
            (at / 10, ("c", speed_m_s * at / 10 + rng.normal(0.0, 1.0), rng.normal(0.0, 1.0), 90.0, *AREAS))
            for at in range(80)
        ]
        known = {each[3] for each in values(outputs("CarOnRoad", stream(*seen))) if each is not None}
        assert known == ({90.0 if speed_m_s > 0 else 270.0} if speed_m_s else set())


def test_what_stands_keeps_its_direction_and_what_comes_late_gives_nothing() -> None:
    moving = [(at, ("c", 15.0 * at, 0.0, 90.0, *AREAS)) for at in range(4)]
    standing = [(4 + at, ("c", 45.0 - at % 2, 0.0, 90.0, *AREAS)) for at in range(9)]
    late = [(2, ("c", -500.0, 0.0, 90.0, *AREAS))]
    made = values(outputs("CarOnRoad", stream(*moving, *standing, *late)))
    assert [each and each[3] for each in made] == [None, None, *[90.0] * 11, None]


def test_a_segment_that_is_drawn_the_other_way_round_turns_no_car() -> None:
    seen = [(at, ("c", 15.0 * at, 0.0, 90.0 if at < 5 else 270.0, f"l{at // 5}", "no_crossing")) for at in range(9)]
    made = values(outputs("CarOnRoad", stream(*seen)))
    assert [each and each[3] for each in made] == [None, None, *[90.0] * 7]


def test_what_queues_drives_as_its_lane_leads_until_its_motion_says_otherwise() -> None:
    lanes = [270.0, 90.0, 270.0, 270.0]  # an error of the position puts it into the other lane once
    queueing = [(at, ("c", 0.0, 2.0, lane_deg, *AREAS)) for at, lane_deg in enumerate(lanes)]
    passing = [(4 + at, ("c", 25.0 * (1 + at), 2.0, 270.0, *AREAS)) for at in range(2)]  # on the lane of the others
    turned = [(6, ("c", 50.0, -3.0, 160.0, "l9", "no_crossing"))]  # sharply onto another link
    made = values(outputs("CarInLane", stream(*queueing, *passing, *turned)))
    assert [each[3] for each in made] == [*[270.0] * 4, *[90.0] * 2, 160.0]


@given(ROADS, st.floats(-200, 200), st.floats(-200, 200))
def test_figure_8_11_of_four_sides_one_holds(forward_deg, ahead_m, right_m) -> None:
    assume(abs(abs(ahead_m) - abs(right_m)) > 0.1)
    assume(abs(math.hypot(ahead_m, right_m) - 60.0) > 1e-6)
    pair = car("a", forward_deg, ahead_m, right_m), car("b", forward_deg, 0.0)
    offset = value_of("RoadOffset", pair)
    assert offset == pytest.approx((ahead_m, right_m, 1.0), abs=1e-6)
    record = ROAD_RELATIONS.as_record(value_of("RoadRelations", offset))
    side = ("in_front" if ahead_m > 0 else "behind") if abs(ahead_m) > abs(right_m) else ("left", "right")[right_m > 0]
    assert [name for name in ("in_front", "behind", "left", "right") if record[name]] == [side]
    assert record["beside"] == (side in {"left", "right"})
    assert record["close"] == (math.hypot(ahead_m, right_m) <= 60)
    assert record["oncoming"] is False


def test_who_drives_against_the_other_is_oncoming() -> None:
    one, other = car("a", 10.0, 0.0), ("c", *place(10.0, 80.0, -3.5), 190.0, *AREAS)
    for pair in ((one, other), (other, one)):
        record = ROAD_RELATIONS.as_record(value_of("RoadRelations", value_of("RoadOffset", pair)))
        assert record == dict.fromkeys(record, False) | {"behind": True, "oncoming": True}


@pytest.mark.parametrize("areas", [("l2", "no_crossing"), (NO_LINK, "x1")])
def test_cars_that_are_not_on_one_link_have_no_relation(areas) -> None:
    assert value_of("RoadOffset", (car("a", 0.0, 0.0, areas=areas), car("b", 0.0, 9.0))) is NO_VALUE
    assert value_of("RoadOffset", (car("a", 0.0, 0.0, areas=areas), NO_VALUE)) is NO_VALUE
    away = car("a", 0.0, 0.0, areas=(NO_LINK, "x1"))
    assert value_of("RoadOffset", (away, away)) is NO_VALUE


def test_pairs_are_of_different_objects_and_in_both_orders() -> None:
    assert value_of("Pairs", ("a", "b", "a")) == (("a", "b"), ("b", "a"))
    assert value_of("Pairs", ("a",)) == ()
    assert value_of("Pairs", (1.5, "b")) == ()


def recognition(*arguments):
    return arguments, (("?car1", arguments[0]),), (("t1", 5),)


def test_a_class_is_formed_by_the_first_arguments_of_what_is_recognised() -> None:
    seen = [
        (1, recognition("a", "b")),
        (2, recognition("c", "b")),
        (3, recognition("a", "c")),
        (3605, recognition("d")),
    ]
    made = values(outputs("Subjects", stream(*seen)))
    assert made == [("a",), ("a", "c"), None, ("d",)]  # a was recognised last 3602 s before
    made = values(outputs("Subjects", stream(*seen), seconds=7200))
    assert made[-1] == ("a", "c", "d")


def test_a_class_is_empty_when_its_time_is_over_though_nothing_more_is_recognised() -> None:
    running = Running(prototypes=(variant(Subjects, "Reckless", "object", "recognition", seconds=30),), sorts={})
    running.add(
        "source recognition seen\nstrmgen seen = seen\nstrmgen reckless = Reckless(seen)\nstream out = reckless\n"
    )
    for at_s, name in ((1, "a"), (11, "b"), (21, "a")):
        running.push("seen", recognition(name, "z"), at_s * 1_000_000)
    running.wait(120_000_000)
    told = [(round(each.valid_us / 1e6, 3), each.value) for name, each in running.outputs if name == "out"]
    assert told == [(1, ("a",)), (11, ("a", "b")), (41, ("a",)), (51, ())]
    assert not running.faults


def test_either_of_two_sets_is_there_before_the_other() -> None:
    unit = process("Either")
    assert unit.on_sample(1, Sample(0, 0, ("b", "a")), 0).value == ("b", "a")
    assert unit.on_sample(0, Sample(1, 1, ("c", "a")), 1).value == ("c", "a", "b")


def test_each_component_has_to_be_stable_by_itself() -> None:
    seen = [(at / 10, (at >= 5, at % 2 == 0 and at < 8)) for at in range(25)]
    made = outputs("StableFields", stream(*seen))
    told = {at: each.value for at, each in enumerate(made) if each is not None}
    assert min(told) == 12  # the second one is false from 7 on
    assert set(told.values()) == {(True, False)}
    assert process("StableFields").on_sample(0, Sample(0, 0, 1.0), 0) is None


@given(st.lists(st.tuples(st.integers(1, 4), st.booleans(), st.sampled_from("xyz")), min_size=1, max_size=40))
def test_stable_fields_are_stability_filters_side_by_side(steps) -> None:
    at, seen = 0, []
    for ticks, *record in steps:
        at += ticks
        seen.append((at / 10, tuple(record)))
    alone = [values(outputs("StabilityFilter", stream(*[(t, each[i]) for t, each in seen]))) for i in range(2)]
    expected = [None if None in each else each for each in zip(*alone, strict=True)]
    assert values(outputs("StableFields", stream(*seen))) == expected
