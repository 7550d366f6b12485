"""The other vehicles as traffic: where each was to be by its newest intent, grown while it is silent, bounded where it lies.

A member that is silent, in the air, stays traffic, by its intent and its contingency, wider by half a metre a second,
until it is heard again, is seen on the ground, or its battery must be empty. The motion of a member without intent
stands for it.
Federation time.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import hypot
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from dyknow.agents.places import Fix
from dyknow.navigation.geodesy import distance_m
from dyknow.navigation.intents.intent import Intent, IntentEnding, IntentSource, RightOfWay
from dyknow.navigation.intents.path import STEP_S, STEPS, FlatOrigin, Tube, contingent, later, nominal, resumed

SILENT_US: Final = 2_000_000
"""Time without an intent or position after which a member is silent: two intents a second are due."""
GROWS_M_S, GROWS_MOST_M = 0.5, 25.0
FORGOTTEN_US: Final = 1_800_000_000
"""By then the battery of a copter is empty."""
MOST_OWN_M: Final = 30.0
"""No vehicle claims more room for itself than that: wider claims are cut down to it."""
LEAP_M, LEAP_M_S = 50.0, 60.0
CREDIBLE_US: Final = 3_000_000
FORMER_US: Final = 20_000_000
"""How long the place of a vehicle without its leap is kept clear, too: the leap may be false."""
CONTRADICTIONS: Final = 3
"""Looks running in which positions contradict an intent, or come without one, before they stand for it: one may be an outlier."""
RESUMES_S: Final = tuple(float(after_s) for after_s in range(0, 33, 4))
"""When a vehicle that is silent since a manoeuvre may fly its own way again, after that was published: each is kept away from."""
RESUMED_STEPS: Final = 400
"""Such a way is flown ahead for 200 s; after that the vehicle is taken to stand there, as wide as it has grown."""
APART_M, APART_UP_M, MOVES_M_S, ASTRAY_M_S = 25.0, 12.0, 3.0, 6.0
"""How far apart position and intent of one moment may be, and how much more for each second between them."""
"""A vehicle that has leapt is traffic where it was last until it has been credible for so long."""
ALTITUDE_LEAP_M, ALTITUDE_LEAP_M_S = 6.0, 12.0
WORD_US: Final = 1_000_000
"""An intent that is so much newer takes back that its vehicle cannot avoid another."""
MOST: Final = 256
_LONGEST: Final = 3600
"""Half an hour: by then it stands where its legs end."""


@dataclass(slots=True)
class Neighbour:
    """One other vehicle.

    Attributes:
        intent: its newest word; heard_us: when that, or its position, came.
        has_intent: whether it is taken by an intent of its own; False: by its positions.
        contradicted: how many looks its positions have contradicted its intent; belied_us: when its positions last
        contradicted its intent; it is taken by them until that is `CREDIBLE_US` ago.
        leapt_us: when it was last somewhere where no vehicle gets so fast; the intent before stands then.
        former: its intent before it leapt, or was elsewhere after a silence, and when that came: it stands, too, until
            `former_until_us`.
        own_way: its newest word that was no manoeuvre.
        cannot: why it does not avoid us, in its own words, since `cannot_us`; empty: it has reported nothing of the kind.
    """

    unit: str
    intent: Intent
    heard_us: int
    has_intent: bool = True
    leapt_us: int | None = None
    belied_us: int | None = None
    contradicted: int = 0
    candidate: Intent | None = None
    cannot: str = ""
    cannot_us: int = 0
    former: tuple[Intent, int] | None = None
    former_until_us: int = 0
    own_way: Intent | None = None
    _tubes: list[Tube] = field(default_factory=list)
    _resumed: list[Tube] = field(default_factory=list)
    _of: tuple[Intent, FlatOrigin, int] | None = None

    def is_silent(self, now_us: int) -> bool:
        return now_us - self.heard_us > SILENT_US

    def age_s(self, now_us: int) -> float:
        return max(0.0, (now_us - self.intent.at_us) / 1e6)

    def rank(self, now_us: int) -> RightOfWay:
        """Its right of way: a vehicle that is silent, or has published no intent, cannot be requested to yield."""
        if not self.has_intent or self.cannot or self.is_silent(now_us) or self.leapt_us is not None:
            return RightOfWay.CANNOT
        return self.intent.rank

    def keep_former(self, now_us: int) -> None:
        """Keep the present intent for `FORMER_US` next to newer ones, which may be wrong."""
        if self.former is None or now_us > self.former_until_us:
            self.former = self.intent, self.heard_us
        self.former_until_us = now_us + FORMER_US

    def tubes(self, origin: FlatOrigin, now_us: int, steps: int) -> list[tuple[Tube, bool]]:
        """Where it will be from now on, each with whether that counts while it is heard: as it has published, as its autopilot flies it
        on a lost link, and as it would be if it had not leapt.
        """
        of_former = self._of_former(origin, now_us, steps)
        return [*self._of_intent(origin, now_us, steps), *([] if of_former is None else [(of_former, True)])]

    def _of_former(self, origin: FlatOrigin, now_us: int, steps: int) -> Tube | None:
        if self.former is None or now_us > self.former_until_us:
            return None
        intent, heard_us = self.former
        tube = tube_of(intent, origin, now_us, steps)
        _grow(tube, (now_us - heard_us - SILENT_US) / 1e6)
        return tube

    def _of_intent(self, origin: FlatOrigin, now_us: int, steps: int) -> list[tuple[Tube, bool]]:
        age_s = self.age_s(now_us)
        needed = min(_LONGEST, STEPS * (1 + (steps + int(age_s / STEP_S)) // STEPS))
        if self._of is None or self._of[0] is not self.intent or self._of[1] is not origin or self._of[2] < needed:
            other = contingent(self.intent, origin, needed)
            self._tubes = [nominal(self.intent, origin, needed), *([] if other is None else [other])]
            self._of, self._resumed = (self.intent, origin, needed), []
        found = [later(tube, age_s, steps) for tube in self._tubes]
        for tube in found:
            _grow(tube, (now_us - self.heard_us - SILENT_US) / 1e6)
        silent = self.is_silent(now_us)
        if silent and self.own_way is not None and self.intent.source is IntentSource.MANOEUVRE:
            found += self._resuming(origin, now_us, needed, steps)
        return [(tube, at == 0 or silent) for at, tube in enumerate(found)]

    def _resuming(self, origin: FlatOrigin, now_us: int, needed: int, steps: int) -> list[Tube]:
        """A manoeuvre ends at an unknown time, and the vehicle flies its own way again."""
        own_way, age_s = self.own_way, self.age_s(now_us)
        if not self._resumed and own_way is not None:
            steps_ahead = min(needed, RESUMED_STEPS)
            self._resumed = [resumed(self.intent, own_way, origin, after_s, steps_ahead) for after_s in RESUMES_S]
        found = [later(tube, age_s, steps) for tube in self._resumed]
        for tube in found:
            _grow(tube, (now_us - self.heard_us - SILENT_US) / 1e6)
        return found

    def say(self, intent: Intent, now_us: int) -> None:
        """Take its newest intent, which is believed."""
        self.intent, self.heard_us = intent, now_us
        if intent.source is not IntentSource.MANOEUVRE:
            self.own_way = intent


def _grow(tube: Tube, silent_s: float) -> None:
    """Widen a tube of a vehicle that has been silent for so long."""
    if silent_s > 0.0:
        tube[4] += np.minimum(GROWS_MOST_M, GROWS_M_S * (silent_s + np.arange(tube.shape[1]) * STEP_S))


def tube_of(intent: Intent, origin: FlatOrigin, now_us: int, steps: int) -> Tube:
    """Where its vehicle is from now on, however old the intent is."""
    age_s = max(0.0, (now_us - intent.at_us) / 1e6)
    return later(nominal(intent, origin, min(_LONGEST, steps + int(age_s / STEP_S) + 1)), age_s, steps)


class Traffic3D(NamedTuple):
    """The tubes of several neighbours: an array of (K, 5, steps), with whose each is, and whether it counts.

    The way of an autopilot on a lost link counts for planning alone while its vehicle is heard.
    """

    tubes: npt.NDArray[np.float64]
    units: tuple[str, ...]
    counts: tuple[bool, ...]


class Neighbours:
    """All other vehicles. Every method takes federation time."""

    def __init__(self) -> None:
        self.by_unit: dict[str, Neighbour] = {}
        self.left_out: dict[str, int] = {}

    def take(self, unit: str, intent: Intent, now_us: int) -> str | None:
        """An intent that a member has published; returns in words why it is not believed, the first time."""
        intent = _bounded(intent)
        known = self.by_unit.get(unit)
        if known is not None and known.belied_us is not None and now_us - known.belied_us < CREDIBLE_US:
            known.candidate = intent
            return None
        if known is None or not known.has_intent:
            self._put(Neighbour(unit, intent, now_us))
            self.by_unit[unit].say(intent, now_us)
            return None
        if intent.at_us < known.intent.at_us:
            return None
        if (
            known.is_silent(now_us)
            and known.leapt_us is None
            and known.candidate is None
            and _is_astray(known.intent, intent)
        ):
            known.keep_former(now_us)
        leap = leap_of(known.candidate or known.intent, intent)
        if leap is None and known.candidate is None:
            if intent.rank is not RightOfWay.CANNOT and intent.at_us > known.cannot_us + WORD_US:
                known.cannot = ""
            known.say(intent, now_us)
            return None
        known.candidate = intent
        if leap is not None:
            is_news, known.leapt_us = known.leapt_us is None, now_us
            self.left_out["leap"] = self.left_out.get("leap", 0) + 1
            return f"{unit} {leap}: it is taken to be where it was until it is credible" if is_news else None
        if known.leapt_us is None or now_us - known.leapt_us >= CREDIBLE_US:
            known.keep_former(now_us)
            known.say(intent, now_us)
            known.candidate = known.leapt_us = None
        return None

    def see(self, unit: str, fix: Fix, now_us: int, radius_m: float = 1.0, half_height_m: float = 0.5) -> str | None:
        """Where a member is by its positions: they count where it publishes no intent, or one that they contradict.

        Returns that contradiction in words, the first time.
        """
        known, problem = self.by_unit.get(unit), None
        is_fresh, is_mute = now_us - fix.valid_us <= SILENT_US, False
        if known is None and not is_fresh:
            return None
        if known is not None:
            if is_fresh and (known.has_intent or known.candidate is not None):
                problem = contradiction(known.candidate or known.intent, fix)
                is_mute = (
                    known.has_intent and known.leapt_us is None and known.intent.is_airborne and known.is_silent(now_us)
                )
            known.contradicted = known.contradicted + 1 if problem is not None or is_mute else 0
            if known.has_intent and known.contradicted < CONTRADICTIONS:
                return None
        intent = Intent(
            fix.valid_us, fix.latitude_deg, fix.longitude_deg, fix.altitude_m, fix.north_m_s, fix.east_m_s,
            fix.down_m_s, IntentSource.STRAIGHT, RightOfWay.CANNOT, (), IntentEnding.OPEN,
            radius_m=min(MOST_OWN_M, radius_m), half_height_m=min(MOST_OWN_M, half_height_m),
        )  # fmt: skip
        if known is None:
            known = Neighbour(unit, intent, now_us, has_intent=False)
            self._put(known)
        elif known.has_intent or fix.valid_us > known.intent.at_us:
            known.candidate = known.intent if known.has_intent and problem is not None else known.candidate
            known.intent, known.heard_us, known.has_intent, known.leapt_us = intent, now_us, False, None
        if problem is None:
            return None
        is_news, known.belied_us = known.belied_us is None, now_us
        self.left_out["contradiction"] = self.left_out.get("contradiction", 0) + 1
        return (
            f"the positions of {unit} contradict its intent: {problem}; it is taken by its positions"
            if is_news
            else None
        )

    def _put(self, neighbour: Neighbour) -> None:
        self.by_unit.pop(neighbour.unit, None)
        while len(self.by_unit) >= MOST:
            first = min(self.by_unit.values(), key=lambda each: (each.intent.is_airborne, each.heard_us))
            del self.by_unit[first.unit]
        self.by_unit[neighbour.unit] = neighbour

    def forget(self, unit: str) -> None:
        self.by_unit.pop(unit, None)

    def expire(self, now_us: int) -> None:
        """Forget those whose battery must be empty, and those on the ground that are silent."""
        for unit, each in list(self.by_unit.items()):
            if now_us - each.heard_us > FORGOTTEN_US or (not each.intent.is_airborne and each.is_silent(now_us)):
                del self.by_unit[unit]

    def airborne(self) -> Iterable[Neighbour]:
        return [each for each in self.by_unit.values() if each.intent.is_airborne]

    def near(self, origin: FlatOrigin, own: Fix, speed_m_s: float, now_us: int, steps: int) -> Traffic3D:
        """The tubes of all that may come near within the steps."""
        tubes: list[Tube] = []
        units: list[str] = []
        counting: list[bool] = []
        seconds = steps * STEP_S
        for each in self.airborne():
            intent = each.intent
            away_m = distance_m(own.latitude_deg, own.longitude_deg, intent.latitude_deg, intent.longitude_deg)
            fastest_m_s = max(intent.speed_m_s, hypot(intent.north_m_s, intent.east_m_s), 5.0)
            reach_m = (speed_m_s + fastest_m_s) * (seconds + min(each.age_s(now_us), 60.0)) + 100.0
            if away_m > reach_m and each.former is None:
                continue
            for tube, counts in each.tubes(origin, now_us, steps):
                tubes.append(tube)
                units.append(each.unit)
                counting.append(counts)
        stacked = np.stack(tubes) if tubes else np.empty((0, 5, steps))
        return Traffic3D(stacked, tuple(units), tuple(counting))


def _bounded(intent: Intent) -> Intent:
    return intent._replace(
        radius_m=min(MOST_OWN_M, intent.radius_m), half_height_m=min(MOST_OWN_M, intent.half_height_m)
    )


def contradiction(intent: Intent, fix: Fix) -> str | None:
    """Whether a vehicle is somewhere else than its intent has it, or flies and claims to be on the ground, in words."""
    if not intent.is_airborne:
        moves_m_s = hypot(fix.speed_m_s, fix.down_m_s)
        return f"it flies at {moves_m_s:.0f} m/s, and claims to be on the ground" if moves_m_s > MOVES_M_S else None
    seconds = abs(fix.valid_us - intent.at_us) / 1e6
    away_m = distance_m(intent.latitude_deg, intent.longitude_deg, fix.latitude_deg, fix.longitude_deg)
    if away_m > APART_M + (max(intent.speed_m_s, hypot(intent.north_m_s, intent.east_m_s)) + ASTRAY_M_S) * seconds:
        return f"they are {away_m:.0f} m apart"
    up_m = abs(intent.altitude_m - fix.altitude_m)
    if up_m > APART_UP_M + ALTITUDE_LEAP_M_S * seconds:
        return f"they are {up_m:.0f} m apart in height"
    return None


def _is_astray(before: Intent, after: Intent) -> bool:
    """Whether one that was silent is far from where its intent had it."""
    origin = FlatOrigin.at(after.latitude_deg, after.longitude_deg)
    north_m, east_m, low_m, high_m, radius_m = tube_of(before, origin, after.at_us, 1)[:, 0]
    up_m = max(low_m - after.altitude_m, after.altitude_m - high_m)
    return bool(hypot(north_m, east_m) > APART_M + radius_m or up_m > APART_UP_M)


def leap_of(before: Intent, after: Intent) -> str | None:
    """Whether position or altitude has changed as that of no aircraft does, in words."""
    seconds = max(0.0, (after.at_us - before.at_us) / 1e6)
    away_m = distance_m(before.latitude_deg, before.longitude_deg, after.latitude_deg, after.longitude_deg)
    if away_m > LEAP_M + LEAP_M_S * seconds:
        return f"has leapt by {away_m:.0f} m"
    up_m = abs(after.altitude_m - before.altitude_m)
    if up_m > ALTITUDE_LEAP_M + ALTITUDE_LEAP_M_S * seconds:
        return f"has leapt by {up_m:.0f} m in height"
    return None
