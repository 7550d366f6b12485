"""Missions in the simulated world: faults are detected and recovered from, noise alone raises none (bar sizes: a tenth)."""

import os

import pytest

from dyknow.planning.execution import events
from tests.planning.recovery.simulated import FAULTS, PERIOD_US, Flown, fly

WHOLE = os.environ.get("DYKNOW_FULL") == "1"
FAULTY, FAULT_FREE, MEDICINE = (500, 200, 100) if WHOLE else (48, 20, 10)
MEDICINE_GOALS = (
    "#goal medicine: delivered(b1) :deadline {}s :weight 50\n#goal rest: forall box: delivered(box) :weight 1"
)


def boxes_of(seed: int) -> int:
    return 2 if seed % 6 == 0 else 1


@pytest.mark.parametrize("kind", FAULTS)
def test_each_fault_is_detected_within_two_periods_and_its_mission_reaches_the_goal(kind: str) -> None:
    seeds = range(FAULTS.index(kind), FAULTY, len(FAULTS))
    flown = [fly(seed, kind, boxes_of(seed)) for seed in seeds]
    late = [(seed, latency(one)) for seed, one in zip(seeds, flown, strict=True) if not 0 <= latency(one) <= 2]
    assert late == []
    reached = [one.outcome == "reached" for one in flown]
    assert sum(reached) >= 0.95 * len(reached)


def latency(flown: Flown) -> float:
    """Periods from the first state that shows the fault to the mission saying so."""
    assert flown.injected is not None and flown.injected.visible_us is not None, flown.notes
    return min((at_us - flown.injected.visible_us) / PERIOD_US for at_us, _ in flown.faults) if flown.faults else 1e9


def test_noise_raises_no_false_alarm() -> None:
    flown = [fly(seed, boxes=boxes_of(seed)) for seed in range(1000, 1000 + FAULT_FREE)]
    assert [one.faults for one in flown if one.faults] == []
    assert {one.outcome for one in flown} == {"reached"}


def test_a_box_that_is_dropped_is_not_carried_on() -> None:
    """The plan is left where the box was lost: what would have followed is not begun."""
    flown = fly(3, "drop")
    lost_us = flown.faults[0][0]
    before = [
        one.action.operator.name for at_us, one in flown.log if isinstance(one, events.StartAction) and at_us < lost_us
    ]
    assert before[-1] == "fly-box-to-goal"
    after = [
        one.action.operator.name for at_us, one in flown.log if isinstance(one, events.StartAction) and at_us > lost_us
    ]
    assert after.index("attach-box") < after.index("fly-box-to-goal") < after.index("detach-box")


def started(flown: Flown) -> list[events.StartAction]:
    return [one for _, one in flown.log if isinstance(one, events.StartAction)]


def test_a_medicine_deadline_that_the_late_uav_would_miss_is_met_by_the_other() -> None:
    """The UAV that is on its way to the medicine makes 2 cm a second; the other one delivers it."""
    met = 0
    for seed in range(2000, 2000 + MEDICINE):
        flown = fly(seed, "late", 2, extra=MEDICINE_GOALS.format(120), box="b1")
        assert flown.injected is not None
        by = [
            one.unit
            for one in started(flown)
            if one.action.shown.startswith("detach-box") and "b1" in one.action.objects
        ]
        met += flown.delivered_us.get("b1", 10**12) <= 120_000_000 and by != [] and flown.injected.unit not in by
    assert met >= 0.9 * MEDICINE


def test_a_mission_is_the_same_whenever_it_is_flown() -> None:
    assert fly(8, "drop").log == fly(8, "drop").log
