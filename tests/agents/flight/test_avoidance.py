"""Who gives way: what two platforms agree on, what one does alone, and when it flies on."""

import pytest

from agents.flight.avoidance import (
    AGAIN_US,
    AWAY_M,
    CLEAR_M,
    DIVERGING_US,
    KNOWN_US,
    PATIENCE_US,
    SEPARATION_M,
    Avoidance,
    Divert,
    ManoeuvreRole,
    May,
    Propose,
    ResumeRoute,
    Step,
    climber_of,
    opening_m_s,
)
from agents.flight.places import Fix

METRE_DEG = 1 / 111_320.0
S = 1_000_000
ABOVE_M = 102.0


def fix(altitude_m: float = 100.0, north_m: float = 0.0, at_us: int = 0, **moves: float) -> Fix:
    return Fix(at_us, 58.0 + north_m * METRE_DEG, 15.0, altitude_m, **moves)


def anything(_altitude_m: float | None) -> str | None:
    return None


def between(floor_m: float, ceiling_m: float) -> May:
    def may(altitude_m: float | None) -> str | None:
        inside = altitude_m is None or floor_m <= altitude_m <= ceiling_m
        return None if inside else "outside the limits"

    return may


def warned(unit: str, own: Fix, other: Fix, may: May = anything, partner: str = "1") -> tuple[Avoidance, Propose]:
    """A platform whose warning about `partner` has just opened, and what it proposes."""
    found = Avoidance(unit)
    (proposed,) = found.on_warning(partner, own, other, may, 0)
    assert isinstance(proposed, Propose)
    return found, proposed


def climbing(own: Fix | None = None, other: Fix | None = None) -> Avoidance:
    """Unit 0, who agreed with unit 1 that it climbs."""
    found, _ = warned("0", own or fix(ABOVE_M), other or fix(north_m=30.0))
    found.on_agreed("1", own or fix(ABOVE_M), other or fix(north_m=30.0), anything)
    return found


def alone(own: Fix, other: Fix, may: May = anything) -> list[Step]:
    """What a platform does whose partner declined."""
    return warned("0", own, other, may)[0].on_declined("1", own, other, may)


# -- who climbs --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("own_m", "other_m", "climber"), [(103.0, 100.0, "7"), (100.0, 103.0, "3")])
def test_the_higher_one_climbs(own_m: float, other_m: float, climber: str) -> None:
    assert climber_of("7", fix(own_m), "3", fix(other_m)) == climber


@pytest.mark.parametrize(("one", "other", "climber"), [("9", "10", "9"), ("10", "9", "9"), ("b", "a", "a")])
def test_a_tie_goes_to_the_unit_that_sorts_first(one: str, other: str, climber: str) -> None:
    assert climber_of(one, fix(100.0), other, fix(100.9)) == climber
    assert climber_of(other, fix(100.9), one, fix(100.0)) == climber, "from either side"


def test_a_warning_proposes_that_the_higher_one_climbs_until_it_is_separated() -> None:
    _, proposed = warned("0", fix(103.0), fix(100.0, 30.0))
    assert proposed == Propose("1", "0", SEPARATION_M - 3.0)
    _, proposed = warned("0", fix(100.0), fix(103.0, 30.0))
    assert proposed == Propose("1", "1", SEPARATION_M - 3.0)


def test_who_may_not_climb_proposes_that_the_other_does() -> None:
    _, proposed = warned("0", fix(103.0), fix(100.0, 30.0), between(60.0, 110.0))
    assert proposed == Propose("1", "1", SEPARATION_M + 3.0)


# -- agreed ------------------------------------------------------------------------------------------------------


def test_nobody_moves_before_the_other_has_answered() -> None:
    found, _ = warned("0", fix(ABOVE_M), fix(north_m=30.0))
    assert found.awaits("1")
    assert found.on_moved("1", fix(ABOVE_M), fix(north_m=20.0), anything, 500_000, warned=True) == []


