"""Two platforms that fly towards each other: each refusal is an act, and whoever is left alone manoeuvres alone."""

from typing import Any

import pytest

from agents.flight.flight import FlightAgent
from agents.flight.giving_way import GivingWay
from agents.flight.levels import SEPARATION_M
from agents.flight.places import FlightLimits, FlightPlan, Waypoint
from agents.monitoring.alarm_log import AlarmLog
from dyknow import Sample
from federation import keys
from federation.messages.acts import Act, Performative
from federation.messages.contents import Avoid, Content, Goto, Hold, MonitorProximity, Reason, read
from federation.messages.receipts import RECEIPT_AGENT
from federation.transport import Put
from navigation.vehicle import GoToOrder, Report
from tests.box import EPOCH, METRE_DEG, Box, Vehicle

P = Performative
BROKEN: list[tuple[dict[str, Any], str]] = [
    ({"says_status": False}, "the vehicle has not said in what state it is"),
    ({"armed": False}, "the vehicle is not armed"),
    ({"airborne": False}, "the vehicle is not airborne"),
    ({"airborne": None}, "the vehicle is not airborne"),
    ({"guided": False, "mode": "LOITER"}, "the vehicle is in mode LOITER"),
]
NO_CONTROL = "this platform was not given control of its vehicle"


def traffic(state: dict[str, Any]) -> bool:
    """Whether a vehicle of that state says that it flies."""
    return state.get("armed", True) and state.get("airborne", True) is not False


def meeting(
    wire: Box, zero: dict[str, Any] | None = None, one: dict[str, Any] | None = None, **vehicle_one: Any
) -> None:
    """Platforms 0 (102 m, the higher one) and 1 (100 m) are to meet after 25 s, and monitor that.

    `zero` and `one` are the settings of the platforms, `vehicle_one` what is otherwise with the vehicle of 1.
    """
    wire.join("0", Vehicle(east_m=-100.0, east_m_s=4.0, altitude_m=102.0), **{"control": True, **(zero or {})})
    there = {"east_m": 100.0, "east_m_s": -4.0, **vehicle_one}
    wire.join("1", Vehicle(**there), **{"control": True, **(one or {})})
    wire.centre()
    wire.run(1.0)
    wire.question("cc", "0", MonitorProximity())
    wire.run(1.5)


def until_proposed(wire: Box) -> Act:
    """The first proposal, when it has just been made."""
    for _ in range(400):
        found = wire.acts(head="avoid")
        if found:
            return found[0]
        wire.run(0.05)
    raise AssertionError("nobody proposed anything")


def refusals(wire: Box, by: str) -> list[str]:
    """Why `by` refused proposals."""
    asked = {act.conversation_id for act in wire.acts(receiver=by, head="avoid")}
    return [reason_of(act) for act in wire.acts(by) if act.performative is P.REFUSE and act.conversation_id in asked]


def reason_of(act: Act) -> str:
    assert act.content is not None
    said = read(act.content)
    assert isinstance(said, Reason)
    return said.text


def orders(wire: Box, unit: str) -> list[object]:
    return [command.order for _, command in wire.vehicle(unit).commands]


def climbs_alone(wire: Box, unit: str, other: str, why: str) -> None:
    """`unit`, the higher one, has gone up by itself, `other` has done nothing, and it is noted why."""
    (first, *_) = orders(wire, unit)
    assert isinstance(first, GoToOrder)
    assert first.altitude_m == pytest.approx(100.0 + SEPARATION_M, abs=1.0)
    assert orders(wire, other) == []
    left = (f"{other} leaves the manoeuvre to {unit}: ", f"{unit} agrees with {other}: leaves all of it to {unit}: ")
    assert any(line.startswith(left) and why in line for line in notes(wire, unit))


def notes(wire: Box, unit: str) -> list[str]:
    """What the platform has noted for people."""
    return wire.nodes[unit].notes


