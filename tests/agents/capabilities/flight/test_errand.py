"""What shows an order: its acknowledgement, the vehicle's own target, its motion; and what ends it."""

import pytest

from dyknow.agents.capabilities.flight.errand import (
    MODE_WITHIN_US,
    SEEN_WITHIN_US,
    SETTLES_US,
    TURNS_US,
    Errand,
    OrderProgress,
)
from dyknow.agents.places import Fix
from dyknow.navigation.vehicle import (
    NO_ANSWER,
    OVERTAKEN,
    SUPERSEDED,
    UNCONFIRMED,
    Command,
    CommandResult,
    GoToOrder,
    HoldOrder,
    InterruptOrder,
    LandOrder,
    Order,
    ReturnHomeOrder,
    StatusReport,
    TargetReport,
    TextReport,
)

P = OrderProgress
HERE = Fix(0, 58.0, 15.0, 100.0)
NORTH_DEG = 1 / 111_194.9
CLIMB = GoToOrder(58.0, 15.0, 125.0)
FAR = GoToOrder(58.01, 15.0, 100.0)
GUIDED = StatusReport(0, armed=True, guided=True, airborne=True, mode="GUIDED")


def errand(order: Order = CLIMB, start: Fix = HERE, *, tells_target: bool = False) -> Errand:
    return Errand(Command(7, order), 0, start, tells_target)


def accepted(under_way: Errand, reason: str = "") -> Errand:
    under_way.on_result(CommandResult(0, 7, True, reason))
    return under_way


def moving(north_m_s: float = 0.0, up_m_s: float = 0.0, altitude_m: float = 100.0, north_m: float = 0.0) -> Fix:
    return Fix(0, 58.0 + north_m * NORTH_DEG, 15.0, altitude_m, north_m_s, 0.0, -up_m_s)


def mode(name: str, *, guided: bool = False, armed: bool = True) -> StatusReport:
    return StatusReport(0, armed, guided, airborne=True, mode=name)


def test_an_acknowledgement_is_not_yet_a_flown_order() -> None:
    climbs = accepted(errand())
    assert climbs.progress is P.ACKNOWLEDGED
    climbs.on_fix(moving(), 100_000)
    assert climbs.progress is P.ACKNOWLEDGED
    climbs.on_fix(moving(up_m_s=1.0), 200_000)
    assert climbs.progress is P.FLOWN


def test_motion_without_acknowledgement_is_somebody_elses_until_the_target_shows_it() -> None:
    flies = errand(FAR)
    flies.on_fix(moving(north_m_s=5.0), 100_000)
    assert flies.progress is P.SENT, "it may have flown there before"
    flies.on_target(TargetReport(0, *FAR[:3]), 200_000)
    flies.on_fix(moving(north_m_s=5.0), 300_000)
    assert flies.progress is P.FLOWN
    assert flies.words == "seen in the vehicle's target"


def test_an_autopilot_that_tells_its_target_has_taken_an_order_only_when_its_target_shows_it() -> None:
    climbs = accepted(errand(tells_target=True))
    climbs.on_fix(moving(up_m_s=1.0), 100_000)
    assert not climbs.is_taken
    climbs.on_target(TargetReport(0, *CLIMB[:3]), 200_000)
    assert climbs.is_taken
    assert climbs.words == "acknowledged, and seen in the vehicle's target"


def test_an_autopilot_that_tells_none_has_taken_it_when_it_acknowledges() -> None:
    taken, unanswered = accepted(errand()), errand()
    assert taken.deadline_us == SETTLES_US
    assert not taken.is_taken, "it may tell one yet"
    for each in (taken, unanswered):
        each.on_time(SETTLES_US)
    assert taken.is_taken
    assert not unanswered.is_taken


def test_what_no_acknowledgement_can_come_of_is_taken_when_the_motion_shows_it() -> None:
    climbs = accepted(errand(), UNCONFIRMED)
    assert not climbs.is_taken
    climbs.on_fix(moving(up_m_s=1.0), 100_000)
    assert climbs.progress is P.FLOWN
    assert climbs.words == "seen in the vehicle's motion"


@pytest.mark.parametrize("reason", ["denied", "unsupported", "failed"])
def test_a_refusal_is_final_and_keeps_the_autopilots_word(reason: str) -> None:
    climbs = errand()
    climbs.on_result(CommandResult(0, 7, False, reason))
    assert (climbs.progress, climbs.reason) == (P.REFUSED, f"autopilot: {reason}")
    accepted(climbs)
    climbs.on_fix(moving(up_m_s=1.0), 1)
    assert climbs.progress is P.REFUSED


