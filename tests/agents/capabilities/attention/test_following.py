"""`(follow object: ...)`: the vehicle flies after what its platform sees, within all rules, and says when it does not."""

from math import hypot, inf, nan

import pytest

from dyknow.agents.capabilities.attention.following import Following
from dyknow.agents.capabilities.attention.requests import ATTEND, FOLLOW
from dyknow.agents.capabilities.attention.standoff import Leaps, Whereabouts, expected, goal
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.capabilities.flight.requests import FLIGHT
from dyknow.agents.places import FlightLimits
from dyknow.agents.tasks.requests import LATER
from dyknow.anchoring.attention.watched import WatchedPlace
from dyknow.federation.messages.contents import Follow, Goto
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.navigation.vehicle import HoldOrder
from dyknow.sim_uavs.dynamics.faults import parse_fault
from tests.agents.capabilities.attention.chase import FED, LINKS, Chase, said

TAKEN = ("inform", "follows co1: acknowledged, and seen in the vehicle's target")


def follow(chase: Chase, symbol: str = "co1", speed_m_s: float = 0.0, seconds: float = 3.0) -> Dialogue:
    dialogue = chase.world.ask("cc", "0", Follow(object=symbol))
    chase.drive(seconds, speed_m_s)
    return dialogue


def chased(speed_m_s: float = 8.0, **config: object) -> tuple[Chase, Dialogue]:
    """A car that drives away is followed."""
    chase = Chase(**config)
    chase.drive(3.0, speed_m_s)
    return chase, follow(chase, speed_m_s=speed_m_s)


def test_the_vehicle_moves_after_the_car_keeps_away_and_keeps_its_height() -> None:
    chase, dialogue = chased()
    chase.drive(20.0, 8.0)
    assert said(dialogue) == [("agree", ""), TAKEN]
    east_m, north_m = chase.at_m
    assert chase.x_m - 45.0 < east_m < chase.x_m
    assert abs(north_m) < 5.0
    assert len({order.altitude_m for order in chase.orders}) == 1
    assert len(chase.orders) < 20
    assert chase.conditions == ["follows co1"]


def test_a_car_that_is_near_enough_has_the_vehicle_stay() -> None:
    chase = Chase()
    chase.x_m += 10.0
    chase.drive(2.0)
    dialogue = follow(chase, seconds=6.0)
    assert said(dialogue) == [("agree", ""), TAKEN]
    assert len(chase.orders) == 1
    assert hypot(*chase.at_m) < 3.0


def test_cancelled_it_holds_and_sends_nothing_more() -> None:
    chase, dialogue = chased()
    chase.world.speak("cc", lambda member, now_us: member.acts.cancel("0", dialogue.conversation, now_us))
    chase.drive(1.0, 8.0)
    sent = len(chase.vehicle.commands)
    assert any(isinstance(each.order, HoldOrder) for _, each in chase.vehicle.commands)
    chase.drive(6.0, 8.0)
    assert len(chase.vehicle.commands) == sent
    assert chase.conditions == []
    assert said(follow(chase, speed_m_s=8.0))[0] == ("agree", "")


def test_through_a_gap_it_is_followed_where_it_is_expected_and_that_is_reported() -> None:
    chase, dialogue = chased()
    chase.end("vp1")
    before_m = chase.at_m[0]
    chase.drive(4.0, 8.0, percept=None)
    assert chase.at_m[0] > before_m + 15.0
    chase.drive(4.0, 8.0, percept="vp2")
    assert said(dialogue)[2:] == [
        ("inform", "co1 is not seen: the vehicle flies where it is expected"),
        ("inform", "co1 is seen again"),
    ]


def test_forgotten_it_is_a_failure_at_once_and_the_vehicle_holds() -> None:
    chase, dialogue = chased(2.0)
    chase.end("vp1")
    chase.drive(29.0, percept=None)
    assert "failure" not in {performative for performative, _ in said(dialogue)}
    chase.drive(4.0, percept=None)
    assert said(dialogue)[-1] == ("failure", "co1 is not known any longer: it was forgotten")
    assert isinstance(chase.vehicle.commands[-1][1].order, HoldOrder) or chase.orders
    assert chase.conditions == ["followed co1: co1 is not known any longer: it was forgotten"]
    sent = len(chase.orders)
    chase.drive(5.0, 8.0, percept="vp9")
    assert len(chase.orders) == sent