def deaf_to_acts(*pairs: tuple[str, str], receipts: bool = False) -> Any:
    """No act crosses from the one to the other; streams and heartbeats do, and `receipts` where that is set."""

    def drop(sender: str, receiver: str, put: Put) -> bool:
        key = keys.parse_key(put.key)
        is_act = isinstance(key, keys.ActKey) and not (receipts and key.agent == RECEIPT_AGENT)
        return (sender, receiver) in pairs and is_act

    return drop


# -- a refusal is an act -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("state", "words"), [(state, words) for state, words in BROKEN if traffic(state)])
def test_a_partner_that_may_not_be_commanded_says_so_and_leaves_the_manoeuvre_to_the_other(
    wire: Box, state: dict[str, Any], words: str
) -> None:
    meeting(wire, **state)
    wire.run(17.0)
    climbs_alone(wire, "0", "1", words.removeprefix("the vehicle is in "))
    assert any(line.startswith("1 does not avoid 0, which is to do all of it: ") for line in notes(wire, "1"))


@pytest.mark.parametrize("state", [state for state, _ in BROKEN if not traffic(state)])
def test_a_partner_on_the_ground_says_so_and_is_no_traffic(wire: Box, state: dict[str, Any]) -> None:
    meeting(wire, **state, east_m_s=0.0, east_m=20.0)
    wire.run(25.0)
    assert "the vehicle is on the ground or not armed" in refusals(wire, "1")
    assert "1 is on the ground: no traffic" in notes(wire, "0")
    assert orders(wire, "0") == orders(wire, "1") == []


@pytest.mark.parametrize("state", [state for state, _ in BROKEN if not traffic(state)])
def test_a_partner_that_says_it_is_on_the_ground_and_moves_is_not_believed(wire: Box, state: dict[str, Any]) -> None:
    meeting(wire, **state)
    wire.run(17.0)
    climbs_alone(wire, "0", "1", "the vehicle is on the ground or not armed")


def test_a_partner_without_control_says_so_and_leaves_the_manoeuvre_to_the_other(wire: Box) -> None:
    meeting(wire, one={"control": False})
    wire.run(17.0)
    assert any(reason.startswith(NO_CONTROL) for reason in refusals(wire, "1"))
    climbs_alone(wire, "0", "1", NO_CONTROL)
    assert wire.acts("1", head="avoid") == [], "who may not move proposes nothing"


def test_a_partner_that_was_told_not_to_give_way_says_so_and_leaves_it_to_the_other(wire: Box) -> None:
    meeting(wire, one={"avoidance": False})
    wire.run(17.0)
    assert "this platform was told not to give way" in refusals(wire, "1")
    climbs_alone(wire, "0", "1", "told not to give way")
    assert wire.acts("1", head="avoid") == []


def test_where_neither_may_be_commanded_nobody_moves_and_nothing_is_proposed(wire: Box) -> None:
    meeting(wire, zero={"control": False}, one={"control": False})
    wire.run(17.0)
    assert wire.acts(head="avoid") == []
    assert orders(wire, "0") == orders(wire, "1") == []


def test_a_climb_above_the_ceiling_is_refused_and_the_other_does_what_its_own_limits_allow(wire: Box) -> None:
    """Home is 50 m above the sea: to climb is to go above 120 m, and neither may go above 110 m."""
    low = {"limits": FlightLimits(ceiling_m=60.0)}
    meeting(wire, zero=low, one=low, altitude_m=101.0)
    wire.run(17.0)
    assert any("is above the ceiling of 60 m" in reason for reason in refusals(wire, "1"))
    (first, *_) = orders(wire, "0")
    assert isinstance(first, GoToOrder)
    assert first.altitude_m == pytest.approx(101.0 - SEPARATION_M, abs=1.0), "who may not climb descends"