def test_answers_to_other_orders_and_to_what_was_replaced_are_not_its_own() -> None:
    climbs = errand()
    climbs.on_result(CommandResult(0, 6, False, "denied"))
    climbs.on_result(CommandResult(0, 7, False, SUPERSEDED))
    assert climbs.progress is P.SENT


def test_what_is_not_seen_within_two_seconds_is_unseen_and_says_what_is_missing() -> None:
    silent, idle, elsewhere = errand(), accepted(errand()), accepted(errand(tells_target=True))
    for each in (silent, idle, elsewhere):
        each.on_time(SEEN_WITHIN_US - 1)
        assert each.deadline_us == SEEN_WITHIN_US
        assert each.progress is not P.UNSEEN
        each.on_time(SEEN_WITHIN_US)
        assert each.progress is P.UNSEEN
    assert silent.reason == NO_ANSWER
    assert "motion" in idle.reason
    assert "target" in elsewhere.reason
    assert [each.has_failed for each in (silent, idle, elsewhere)] == [True, False, True]
    assert silent.deadline_us is None


def test_no_answer_is_told_at_once_but_what_is_seen_needs_none() -> None:
    silent, seen = errand(), errand()
    seen.on_target(TargetReport(0, *CLIMB[:3]), 100_000)
    for each in (silent, seen):
        each.on_result(CommandResult(0, 7, False, NO_ANSWER))
    assert (silent.progress, silent.reason) == (P.UNSEEN, NO_ANSWER)
    assert seen.is_taken


def test_what_was_not_seen_may_be_seen_later_and_what_was_seen_may_stop() -> None:
    climbs = accepted(errand())
    climbs.on_time(SEEN_WITHIN_US)
    climbs.on_fix(moving(up_m_s=1.0), 2_100_000)
    assert (climbs.progress, climbs.reason) == (P.FLOWN, "")
    climbs.on_fix(moving(altitude_m=110.0), 3_000_000)
    climbs.on_time(2_100_000 + SEEN_WITHIN_US)
    assert climbs.progress is P.UNSEEN, "it hangs half way"


def test_a_vehicle_that_is_there_needs_no_motion() -> None:
    climbs = accepted(errand())
    for at_us in range(0, 10_000_000, 100_000):
        climbs.on_fix(moving(altitude_m=124.5), at_us)
        climbs.on_time(at_us)
    assert climbs.progress is P.FLOWN


@pytest.mark.parametrize("speed_m_s", [5.0, 10.0])
def test_stopping_is_shown_by_slowing_down_whatever_recoil_follows(speed_m_s: float) -> None:
    start = moving(north_m_s=speed_m_s)
    holds = accepted(errand(HoldOrder(), start))
    holds.on_fix(moving(north_m_s=speed_m_s), 100_000)
    assert holds.progress is P.ACKNOWLEDGED
    holds.on_fix(moving(north_m_s=0.7 * speed_m_s, north_m=5.0), 1_000_000)
    assert holds.progress is P.FLOWN
    for at_us in range(1_000_000, 5_000_000, 100_000):
        holds.on_fix(moving(north_m_s=-0.5 * speed_m_s, north_m=8.0), at_us)
        holds.on_time(at_us)
    assert holds.progress is P.FLOWN


def test_the_target_of_a_vehicle_that_stops_may_lie_a_braking_distance_ahead() -> None:
    holds = accepted(errand(HoldOrder(), moving(north_m_s=10.0), tells_target=True))
    holds.on_target(TargetReport(0, 58.0 + 25.0 * NORTH_DEG, 15.0, 100.0), 100_000)
    assert holds.in_target
    other = accepted(errand(HoldOrder(), moving(), tells_target=True))
    assert not other.is_ours(TargetReport(0, 58.0 + 25.0 * NORTH_DEG, 15.0, 100.0))


def test_a_ground_station_that_streams_its_target_is_seen_with_its_first_one_after_ours() -> None:
    climbs = accepted(errand(tells_target=True))
    climbs.on_target(TargetReport(0, *CLIMB[:3]), 10_000)
    climbs.on_target(TargetReport(0, *FAR[:3]), 900_000)
    assert climbs.progress is P.OVERTAKEN
    assert "another target" in climbs.reason


