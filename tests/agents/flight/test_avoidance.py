"""Who gives way: what two platforms agree on, what one does alone, what it leaves to the other, and when it flies on."""

import pytest

from agents.flight.avoidance import (
    AGAIN_US,
    CLOSE_M,
    KNOWN_US,
    MOST_CLIMB_M,
    PATIENCE_US,
    UNMOVED_US,
    WOULD_HOLD,
    Avoidance,
    May,
)
from agents.flight.encounters import (
    ASIDE_M,
    CLEAR_M,
    IDLE_US,
    KEEP_M,
    NEAR_Z_M,
    OPENING_US,
    Divert,
    EncounterPhase,
    LeaveToPartner,
    ManoeuvreRole,
    NeitherCan,
    Over,
    Propose,
    ResumeRoute,
    Step,
    braking_m,
    climber_of,
    converge,
    flees,
    leaps,
    relation,
    run_m,
)
from agents.flight.evidence import BUDGET_US
from agents.flight.levels import LOWER_M, SEPARATION_M
from agents.flight.places import Fix
from navigation.geodesy import distance_m

METRE_DEG = 1 / 111_320.0
S = 1_000_000
HIGHER_M = 102.0
ABOVE_M = 100.0 + SEPARATION_M


def fix(altitude_m: float = 100.0, north_m: float = 0.0, *, at_us: int = 0, **moves: float) -> Fix:
    return Fix(at_us, 58.0 + north_m * METRE_DEG, 15.0, altitude_m, **moves)


OWN = fix(HIGHER_M, north_m_s=5.0)
"""Unit 0, flying north."""
OTHER = fix(100.0, 90.0, north_m_s=-5.0)
"""Unit 1, flying south towards it."""


def anything(_altitude_m: float | None) -> str | None:
    return None


def nothing(_altitude_m: float | None) -> str | None:
    return "the vehicle is in mode AUTO"


def between(floor_m: float, ceiling_m: float) -> May:
    def may(altitude_m: float | None) -> str | None:
        inside = altitude_m is None or floor_m <= altitude_m <= ceiling_m
        return None if inside else "outside the limits"

    return may


def warned(unit: str = "0", own: Fix = OWN, other: Fix = OTHER, may: May = anything, partner: str = "1") -> Avoidance:
    """A platform whose warning about `partner` has just opened."""
    found = Avoidance(unit)
    assert found.on_warned(partner, own, other, may, 0)
    return found


def climbing(own: Fix = OWN, other: Fix = OTHER) -> Avoidance:
    """Unit 0, who agreed with unit 1 that it climbs."""
    found = warned("0", own, other)
    found.on_agreed("1", own, other, anything, 0)
    return found


def holding(own: Fix = OTHER, other: Fix = OWN) -> Avoidance:
    """Unit 1, who agreed with unit 0 that unit 0 climbs."""
    found = Avoidance("1")
    refused, _ = found.on_proposal("0", "0", own, other, anything, 0, warned=True)
    assert refused is None
    return found


def alone(own: Fix, other: Fix, may: May = anything) -> list[Step]:
    """What a platform does whose partner declined."""
    return warned("0", own, other, may).on_declined("1", own, other, may, 0)


def altitudes(steps: list[Step]) -> list[float | None]:
    return [step.altitude_m for step in steps if isinstance(step, Divert)]


def role(found: Avoidance, partner: str = "1") -> ManoeuvreRole | None:
    return found.encounters[partner].role


# -- who climbs --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("own_m", "other_m", "climber"), [(103.0, 100.0, "7"), (100.0, 103.0, "3")])
def test_the_higher_one_climbs(own_m: float, other_m: float, climber: str) -> None:
    assert climber_of("7", fix(own_m), "3", fix(other_m)) == climber


@pytest.mark.parametrize(("one", "other", "climber"), [("9", "10", "9"), ("10", "9", "9"), ("b", "a", "a")])
def test_a_tie_goes_to_the_unit_that_sorts_first(one: str, other: str, climber: str) -> None:
    assert climber_of(one, fix(100.0), other, fix(100.9)) == climber
    assert climber_of(other, fix(100.9), one, fix(100.0)) == climber, "from either side"


def test_a_warning_proposes_that_the_higher_one_climbs_until_it_is_separated() -> None:
    assert Avoidance("0").on_warned("1", OWN, OTHER, anything, 0) == [Propose("1", "0", SEPARATION_M - 2.0)]
    lower = OWN._replace(altitude_m=98.0)
    assert Avoidance("0").on_warned("1", lower, OTHER, anything, 0) == [Propose("1", "1", SEPARATION_M - 2.0)]