def test_when_it_is_agreed_the_one_climbs_and_the_other_holds() -> None:
    found, proposed = warned("0", fix(ABOVE_M), fix(north_m=30.0))
    partner = Avoidance("1")
    reason, steps = partner.on_proposal("0", proposed.climber, fix(north_m=30.0), fix(ABOVE_M), anything, 0)
    assert (reason, steps) == (None, [Divert(None)])
    assert found.on_agreed("1", fix(ABOVE_M), fix(north_m=30.0), anything) == [Divert(100.0 + SEPARATION_M)]
    assert not found.awaits("1")


def test_an_agreement_that_comes_twice_does_nothing_more() -> None:
    found = climbing()
    assert found.on_agreed("1", fix(ABOVE_M), fix(north_m=30.0), anything) == []
    assert Avoidance("0").on_agreed("1", fix(), fix(), anything) == []


def test_a_proposal_is_refused_by_the_rule_that_it_breaks() -> None:
    found = Avoidance("1")
    reason, steps = found.on_proposal("0", "1", fix(103.0), fix(), between(60.0, 110.0), 0)
    assert (str(reason), steps) == ("outside the limits", [])
    assert found.encounters == {}
    reason, _ = found.on_proposal("0", "0", fix(), fix(103.0), lambda _: "not armed", 0)
    assert str(reason) == "not armed", "holding is a promise too"


@pytest.mark.parametrize("first", ["0", "1"])
def test_proposals_that_cross_settle_on_the_one_of_the_unit_that_sorts_first(first: str) -> None:
    """Each believes itself to be the higher one."""
    zero, of_zero = warned("0", fix(105.0), fix(100.0, 30.0))
    one, of_one = warned("1", fix(105.0), fix(100.0, 30.0), partner="0")
    assert (of_zero.climber, of_one.climber) == ("0", "1")

    def zero_hears() -> None:
        reason, steps = zero.on_proposal("1", "1", fix(105.0), fix(100.0, 30.0), anything, 0)
        assert reason is not None
        assert reason.code == "superseded"
        assert steps == []

    def one_hears() -> None:
        assert one.on_proposal("0", "0", fix(105.0), fix(100.0, 30.0), anything, 0) == (None, [Divert(None)])

    for hears in (zero_hears, one_hears) if first == "0" else (one_hears, zero_hears):
        hears()
    one.on_superseded("0")
    assert zero.on_agreed("1", fix(105.0), fix(100.0, 30.0), anything) == [Divert(125.0)]
    assert (zero.encounters["1"].role, one.encounters["0"].role) == (ManoeuvreRole.CLIMB, ManoeuvreRole.HOLD)
    assert not zero.awaits("1")
    assert not one.awaits("0")


def test_crossing_proposals_that_say_the_same_are_both_agreed_to() -> None:
    zero, one = warned("0", fix(105.0), fix(100.0))[0], warned("1", fix(100.0), fix(105.0), partner="0")[0]
    assert zero.on_proposal("1", "0", fix(105.0), fix(100.0), anything, 0) == (None, [Divert(125.0)])
    assert one.on_proposal("0", "0", fix(100.0), fix(105.0), anything, 0) == (None, [Divert(None)])
    assert zero.on_agreed("1", fix(105.0), fix(100.0), anything) == []
    assert one.on_agreed("0", fix(100.0), fix(105.0), anything) == []


# -- alone -------------------------------------------------------------------------------------------------------


def test_who_is_left_alone_climbs_if_it_is_the_higher_one() -> None:
    assert alone(fix(ABOVE_M), fix()) == [Divert(125.0)]


def test_who_is_left_alone_well_below_descends() -> None:
    assert alone(fix(100.0), fix(106.0)) == [Divert(106.0 - SEPARATION_M)]