def test_where_neither_floor_nor_ceiling_leave_room_the_one_left_alone_goes_aside(wire: Box) -> None:
    narrow = {"limits": FlightLimits(floor_m=45.0, ceiling_m=60.0)}
    meeting(wire, zero=narrow, one=narrow)
    wire.run(17.0)
    (first, *_) = orders(wire, "0")
    assert isinstance(first, GoToOrder)
    assert first.altitude_m == pytest.approx(102.0, abs=0.5)
    assert abs(first.latitude_deg - 58.0) / METRE_DEG == pytest.approx(40.0, abs=1.0)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        (Avoid(alarm="a", climber="2", climb_m=25.0, units=("0", "1")), "not between the two of us"),
        (Avoid(alarm="a", climber="0", climb_m=25.0, units=("0", "2")), "not between the two of us"),
        (Avoid(alarm="a", climber="0", climb_m=25.0, units=("0", "1")), "does not know where 1 is"),
    ],
)
def test_a_proposal_that_is_not_about_the_two_or_from_somebody_unseen_is_refused(
    wire: Box, said: Avoid, words: str
) -> None:
    for unit in "01":
        wire.join(unit, control=True)
    wire.run(1.0)
    question = wire.asked("1", "0", said)
    assert question.performatives == [P.REFUSE]
    assert words in question.reason
    assert orders(wire, "0") == []


@pytest.mark.parametrize(("state", "words"), [*BROKEN, ({"home_m": None}, "the vehicle's home is not known")])
def test_an_order_to_a_vehicle_that_may_not_be_commanded_is_refused_by_name_of_the_rule(
    wire: Box, state: dict[str, Any], words: str
) -> None:
    refuses(wire, Goto(latitude_deg=58.0, longitude_deg=15.0, altitude_m=100.0), words, Vehicle(**state))


@pytest.mark.parametrize(
    ("altitude_m", "words"), [(59.0, "9.0 m above home is below the floor"), (171.0, "121.0 m above home is above the")]
)
def test_an_order_below_the_floor_or_above_the_ceiling_is_refused(wire: Box, altitude_m: float, words: str) -> None:
    refuses(wire, Goto(latitude_deg=58.0, longitude_deg=15.0, altitude_m=altitude_m), words)


@pytest.mark.parametrize("asked", [Hold(), Goto(latitude_deg=58.0, longitude_deg=15.0, altitude_m=100.0)])
def test_an_order_to_a_platform_without_control_is_refused(wire: Box, asked: Content) -> None:
    refuses(wire, asked, NO_CONTROL, control=False)


def refuses(wire: Box, asked: Content, words: str, vehicle: Vehicle | None = None, *, control: bool = True) -> None:
    wire.join("0", vehicle, control=control)
    wire.centre()
    wire.run(1.0)
    question = wire.asked("cc", "0", asked)
    assert question.performatives == [P.REFUSE]
    assert words in question.reason
    assert orders(wire, "0") == []


# -- silence -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("receipts", "after_us"), [(True, 1_000_000), (False, 800_000)], ids=["reads but is silent", "does not hear"]
)
def test_a_partner_that_is_silent_for_a_second_leaves_the_manoeuvre_to_the_other(
    wire: Box, receipts: bool, after_us: int
) -> None:
    """Whoever gives no receipt either is given up when the last repetition was in vain, a little sooner."""
    meeting(wire)
    wire.wire.drop = deaf_to_acts(("0", "1"), ("1", "0")) if not receipts else deaf_to_acts(("1", "0"), receipts=True)
    until_proposed(wire)
    wire.run(3.0)
    asked_us = wire.acts("0", head="avoid")[0].created_us
    (at_us, first), *_ = wire.vehicle("0").commands
    assert isinstance(first.order, GoToOrder)
    assert first.order.altitude_m == pytest.approx(100.0 + SEPARATION_M, abs=1.0)
    assert after_us <= at_us - asked_us <= after_us + 100_000
    assert any(line.startswith("1 leaves the manoeuvre to 0: ") for line in notes(wire, "0"))


def test_a_partner_that_froze_leaves_the_manoeuvre_to_the_other(wire: Box) -> None:
    """It freezes before it hears of the proposal."""
    meeting(wire, one={"avoidance": False})
    wire.wire.drop = deaf_to_acts(("0", "1"), ("1", "0"))
    until_proposed(wire)
    wire.freeze("1")
    wire.run(1.2)
    climbs_alone(wire, "0", "1", "")