@pytest.mark.parametrize(
    ("symbol", "because"),
    [("co11", "Did you mean 'co1'?"), ("vp1", "Known: co1"), ("car\u00e9", "no object is called")],
)
def test_what_is_not_known_is_refused_with_what_is(symbol: str, because: str) -> None:
    chase = Chase()
    chase.drive(2.0)
    ((performative, text),) = said(follow(chase, symbol, seconds=1.0))
    assert performative == "refuse"
    assert because in text
    assert chase.vehicle.commands == []


def test_names_of_every_level_are_near_ones() -> None:
    chase = Chase(f"{LINKS}strmgen vehicles = link(cars, SameState, true, xy_dist[from, to] < thresh, true)\n")
    chase.drive(2.0)
    for symbol, near in (("co9", "co1"), ("vehicle9", "vo1")):
        ((performative, text),) = said(follow(chase, symbol, seconds=1.0))
        assert performative == "refuse"
        assert near in text
        assert text.endswith("dyknow objects lists them.")


def test_one_object_at_a_time() -> None:
    chase, _ = chased()
    ((performative, text),) = said(follow(chase, seconds=1.0))
    assert (performative, text.partition(":")[0]) == ("refuse", "the vehicle follows co1")


def test_without_control_or_in_its_pilots_hands_it_is_refused() -> None:
    watched = Chase(control=False)
    watched.drive(2.0)
    ((performative, text),) = said(follow(watched, seconds=1.0))
    assert (performative, "not given control" in text) == ("refuse", True)
    taken = Chase()
    taken.drive(2.0)
    taken.vehicle.inject(parse_fault("takeover"), taken.world.now_us)
    taken.drive(2.0)
    ((performative, text),) = said(follow(taken, seconds=1.0))
    assert performative == "refuse"
    assert "LOITER" in text
    assert taken.vehicle.commands == watched.vehicle.commands == []


def test_the_pilots_hands_end_it_within_two_seconds_and_nothing_is_sent_then() -> None:
    chase, dialogue = chased()
    chase.vehicle.inject(parse_fault("takeover"), chase.world.now_us)
    chase.drive(2.0, 8.0)
    assert said(dialogue)[-1] == ("failure", "the vehicle was taken over: mode LOITER")
    sent = len(chase.orders)
    chase.drive(5.0, 8.0)
    assert len(chase.orders) == sent


def test_another_order_of_a_user_ends_it() -> None:
    chase, dialogue = chased()
    truth = chase.vehicle.truth(chase.world.now_us)
    place = Goto(latitude_deg=truth.latitude_deg, longitude_deg=truth.longitude_deg, altitude_m=truth.altitude_m + 5.0)
    chase.world.ask("cc", "0", place)
    chase.drive(3.0, 8.0)
    assert said(dialogue)[-1] == ("failure", "overtaken by a newer order")
    assert chase.orders[-1].altitude_m == place.altitude_m


def test_giving_way_comes_first_and_then_it_follows_again() -> None:
    chase, dialogue = chased()
    pilot = chase.platform.built[Pilot.of]
    assert pilot.fix is not None
    for command in pilot.divert(pilot.fix.altitude_m + 12.0):
        chase.platform.ports.emit(command)
    chase.world.run_for(0.1)
    sent = len(chase.orders)
    chase.drive(6.0, 8.0)
    assert len(chase.orders) <= sent + 1
    for command in pilot.resume():
        chase.platform.ports.emit(command)
    chase.drive(14.0, 8.0)
    assert len(chase.orders) > sent + 2
    assert said(dialogue)[-1] == TAKEN
    assert chase.x_m - 60.0 < chase.at_m[0] < chase.x_m


def test_a_car_that_leaves_the_range_is_followed_to_its_edge_and_no_farther() -> None:
    chase, dialogue = chased(limits=FlightLimits(range_m=60.0))
    farthest_m = 0.0
    for _ in range(30):
        chase.drive(1.0, 8.0)
        farthest_m = max(farthest_m, hypot(*chase.at_m))
    assert 40.0 < farthest_m < 64.0
    assert "failure" not in {performative for performative, _ in said(dialogue)}