def test_a_target_from_before_the_order_is_not_another_will() -> None:
    climbs = accepted(errand(tells_target=True))
    climbs.before = TargetReport(0, *FAR[:3])
    climbs.on_target(TargetReport(0, *FAR[:3]), SETTLES_US + 1)
    assert climbs.progress is P.ACKNOWLEDGED, (
        "the autopilot has not taken the order over, and flies where it flew before"
    )
    climbs.on_text(TextReport(0, 2, "Reposition is outside geofence"), 1_000)
    climbs.on_text(TextReport(0, 4, "Battery low"), 2_000)
    climbs.on_time(SETTLES_US)
    climbs.on_time(SEEN_WITHIN_US)
    assert climbs.reason.endswith("target within 2 s; the autopilot says: Reposition is outside geofence")


def test_a_target_that_differs_from_the_one_before_as_well_is_another_will() -> None:
    climbs = accepted(errand(tells_target=True))
    for latitude_deg, progress in ((58.01, P.ACKNOWLEDGED), (58.01, P.ACKNOWLEDGED), (58.02, P.OVERTAKEN)):
        climbs.on_target(TargetReport(0, latitude_deg, 15.0, 100.0), SETTLES_US)
        assert climbs.progress is progress


def test_what_an_autopilot_says_later_is_not_of_the_order() -> None:
    climbs = accepted(errand())
    climbs.on_text(TextReport(0, 4, "Battery low"), 1_000_001)
    climbs.on_time(SETTLES_US)
    climbs.on_time(SEEN_WITHIN_US)
    assert climbs.progress is P.UNSEEN
    assert "Battery" not in climbs.reason


@pytest.mark.parametrize("status", [mode("LOITER"), mode("GUIDED", guided=True, armed=False)])
def test_a_pilot_who_takes_over_ends_it(status: StatusReport) -> None:
    climbs = accepted(errand())
    climbs.on_status(GUIDED)
    assert climbs.progress is P.ACKNOWLEDGED
    climbs.on_status(status)
    assert climbs.progress is P.OVERTAKEN
    assert climbs.has_failed


def test_a_repetition_that_the_pilot_forestalled_is_a_takeover() -> None:
    climbs = errand()
    climbs.on_result(CommandResult(0, 7, False, OVERTAKEN))
    assert climbs.progress is P.OVERTAKEN


def test_a_mission_is_left_only_once_the_autopilot_agrees() -> None:
    leaves = errand(InterruptOrder(*CLIMB[:3]))
    leaves.on_status(mode("AUTO"))
    assert leaves.progress is P.SENT, "it is still to be left"
    accepted(leaves)
    leaves.on_status(mode("AUTO"))
    assert leaves.progress is P.OVERTAKEN, "it was begun again"


@pytest.mark.parametrize(("order", "name"), [(LandOrder(), "LAND"), (ReturnHomeOrder(), "RTL")])
def test_landing_and_returning_are_shown_by_the_mode(order: Order, name: str) -> None:
    lands = accepted(errand(order))
    lands.on_status(GUIDED)
    assert not lands.is_taken
    lands.on_status(mode(name))
    assert lands.progress is P.FLOWN
    assert lands.words == "acknowledged, and seen in the vehicle's mode"
    lands.on_status(mode("LOITER"))
    assert lands.progress is P.OVERTAKEN


def test_a_mode_that_does_not_come_is_unseen() -> None:
    lands = accepted(errand(LandOrder()))
    lands.on_time(SETTLES_US)
    assert lands.deadline_us == MODE_WITHIN_US
    lands.on_time(MODE_WITHIN_US)
    assert lands.has_failed
    assert "mode" in lands.reason


def test_a_vehicle_that_has_to_turn_round_for_its_target_gets_the_time_to_brake() -> None:
    back = accepted(errand(GoToOrder(57.9996, 15.0, 100.0), moving(north_m_s=2.5), tells_target=True))
    back.on_target(TargetReport(0, 57.9996, 15.0, 100.0), 100_000)
    back.on_time(SETTLES_US)
    assert back.deadline_us == SEEN_WITHIN_US + TURNS_US + 1_000_000
    back.on_fix(moving(north_m_s=1.0, north_m=3.0), SEEN_WITHIN_US)
    back.on_time(SEEN_WITHIN_US)
    assert back.progress is P.ACKNOWLEDGED
    back.on_fix(moving(north_m_s=-1.0, north_m=3.0), SEEN_WITHIN_US + TURNS_US)
    assert back.progress is P.FLOWN


def test_one_that_has_not_taken_the_target_has_no_more_time_to_turn() -> None:
    back = accepted(errand(GoToOrder(57.9996, 15.0, 100.0), moving(north_m_s=2.5)))
    back.on_time(SETTLES_US)
    assert back.deadline_us == SEEN_WITHIN_US