# -- and then hold, and resume -----------------------------------------------------------------------------------


def test_what_is_agreed_is_flown_and_the_route_resumed_when_they_are_clear(wire: Box) -> None:
    """The vehicles of the wire fly straight; the climber is lifted by hand, and both have passed after 25 s."""
    target = Waypoint(58.0, 15.0 + 900.0 * METRE_DEG / 0.5299, 102.0)
    meeting(wire, zero={"plan": FlightPlan((target,))})
    on_route = GoToOrder(*target, 5.0)
    assert orders(wire, "0") == [on_route]
    until_proposed(wire)
    wire.run(0.5)
    assert isinstance(orders(wire, "0")[1], GoToOrder)
    (held,) = orders(wire, "1")
    assert isinstance(held, GoToOrder), "the lower one stops, a braking distance ahead"
    assert held.altitude_m == pytest.approx(100.0, abs=0.5)
    assert [wire.platform(unit).part(GivingWay).encounters for unit in "01"] == [("1",), ("0",)]
    vehicle = wire.vehicle("0")
    assert vehicle is not None
    vehicle.altitude_m = 127.0
    wire.run(40.0)
    assert orders(wire, "0")[-1] == on_route
    assert [wire.platform(unit).part(GivingWay).encounters for unit in "01"] == [(), ()]


def test_a_vehicle_that_is_taken_out_of_guided_mode_while_it_gives_way_is_not_commanded_further(wire: Box) -> None:
    meeting(wire)
    until_proposed(wire)
    wire.run(0.5)
    vehicle = wire.vehicle("0")
    assert vehicle is not None
    vehicle.guided, vehicle.mode = False, "LOITER"
    wire.run(0.2)
    before = orders(wire, "0")
    wire.run(40.0)
    assert orders(wire, "0") == before


# -- what is no traffic, and what is no altitude -----------------------------------------------------------------


def raised(wire: Box, unit: str) -> list[tuple[str, str]]:
    """The alarms that the platform has opened and closed, in their order."""
    return [(event.monitor, event.event) for event in wire.platform(unit).part(AlarmLog).events]


def test_a_vehicle_that_says_it_is_on_the_ground_and_moves_is_traffic(wire: Box) -> None:
    broken: dict[str, Any] = {"armed": False, "airborne": False}
    wire.join("0", Vehicle(east_m=-40.0, east_m_s=2.0, **broken), control=True)
    wire.join("1", Vehicle(east_m=40.0, east_m_s=-2.0, **broken), control=True)
    wire.centre()
    wire.run(1.0)
    wire.question("cc", "0", MonitorProximity())
    wire.run(20.0)
    for unit in "01":
        assert ("proximity", "opened") in raised(wire, unit)


def leaping(wire: Box, unit: str, until_us: int) -> None:
    """Until then the platform reports every other second an altitude that is 9 m too high."""
    found = wire.platform(unit).part(FlightAgent).streams.filter
    on_report = found.on_report

    def spoilt(report: Report, now_us: int) -> list[Sample]:
        return [
            sample._replace(value=sample.value._replace(altitude_m=sample.value.altitude_m + 9.0))
            if sample.valid_us < until_us and sample.valid_us // 1_000_000 % 2
            else sample
            for sample in on_report(report, now_us)
        ]

    found.on_report = spoilt  # type: ignore[method-assign]


def test_an_altitude_that_leaps_puts_the_manoeuvre_off_and_that_is_told_once_a_warning(wire: Box) -> None:
    meeting(wire)
    leaping(wire, "1", EPOCH + 20_000_000)
    wire.run(17.0)
    assert ("proximity-warn", "opened") in raised(wire, "0")
    text = "0 puts off avoiding 1: the altitude of 1 has leapt"
    assert notes(wire, "0").count(text) == 1
    assert orders(wire, "0") == []
    wire.run(5.0)
    assert orders(wire, "0"), "and not for ever"
    assert notes(wire, "0").count(text) == 1
