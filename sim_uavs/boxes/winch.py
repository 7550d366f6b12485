"""A winch with an electromagnet at the end of its line, on one simulated UAV. Stepped with the flight; no protocol.

The line is let out and wound in; a thing on the magnet hangs on it, swings, and stands on the ground when the line is
slack. A magnet that is on takes what it touches.
"""

from enum import Enum
from math import hypot
from typing import Final

import numpy as np

from dyknow.sim_uavs.boxes.bodies import BUILDS, STEP_US, Place
from dyknow.sim_uavs.boxes.handled import Handling, Placed, within_reach
from dyknow.sim_uavs.boxes.shared import SharedBoxes
from dyknow.sim_uavs.dynamics.quadcopter import GRAVITY_M_S2, Body
from dyknow.sim_uavs.dynamics.slung import HoistFaults

REACH_M: Final = 1.5
"""How far aside of the hook a thing may be that the magnet draws to itself: the line gives way."""
LONGEST_M: Final = 30.0
TELL_US: Final = 500_000
"""How often a UAV notes where it carries a thing."""
_STEP_S: Final = STEP_US / 1e6
_GAIN_PER_S: Final = 1.0
_DAMPING_PER_S: Final = 0.5
_LEAST_SWING_M: Final = 0.5
_MISPLACED_RNG: Final = 42


class LineControl(Enum):
    RELAXED = 0
    LENGTH = 1
    RATE = 2