def test_who_may_not_climb_proposes_that_the_other_does() -> None:
    steps = Avoidance("0").on_warned("1", OWN, OTHER, between(60.0, 110.0), 0)
    assert steps == [Propose("1", "1", SEPARATION_M + 2.0)]


# -- whether there is anything to avoid ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("own", "other"),
    [
        (fix(), fix(100.0, 20.0)),
        (fix(north_m_s=0.3), fix(100.0, 20.0, north_m_s=-0.3)),
        (fix(north_m_s=-5.0), fix(100.0, 40.0, north_m_s=5.0)),
        (OWN._replace(altitude_m=100.0 + NEAR_Z_M), OTHER),
        (fix(north_m_s=5.0), fix(100.0, 200.0, north_m_s=-5.0)),
    ],
    ids=["hovering side by side", "drifting", "past each other", "high above", "far away"],
)
def test_a_warning_about_one_that_does_not_come_near_begins_nothing(own: Fix, other: Fix) -> None:
    found = Avoidance("0")
    assert not converge(own, other)
    assert found.on_warned("1", own, other, anything, 0) == []
    assert found.on_moved("1", own, other, anything, S, warned=True) == []
    assert not found.encounters


def test_what_hovers_near_and_begins_to_come_is_avoided_though_the_warning_is_an_old_one() -> None:
    found = Avoidance("0")
    assert found.on_moved("1", fix(), fix(100.0, 40.0), anything, 0, warned=True) == []
    comes = fix(100.0, 38.0, north_m_s=-2.0)
    assert found.on_moved("1", fix(), comes, anything, S, warned=True) == [Propose("1", "0", SEPARATION_M)]


def test_one_on_the_ground_is_no_traffic() -> None:
    found = warned()
    assert found.on_grounded("1") == [Over("1")]
    assert not found.encounters
    assert found.on_grounded("1") == []


# -- agreed ------------------------------------------------------------------------------------------------------


def test_nobody_moves_before_the_other_has_answered() -> None:
    found = warned()
    assert found.awaits("1")
    assert found.on_moved("1", OWN, OTHER, anything, 500_000, warned=True) == []


def test_when_it_is_agreed_the_one_climbs_on_its_way_and_the_other_stops() -> None:
    found = warned()
    refused, (held,) = Avoidance("1").on_proposal("0", "0", OTHER, OWN, anything, 0, warned=True)
    (climbed,) = found.on_agreed("1", OWN, OTHER, anything, 0)
    assert refused is None
    assert isinstance(held, Divert)
    assert isinstance(climbed, Divert)
    assert (climbed.altitude_m, held.altitude_m) == (100.0 + SEPARATION_M, None)
    assert not found.awaits("1")


def test_who_stops_stops_a_braking_distance_ahead() -> None:
    """What is told to stop where it is overshoots, and flies back: to its partner that looks like going away."""
    for speed_m_s in (5.0, 10.0):
        own = OTHER._replace(north_m_s=-speed_m_s, latitude_deg=OWN.latitude_deg + 150.0 * METRE_DEG)
        _, (step,) = Avoidance("1").on_proposal("0", "0", own, OWN, anything, 0, warned=True)
        assert isinstance(step, Divert)
        assert step.place is not None
        gone_m = distance_m(own.latitude_deg, own.longitude_deg, *step.place)
        assert gone_m == pytest.approx(braking_m(own), rel=0.01)
        assert step.place[0] < own.latitude_deg, "the way it flies"


def test_who_climbs_keeps_away_from_who_holds_until_it_is_above() -> None:
    for away_m in (60.0, 90.0, 200.0):
        other = fix(100.0, away_m, north_m_s=-5.0)
        ahead_m = run_m(OWN, other, SEPARATION_M)
        rest_m = away_m - braking_m(other) - ahead_m
        assert ahead_m >= braking_m(OWN)
        assert rest_m >= KEEP_M - 0.1 or ahead_m == braking_m(OWN)


