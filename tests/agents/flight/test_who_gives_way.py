"""Who gives way, and each rule of commanding aircraft in which it refuses."""

import pytest

from agents.flight.avoidance import Avoidance, Divert, ManoeuvreRole, Propose, ResumeRoute, climber_of
from agents.flight.pilot import Pilot
from agents.flight.places import Fix, FlightLimits, FlightPlan, Waypoint
from dyknow.model.errors import Refused
from navigation.vehicle import GoToOrder, HoldOrder, HomeReport, StatusReport

S = 1_000_000


def fix(altitude_m, east_m=0.0, *, at_us=0, east_m_s=0.0, down_m_s=0.0):
    return Fix(at_us, 0.0, east_m / 111_319.49, altitude_m, 0.0, east_m_s, down_m_s)


def may(_altitude_m):
    return None


def ceiling(highest_m):
    return lambda altitude_m: None if altitude_m is None or altitude_m <= highest_m else "above the ceiling"


def agreed(unit="0", climber="0"):
    """An encounter of `unit` with the other of 0 and 1, both at 50 m and 80 m apart, that was agreed on."""
    other = "1" if unit == "0" else "0"
    avoidance = Avoidance(unit)
    reason, steps = avoidance.on_proposal(other, climber, fix(50.0), fix(50.0, 80.0), may, 0)
    assert reason is None
    return avoidance, other, steps


def test_the_higher_one_climbs_and_a_tie_goes_to_the_unit_that_sorts_first():
    assert climber_of("0", fix(50.0), "1", fix(52.0)) == "1"
    assert climber_of("0", fix(52.0), "1", fix(50.0)) == "0"
    assert climber_of("10", fix(50.0), "9", fix(50.5)) == "9"


def test_a_warning_proposes_and_the_climb_leaves_25_m_between_them():
    (proposal,) = Avoidance("0").on_warning("1", fix(52.0), fix(50.0, 80.0), may, 0)
    assert proposal == Propose("1", "0", 23.0)


def test_one_that_cannot_climb_proposes_that_the_other_does():
    (proposal,) = Avoidance("0").on_warning("1", fix(110.0), fix(100.0, 80.0), ceiling(115.0), 0)
    assert isinstance(proposal, Propose)
    assert proposal.climber == "1"


def test_a_proposal_to_climb_above_the_ceiling_is_refused_with_the_rule():
    avoidance = Avoidance("0")
    refused, steps = avoidance.on_proposal("1", "0", fix(100.0), fix(100.0, 80.0), ceiling(120.0), 0)
    assert (str(refused), steps) == ("above the ceiling", [])
    assert not avoidance.encounters


def test_proposals_that_cross_settle_on_that_of_the_unit_that_sorts_first():
    first, second = Avoidance("0"), Avoidance("1")
    first.on_warning("1", fix(50.0), fix(50.9, 80.0), may, 0)
    second.on_warning("0", fix(52.5), fix(50.0, 80.0), may, 0)
    reason, _ = first.on_proposal("1", "1", fix(50.0), fix(50.9, 80.0), may, 0)
    assert reason is not None
    assert reason.code == "superseded"
    assert second.on_proposal("0", "0", fix(52.5), fix(50.0, 80.0), may, 0) == (None, [Divert(None)])


def test_a_partner_that_declines_leaves_the_whole_manoeuvre_to_us():
    avoidance = Avoidance("0")
    avoidance.on_warning("1", fix(50.0), fix(50.0, 80.0), may, 0)
    assert avoidance.on_declined("1", fix(50.0), fix(50.0, 70.0), may) == [Divert(75.0)]
    below = Avoidance("0")
    below.on_warning("1", fix(90.0), fix(100.0, 80.0), may, 0)
    assert below.on_declined("1", fix(90.0), fix(100.0, 70.0), may) == [Divert(75.0)]


def test_who_can_neither_climb_nor_sink_holds():
    avoidance = Avoidance("0")
    avoidance.on_warning("1", fix(50.0), fix(50.0, 80.0), may, 0)
    only_hold = ceiling(-1.0)
    assert avoidance.on_declined("1", fix(50.0), fix(50.0, 70.0), only_hold) == [Divert(None)]


def test_the_one_that_holds_stays_while_the_warning_flickers_and_flies_on_when_they_are_apart():
    avoidance, other, steps = agreed("1", "0")
    assert steps == [Divert(None)]
    for at_us, warned in ((S, True), (2 * S, False), (3 * S, True), (4 * S, False)):
        assert avoidance.on_moved(other, fix(50.0), fix(55.0, 70.0), may, at_us, warned=warned) == []
    assert avoidance.on_moved(other, fix(50.0), fix(71.0, 70.0), may, 5 * S, warned=False) == [ResumeRoute()]
    assert not avoidance.encounters