@pytest.mark.parametrize("bad", [nan, inf, -inf])
def test_a_place_that_is_none_is_not_flown_to(bad: float) -> None:
    chase = Chase(FED)
    chase.feed("car1", 40.0, 0.0, 1.0)
    dialogue = chase.world.ask("cc", "0", Follow(object="car1"))
    chase.feed("car1", 40.0, 0.0, 3.0)
    chase.feed("car1", bad, 0.0, 3.0)
    assert all(order.latitude_deg == order.latitude_deg for order in chase.orders)
    assert said(dialogue)[:1] == [("agree", "")]
    sent = len(chase.orders)
    chase.feed("car1", 400.0, 0.0, 3.0)
    assert len(chase.orders) == sent


def test_a_symbol_that_leaps_is_not_followed_and_that_is_a_failure() -> None:
    chase = Chase(FED)
    chase.feed("car1", 40.0, 0.0, 1.0)
    dialogue = chase.world.ask("cc", "0", Follow(object="car1"))
    chase.feed("car1", 40.0, 0.0, 4.0)
    chase.feed("car1", -700.0, 300.0, 1.0)
    chase.feed("car1", 40.0, 0.0, 2.0)
    assert said(dialogue)[-1][0] == "inform"
    chase.feed("car1", -700.0, 300.0, 5.0)
    assert said(dialogue)[-1] == ("failure", "car1 leapt to where no object can be so soon")
    assert all(hypot(*chase.at_m) < 60.0 for _ in chase.orders)


def test_one_that_leaps_to_and_fro_keeps_the_vehicle_in_its_range_and_sends_few_orders() -> None:
    chase = Chase(FED, limits=FlightLimits(range_m=100.0))
    chase.feed("car1", 30.0, 0.0, 1.0)
    chase.world.ask("cc", "0", Follow(object="car1"))
    for number in range(20):
        chase.feed("car1", 30.0 + 20.0 * (-1) ** number, 500.0 * (number % 3), 0.5)
    assert len(chase.orders) <= 8
    assert hypot(*chase.at_m) < 104.0


def test_without_cameras_there_is_no_such_part() -> None:
    chase = Chase(cameras=None)
    with pytest.raises(LookupError):
        chase.platform.part(Following)
    ((performative, _),) = said(chase.ask(Follow(object="co1"), 1.0))
    assert performative == "not-understood"


def test_the_goal_is_before_the_object_and_leads_it() -> None:
    assert goal(Whereabouts(0.0, 0.0), Whereabouts(100.0, 0.0), 20.0) == Whereabouts(80.0, 0.0)
    assert goal(Whereabouts(0.0, 0.0), Whereabouts(100.0, 0.0, 10.0, 0.0), 20.0) == Whereabouts(100.0, 0.0)
    assert goal(Whereabouts(5.0, 5.0), Whereabouts(10.0, 5.0), 20.0) == Whereabouts(5.0, 5.0)


def test_hypotheses_that_differ_are_followed_between_them_by_weight() -> None:
    assert expected((WatchedPlace(0.0, 0.0, weight=0.75), WatchedPlace(40.0, 0.0, weight=0.25))) == Whereabouts(
        10.0, 0.0
    )
    assert expected((WatchedPlace(nan, 0.0), WatchedPlace(3.0, 4.0, weight=0.2))) == pytest.approx(
        Whereabouts(3.0, 4.0)
    )
    assert expected((WatchedPlace(nan, 0.0), WatchedPlace(1.0, 0.0, weight=0.0))) is None
    assert expected(()) is None


def test_what_is_too_fast_for_any_object_has_leapt() -> None:
    leaps = Leaps()
    assert leaps.is_credible(0, Whereabouts(0.0, 0.0))
    assert leaps.is_credible(1_000_000, Whereabouts(60.0, 0.0))
    assert not leaps.is_credible(1_200_000, Whereabouts(300.0, 0.0))
    assert leaps.since_us == 1_200_000
    assert leaps.is_credible(1_400_000, Whereabouts(70.0, 0.0))
    assert leaps.since_us is None


def test_only_those_that_may_give_orders_to_a_vehicle_may_have_it_follow_or_attend() -> None:
    assert {FOLLOW.role, ATTEND.role} == {each.role for each in FLIGHT}
    assert FOLLOW.lasting
    assert not {FOLLOW.head, ATTEND.head} & LATER