def test_who_flies_ahead_of_the_other_does_not_stop_in_its_way() -> None:
    slow = fix(100.0, 55.0, north_m_s=5.0)
    fast = fix(101.5, 0.0, north_m_s=10.0)
    assert flees(slow, fast)
    assert not flees(fast, slow)
    _, steps = Avoidance("1").on_proposal("0", "0", slow, fast, anything, 0, warned=True)
    assert steps == [ResumeRoute(lowered_to_m=100.0)], "it only stays below"
    assert run_m(fast, slow, SEPARATION_M) > run_m(fast, slow._replace(north_m_s=-5.0), SEPARATION_M)


def test_an_agreement_that_comes_twice_does_nothing_more() -> None:
    assert climbing().on_agreed("1", OWN, OTHER, anything, 0) == []
    assert Avoidance("0").on_agreed("1", OWN, OTHER, anything, 0) == []


def test_a_proposal_is_refused_by_the_rule_that_it_breaks() -> None:
    found = Avoidance("1")
    refused, steps = found.on_proposal("0", "1", OTHER, OWN, between(90.0, 110.0), 0, warned=True)
    assert (str(refused), steps) == ("outside the limits", [])
    assert found.encounters == {}
    refused, _ = found.on_proposal("0", "0", OTHER, OWN, nothing, 0, warned=True)
    assert str(refused) == "the vehicle is in mode AUTO", "holding is a promise too"


@pytest.mark.parametrize("first", ["0", "1"])
def test_proposals_that_cross_settle_on_the_one_of_the_unit_that_sorts_first(first: str) -> None:
    """Each believes itself to be the higher one."""
    of_zero, of_one = (OWN._replace(altitude_m=105.0), OTHER), (OTHER._replace(altitude_m=105.0), OWN)
    zero, one = warned("0", *of_zero), warned("1", *of_one, partner="0")
    assert (zero.encounters["1"].climber, one.encounters["0"].climber) == ("0", "1")

    def zero_hears() -> None:
        refused, steps = zero.on_proposal("1", "1", *of_zero, anything, 0, warned=True)
        assert refused is not None
        assert refused.code == "superseded"
        assert steps == []

    def one_hears() -> None:
        refused, steps = one.on_proposal("0", "0", *of_one, anything, 0, warned=True)
        assert (refused, altitudes(steps)) == (None, [None])

    for hears in (zero_hears, one_hears) if first == "0" else (one_hears, zero_hears):
        hears()
    one.on_superseded("0")
    assert altitudes(zero.on_agreed("1", *of_zero, anything, 0)) == [ABOVE_M]
    assert (role(zero), role(one, "0")) == (ManoeuvreRole.CLIMB, ManoeuvreRole.HOLD)
    assert not zero.awaits("1")
    assert not one.awaits("0")


def test_crossing_proposals_that_say_the_same_are_both_agreed_to() -> None:
    zero, one = warned(), warned("1", OTHER, OWN, partner="0")
    refused, steps = zero.on_proposal("1", "0", OWN, OTHER, anything, 0, warned=True)
    assert (refused, altitudes(steps)) == (None, [ABOVE_M])
    refused, steps = one.on_proposal("0", "0", OTHER, OWN, anything, 0, warned=True)
    assert (refused, altitudes(steps)) == (None, [None])
    assert zero.on_agreed("1", OWN, OTHER, anything, 0) == []
    assert one.on_agreed("0", OTHER, OWN, anything, 0) == []


# -- authority -----------------------------------------------------------------------------------------------------


def test_a_proposal_without_a_warning_or_evidence_of_ours_is_refused_with_a_code() -> None:
    found = Avoidance("0")
    far = fix(100.0, 20_000.0)
    for because in (None, "autopilot: denied"):
        refused, steps = found.on_proposal("1", "1", OWN, far, anything, 0, warned=False, because=because)
        assert refused is not None
        assert (refused.code, steps) == ("no-evidence", [])
    assert not found.encounters


def test_what_is_seen_here_is_evidence_though_our_warning_is_not_open_yet() -> None:
    refused, steps = Avoidance("0").on_proposal("1", "1", OWN, OTHER, anything, 0, warned=False)
    assert refused is None
    assert steps


def test_without_a_warning_of_ours_a_partner_has_one_manoeuvre_in_half_a_minute() -> None:
    found = Avoidance("0")
    codes = []
    for second in range(0, 90, 5):
        refused, _ = found.on_proposal("1", "1", OWN, OTHER, anything, second * S, warned=False)
        codes.append(None if refused is None else refused.code)
        found.encounters.clear()
    assert codes.count(None) == 3
    assert set(codes) == {None, "too-often"}
    assert BUDGET_US == 30 * S


