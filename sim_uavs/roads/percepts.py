"""Percepts as from a camera's tracker: noisy positions of visible vehicles, with gaps, misses and clutter.

Each time a vehicle comes into view it is a new percept, as for a tracker without memory.
"""

from collections.abc import Sequence
from math import cos, sin
from typing import Any, NamedTuple

from numpy.random import Generator

from dyknow.sim_uavs.roads.drivers import RoadState

Area = tuple[float, float, float, float]
"""West, south, east, north in metres."""


class Seeing(NamedTuple):
    """How vehicles are seen.

    Attributes:
        period_us: between two looks at all of them.
        sd_m: of the error of a position, on each axis; independent from look to look.
        seen_us, hidden_us: lengths of the visible and of the hidden part of the cycle; hidden 0: seen all the time.
        together: all cycles begin together with a visible part; else each is shifted by chance.
        overlooked: the share of looks at something visible that find nothing; the percept lives on.
        clutter_s: percepts of nothing that begin in a second.
        clutter_us: shortest and longest time that one of them lives.
        velocity_sd_m_s: of the error of a velocity; None: none is stated.
    """

    period_us: int = 100_000
    sd_m: float = 0.5
    seen_us: int = 3_000_000
    hidden_us: int = 2_000_000
    together: bool = False
    overlooked: float = 0.0
    clutter_s: float = 0.0
    clutter_us: tuple[int, int] = (100_000, 900_000)
    velocity_sd_m_s: float | None = None


class SeenPercept(NamedTuple):
    """A percept and the truth about it: `of` is the name of the vehicle, or None where there is nothing."""

    t_us: int
    percept: str
    of: str | None
    x_m: float
    y_m: float
    sd_m: float
    vx_m_s: float | None = None
    vy_m_s: float | None = None
    colour: str | None = None
    end: bool = False

    def record(self) -> dict[str, Any]:
        """The line of JSON that states it; the truth is not part of it."""
        line: dict[str, Any] = {"t_ms": self.t_us // 1000, "percept": self.percept, "type": "vision_percept"}
        if self.end:
            return {**line, "end": True}
        line |= {"x_m": round(self.x_m, 3), "y_m": round(self.y_m, 3), "sd_m": self.sd_m}
        optional = {"vx_m_s": self.vx_m_s, "vy_m_s": self.vy_m_s, "colour": self.colour}
        return line | {name: value for name, value in optional.items() if value is not None}


class _Clutter(NamedTuple):
    percept: str
    x_m: float
    y_m: float
    until_us: int


class PerceptSource:
    """Looks at vehicles, tick by tick; the same seed and the same truth give the same percepts.

    Args:
        area: where clutter appears.
    """

    def __init__(self, seeing: Seeing, area: Area, rng: Generator) -> None:
        self._seeing, self._area, self._rng = seeing, area, rng
        self._shifts: dict[str, int] = {}
        self._open: dict[str, str] = {}
        self._clutter: list[_Clutter] = []
        self._count = 0

    def visible(self, name: str, now_us: int) -> bool:
        """Whether the vehicle is in the visible part of its cycle."""
        seeing = self._seeing
        cycle_us = seeing.seen_us + seeing.hidden_us
        if not seeing.hidden_us:
            return True
        shift = self._shifts.get(name)
        if shift is None:
            drawn = 0 if seeing.together else int(self._rng.integers(cycle_us))
            shift = self._shifts[name] = drawn // seeing.period_us * seeing.period_us
        return (now_us + shift) % cycle_us < seeing.seen_us

    def look(self, states: Sequence[RoadState], now_us: int) -> list[SeenPercept]:
        """All percepts of one instant, those that end then included."""
        visible = {state.name: state for state in states if self.visible(state.name, now_us)}
        out = [self._end(now_us, self._open.pop(name), name) for name in list(self._open) if name not in visible]
        for name, state in visible.items():
            percept = self._open.get(name)
            if percept is None:
                percept = self._open[name] = self._name()
            if self._rng.random() >= self._seeing.overlooked:
                out.append(self._seen(state, percept, now_us))
        return out + self._cluttered(now_us)

    def _name(self) -> str:
        self._count += 1
        return f"vp{self._count}"

    def _end(self, now_us: int, percept: str, of: str | None) -> SeenPercept:
        return SeenPercept(now_us, percept, of, 0.0, 0.0, self._seeing.sd_m, end=True)

    def _seen(self, state: RoadState, percept: str, now_us: int) -> SeenPercept:
        seeing = self._seeing
        dx, dy, dvx, dvy = (float(x) for x in self._rng.standard_normal(4))
        vx = vy = None
        if seeing.velocity_sd_m_s is not None:
            vx = state.speed_m_s * cos(state.heading_rad) + seeing.velocity_sd_m_s * dvx
            vy = state.speed_m_s * sin(state.heading_rad) + seeing.velocity_sd_m_s * dvy
        x, y = state.x_m + seeing.sd_m * dx, state.y_m + seeing.sd_m * dy
        return SeenPercept(now_us, percept, state.name, x, y, seeing.sd_m, vx, vy)

    def _cluttered(self, now_us: int) -> list[SeenPercept]:
        seeing, rng = self._seeing, self._rng
        over = [each for each in self._clutter if each.until_us <= now_us]
        self._clutter = [each for each in self._clutter if each.until_us > now_us]
        west, south, east, north = self._area
        for _ in range(int(rng.poisson(seeing.clutter_s * seeing.period_us / 1e6))):
            lives_us = int(rng.integers(seeing.clutter_us[0], seeing.clutter_us[1] + 1))
            place = float(rng.uniform(west, east)), float(rng.uniform(south, north))
            self._clutter.append(_Clutter(self._name(), *place, now_us + lives_us))
        out = [self._end(now_us, each.percept, None) for each in over]
        for each in self._clutter:
            dx, dy = (float(x) for x in rng.standard_normal(2))
            place = each.x_m + seeing.sd_m * dx, each.y_m + seeing.sd_m * dy
            out.append(SeenPercept(now_us, each.percept, None, *place, seeing.sd_m))
        return out
