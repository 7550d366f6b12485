"""Members with valid keys that hide, lie, withhold, flood or pursue, and manoeuvres whose reason is gone meanwhile."""

from collections.abc import Callable
from typing import Any

import pytest

from dyknow.agents.capabilities.flight.options import AvoidanceOptions
from dyknow.agents.capabilities.separation.giving_way import GivingWay
from dyknow.agents.capabilities.separation.neighbourhood import Neighbourhood
from dyknow.agents.capabilities.separation.neighbours import CREDIBLE_US, MOST, Neighbours, contradiction, tube_of
from dyknow.agents.capabilities.separation.often import PURSUES, REPORTS, Often
from dyknow.agents.capabilities.separation.records import legs_of, legs_text
from dyknow.agents.capabilities.separation.situation import Fly, GoOn, ManoeuvreState, Propose
from dyknow.agents.monitoring.alarm_log import AlarmLog
from dyknow.agents.options import Chosen
from dyknow.agents.places import Fix
from dyknow.federation.messages.contents import Avoid, MonitorProximity
from dyknow.navigation.intents.intent import IntendedPlace, Intent, IntentEnding, IntentSource, RightOfWay
from dyknow.navigation.intents.path import STEPS, FlatMotion, FlatOrigin, FlatPlace
from tests.agents.capabilities.separation.meetings import meeting, notes, orders
from tests.agents.capabilities.separation.test_hostile_members import far_member
from tests.agents.capabilities.separation.vehicles import ORIGIN, Airspace, Flyer
from tests.box import Box, Vehicle

S = 1_000_000


def part_of(wire: Box, unit: str) -> Neighbourhood:
    return wire.platform(unit).part(Neighbourhood)


def head_on_with(wire: Box, lie: Callable[[Intent], Intent | None]) -> None:
    """Platform 1 flies at platform 0, may not be commanded, and publishes `lie` of its intent (None: nothing)."""
    wire.join("0", Vehicle(east_m=-100.0, east_m_s=4.0, altitude_m=102.0), control=True)
    wire.join(
        "1", Vehicle(east_m=100.0, east_m_s=-4.0), control=True, options=Chosen(AvoidanceOptions(avoidance=False))
    )
    wire.centre()
    part = part_of(wire, "1")
    truth = part.intent

    def told() -> Intent | None:
        intent = truth()
        return None if intent is None else lie(intent)

    part.intent = told  # type: ignore[method-assign]
    wire.run(1.0)
    wire.question("cc", "0", MonitorProximity())
    wire.run(18.0)


LIES: dict[str, Callable[[Intent], Intent | None]] = {
    "withheld": lambda _: None,
    "elsewhere": lambda intent: intent._replace(latitude_deg=58.02),
    "higher": lambda intent: intent._replace(altitude_m=160.0),
    "on the ground": lambda intent: intent._replace(source=IntentSource.GROUND),
}


@pytest.mark.parametrize("lie", LIES)
def test_one_that_hides_behind_its_intent_is_taken_by_its_positions(wire: Box, lie: str) -> None:
    head_on_with(wire, LIES[lie])
    assert orders(wire, "0"), "it makes room"
    words = [line for line in notes(wire, "0") if "contradict its intent" in line]
    assert len(words) == (lie != "withheld")


def test_one_without_a_word_of_its_autopilot_is_no_traffic_on_the_ground_while_it_flies(wire: Box) -> None:
    wire.join("0", Vehicle(east_m=-100.0, east_m_s=4.0, altitude_m=102.0), control=True)
    wire.join("1", Vehicle(east_m=100.0, east_m_s=-4.0, says_status=False), control=True)
    wire.centre()
    wire.run(1.0)
    wire.question("cc", "0", MonitorProximity())
    wire.run(18.0)
    assert orders(wire, "0")