def test_who_may_not_descend_climbs_and_who_may_not_climb_descends() -> None:
    assert alone(fix(100.0), fix(106.0), between(90.0, 170.0)) == [Divert(131.0)]
    assert alone(fix(106.0), fix(100.0), between(60.0, 110.0)) == [Divert(75.0)]


def test_who_may_do_neither_holds() -> None:
    assert alone(fix(100.0), fix(106.0), between(95.0, 110.0)) == [Divert(None)]


def test_who_has_agreed_with_the_partner_meanwhile_is_not_left_alone() -> None:
    found, _ = warned("1", fix(), fix(105.0), partner="0")
    found.on_proposal("0", "0", fix(), fix(105.0), anything, 0)
    assert found.on_declined("0", fix(), fix(105.0), anything) == []
    assert found.encounters["0"].role is ManoeuvreRole.HOLD


def test_silence_after_an_answer_or_without_a_question_means_nothing() -> None:
    assert climbing().on_declined("1", fix(ABOVE_M), fix(), anything) == []
    assert Avoidance("0").on_declined("1", fix(), fix(), anything) == []


def test_of_two_that_climb_alone_the_one_that_is_to_hold_stops() -> None:
    """Each was left alone; the lower one sees the other rise."""
    own, other = fix(100.0), fix(ABOVE_M, 30.0)
    found, _ = warned("0", own, other)
    assert found.on_declined("1", own, other, anything) == [Divert(127.0)]
    rising = fix(104.0, 30.0, down_m_s=-2.0)
    assert found.on_moved("1", fix(101.0), rising, anything, S, warned=True) == [Divert(None)]


def test_who_climbs_stays_above_a_partner_that_rises_within_the_limits() -> None:
    found = climbing()
    moved = found.on_moved("1", fix(130.0), fix(108.0, 30.0), anything, S, warned=True)
    assert moved == [Divert(133.0)]
    assert found.on_moved("1", fix(133.0), fix(120.0), between(60.0, 140.0), 2 * S, warned=True) == []


# -- holding and flying on ---------------------------------------------------------------------------------------


def test_a_warning_that_flickers_changes_nothing_of_what_is_done() -> None:
    found = climbing()
    for step in range(20):
        now_us = step * S // 5
        assert found.on_moved("1", fix(103.0), fix(north_m=30.0), anything, now_us, warned=step % 2 == 0) == []
        if step % 2 == 0:
            assert found.on_warning("1", fix(103.0), fix(north_m=30.0), anything, now_us) == []
    assert found.encounters["1"].role is ManoeuvreRole.CLIMB


def test_a_warning_that_closes_before_anything_is_agreed_is_over_once_it_is_answered() -> None:
    found, _ = warned("0", fix(), fix(north_m=30.0))
    found.on_superseded("1")
    assert found.on_moved("1", fix(), fix(north_m=30.0), anything, S, warned=False) == []
    assert found.encounters == {}


def test_what_was_superseded_and_did_not_come_is_proposed_again() -> None:
    found, _ = warned("0", fix(ABOVE_M), fix(north_m=30.0))
    found.on_superseded("1")
    own, other = fix(ABOVE_M), fix(north_m=30.0)
    assert found.on_moved("1", own, other, anything, AGAIN_US - 1, warned=True) == []
    assert found.on_moved("1", own, other, anything, AGAIN_US, warned=True) == [Propose("1", "0", SEPARATION_M - 2.0)]


def test_who_holds_flies_on_when_they_are_apart_vertically() -> None:
    found = Avoidance("1")
    found.on_proposal("0", "0", fix(), fix(ABOVE_M), anything, 0)
    near = fix(100.0 + CLEAR_M - 0.1, 10.0)
    assert found.on_moved("0", fix(), near, anything, S, warned=False) == []
    assert found.on_moved("0", fix(), fix(100.0 + CLEAR_M, 10.0), anything, 2 * S, warned=False) == [ResumeRoute()]
    assert found.encounters == {}


