"""Vehicles that keep apart by the rule alone, in one process: each hears what the others say, and flies what it decides."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations
from math import hypot

from dyknow.agents.capabilities.separation.logic import STEPS, SeparationLogic
from dyknow.agents.capabilities.separation.neighbours import Neighbours
from dyknow.agents.capabilities.separation.situation import (
    Fly,
    GoOn,
    LeaveTo,
    Neither,
    Propose,
    Situation,
    Step,
)
from dyknow.agents.places import Fix
from dyknow.navigation.intents.intent import IntendedPlace, Intent, IntentEnding, IntentSource, RightOfWay
from dyknow.navigation.intents.path import FlatMotion, FlatOrigin, FlatPlace, Performance, fly

ORIGIN = FlatOrigin.at(58.0, 15.0)
DT_S = 0.1
FLOOR_M, CEILING_M = 15.0, 120.0


@dataclass
class Flyer:
    """One vehicle: it flies to `goal`, unless its platform decides otherwise.

    Attributes:
        cannot: why it may not be commanded; silent_s: since when it says nothing; refuses: its autopilot does.
        steps: what its platform decided, and when.
    """

    unit: str
    motion: FlatMotion
    goal: FlatPlace
    speed_m_s: float = 5.0
    cannot: str = ""
    silent_s: float = 1e9
    refuses: bool = False
    ceiling_m: float = CEILING_M
    logic: SeparationLogic = field(init=False)
    others: Neighbours = field(default_factory=Neighbours)
    flown: tuple[FlatPlace, ...] | None = None
    steps: list[tuple[float, Step]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.logic = SeparationLogic(self.unit)

    @property
    def performance(self) -> Performance:
        return Performance(self.speed_m_s, 2.5, 1.5, 1.0, 0.5)

    def intent(self, at_us: int) -> Intent:
        m, places = self.motion, (self.goal,) if self.flown is None else self.flown
        rank = RightOfWay.CANNOT if self.cannot else RightOfWay.NAMED if self.flown is None else RightOfWay.COMMITTED
        legs = tuple(IntendedPlace(*ORIGIN.degrees(p.north_m, p.east_m), p.altitude_m) for p in places)
        source = IntentSource.ORDER if self.flown is None else IntentSource.MANOEUVRE
        return Intent(
            at_us, *ORIGIN.degrees(m.north_m, m.east_m), m.altitude_m, m.north_m_s, m.east_m_s, -m.up_m_s,
            source, rank, legs, IntentEnding.HOVER, self.speed_m_s,
        )  # fmt: skip

    def situation(self, now_us: int) -> Situation:
        m = self.motion
        here = Fix(now_us, *ORIGIN.degrees(m.north_m, m.east_m), m.altitude_m)
        traffic = self.others.near(ORIGIN, here, self.speed_m_s, now_us, STEPS)
        rank = RightOfWay.CANNOT if self.cannot else RightOfWay.NAMED
        return Situation(
            now_us, rank, self.cannot, m, (self.goal,), IntentEnding.HOVER, self.performance, self.others.by_unit,
            traffic, lambda place, _before: FLOOR_M <= place.altitude_m <= self.ceiling_m,
        )  # fmt: skip

    def move(self) -> None:
        """A tenth of a second, as its autopilot flies it; a climb at once or along the line, by its name."""
        places = (self.goal,) if self.flown is None else self.flown
        tube = fly(self.motion, places, IntentEnding.HOVER, self.performance, 2)
        at = 3 if int(self.unit) % 2 else 2
        height = self.motion.altitude_m + (float(tube[at, 1] - tube[at, 0])) * DT_S / 0.5
        north, east = (float(each) for each in (tube[:2, 1] - tube[:2, 0]) / 0.5)
        self.motion = FlatMotion(
            self.motion.north_m + north * DT_S, self.motion.east_m + east * DT_S, height, north, east,
            (height - self.motion.altitude_m) / DT_S,
        )  # fmt: skip

    @property
    def is_there(self) -> bool:
        m, goal = self.motion, self.goal
        return (
            hypot(m.north_m - goal.north_m, m.east_m - goal.east_m) < 3.0 and abs(m.altitude_m - goal.altitude_m) < 2.0
        )


class Airspace:
    """Several of them; `invariants` is called after every step."""

    def __init__(self, flyers: Sequence[Flyer]) -> None:
        self.flyers, self.now_s = list(flyers), 0.0
        self.least_m, self.arrived_s = float("inf"), dict[str, float]()

    def run(self, seconds: float) -> None:
        """Until then, or until all are there and none gives way."""
        while self.now_s < seconds and len(self.arrived_s) < len(self.flyers):
            self._step()

    def _step(self) -> None:
        now_us = round(self.now_s * 1e6)
        by_unit = {each.unit: each for each in self.flyers}
        if round(self.now_s * 10) % 5 == 0:
            for one in self.flyers:
                if self.now_s < one.silent_s:
                    for other in self.flyers:
                        if other is not one:
                            other.others.take(one.unit, one.intent(now_us), now_us)
        for one in self.flyers:
            if self.now_s >= one.silent_s:
                continue
            for step in one.logic.look(one.situation(now_us)):
                one.steps.append((self.now_s, step))
                self._carry_out(one, step, by_unit, now_us)
        for one in self.flyers:
            one.move()
        self.now_s += DT_S
        for a, b in combinations(self.flyers, 2):
            p, q = a.motion, b.motion
            self.least_m = min(
                self.least_m, hypot(p.north_m - q.north_m, p.east_m - q.east_m, p.altitude_m - q.altitude_m)
            )
        for one in self.flyers:
            if one.is_there and one.flown is None:
                self.arrived_s.setdefault(one.unit, self.now_s)

    def _carry_out(self, one: Flyer, step: Step, by_unit: dict[str, Flyer], now_us: int) -> None:
        match step:
            case Propose(unit, _):
                if self.now_s < by_unit[unit].silent_s:
                    for begun in one.logic.on_agreed(unit, now_us):
                        one.steps.append((self.now_s, begun))
                        self._carry_out(one, begun, by_unit, now_us)
            case Fly():
                if one.refuses:
                    one.logic.on_not_flown("autopilot: denied", now_us, overtaken=True)
                elif one.logic.manoeuvre is not None:
                    one.flown = one.logic.manoeuvre.places
            case GoOn():
                one.flown = None
            case LeaveTo(unit, reason):
                other = by_unit[unit]
                known = other.others.by_unit.get(one.unit)
                if known is None or self.now_s >= other.silent_s:
                    return
                known.cannot, known.cannot_us = reason, now_us
                refused = other.logic.on_left(one.unit, other.situation(now_us))
                if refused is not None:
                    for again in one.logic.on_left_refused(unit, refused, one.situation(now_us)):
                        one.steps.append((self.now_s, again))

    def told(self, unit: str) -> list[tuple[float, Neither]]:
        """When that one was told that neither can avoid the other."""
        (one,) = (each for each in self.flyers if each.unit == unit)
        return [(at_s, step) for at_s, step in one.steps if isinstance(step, Neither)]