def test_an_intent_is_believed_again_once_positions_agree_with_it() -> None:
    others = Neighbours()
    there = IntendedPlace(58.0, 15.0, 60.0)
    for half in range(40):
        at_us = half * S // 2
        north = 0.02 if half < 8 else 0.0
        others.take("1", _intent(at_us, there.latitude_deg + north), at_us)
        others.see("1", Fix(at_us, *there, 0.0, 0.0, 0.0), at_us)
        if half == 7:
            assert not others.by_unit["1"].has_intent
            assert others.by_unit["1"].rank(at_us) is RightOfWay.CANNOT
    assert others.by_unit["1"].has_intent
    assert CREDIBLE_US < 20 * S


def test_one_that_flies_faster_than_it_claims_is_looked_at_from_as_far_as_it_comes() -> None:
    others = Neighbours()
    for unit, source in (("1", IntentSource.STRAIGHT), ("2", IntentSource.ROUTE)):
        far = _intent(0, 58.0 + 700.0 / 111_320.0)
        others.take(unit, far._replace(source=source, north_m_s=-55.0, ending=IntentEnding.OPEN, speed_m_s=0.5), 0)
    assert set(others.near(ORIGIN, Fix(0, 58.0, 15.0, 60.0), 5.0, 0, STEPS).units) == {"1", "2"}


def test_of_too_many_those_on_the_ground_are_left_out_first() -> None:
    others = Neighbours()
    others.take("in the air", _intent(0, 58.0), 0)
    for unit in range(MOST + 5):
        others.take(str(unit), _intent(unit, 58.0)._replace(source=IntentSource.GROUND), unit)
    assert "in the air" in others.by_unit
    others.take("in the air", _intent(S, 58.0), S)
    assert len(others.by_unit) == MOST