def test_nobody_flies_on_while_the_warning_is_open() -> None:
    found = Avoidance("1")
    found.on_proposal("0", "0", fix(), fix(ABOVE_M), anything, 0)
    for second in range(1, 60):
        assert found.on_moved("0", fix(), fix(150.0, 10.0), anything, second * S, warned=True) == []


def test_who_climbed_flies_on_above_the_other_and_comes_down_when_it_is_away() -> None:
    found = climbing()
    up, below = fix(125.0, north_m_s=-3.0), fix(100.0, 30.0, north_m_s=3.0)
    assert found.on_moved("1", up, below, anything, S, warned=False) == [ResumeRoute(raised_to_m=125.0)]
    away = fix(100.0, AWAY_M + 1.0, north_m_s=3.0)
    assert found.on_moved("1", up, away, anything, S + DIVERGING_US - 1, warned=False) == []
    assert found.on_moved("1", up, away, anything, S + DIVERGING_US, warned=False) == [ResumeRoute()]
    assert found.encounters == {}


def test_who_descended_flies_on_below_the_other() -> None:
    found, _ = warned("0", fix(100.0), fix(106.0, 30.0))
    found.on_declined("1", fix(100.0), fix(106.0, 30.0), anything)
    moved = found.on_moved("1", fix(81.0), fix(106.0, 30.0), anything, S, warned=False)
    assert moved == [ResumeRoute(None, 81.0)]


def test_a_new_warning_while_flying_on_above_stops_it_again() -> None:
    found = climbing()
    found.on_moved("1", fix(125.0), fix(north_m=30.0), anything, S, warned=False)
    assert found.on_warning("1", fix(125.0), fix(north_m=20.0), anything, 2 * S) == [Divert(125.0)]


def test_nobody_waits_for_ever_for_a_climber_that_does_not_climb() -> None:
    found = Avoidance("1")
    found.on_proposal("0", "0", fix(), fix(ABOVE_M), anything, 0)
    stays = fix(ABOVE_M, 40.0)
    assert found.on_moved("0", fix(), stays, anything, PATIENCE_US - 1, warned=False) == []
    assert found.on_moved("0", fix(), stays, anything, PATIENCE_US, warned=False) == [ResumeRoute()]


def test_a_partner_of_whom_nothing_is_known_any_more_or_who_left_holds_nobody() -> None:
    found = climbing()
    stale = fix(north_m=30.0)
    assert found.on_moved("1", fix(at_us=KNOWN_US), stale, anything, KNOWN_US, warned=False) == []
    assert found.on_moved("1", fix(at_us=KNOWN_US + 1), stale, anything, KNOWN_US + 1, warned=False) == [ResumeRoute()]
    assert climbing().on_gone("1") == [ResumeRoute()]
    assert Avoidance("0").on_gone("1") == []


def test_of_several_encounters_the_highest_climb_is_flown_and_the_last_to_end_lets_go() -> None:
    found = climbing()
    assert found.on_proposal("2", "0", fix(ABOVE_M), fix(110.0), anything, 0) == (None, [Divert(135.0)])
    assert found.on_gone("2") == [Divert(125.0)]
    assert found.on_gone("1") == [ResumeRoute()]


def test_what_was_not_done_is_said_again() -> None:
    found = climbing()
    found.forget_order()
    moved = found.on_moved("1", fix(ABOVE_M), fix(north_m=30.0), anything, S, warned=True)
    assert moved == [Divert(125.0)]


def test_the_distance_opens_at_the_speed_along_it() -> None:
    assert opening_m_s(fix(), fix(north_m=100.0, north_m_s=3.0)) == pytest.approx(3.0)
    assert opening_m_s(fix(north_m_s=2.0), fix(north_m=100.0, north_m_s=-3.0)) == pytest.approx(-5.0)
    assert opening_m_s(fix(), fix(north_m_s=9.0)) == 0.0, "at no distance"