class MagnetHoist:
    """Of the UAV `name`.

    Args:
        home: the vehicle's home from the origin of the things, metres east and north.

    Attributes:
        rate_m_s: the fastest that the line moves.
        faults: its faults.
        line_m, speed_m_s: of the line; positive: it is let out.
        magnet: whether it is on.
        held: the thing on its magnet.
    """

    def __init__(self, name: str, boxes: SharedBoxes, home: tuple[float, float] = (0.0, 0.0), seed: int = 0) -> None:
        self.name, self.rate_m_s, self.faults = name, 1.0, HoistFaults()
        self.line_m, self.speed_m_s, self.magnet = 1.0, 0.0, False
        self.held: str | None = None
        self._boxes, self._home = boxes, home
        self._rng = np.random.default_rng((seed, _MISPLACED_RNG))
        self._control, self._wanted = LineControl.RELAXED, 0.0
        self._swing, self._swung = (0.0, 0.0), (0.0, 0.0)
        self._is_slack = False
        self._place: Place = (0.0, 0.0, 0.0)
        self._velocity: Place = (0.0, 0.0, 0.0)
        self._told_us = 0

    @property
    def load_kg(self) -> float:
        """The mass on the line; 0 while it is slack."""
        return 0.0 if self.held is None or self._is_slack else self._boxes.world.load_kg(self.held)

    def relax(self) -> None:
        """Stop the motor."""
        self._control = LineControl.RELAXED

    def let_out(self, length_m: float) -> float:
        """Let out so much more than is out now; negative: wind in. The length that it will be."""
        self._control, self._wanted = LineControl.LENGTH, self.line_m + length_m
        return self._wanted

    def let_out_at(self, speed_m_s: float) -> None:
        self._control, self._wanted = LineControl.RATE, speed_m_s

    def grip(self) -> None:
        """Switch the magnet on."""
        self.magnet = True

    def release(self, now_us: int) -> None:
        """Switch the magnet off: its thing falls."""
        self.magnet = False
        self.drop(now_us)

    def drop(self, now_us: int) -> None:
        """Lose what is held."""
        if self.held is None:
            return
        x, y, up = self._place
        if self.faults.misplaces_m:
            turn = self._rng.uniform(0.0, 2.0 * np.pi)
            x, y = x + self.faults.misplaces_m * np.cos(turn), y + self.faults.misplaces_m * np.sin(turn)
        self._boxes.do(Handling(now_us, "release", self.held, self.name, (float(x), float(y), up), self._velocity))
        self.held = None

    def step(self, body: Body, now_us: int) -> None:
        """20 ms, the vehicle being where `body` is then."""
        self._wind()
        if self.held is not None:
            self._carry(body, now_us)
        elif self.magnet and not self.faults.grips_nothing:
            self._take(body, now_us)

    def _wind(self) -> None:
        speed = 0.0
        if self._control is LineControl.LENGTH:
            speed = _GAIN_PER_S * (self._wanted - self.line_m)
        elif self._control is LineControl.RATE:
            speed = self._wanted
        speed = min(max(speed, -self.rate_m_s), self.rate_m_s)
        before = self.line_m
        self.line_m = min(max(before + speed * _STEP_S, 0.0), LONGEST_M)
        self.speed_m_s = (self.line_m - before) / _STEP_S

    def _hook(self, body: Body) -> Place:
        return self._home[0] + body.position.east, self._home[1] + body.position.north, body.height_m - self.line_m

    def _take(self, body: Body, now_us: int) -> None:
        """Take the thing that the hook touches, if no other has taken it meanwhile."""
        found = within_reach(self._boxes.at(now_us), self._hook(body), REACH_M)
        if found is None or not self._boxes.do(Handling(now_us, "take", found.thing.name, self.name, found.place)):
            return
        self.held, self._told_us = found.thing.name, now_us
        self._is_slack = True
        self._place, self._velocity = found.place, (0.0, 0.0, 0.0)

    def _carry(self, body: Body, now_us: int) -> None:
        """Move what is held: under the hook, swinging, or dragged over what it stands on."""
        held = self.held
        if held is None:
            return
        x, y, up = self._hook(body)
        hangs_m = up - BUILDS[self._boxes.world.things[held].kind].top_m
        stands_m = self._support_m(held, now_us)
        was_slack, self._is_slack = self._is_slack, hangs_m <= stands_m
        if self._is_slack:
            x, y = self._dragged(x, y)
        else:
            if was_slack:
                self._swing, self._swung = (self._place[0] - x, self._place[1] - y), (0.0, 0.0)
            self._sway(body)
            x, y = x + self._swing[0], y + self._swing[1]
        was, self._place = self._place, (x, y, max(hangs_m, stands_m))
        vx, vy, vu = ((now - then) / _STEP_S for now, then in zip(self._place, was, strict=True))
        self._velocity = (vx, vy, vu)
        if now_us - self._told_us >= TELL_US:
            self._told_us = now_us
            if not self._boxes.do(Handling(now_us, "carry", held, self.name, self._place)):
                self.held = None

    def _support_m(self, held: str, now_us: int) -> float:
        """How high the things below would carry it: a carrier's deck, or the ground."""
        x, y, up = self._place
        if self._boxes.world.things[held].kind != "box" or up > 1.0:
            return 0.0
        under = (each for each in self._boxes.at(now_us) if each.build.deck_m and each.thing.name != held)
        return max((_deck_under(each, x, y) for each in under), default=0.0)

    def _dragged(self, x: float, y: float) -> tuple[float, float]:
        """A thing on a slack line stays where it stands until the hook is further away than it reaches."""
        from_x, from_y, _ = self._place
        away = hypot(x - from_x, y - from_y)
        share = max(0.0, 1.0 - REACH_M / away) if away else 0.0
        return from_x + share * (x - from_x), from_y + share * (y - from_y)

    def _sway(self, body: Body) -> None:
        """A pendulum below a moving point: small angles, damped."""
        pull = GRAVITY_M_S2 / max(self.line_m, _LEAST_SWING_M)
        along = body.acceleration.east, body.acceleration.north
        swung = tuple(
            speed + (-pull * off - drive - _DAMPING_PER_S * speed) * _STEP_S
            for off, speed, drive in zip(self._swing, self._swung, along, strict=True)
        )
        east, north = (off + speed * _STEP_S for off, speed in zip(self._swing, swung, strict=True))
        length = hypot(east, north)
        most = max(self.line_m, _LEAST_SWING_M)
        if length > most:
            east, north = east * most / length, north * most / length
        self._swing, self._swung = (east, north), (swung[0], swung[1])


def _deck_under(deck: Placed, x: float, y: float) -> float:
    half_m = deck.build.side_m / 2.0
    is_over = abs(x - deck.place[0]) <= half_m and abs(y - deck.place[1]) <= half_m
    return deck.place[2] + BUILDS[deck.thing.kind].deck_m if is_over and deck.holder is None else 0.0