def test_the_climber_flies_on_above_and_comes_down_when_the_other_is_away():
    avoidance, other, steps = agreed("0", "0")
    assert steps == [Divert(75.0)]
    assert avoidance.on_moved(other, fix(60.0), fix(50.0, 70.0), may, S, warned=False) == []
    assert avoidance.on_moved(other, fix(74.0), fix(50.0, 70.0), may, 8 * S, warned=False) == [ResumeRoute(75.0)]
    away = fix(50.0, 90.0, east_m_s=5.0)
    assert avoidance.on_moved(other, fix(75.0), away, may, 20 * S, warned=False) == []
    assert avoidance.on_moved(other, fix(75.0), away, may, 24 * S, warned=False) == [ResumeRoute()]
    assert not avoidance.encounters


def test_of_two_that_climb_the_later_unit_holds():
    avoidance, other, _ = agreed("1", "1")
    rising = fix(55.0, 70.0, down_m_s=-3.0)
    assert avoidance.on_moved(other, fix(55.0), rising, may, S, warned=True) == [Divert(None)]
    assert avoidance.encounters[other].role is ManoeuvreRole.HOLD


def test_nobody_waits_for_ever():
    avoidance, other, _ = agreed("1", "0")
    for second in range(25):
        steps = avoidance.on_moved(other, fix(50.0), fix(52.0, 70.0), may, second * S, warned=False)
    assert not avoidance.encounters or steps == [ResumeRoute()]
    gone, other, _ = agreed("0", "0")
    assert gone.on_gone(other) == [ResumeRoute()]


def test_a_hold_for_one_does_not_stop_a_climb_for_another():
    avoidance, _, steps = agreed("0", "0")
    assert steps == [Divert(75.0)]
    _, steps = avoidance.on_proposal("2", "2", fix(50.0), fix(52.0, -80.0), may, 0)
    assert steps == []


# -- the rules of commanding aircraft --------------------------------------------------------------------------------


def pilot(*, control=True, armed=True, airborne=True, guided=True, home=True):
    found = Pilot(control, FlightPlan((Waypoint(0.0, 0.001, 50.0),)), FlightLimits(10.0, 120.0))
    found.on_report(StatusReport(0, armed, guided, airborne, "GUIDED" if guided else "LOITER"), 0)
    if home:
        found.on_report(HomeReport(0, 0.0, 0.0, 20.0), 0)
    found.fix = fix(60.0)
    return found


@pytest.mark.parametrize(
    ("state", "rule"),
    [
        ({"control": False}, "not given control"),
        ({"armed": False}, "not armed"),
        ({"airborne": False}, "not airborne"),
        ({"guided": False}, "guided mode"),
    ],
)
def test_nothing_is_commanded_without_control_arms_air_and_a_guided_mode(state, rule):
    found = pilot(**state)
    for do in (lambda: found.divert(75.0), lambda: found.divert(None), lambda: found.order(HoldOrder())):
        with pytest.raises(Refused, match=rule):
            do()


def test_nothing_is_commanded_of_a_vehicle_that_has_not_said_its_state():
    with pytest.raises(Refused, match="has not said"):
        Pilot(control=True).order(HoldOrder())


@pytest.mark.parametrize(("altitude_m", "rule"), [(29.9, "floor"), (140.1, "ceiling")])
def test_never_below_the_floor_nor_above_the_ceiling(altitude_m, rule):
    with pytest.raises(Refused, match=rule):
        pilot().divert(altitude_m)
    with pytest.raises(Refused, match=rule):
        pilot().order(GoToOrder(0.0, 0.0, altitude_m))


def test_without_a_home_there_is_neither_floor_nor_ceiling_and_so_no_height():
    with pytest.raises(Refused, match="home is not known"):
        pilot(home=False).divert(75.0)


def test_while_it_gives_way_a_vehicle_takes_no_other_place_to_go():
    found = pilot()
    found.divert(75.0)
    with pytest.raises(Refused, match="giving way"):
        found.order(GoToOrder(0.0, 0.0, 60.0))


def test_who_flies_on_above_another_does_not_descend_to_its_route():
    found = pilot()
    found.divert(90.0)
    (command,) = found.resume(90.0)
    assert isinstance(command.order, GoToOrder)
    assert command.order.altitude_m == 90.0
    (command,) = found.resume()
    assert isinstance(command.order, GoToOrder)
    assert command.order.altitude_m == 50.0
