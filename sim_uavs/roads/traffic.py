"""Vehicles on a network: they follow each other, wait at crossings, turn, and overtake. Pure; time is an argument.

Speeds follow the intelligent driver model (Treiber, Hennecke, Helbing, Phys. Rev. E 62, 2000):
dv/dt = a (1 - (v / v0)^4 - (s* / s)^2), s* = s0 + v T + v dv / (2 sqrt(a b)). A crossing is given to the first that comes
near, and to others whose curves do not touch that one's, if there is room behind it.
"""

from collections import defaultdict
from collections.abc import Iterable
from math import inf, sqrt

from numpy.random import Generator

from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.sim_uavs.roads.drivers import BUILDS, Driver, RoadState
from dyknow.sim_uavs.roads.layouts import LANE_M
from dyknow.sim_uavs.roads.legs import Driveways, Leg

STEP_US = 20_000
_STEP_S = STEP_US / 1e6
_STANDSTILL_M = 2.0
_HEADWAY_S = 1.2
_HARDEST_M_S2 = 7.0
_SIGHT_M = 90.0
_SIDEWAYS_M_S = 1.8
_BESIDE_M = 2.0
"""Vehicles that are further apart sideways than that do not hinder each other."""
_MARGIN_M = 12.0
_WORTH_M_S = 2.0
"""How much slower a leader is that is overtaken."""


class RoadUser:
    """One vehicle on its way: `along_m` of `legs[0]`, `aside_m` to the left of the line."""

    __slots__ = ("along_m", "aside_m", "build", "driver", "legs", "passing", "route", "speed_m_s", "waits_us")

    def __init__(self, driver: Driver, leg: Leg) -> None:
        self.driver, self.build = driver, BUILDS[driver.kind]
        self.legs = [leg]
        self.route = list(driver.route[2:])
        self.along_m, self.aside_m = driver.start_m, 0.0
        self.speed_m_s = min(driver.cruise_m_s, leg.limit_m_s)
        self.passing: RoadUser | None = None
        self.waits_us: int | None = None

    @property
    def left_m(self) -> float:
        """How much of the leg is ahead."""
        return self.legs[0].line.length_m - self.along_m

    def state(self) -> RoadState:
        leg, driver = self.legs[0], self.driver
        x, y, heading = leg.line.at(self.along_m, self.aside_m)
        passing = self.passing.driver.name if self.passing is not None else None
        return RoadState(
            driver.name, driver.kind, driver.colour, x, y, heading, self.speed_m_s,
            leg.link, leg.way.direction, leg.crossing, passing,
        )  # fmt: skip