def test_one_outlier_of_a_position_contradicts_nothing() -> None:
    others = Neighbours()
    others.take("1", _intent(0, 58.0), 0)
    assert others.see("1", Fix(0, 58.1, 15.0, 60.0), 0) is None
    others.see("1", Fix(S // 2, 58.0, 15.0, 60.0), S // 2)
    assert others.by_unit["1"].has_intent
    assert "contradiction" not in others.left_out


def test_positions_of_before_and_of_manoeuvring_contradict_nothing() -> None:
    intent = _intent(10 * S, 58.0)._replace(north_m_s=10.0, speed_m_s=10.0)
    behind = Fix(8 * S, 58.0 - 20.0 / 111_320.0, 15.0, 57.0, 10.0)
    assert contradiction(intent, behind) is None
    parked = intent._replace(source=IntentSource.GROUND)
    assert contradiction(parked, Fix(10 * S, 58.0, 15.0, 60.0, 0.3, 0.2, 0.5)) is None


def _intent(at_us: int, latitude_deg: float) -> Intent:
    return Intent(at_us, latitude_deg, 15.0, 60.0, 0.0, 0.0, 0.0, IntentSource.HOVER, RightOfWay.NAMED)


# -- acts ------------------------------------------------------------------------------------------------------


def test_a_flood_of_proposals_is_answered_and_reported_in_bounds(wire: Box) -> None:
    far_member(wire)
    before = len(notes(wire, "0")), len(wire.acts("0", "cc"))
    for because in (None, "denied"):
        for _ in range(40):
            wire.question("1", "0", Avoid(units=("0", "1"), because=because, legs="58.0000000,15.0000000,100.0"))
            wire.run(0.02)
    assert len(notes(wire, "0")) - before[0] <= 2 * REPORTS
    assert len(wire.acts("0", "cc")) - before[1] <= 2 * REPORTS + 4
    assert wire.platform("0").part(GivingWay).refused["no-evidence"] > 10, "they are counted all the same"


def test_proposals_do_not_keep_one_heard_whose_intents_are_silent(wire: Box) -> None:
    far_member(wire, north_m=200.0)
    part_of(wire, "1").intent = lambda: None  # type: ignore[method-assign]
    wire.run(0.7)
    known = part_of(wire, "0").others.by_unit["1"]
    heard_us = known.heard_us
    wire.asked("1", "0", Avoid(units=("0", "1"), legs="58.0050000,15.0000000,100.0"))
    assert known.intent.source is IntentSource.MANOEUVRE
    assert known.heard_us == heard_us


def test_an_intent_of_long_ago_costs_as_much_as_one_of_half_an_hour() -> None:
    tube = tube_of(_intent(0, 58.0), ORIGIN, 1_700_000_000 * S, STEPS)
    assert tube.shape == (5, STEPS)


def test_one_that_is_taken_by_its_positions_does_not_propose_itself_away(wire: Box) -> None:
    head_on_with(wire, LIES["withheld"])
    known = part_of(wire, "0").others.by_unit["1"]
    assert not known.has_intent
    wire.asked("1", "0", Avoid(units=("0", "1"), legs="58.0200000,15.0000000,100.0"))
    known = part_of(wire, "0").others.by_unit["1"]
    assert known.intent.source is IntentSource.STRAIGHT
    assert known.intent.ending is IntentEnding.OPEN


# -- pursuit ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rank", [RightOfWay.CANNOT, RightOfWay.URGENT, RightOfWay.NAMED])
@pytest.mark.parametrize("pulses", [False, True])
def test_one_that_pursues_causes_few_orders_and_none_out_of_limits(rank: RightOfWay, pulses: bool) -> None:
    hunted = Flyer("1", FlatMotion(0.0, 0.0, 60.0, 5.0, 0.0, 0.0), FlatPlace(400.0, 0.0, 60.0))
    hunter = Flyer("0", FlatMotion(150.0, 0.0, 60.0, 0.0, 0.0, 0.0), FlatPlace(150.0, 0.0, 60.0), cannot="its pilot")
    space = Airspace([hunted, hunter])

    def pursues(at_us: int) -> Intent:
        motion = hunted.motion
        is_off = pulses and at_us // (3 * S) % 2
        at = ORIGIN.degrees(motion.north_m + (80.0 if is_off else 60.0), motion.east_m + (60.0 if is_off else 0.0))
        leg = IntendedPlace(*ORIGIN.degrees(motion.north_m - 100.0, motion.east_m), motion.altitude_m)
        return Intent(
            at_us, *at, motion.altitude_m, 0.0 if is_off else -8.0, 0.0, 0.0, IntentSource.PILOT, rank,
            () if is_off else (leg,), IntentEnding.HOVER, 10.0,
        )  # fmt: skip

    hunter.intent = pursues  # type: ignore[method-assign]
    while space.now_s < 120.0:
        space._step()
        assert 10.0 <= hunted.motion.altitude_m <= 125.0
    commanded = sum(isinstance(step, Fly | GoOn) for _, step in hunted.steps)
    assert 4 <= commanded <= 60, "at most one in two seconds"


def test_one_for_which_room_is_made_again_and_again_is_reported(wire: Box) -> None:
    far_member(wire)
    part = wire.platform("0").part(GivingWay)
    for at in range(2 * PURSUES - 1):
        part._count_pursuit("1", wire.now_us + at * S)
        part._count_pursuit("2", wire.now_us + at * 20 * S)
    wire.settle("0")
    wire.run(0.5)
    told = [line for line in notes(wire, "0") if "within a minute" in line]
    assert told == [f"0 has made room for 1 {PURSUES} times within a minute: it may be following"]


def test_what_is_counted_is_bounded() -> None:
    often = Often(2, S)
    assert [often.allows("1", at) for at in (0, 1, 2, S + 1, S + 2, S + 3)] == [True, True, False, True, True, False]
    for unit in range(1000):
        often.count(str(unit), 5 * S)
    assert len(often._at_us) <= 256


# -- manoeuvres whose reason is gone ---------------------------------------------------------------------------


def test_a_proposal_that_is_dropped_leaves_the_manoeuvre_that_is_flown() -> None:
    """A third one crosses what is flown, and is gone before that was agreed: the vehicle flies on afterwards."""
    one = Flyer("1", FlatMotion(100.0, 0.0, 60.0, -5.0, 0.0, 0.0), FlatPlace(-100.0, 0.0, 60.0))
    zero = Flyer("0", FlatMotion(-100.0, 0.0, 60.0, 5.0, 0.0, 0.0), FlatPlace(100.0, 0.0, 60.0))
    space = Airspace([zero, one])
    while one.flown is None:
        space._step()
    space.run(space.now_s + 1.5)
    now_us = round(space.now_s * 1e6)
    logic = one.logic
    assert logic.manoeuvre is not None
    north_m, east_m, low_m, high_m, _ = logic.flown(one.situation(now_us))[:, 20]
    height_m = (low_m + high_m) / 2.0
    start = ORIGIN.degrees(north_m, east_m + 4.0 * 10.0 + 15.0)
    leg = IntendedPlace(*ORIGIN.degrees(north_m, east_m - 60.0), height_m)
    one.others.take(
        "2", Intent(now_us, *start, height_m, 0.0, -4.0, 0.0, IntentSource.PILOT, RightOfWay.CANNOT, (leg,), speed_m_s=4.0), now_us
    )  # fmt: skip
    proposed = logic.look(one.situation(now_us))
    assert any(isinstance(step, Propose) and step.unit == "2" for step in proposed), proposed
    assert logic.manoeuvre.state is ManoeuvreState.PROPOSED
    one.others.forget("2")
    logic.look(one.situation(now_us + 100_000))
    assert logic.manoeuvre is not None
    assert logic.manoeuvre.state is ManoeuvreState.FLOWN, "that before it"
    space.run(120.0)
    assert any(isinstance(step, GoOn) for _, step in one.steps)
    assert len(space.arrived_s) == 2


@pytest.mark.parametrize("what", ["airborne", "late"])
def test_a_manoeuvre_ends_also_where_its_reason_is_gone_while_nothing_could_be_commanded(wire: Box, what: str) -> None:
    meeting(wire)
    while not orders(wire, "1"):
        wire.run(0.1)
    wire.run(1.0)
    member = wire.vehicle("1")
    if what == "late":
        wire.report_us = 3 * S
        wire.run(6.0)
    else:
        member.airborne = False
        wire.run(1.0)
    wire.kill("0")
    wire.run(4.0)
    part_of(wire, "1").others.forget("0")
    wire.run(1.0)
    wire.report_us = 0
    member.airborne = True
    wire.run(10.0)
    assert wire.platform("1").part(GivingWay)._pilot.diversion is None
    intent = part_of(wire, "1").intent()
    assert intent is not None
    assert intent.source is not IntentSource.MANOEUVRE
    assert "1 flies on" in "\n".join(notes(wire, "1"))


def test_the_alarm_that_neither_can_closes_on_the_ground_and_opens_in_the_next_flight(wire: Box) -> None:
    meeting(wire, zero={"control": False}, one={"control": False})
    wire.run(14.0)

    def events() -> list[Any]:
        return [e.event for e in wire.platform("0").part(AlarmLog).events if e.monitor == "neither-can-avoid"]

    assert events() == ["opened"]
    wire.vehicle("0").armed = False
    wire.run(1.0)
    assert events() == ["opened", "closed"]
    wire.vehicle("0").armed = True
    wire.run(2.0)
    assert events() == ["opened", "closed", "opened"]


# -- places ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("longitude_deg", [179.9999, -179.9999])
def test_a_manoeuvre_over_the_antimeridian_has_places_that_others_read(longitude_deg: float) -> None:
    origin = FlatOrigin.at(10.0, longitude_deg)
    for east_m in (-100.0, 100.0):
        place = IntendedPlace(*origin.degrees(50.0, east_m), 60.0)
        assert legs_of(legs_text((place,)))
        assert origin.metres(*place[:2]) == pytest.approx((50.0, east_m), abs=0.01)