def test_no_partner_leads_a_vehicle_far_from_its_own_altitude() -> None:
    found = climbing()
    for second in range(1, 60):
        rises = OTHER._replace(valid_us=second * S, altitude_m=100.0 + 5.0 * second, down_m_s=-5.0)
        own = OWN._replace(valid_us=second * S, altitude_m=ABOVE_M)
        found.on_moved("1", own, rises, anything, second * S, warned=True)
        altitude_m = found.encounters["1"].altitude_m if "1" in found.encounters else None
        assert altitude_m is None or altitude_m <= HIGHER_M + MOST_CLIMB_M


def test_an_altitude_that_leaps_is_not_believed() -> None:
    leapt = OTHER._replace(valid_us=S // 10, altitude_m=140.0)
    assert leaps(OTHER, leapt)
    assert not leaps(OTHER, OTHER._replace(valid_us=S, altitude_m=105.0))
    found = climbing()
    assert found.on_moved("1", OWN._replace(valid_us=S // 10), leapt, anything, S // 10, warned=True) == []
    assert found.encounters["1"].other == OTHER
    assert found.encounters["1"].altitude_m == ABOVE_M


# -- alone -------------------------------------------------------------------------------------------------------


def test_who_is_left_alone_climbs_if_it_is_the_higher_one() -> None:
    assert altitudes(alone(OWN, OTHER)) == [ABOVE_M]


def test_who_is_left_alone_well_below_descends() -> None:
    above = OTHER._replace(altitude_m=108.0)
    assert altitudes(alone(OWN, above)) == [108.0 - SEPARATION_M]


def test_who_may_not_descend_climbs_and_who_may_not_climb_descends() -> None:
    above = OTHER._replace(altitude_m=108.0)
    assert altitudes(alone(OWN, above, between(90.0, 170.0))) == [108.0 + SEPARATION_M]
    assert altitudes(alone(OWN, OTHER, between(60.0, 110.0))) == [100.0 - SEPARATION_M]


def test_who_may_do_neither_goes_aside() -> None:
    """To hold would be to stand in the other's way."""
    (step,) = alone(OWN, OTHER, between(95.0, 110.0))
    assert isinstance(step, Divert)
    assert step.place is not None
    beside = OWN._replace(latitude_deg=step.place[0], longitude_deg=step.place[1])
    assert abs(relation(beside, OTHER).p_m[1]) == pytest.approx(ASIDE_M, rel=0.02), "of its course, which is north"


def test_who_has_agreed_with_the_partner_meanwhile_is_not_left_alone() -> None:
    found = warned("1", OTHER, OWN, partner="0")
    found.on_proposal("0", "0", OTHER, OWN, anything, 0, warned=True)
    assert found.on_declined("0", OTHER, OWN, anything, 0) == []
    assert role(found, "0") is ManoeuvreRole.HOLD


def test_silence_after_an_answer_or_without_a_question_means_nothing() -> None:
    assert climbing().on_declined("1", OWN, OTHER, anything, 0) == []
    assert Avoidance("0").on_declined("1", OWN, OTHER, anything, 0) == []


def test_of_two_that_climb_alone_the_one_that_is_to_hold_stops() -> None:
    """Each was left alone; the lower one sees the other rise."""
    own, other = OWN._replace(altitude_m=100.0), OTHER._replace(altitude_m=102.0)
    found = warned("0", own, other)
    assert altitudes(found.on_declined("1", own, other, anything, 0)) == [HIGHER_M + SEPARATION_M]
    rising = other._replace(altitude_m=104.0, down_m_s=-2.0, valid_us=S)
    steps = found.on_moved("1", own._replace(altitude_m=101.0, valid_us=S), rising, anything, S, warned=True)
    assert altitudes(steps) == [None]


def test_who_climbs_stays_above_a_partner_that_rises_within_the_limits() -> None:
    found = climbing()
    own = OWN._replace(altitude_m=115.0)
    moved = found.on_moved("1", own, OTHER._replace(altitude_m=106.0), anything, S, warned=True)
    assert altitudes(moved) == [106.0 + SEPARATION_M]
    assert found.on_moved("1", own, OTHER._replace(altitude_m=112.0), between(60.0, 132.0), 2 * S, warned=True) == []


# -- what is not flown -------------------------------------------------------------------------------------------


def not_flown(found: Avoidance, may: May = anything, *, own: Fix = OWN, **how: bool) -> list[Step]:
    return found.on_not_flown("autopilot: failed", own, may, S, **{"refused": False, "overtaken": False} | how)


def test_a_climb_that_the_autopilot_refuses_is_tried_as_a_descent_at_once() -> None:
    found = climbing()
    assert altitudes(not_flown(found, refused=True)) == [100.0 - SEPARATION_M]
    assert role(found) is ManoeuvreRole.DESCEND


def test_what_is_refused_every_way_is_left_to_the_partner_and_nothing_is_ordered_further() -> None:
    found = climbing()
    steps = [step for _ in range(3) for step in not_flown(found, refused=True)]
    assert [step for step in steps if isinstance(step, LeaveToPartner)] == [LeaveToPartner("1", "autopilot: failed")]
    assert found.encounters["1"].phase is EncounterPhase.LEFT
    for second in range(2, 12):
        own, other = OWN._replace(valid_us=second * S), OTHER._replace(valid_us=second * S)
        assert found.on_moved("1", own, other, anything, second * S, warned=True) == []


def test_below_the_floor_it_does_not_descend_but_leaves_it_to_the_partner_after_going_aside() -> None:
    found = climbing()
    (step,) = not_flown(found, between(90.0, 170.0), refused=True)
    assert isinstance(step, Divert)
    assert role(found) is ManoeuvreRole.ASIDE
    assert [type(step) for step in not_flown(found, between(90.0, 170.0), refused=True)] == [
        LeaveToPartner,
        ResumeRoute,
    ]


def test_what_another_ground_station_overwrites_is_left_to_the_partner_at_once_and_not_said_again() -> None:
    found = climbing()
    assert not_flown(found, overtaken=True) == [LeaveToPartner("1", "autopilot: failed")]
    assert found.encounters["1"].phase is EncounterPhase.LEFT
    assert found.on_moved("1", OWN, OTHER, anything, 2 * S, warned=True) == []


def test_what_is_not_seen_is_left_to_the_partner_and_stays_ordered() -> None:
    found = climbing()
    assert not_flown(found) == [LeaveToPartner("1", "autopilot: failed")]
    assert role(found) is ManoeuvreRole.CLIMB
    assert not_flown(found) == [], "told once"


def test_who_cannot_be_commanded_leaves_it_to_the_partner_when_the_warning_opens() -> None:
    assert Avoidance("0").on_warned("1", OWN, OTHER, nothing, 0) == [LeaveToPartner("1", "the vehicle is in mode AUTO")]


def test_who_holds_takes_all_of_it_when_the_partner_leaves_it() -> None:
    found = holding()
    refused, steps = found.on_proposal("0", "1", OTHER, OWN, anything, S, warned=True, because="autopilot: failed")
    assert refused is None
    assert altitudes(steps) == [HIGHER_M + SEPARATION_M]
    assert role(found, "0") is ManoeuvreRole.CLIMB


def test_who_climbs_already_goes_on_but_stops_before_one_that_does_not_hold() -> None:
    far = OTHER._replace(latitude_deg=58.0 + 140.0 * METRE_DEG, north_m_s=-10.0)
    found = climbing(OWN, far)
    run = found.encounters["1"].place
    refused, (step,) = found.on_proposal("1", "0", OWN, far, anything, S, warned=True, because="taken over")
    assert refused is None
    assert isinstance(step, Divert)
    assert step.altitude_m == ABOVE_M
    assert run is not None
    assert step.place is not None
    assert step.place[0] < run[0]


def test_who_cannot_take_it_says_so_and_both_raise_the_alarm_and_nobody_is_left_holding() -> None:
    found = holding()
    refused, steps = found.on_proposal("0", "1", OTHER, OWN, nothing, S, warned=True, because="autopilot: denied")
    assert refused is not None
    assert refused.code == "cannot"
    assert steps == [ResumeRoute(), NeitherCan("0", ("the vehicle is in mode AUTO", "autopilot: denied"))]
    left = Avoidance("0")
    left.on_warned("1", OWN, OTHER, nothing, 0)
    both = ("the vehicle is in mode AUTO", "no answer")
    assert left.on_left_refused("1", "no answer", OWN, OTHER, nothing, S) == [NeitherCan("1", both)]


def test_who_left_it_and_is_left_all_of_it_in_turn_says_that_neither_can_until_it_is_flown_after_all() -> None:
    found = climbing()
    not_flown(found)
    refused, steps = found.on_proposal("1", "0", OWN, OTHER, anything, S, warned=True, because="not seen")
    assert refused is not None
    assert refused.code == "cannot"
    assert steps == [NeitherCan("1", ("autopilot: failed", "not seen"))]
    found.on_flown()
    refused, _ = found.on_proposal("1", "0", OWN, OTHER, anything, S, warned=True, because="not seen")
    assert refused is None
    assert [type(step) for step in not_flown(found)] == [LeaveToPartner], "it may be left again"


def test_who_left_it_goes_aside_if_the_partner_cannot_take_it() -> None:
    found = climbing()
    found.encounters["1"].failed[ManoeuvreRole.ASIDE] = "not tried"
    not_flown(found, refused=True)
    not_flown(found, refused=True)
    del found.encounters["1"].failed[ManoeuvreRole.ASIDE]
    (step,) = found.on_left_refused("1", "mode AUTO", OWN, OTHER, anything, S)
    assert isinstance(step, Divert)
    assert role(found) is ManoeuvreRole.ASIDE


def test_who_holds_for_one_that_does_not_move_takes_all_of_it() -> None:
    found = holding()
    for second in range(UNMOVED_US // S + 1):
        own, other = OTHER._replace(valid_us=second * S), OWN._replace(valid_us=second * S)
        steps = found.on_moved("0", own, other, anything, second * S, warned=True)
    assert altitudes(steps) == [HIGHER_M + SEPARATION_M]


def test_who_holds_sees_that_the_partner_climbs_though_it_rises_itself() -> None:
    """For another, say: so the gap does not grow."""
    found = holding()
    for second in range(UNMOVED_US // S + 2):
        up_m = 2.5 * second
        own = OTHER._replace(valid_us=second * S, altitude_m=OTHER.altitude_m + up_m)
        other = OWN._replace(valid_us=second * S, altitude_m=OWN.altitude_m + up_m, down_m_s=-2.5)
        found.on_moved("0", own, other, anything, second * S, warned=True)
    assert role(found, "0") is ManoeuvreRole.HOLD


@pytest.mark.parametrize(
    ("lower_m", "makes_room"), [(LOWER_M, ManoeuvreRole.DESCEND), (LOWER_M - 0.5, ManoeuvreRole.CLIMB)]
)
def test_who_would_hold_but_not_climb_says_so_and_the_other_makes_room_the_shorter_way(
    lower_m: float, makes_room: ManoeuvreRole
) -> None:
    fenced, own = Avoidance("0"), OTHER._replace(altitude_m=HIGHER_M - lower_m)
    refused, _ = fenced.on_proposal("1", "0", OWN, own, between(60.0, 110.0), 0, warned=True)
    assert refused is not None
    assert refused.code == WOULD_HOLD
    found = warned("1", own, OWN, partner="0")
    assert found.on_counter("0", WOULD_HOLD, own, OWN, anything, 0) == [Propose("0", "1", SEPARATION_M + lower_m)]
    refused, _ = fenced.on_proposal("1", "1", OWN, own, between(60.0, 110.0), 0, warned=True)
    assert refused is None
    found.on_agreed("0", own, OWN, anything, 0)
    assert (role(fenced), role(found, "0")) == (ManoeuvreRole.HOLD, makes_room)


def test_who_is_much_lower_climbs_where_there_is_no_room_below() -> None:
    found = warned("1", OTHER, OWN, may=between(90.0, 130.0), partner="0")
    assert found.on_counter("0", WOULD_HOLD, OTHER, OWN, between(90.0, 130.0), 0)
    found.on_agreed("0", OTHER, OWN, between(90.0, 130.0), 0)
    assert role(found, "0") is ManoeuvreRole.CLIMB


def test_of_two_that_may_not_climb_one_descends() -> None:
    level = OTHER._replace(altitude_m=HIGHER_M)
    found = warned("1", level, OWN, partner="0")
    steps = found.on_counter("0", WOULD_HOLD, level, OWN, between(60.0, 110.0), 0)
    assert altitudes(steps) == [HIGHER_M - SEPARATION_M]


# -- holding and flying on ---------------------------------------------------------------------------------------


def test_a_warning_that_flickers_changes_nothing_of_what_is_done() -> None:
    found = climbing()
    for step in range(20):
        now_us = step * S // 5
        assert found.on_moved("1", OWN, OTHER, anything, now_us, warned=step % 2 == 0) == []
    assert role(found) is ManoeuvreRole.CLIMB


def test_what_brakes_do_ends_nothing() -> None:
    """Both stop, overshoot and drift back at 3 m/s, more than 60 m apart: they still want to go where they wanted."""
    climber, holder = climbing(), holding()
    for tenth in range(1, 45):
        now_us = tenth * S // 10
        one = OWN._replace(valid_us=now_us, north_m_s=-3.0, altitude_m=103.0 + tenth / 10)
        other = OTHER._replace(valid_us=now_us, north_m_s=3.0)
        assert climber.on_moved("1", one, other, anything, now_us, warned=False) == []
        assert holder.on_moved("0", other, one, anything, now_us, warned=False) == []


def test_what_was_superseded_and_did_not_come_is_proposed_again_while_they_converge() -> None:
    found = warned()
    found.on_superseded("1")
    assert found.on_moved("1", OWN, OTHER, anything, AGAIN_US - 1, warned=True) == []
    assert found.on_moved("1", OWN, OTHER, anything, AGAIN_US, warned=True) == [Propose("1", "0", SEPARATION_M - 2.0)]
    found.on_superseded("1")
    gone = OTHER._replace(north_m_s=6.0)
    assert found.on_moved("1", OWN, gone, anything, 3 * AGAIN_US, warned=True) == [Over("1")]


def test_who_holds_flies_on_when_they_are_apart_and_stays_below_until_the_other_is_away() -> None:
    found = holding()
    near = OWN._replace(altitude_m=100.0 + CLEAR_M - 0.1, valid_us=S)
    assert found.on_moved("0", OTHER, near, anything, S, warned=True) == []
    above = near._replace(altitude_m=100.0 + CLEAR_M)
    assert found.on_moved("0", OTHER, above, anything, 2 * S, warned=True) == [ResumeRoute(lowered_to_m=100.0)]
    assert found.encounters["0"].phase is EncounterPhase.PASSING


def test_who_holds_flies_on_as_soon_as_the_climb_will_do() -> None:
    found = holding()
    own, far = OTHER._replace(valid_us=4 * S), fix(112.0, -40.0, at_us=4 * S, north_m_s=5.0)
    assert found.on_moved("0", own, far._replace(down_m_s=-0.8), anything, 4 * S, warned=True) == []
    steps = found.on_moved("0", own, far._replace(down_m_s=-2.5), anything, 4 * S, warned=True)
    assert steps == [ResumeRoute(lowered_to_m=100.0)]


def test_who_stands_flies_on_earlier_than_who_has_its_speed_still_and_stops_again_only_if_the_climb_ends() -> None:
    """Ten metres before it is near, 15.5 m apart, the other climbing at 2.5 m/s: it takes 1.5 s to gain 5 m/s."""
    near = fix(115.5, 52.5, at_us=4 * S, north_m_s=5.0, down_m_s=-2.5)
    moving = holding()
    own = OTHER._replace(valid_us=4 * S)
    assert moving.on_moved("0", own, near, anything, 4 * S, warned=True) == []
    standing, stands = holding(), own._replace(north_m_s=0.0)
    assert standing.on_moved("0", stands, near, anything, 4 * S, warned=True) == [ResumeRoute(lowered_to_m=100.0)]
    low = near._replace(altitude_m=114.0)
    assert standing.on_moved("0", stands, low._replace(down_m_s=-4.5), anything, 5 * S, warned=True) == []
    assert altitudes(standing.on_moved("0", stands, low._replace(down_m_s=0.0), anything, 6 * S, warned=True)) == [None]


def test_who_climbed_flies_on_above_the_other_and_comes_down_when_it_is_away() -> None:
    found = climbing()
    up = OWN._replace(altitude_m=121.0)
    assert found.on_moved("1", up, OTHER, anything, S, warned=False) == [ResumeRoute(raised_to_m=ABOVE_M)]
    for north_m in (60.0, 20.0, 0.0):
        passing = OTHER._replace(latitude_deg=58.0 + north_m * METRE_DEG, valid_us=2 * S)
        assert found.on_moved("1", up, passing, anything, 2 * S, warned=False) == []
    past = OTHER._replace(latitude_deg=58.0 - 60.0 * METRE_DEG, valid_us=9 * S)
    assert found.on_moved("1", up, past, anything, 9 * S, warned=False) == []
    assert found.on_moved("1", up, past, anything, 9 * S + OPENING_US, warned=False) == [ResumeRoute(), Over("1")]
    assert found.encounters == {}


def test_between_where_they_fly_on_and_where_they_stop_again_lies_a_gap() -> None:
    found = climbing()
    up = OWN._replace(altitude_m=121.0)
    found.on_moved("1", up, OTHER, anything, S, warned=False)
    for gap_m in (CLEAR_M - 0.1, CLEAR_M + 0.1, CLOSE_M + 0.1, CLEAR_M - 0.1):
        low = OWN._replace(altitude_m=100.0 + gap_m)
        assert found.on_moved("1", low, OTHER, anything, 2 * S, warned=True) == []
    low = OWN._replace(altitude_m=100.0 + CLOSE_M - 0.1)
    assert altitudes(found.on_moved("1", low, OTHER, anything, 3 * S, warned=True)) == [ABOVE_M]


def test_who_descended_flies_on_below_the_other() -> None:
    found = warned("0", OWN, above := OTHER._replace(altitude_m=108.0))
    found.on_declined("1", OWN, above, anything, 0)
    moved = found.on_moved("1", OWN._replace(altitude_m=84.0), above, anything, S, warned=False)
    assert moved == [ResumeRoute(None, 108.0 - SEPARATION_M)]


def test_two_that_stand_beside_each_other_afterwards_need_no_more_room() -> None:
    found = climbing()
    up = OWN._replace(altitude_m=121.0, north_m_s=0.0)
    found.on_moved("1", up, OTHER, anything, S, warned=False)
    stands = fix(100.0, 35.0)
    assert found.on_moved("1", up, stands, anything, 2 * S, warned=False) == []
    assert found.on_moved("1", up, stands, anything, 2 * S + IDLE_US, warned=False) == [ResumeRoute(), Over("1")]


def test_nobody_waits_for_ever_for_a_climber_that_climbs_hardly() -> None:
    found = holding()
    over_us = None
    for tenth in range(10 * (PATIENCE_US // S) + 2):
        now_us = tenth * S // 10
        hardly = OWN._replace(valid_us=now_us, altitude_m=HIGHER_M + min(9.0, tenth / 10))
        steps = found.on_moved("0", OTHER._replace(valid_us=now_us), hardly, anything, now_us, warned=True)
        over_us = now_us if Over("0") in steps else over_us
    assert over_us == PATIENCE_US


def test_a_partner_that_is_lost_is_taken_to_stand_where_it_was_and_all_of_it_is_ours() -> None:
    found = holding()
    later = KNOWN_US + S
    own = OTHER._replace(valid_us=later)
    steps = found.on_moved("0", own, OWN, anything, later, warned=False)
    assert altitudes(steps) == [HIGHER_M - SEPARATION_M], "it was to climb: go down"
    found.on_gone("0")
    low = own._replace(altitude_m=HIGHER_M - SEPARATION_M, valid_us=later + S)
    assert found.on_moved("0", low, None, anything, later + S, warned=False) == [
        ResumeRoute(None, HIGHER_M - SEPARATION_M)
    ]


def test_of_several_encounters_the_highest_climb_is_flown_and_the_last_to_end_lets_go() -> None:
    found = climbing()
    third = OTHER._replace(altitude_m=110.0)
    _, steps = found.on_proposal("2", "0", OWN, third, anything, 0, warned=True)
    assert altitudes(steps) == [110.0 + SEPARATION_M]
    assert altitudes(found.on_grounded("2")) == [ABOVE_M]
    assert found.on_grounded("1") == [ResumeRoute(), Over("1")]


def test_who_climbs_for_one_does_not_descend_for_another() -> None:
    found = climbing()
    above = OTHER._replace(altitude_m=112.0)
    found.on_warned("2", OWN, above, anything, 0)
    found.on_declined("2", OWN, above, anything, 0)
    assert role(found, "2") is ManoeuvreRole.CLIMB


def test_the_distance_opens_at_the_speed_along_it() -> None:
    assert relation(fix(), fix(100.0, 100.0, north_m_s=3.0)).opening_m_s == pytest.approx(3.0)
    assert relation(fix(north_m_s=2.0), fix(100.0, 100.0, north_m_s=-3.0)).opening_m_s == pytest.approx(-5.0)
    assert relation(fix(), fix(north_m_s=9.0)).opening_m_s == 0.0, "at no distance"
