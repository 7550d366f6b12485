"""Relations of two cars in one unit, against the chain of units that it stands for."""

import numpy as np
import pytest

from dyknow import NO_VALUE, Predicted, Quality, Sample
from dyknow.compunits import ROAD_RELATIONS
from tests.compunits.units import process

CHAIN = ("RoadOffset", "SmoothOffset", "RoadRelations", "StableFields")


def car(name, along_m, right_m, link="l1"):
    return (name, along_m, -right_m, 90.0, link, "no_crossing")


def at(at_ms, value, quality=None):
    sample = Sample(1000 * at_ms, 1000 * at_ms, value)
    return sample if quality is None else sample._replace(quality=quality)


def chained(rows):
    """What the chain makes of states of both cars, (ms, one, other)."""
    units, made = [process(name) for name in CHAIN], []
    for at_ms, one, other in rows:
        sample = at(at_ms, (one, other))
        for unit in units:
            sample = None if sample is None else unit.on_sample(0, sample, 1000 * at_ms)
        if sample is not None:
            made.append((sample.valid_us, sample.value))
    return made


def fused(rows, **settings):
    unit, made = process("StableRelations", **settings), []
    for at_ms, *values in rows:
        for i, value in enumerate(values):
            sample = None if value is None else unit.on_sample(i, at(at_ms, value), 1000 * at_ms)
            if sample is not None:
                made.append((sample.valid_us, sample.value))
    return made


@pytest.mark.parametrize("seed", range(20))
def test_it_gives_what_the_chain_gives_of_cars_that_are_seen_together(seed):
    rng = np.random.default_rng(seed)
    ahead_m, faster_m_s, side_m = rng.uniform(-40.0, 10.0), rng.uniform(-3.0, 8.0), rng.uniform(0.0, 4.0)
    rows = []
    for step in range(150):
        noise = rng.normal(0.0, 1.0, 4)
        link = "l1" if rng.random() < 0.98 else "no_link"
        one = car("a", ahead_m + (20.0 + faster_m_s) * step / 10 + noise[0], side_m + noise[1], link)
        rows.append((100 * step, one, car("b", 2.0 * step + noise[2], noise[3])))
    assert fused(rows, every_s=0.001) == chained(rows)
    seldom = fused(rows)
    assert min(np.diff([valid_us for valid_us, value in seldom if value is not NO_VALUE])) >= 200_000
    assert len(seldom) < 0.6 * len(chained(rows))


@pytest.mark.parametrize("seed", range(10))
def test_a_car_that_is_seen_at_other_times_is_on_the_line_between_its_places(seed):
    """Both drive at 30 m/s, level but for half a metre: three metres of error would make it behind or in front."""
    late_ms = int(np.random.default_rng(seed).integers(1, 100))
    unit, made = process("StableRelations"), []
    for step in range(60):
        for i, at_ms, name, more_m in ((0, 100 * step, "a", 0.5), (1, 100 * step + late_ms, "b", 0.0)):
            value = car(name, more_m + 0.03 * at_ms, -2.0 if i == 0 else 0.0)
            made.append(unit.on_sample(i, at(at_ms, value), 1000 * at_ms))
    records = {ROAD_RELATIONS.as_record(each.value)["left"] for each in made if each is not None}
    assert records == {True}


@pytest.mark.parametrize("both", [False, True], ids=["one leaves", "both leave"])
def test_relations_end_a_second_after_one_of_both_was_seen_last(both):
    unit, ends = process("StableRelations"), []
    for step in range(40):
        at_ms = 100 * step
        for i, name, along_m in ((0, "a", 0.0), (1, "b", 20.0)):
            if at_ms > 1500 and (both or i == 1):
                continue
            made = unit.on_sample(i, at(at_ms, car(name, along_m + at_ms / 50, 0.0)), 1000 * at_ms)
            if made is not None and at_ms > 1500 and made.value is NO_VALUE:
                ends.append(at_ms)
        if unit.due_us is not None and unit.due_us <= 1000 * at_ms:
            ends += [at_ms for each in unit.on_time(1000 * at_ms) if each.value is NO_VALUE]
    assert 2100 <= ends[0] <= 2600
    assert unit.due_us is None


def test_what_rests_on_a_prediction_says_so():
    unit, made = process("StableRelations"), None
    for step in range(11):
        at_ms = 100 * step
        quality = Quality(0.8, (), Predicted(500_000)) if step >= 6 else None
        unit.on_sample(0, at(at_ms, car("a", 0.0, 0.0)), 1000 * at_ms)
        made = unit.on_sample(1, at(at_ms, car("b", 20.0, 0.0), quality), 1000 * at_ms)
    assert made is not None
    assert made.quality.prediction == Predicted(500_000)
    assert made.quality.certainty == 0.8