class SimulatedTraffic:
    """All vehicles of a network, stepped every 20 ms.

    Args:
        drivers: drivers on the road and those to enter it; a driver whose place is taken waits outside until it is
            free.
        rng: decides at crossings beyond the ends of routes.
    """

    def __init__(self, network: RoadNetwork, drivers: Iterable[Driver], rng: Generator, now_us: int = 0) -> None:
        self.ways, self.now_us = Driveways(network), now_us
        self._rng = rng
        self._outside = sorted(drivers, key=lambda driver: driver.enters_us)
        self._users: list[RoadUser] = []
        self._on: dict[Leg, list[RoadUser]] = defaultdict(list)
        self._given: dict[str, dict[RoadUser, Leg]] = defaultdict(dict)
        self._sort()

    def states(self) -> list[RoadState]:
        """The states of all vehicles on the road, in the order in which they entered."""
        return [user.state() for user in self._users]

    def advance(self, now_us: int) -> None:
        """Step until the last multiple of 20 ms that is not after `now_us`."""
        while self.now_us + STEP_US <= now_us:
            self.now_us += STEP_US
            self._enter()
            self._give_crossings()
            wanted = [(user, self._acceleration(user)) for user in self._users]
            for user, acceleration in wanted:
                self._overtake(user)
                self._move(user, acceleration)
            self._sort()

    def _enter(self) -> None:
        late: list[Driver] = []
        for driver in self._outside:
            leg = self.ways.lane(self.ways.way(*driver.route[:2]), driver.lane)
            room_m = BUILDS[driver.kind].length_m + 2.0 * _STANDSTILL_M
            if driver.enters_us > self.now_us or any(
                abs(user.along_m - driver.start_m) < room_m + user.build.length_m / 2.0 for user in self._on[leg]
            ):
                late.append(driver)
                continue
            user = RoadUser(driver, leg)
            self._users.append(user)
            self._on[leg].append(user)
            self._decide(user)
        self._outside = late

    def _decide(self, user: RoadUser) -> None:
        """Where it drives at the end of the lane on which it is; nowhere at the end of a road."""
        lane = user.legs[-1]
        onward = self.ways.onward(lane.way)
        if not onward:
            return
        if user.route:
            way = self.ways.way(lane.crosses or "", user.route.pop(0))
        else:
            way = onward[int(self._rng.integers(len(onward)))]
        onto = self.ways.lane(way, min(lane.lane, self.ways.lanes(way) - 1))
        user.legs += [self.ways.through(lane, onto), onto]

    def _sort(self) -> None:
        self._on.clear()
        for user in self._users:
            self._on[user.legs[0]].append(user)
        for users in self._on.values():
            users.sort(key=lambda user: user.along_m)

    def _ahead(self, user: RoadUser) -> tuple[RoadUser | None, float]:
        """The next vehicle on the way and the room up to it, m."""
        base = -user.along_m
        for number, leg in enumerate(user.legs):
            for other in self._on.get(leg, ()):
                if (number or other.along_m > user.along_m) and abs(other.aside_m - user.aside_m) < _BESIDE_M:
                    return other, base + other.along_m - (user.build.length_m + other.build.length_m) / 2.0
            base += leg.line.length_m
            if base > _SIGHT_M:
                break
        return None, inf

    def _acceleration(self, user: RoadUser) -> float:
        """m/s^2, of the driver model, within the limits of the road, the next vehicle and the crossing ahead."""
        build, speed = user.build, user.speed_m_s
        wish, before_m = min(user.driver.cruise_m_s, user.legs[0].limit_m_s), user.left_m
        for leg in user.legs[1:]:
            wish = min(wish, sqrt(leg.limit_m_s**2 + 2.0 * 0.7 * build.brakes_m_s2 * before_m))
            before_m += leg.line.length_m
        other, room_m = self._ahead(user)
        closing = speed - other.speed_m_s if other is not None else 0.0
        if user.waits_us is not None:
            stop_m = user.left_m - build.length_m / 2.0 + _STANDSTILL_M
            if stop_m < room_m:
                room_m, closing = stop_m, speed
        pressed = 0.0
        if room_m < inf:
            at_ease = 2.0 * sqrt(build.speeds_up_m_s2 * build.brakes_m_s2)
            safe_m = _STANDSTILL_M + max(0.0, speed * _HEADWAY_S + speed * closing / at_ease)
            pressed = (safe_m / max(room_m, 0.1)) ** 2
        free = 1.0 - (speed / max(wish, 0.1)) ** 4
        return max(-_HARDEST_M_S2, build.speeds_up_m_s2 * (free - pressed))

    def _give_crossings(self) -> None:
        """Give each crossing to those that come near, in the order in which they came near."""
        near = []
        for user in self._users:
            leg = user.legs[0]
            if leg.crossing is None and len(user.legs) > 1 and user not in self._given[leg.crosses or ""]:
                brakes_m = user.speed_m_s**2 / (1.4 * user.build.brakes_m_s2)
                if user.left_m < brakes_m + 2.0 * _MARGIN_M:
                    user.waits_us = self.now_us if user.waits_us is None else user.waits_us
                    near.append((user.waits_us, user.left_m, user))
        for _, _, user in sorted(near, key=lambda each: each[:2]):
            curve = user.legs[1]
            given = self._given[curve.crosses or ""]
            first = self._on[user.legs[0]][-1] is user
            if first and self._room_behind(user) and not any(self._blocks(at, curve, it) for it, at in given.items()):
                given[user] = curve
                user.waits_us = None

    def _blocks(self, taken: Leg, curve: Leg, holder: RoadUser) -> bool:
        if taken.way == curve.way and taken is not curve:
            return holder.legs[0] is not taken or holder.along_m < _MARGIN_M
        return self.ways.conflict(taken, curve)

    def _room_behind(self, user: RoadUser) -> bool:
        """Whether it would not have to stop in the crossing."""
        last = self._on.get(user.legs[2], ())
        needed_m = user.build.length_m + 2.0 * _STANDSTILL_M
        return not last or last[0].along_m - last[0].build.length_m / 2.0 > needed_m or last[0].speed_m_s > 4.0

    def _overtake(self, user: RoadUser) -> None:
        """Begin, continue or end an overtake; it is driven one lane to the left of the line."""
        leg, passed = user.legs[0], user.passing
        if passed is not None:
            past_m = user.along_m - passed.along_m - (user.build.length_m + passed.build.length_m) / 2.0
            if passed.legs[0] is not leg or past_m > _MARGIN_M / 1.5:
                user.passing = None
            return
        if not user.driver.passes or leg.crossing is not None or abs(user.aside_m) > 0.1:
            return
        other, room_m = self._ahead(user)
        if other is None or room_m > 3.0 * _MARGIN_M or other.legs[0] is not leg or other.passing is not None:
            return
        fast = min(user.driver.cruise_m_s, leg.limit_m_s)
        faster = fast - max(other.speed_m_s, 3.0)
        if faster < _WORTH_M_S or (other.speed_m_s < 3.0 and other.left_m < 4.0 * _MARGIN_M):
            return
        takes_s = (room_m + 2.0 * _MARGIN_M + user.build.length_m + other.build.length_m) / faster + 3.0
        if fast * takes_s < user.left_m - _MARGIN_M and self._left_is_free(user, fast * takes_s, takes_s):
            user.passing = other

    def _left_is_free(self, user: RoadUser, reach_m: float, takes_s: float) -> bool:
        leg = user.legs[0]
        if leg.lane:
            beside = self._on.get(self.ways.lane(leg.way, leg.lane - 1), ())
            return all(abs(other.along_m - user.along_m) > 2.0 * _MARGIN_M for other in beside)
        facing = self.ways.lane(leg.way.back)
        oncoming = self._on.get(facing, ())
        free = all(
            facing.line.length_m - other.along_m < user.along_m - _MARGIN_M
            or facing.line.length_m - other.along_m > user.along_m + reach_m + other.speed_m_s * takes_s
            for other in oncoming
        )
        enters_m = leg.line.length_m - user.along_m
        same = self._on[leg]
        return free and enters_m > reach_m + leg.limit_m_s * takes_s and all(it.passing is None for it in same)

    def _move(self, user: RoadUser, acceleration: float) -> None:
        speed = max(0.0, user.speed_m_s + acceleration * _STEP_S)
        user.along_m += (user.speed_m_s + speed) / 2.0 * _STEP_S
        user.speed_m_s = speed
        aside = LANE_M if user.passing is not None else 0.0
        sideways = min(_SIDEWAYS_M_S, 0.3 * speed) * _STEP_S
        user.aside_m += max(-sideways, min(sideways, aside - user.aside_m))
        while user.left_m < 0.0:
            done = user.legs[0]
            if len(user.legs) == 1:
                self._users.remove(user)
                return
            user.along_m -= done.line.length_m
            user.passing = None
            del user.legs[0]
            if done.crossing is not None:
                self._decide(user)
        leg = user.legs[0]
        if leg.crossing is None and user.along_m > user.build.length_m / 2.0:
            behind = self.ways.network.links[leg.way.link].crossing_at(-leg.way.direction)
            self._given[behind or ""].pop(user, None)
