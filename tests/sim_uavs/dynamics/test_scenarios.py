from itertools import combinations

import pytest

from dyknow.model.errors import TextError
from dyknow.navigation.geodesy import LocalFrame, distance_m
from dyknow.sim_uavs.dynamics.flight import Flight, FlightAnswer
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from dyknow.sim_uavs.dynamics.routes import circle, hover, patrol
from dyknow.sim_uavs.dynamics.scenarios import NAMES, ORIGIN, scenario
from dyknow.sim_uavs.dynamics.settings import HomePlace

S = 1_000_000
FRAME = LocalFrame(*ORIGIN)
UP = Vector(0.0, 0.0, -40.0)


class Follower:
    """Flies a route as a platform does: the next place once within 3 m of one."""

    def __init__(self, unit) -> None:
        self.flight, self.route = Flight(unit.vehicle(unit.number + 1, airborne=True), 0), unit.route
        self.frame, self.leg = LocalFrame(*unit.home), 0
        self.flight.change_speed(unit.route.speed_m_s)

    def on_time(self, now_us) -> Vector:
        target = Vector(*self.frame.to_ned(*self.route.waypoints[self.leg]))
        if self.flight.body.position.is_close_to(target, 3.0):
            following = self.leg + 1
            self.leg = (
                following % len(self.route.waypoints)
                if self.route.loop
                else min(following, len(self.route.waypoints) - 1)
            )
            target = Vector(*self.frame.to_ned(*self.route.waypoints[self.leg]))
        assert self.flight.go_to(target) is FlightAnswer.ACCEPTED
        self.flight.on_time(now_us)
        return Vector(*FRAME.to_ned(*self.frame.from_ned(*self.flight.body.position)))


def separations(found, seconds):
    """Smallest 3-D separation of each pair while the routes are flown undisturbed, and when it was (us)."""
    followers = {unit.number: Follower(unit) for unit in found.units}
    least = {}
    for now_us in range(100_000, seconds * S, 100_000):
        places = {number: follower.on_time(now_us) for number, follower in followers.items()}
        for pair in combinations(sorted(places), 2):
            offset = places[pair[0]].minus(places[pair[1]])
            apart = (offset.horizontal**2 + offset.down**2) ** 0.5
            least[pair] = min(least.get(pair, (apart, now_us)), (apart, now_us))
    return least


@pytest.mark.parametrize("name", ["crossing", "encounter"])
def test_two_meet_where_and_when_the_scenario_says_and_the_third_stays_apart(name) -> None:
    found = scenario(name)
    (meeting,) = found.meetings
    assert all(found.units[number].route.speed_m_s >= 5.0 for number in meeting.units)
    least = separations(found, 45)
    apart, when_us = least[meeting.units]
    assert apart < 2.0
    assert abs(when_us - meeting.after_us) <= 200_000
    others = [apart for pair, (apart, _) in least.items() if pair != meeting.units]
    assert min(others) > 300.0


def test_the_crossing_is_at_right_angles_at_one_height() -> None:
    north, east, _ = scenario("crossing").units
    assert north.height_m == pytest.approx(east.height_m, abs=0.01)
    (a, b), (c, d) = ([FRAME.to_ned(*place) for place in unit.route.waypoints] for unit in (north, east))
    along = [(q[0] - p[0], q[1] - p[1]) for p, q in ((a, b), (c, d))]
    assert along[0][0] * along[1][0] + along[0][1] * along[1][1] == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize(("name", "count"), [("hover", 5), ("patrol", 4), ("swarm", 9)])
def test_scenarios_without_meetings_keep_everybody_apart(name, count) -> None:
    found = scenario(name, count, seed=3)
    assert not found.meetings
    assert len(found.units) == count
    assert min(apart for apart, _ in separations(found, 60).values()) > 50.0


@pytest.mark.parametrize("name", NAMES)
def test_every_scenario_is_a_function_of_its_arguments(name) -> None:
    assert scenario(name, 4, 1) == scenario(name, 4, 1)
    for unit in scenario(name, 4, 1).units:
        first = unit.route.waypoints[0]
        assert distance_m(*unit.home[:2], *first[:2]) < 0.01
        assert unit.home.altitude_m == ORIGIN.altitude_m
        assert unit.vehicle(1, airborne=True).airborne_m == pytest.approx(unit.height_m)


def test_the_seed_draws_the_swarm() -> None:
    assert scenario("swarm", 4, 1) != scenario("swarm", 4, 2)


@pytest.mark.parametrize(("name", "count"), [("dance", 3), ("crossing", 1), ("swarm", 0)])
def test_an_impossible_scenario_is_refused(name, count) -> None:
    with pytest.raises(TextError):
        scenario(name, count)


def test_routes_are_where_they_say() -> None:
    assert hover(FRAME, UP).waypoints == (pytest.approx(FRAME.from_ned(*UP)),)
    around = patrol(FRAME, UP, 80.0, 60.0, 5.0)
    assert around.loop
    sides = [distance_m(*a[:2], *b[:2]) for a, b in zip(around.waypoints, around.waypoints[1:], strict=False)]
    assert sides == pytest.approx([80.0, 60.0, 80.0], abs=0.01)
    ring = circle(FRAME, UP, 40.0, 5.0, corners=8, from_rad=1.0)
    assert [distance_m(*p[:2], *ORIGIN[:2]) for p in ring.waypoints] == pytest.approx([40.0] * 8, abs=0.01)


def test_a_scenario_takes_place_where_it_is_told_to() -> None:
    here, there = scenario("crossing"), scenario("crossing", origin=HomePlace(-35.36, 149.16, 580.0))
    (meeting,) = there.meetings
    assert meeting.place == pytest.approx((-35.36, 149.16, 620.0))
    for ours, theirs in zip(here.units, there.units, strict=True):
        assert theirs.home.altitude_m == 580.0
        assert theirs.height_m == pytest.approx(ours.height_m, abs=0.1)
        first, last = theirs.route.waypoints[0], theirs.route.waypoints[-1]
        legs = [
            distance_m(*a[:2], *b[:2]) for a, b in ((first, last), (ours.route.waypoints[0], ours.route.waypoints[-1]))
        ]
        assert legs[0] == pytest.approx(legs[1], abs=0.05)
