"""Where objects on roads are predicted while they are not seen.

The speed is kept, or that expected of the individual; the routes are `hypotheses`. The covariance grows along the road
with time, as of an object whose acceleration is white noise, and stays what it was across.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from dyknow import US_PER_S, Value
from dyknow.anchoring.links.individuals import Individual
from dyknow.anchoring.links.prediction import ConstantVelocity, Hypothesis, ObjectPrediction
from dyknow.anchoring.links.states import ObjectState
from dyknow.anchoring.roads.elements import DirectedLink
from dyknow.anchoring.roads.fluents import (
    ROAD_ATTRIBUTES,
    ROUTE,
    TRAVELLED,
    TURN_MADE,
    attributes_of,
    number_of,
    place_of,
)
from dyknow.anchoring.roads.hypotheses import (
    USUAL_PRUNING,
    Pruning,
    RouteHypothesis,
    TurnPrior,
    advance,
    pruned,
    uniform,
)
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.anchoring.roads.objects import MEASURED, velocity_of
from dyknow.anchoring.roads.snapping import DEFAULTS, RoadPlace, SnapSettings, snap
from dyknow.compunits.covariances import Matrix

_COUNTS: Final = 4.0
"""The prior over turns counts as much as this many observed turns of the individual."""
_ACROSS_M_S: Final = 0.5
"""Standard deviation of the speed across the road."""
_WRONG_WAY_M_S: Final = 3.0
"""An object that is so fast against a one-way street continues that way."""
_TURNED_SD_RAD: Final = 0.5
_STRAYED_SD_M: Final = 3.0
_SPEED_SD_M_S: Final = 3.0
_MOST_SLOWED: Final = 4.0
"""A speed that fits no better than by two standard deviations has another cause than the way."""


class AlongRoads:
    """Predicts objects along the roads: a `Predictor` whose hypotheses are routes.

    Attributes of each hypothesis are those of a place on the roads. An object off the roads is predicted with constant
    velocity.

    Args:
        prior: over turns; that of the individual is put on top of it.
        noise: density of the acceleration noise along the road, m^2/s^3.
        has_habits: whether what was learnt of the individual is used.
    """

    def __init__(
        self,
        network: RoadNetwork,
        prior: TurnPrior = uniform,
        pruning: Pruning = USUAL_PRUNING,
        noise: float = 2.0,
        settings: SnapSettings = DEFAULTS,
        *,
        has_habits: bool = True,
    ) -> None:
        self._network, self._prior, self._pruning, self._has_habits = network, prior, pruning, has_habits
        self._noise, self._settings = noise, settings
        self._general = ConstantVelocity()

    def predict(
        self,
        history: Sequence[ObjectState],
        to_us: int,
        before: ObjectPrediction | None = None,
        individual: Individual | None = None,
    ) -> ObjectPrediction:
        """The routes that it may have taken, the most probable first."""
        history = tuple(history)
        last, individual = history[-1], individual if self._has_habits else None
        if before is None:
            routes, from_us = self._start(history, individual), last.valid_us
        else:
            routes = tuple(filter(None, (_route_of(self._network, each) for each in before.hypotheses)))
            from_us = before.likely.valid_us
        if not routes:
            return self._general.predict(history, to_us, before, individual)
        speed_m_s = self._speed_m_s(history)
        travelled_m = _expected_m(speed_m_s, last.valid_us, from_us, to_us, individual)
        prior = self._prior if individual is None else _Habits(self._prior, individual.turns)
        moved = advance(self._network, routes, travelled_m, prior, self._pruning)
        seconds = (to_us - last.valid_us) / US_PER_S
        grown, now_m_s = self._grown(last, seconds), _expected_speed(speed_m_s, seconds, individual)
        kept = {
            name: value for name, value in last.attributes.items() if name not in ROAD_ATTRIBUTES or name in TURN_MADE
        }
        return ObjectPrediction(
            tuple(Hypothesis(self._state(one, to_us, now_m_s, grown, kept), one.weight) for one in moved)
        )

    def _start(self, history: Sequence[ObjectState], individual: Individual | None) -> tuple[RouteHypothesis, ...]:
        """Where it is when it is seen last; off the roads there is nothing."""
        last = history[-1]
        place = place_of(last)
        velocity = velocity_of(last) or self._slope(history)
        if place is None or place.link not in {*self._network.links, None}:
            place = snap(self._network, last.x_m, last.y_m, velocity, settings=self._settings)
        if place is None:
            return ()
        if place.link is not None:
            return self._on_link(place, place.link, velocity)
        usual_m_s = individual.speed.mean if individual is not None and individual.is_known else None
        return self._in_crossing(place, velocity, usual_m_s)

    def _on_link(self, place: RoadPlace, link: str, velocity: tuple[float, float]) -> tuple[RouteHypothesis, ...]:
        """One hypothesis, or one for each direction if that is not known; none against a one-way street."""
        network = self._network
        directions: tuple[int, ...] = (place.direction,)
        line_rad = network.links[link].line.at(place.offset_m)[2]
        along_m_s = velocity[0] * math.cos(line_rad) + velocity[1] * math.sin(line_rad)
        if len(network.links[link].directions) == 1 and along_m_s * place.direction < -_WRONG_WAY_M_S:
            return ()
        if not place.direction:
            directions = network.links[link].directions
            if abs(along_m_s) >= self._settings.least_speed_m_s and len(directions) > 1:
                directions = (1 if along_m_s > 0.0 else -1,)
        length_m = network.links[link].length_m
        return pruned(
            RouteHypothesis(
                DirectedLink(link, each), place.offset_m if each > 0 else length_m - place.offset_m,
                network.links[link].lane_near(place.across_m, each, place.lane), 1.0 / len(directions),
            )
            for each in directions
        )  # fmt: skip

    def _in_crossing(
        self, place: RoadPlace, velocity: tuple[float, float], usual_m_s: float | None
    ) -> tuple[RouteHypothesis, ...]:
        """One hypothesis for each way through, weighted by how well position, heading and speed fit it."""
        network, crossing = self._network, place.crossing or ""
        via = place.via if place.via is not None and place.via.link in network.links else None
        if via is not None and network.links[via.link].crossing_at(via.direction) != crossing:
            via = None
        exits = network.turns.exits(via) if via else dict.fromkeys(network.departures.get(crossing, ()), "straight")
        if not exits:
            return ()
        priors = self._prior(crossing, exits)
        found = [self._through(place, velocity, via, way, priors.get(way, 0.0)) for way in exits]
        if usual_m_s is not None:
            speed_m_s = math.hypot(*velocity)
            found = [one._replace(weight=one.weight * self._as_fast(one, speed_m_s, usual_m_s)) for one in found]
        return pruned(found, self._pruning)

    def _as_fast(self, route: RouteHypothesis, speed_m_s: float, usual_m_s: float) -> float:
        """How well a speed fits a way through a crossing: vehicles that turn have slowed down."""
        path = self._network.paths.through(route.via, route.way, route.lane)
        expected_m_s = usual_m_s if path is None else min(usual_m_s, path.comfortable_m_s)
        return math.exp(-min(((speed_m_s - expected_m_s) / _SPEED_SD_M_S) ** 2, _MOST_SLOWED) / 2.0)

    def _through(
        self, place: RoadPlace, velocity: tuple[float, float], via: DirectedLink | None, way: DirectedLink, prior: float
    ) -> RouteHypothesis:
        """The nearest place on one way through a crossing: on its curve, the link before or the one that follows."""
        network = self._network
        lane = network.links[way.link].lanes_of(way.direction)[0]
        path = network.paths.through(via, way, lane)
        begins_m, ends_m = (0.0, 0.0) if path is None else (-path.before_m, path.after_m)
        choices = [] if path is None else [path.nearest(place.x_m, place.y_m)]
        for step in (way,) if via is None else (via, way):
            on = network.links[step.link]
            at = on.line.project(place.x_m, place.y_m)
            travelled_m = at.offset_m if step.direction > 0 else on.length_m - at.offset_m
            ahead_m = travelled_m if step is way else travelled_m - on.length_m
            if path is None or ahead_m < begins_m or ahead_m > ends_m:
                choices.append((ahead_m, abs(at.across_m), at.heading_rad + (0.0 if step.direction > 0 else math.pi)))
        ahead_m, strayed_m, heading_rad = min(choices, key=lambda each: each[1])
        cost = (strayed_m / _STRAYED_SD_M) ** 2
        if math.hypot(*velocity) >= self._settings.least_speed_m_s:
            turned = math.remainder(math.atan2(velocity[1], velocity[0]) - heading_rad, math.tau)
            cost += (turned / _TURNED_SD_RAD) ** 2
        weight = max(prior, 1e-6) * math.exp(-min(cost, 60.0) / 2.0)
        return RouteHypothesis(way, ahead_m, lane, weight, via)

    def _speed_m_s(self, history: Sequence[ObjectState]) -> float:
        return math.hypot(*(velocity_of(history[-1]) or self._slope(history)))

    def _slope(self, history: Sequence[ObjectState]) -> tuple[float, float]:
        likely = self._general.predict(history, history[-1].valid_us).likely
        return likely.vx_m_s, likely.vy_m_s

    def _state(
        self, route: RouteHypothesis, to_us: int, speed_m_s: float, grown: Matrix, kept: Mapping[str, Value]
    ) -> ObjectState:
        """The state on a route."""
        network, way = self._network, route.way
        x_m, y_m, heading_rad = route.at(network)
        crossing = self._around(x_m, y_m, route)
        arrives = crossing is None or network.links[way.link].crossing_at(way.direction) == crossing
        via = route.via if route.path(network) is not None else way if arrives else route.via
        place = RoadPlace(
            x_m, y_m, None if crossing else way.link, crossing, way.direction, route.lane, route.offset_m(network),
            network.links[way.link].lanes[route.lane].offset_m, heading_rad, speed_m_s, via,
        )  # fmt: skip
        cosine, sine = math.cos(heading_rad), math.sin(heading_rad)
        back = np.array([[cosine, -sine, 0.0, 0.0], [sine, cosine, 0.0, 0.0],
                         [0.0, 0.0, cosine, -sine], [0.0, 0.0, sine, cosine]])  # fmt: skip
        return ObjectState(
            to_us, x_m, y_m, speed_m_s * cosine, speed_m_s * sine, back @ grown @ back.T,
            {**kept, **attributes_of(place), ROUTE: way.link, TRAVELLED: route.travelled_m},
        )  # fmt: skip

    def _around(self, x_m: float, y_m: float, route: RouteHypothesis) -> str | None:
        """The crossing through which it goes, or the one at either end of the link that holds a position."""
        if route.via is not None and route.path(self._network) is not None:
            return self._network.links[route.via.link].crossing_at(route.via.direction)
        link, crossings = self._network.links[route.way.link], self._network.crossings
        for name in (link.start, link.end):
            if name is not None:
                one = crossings[name]
                if math.hypot(x_m - one.x_m, y_m - one.y_m) <= one.radius_m:
                    return name
        return None

    def _grown(self, last: ObjectState, seconds: float) -> Matrix:
        """The covariance of (along, across, their rates): along the road that of constant velocity, across the last."""
        axes = _axes(math.atan2(last.vy_m_s, last.vx_m_s))
        position = axes @ last.covariance[:2, :2] @ axes.T
        speed = min(float((axes @ last.covariance[2:, 2:] @ axes.T)[0, 0]), MEASURED)
        grown = np.diag([
            position[0, 0] + speed * seconds**2 + self._noise * seconds**3 / 3, position[1, 1],
            speed + self._noise * seconds, _ACROSS_M_S**2,
        ])  # fmt: skip
        grown[0, 2] = grown[2, 0] = speed * seconds + self._noise * seconds**2 / 2
        return grown


class _Habits:
    """A prior over turns together with the turns that an individual made: left, straight, right."""

    def __init__(self, prior: TurnPrior, turns: Mapping[str, int]) -> None:
        self._prior, self._turns = prior, turns

    def __call__(self, crossing: str | None, exits: Mapping[DirectedLink, str]) -> Mapping[DirectedLink, float]:
        weights = self._prior(crossing, exits)
        total, ways = sum(weights.values()) or 1.0, list(exits.values())
        return {
            way: _COUNTS * weights.get(way, 0.0) / total + self._turns.get(turn, 0) / ways.count(turn)
            for way, turn in exits.items()
        }


def _axes(heading_rad: float) -> Matrix:
    """Turns (east, north) into (along, left of it)."""
    cosine, sine = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([[cosine, sine], [-sine, cosine]])


def _route_of(network: RoadNetwork, hypothesis: Hypothesis) -> RouteHypothesis | None:
    """The route that a hypothesis of `AlongRoads` has in its attributes; None: they describe none."""
    about = hypothesis.state.attributes
    place, link = place_of(hypothesis.state), network.links.get(str(about.get(ROUTE)))
    travelled_m = number_of(about.get(TRAVELLED))
    if link is None or place is None or not place.direction or travelled_m is None:
        return None
    if place.lane is None or place.lane >= len(link.lanes):
        return None
    way = DirectedLink(link.id, place.direction)
    via = None if place.crossing is None or place.via == way else place.via
    known = via if via is not None and via.link in network.links and via.direction else None
    return RouteHypothesis(way, travelled_m, place.lane, hypothesis.weight, known)


def _expected_speed(speed_m_s: float, seconds: float, individual: Individual | None) -> float:
    if individual is None or not individual.is_known:
        return speed_m_s
    return max(0.0, individual.speed.after(speed_m_s, seconds))


def _expected_m(speed_m_s: float, seen_us: int, from_us: int, to_us: int, individual: Individual | None) -> float:
    """How far it goes between two times; of an individual by Simpson's rule."""
    begin_s, end_s = (from_us - seen_us) / US_PER_S, (to_us - seen_us) / US_PER_S
    speeds = [_expected_speed(speed_m_s, at_s, individual) for at_s in (begin_s, (begin_s + end_s) / 2, end_s)]
    return (end_s - begin_s) * (speeds[0] + 4.0 * speeds[1] + speeds[2]) / 6.0
