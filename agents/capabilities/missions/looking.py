"""The effects of an action, looked at before the action counts as done: `:locate` of an operator.

The unit looks straight down from where it is, and from above at an object that is not in view. The seen place counts,
whatever the effects say; an object that was not seen is a failure. Times of streams are federation time.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count
from typing import Final

import numpy as np

from dyknow.agents.capabilities.missions.command_run import VehicleCommand
from dyknow.agents.capabilities.missions.locating import SearchingUnit, UnitSights, other_things, wanted_colour
from dyknow.navigation.searching.landing import Drop, LandingPrior, landing
from dyknow.navigation.searching.search import SightSearch
from dyknow.planning.execution.events import ActionEnded, StartAction
from dyknow.planning.recovery.situation import objects_of

FIRST_LOOK: Final = 2_000_000
"""Flights to look are numbered from here on."""
RESTS_US: Final = 1_000_000
"""A released object lies still by then."""
NEAR_US: Final = 2_500_000
"""How long the object is looked for from the unit's place."""
ABOVE_US: Final = 4_000_000
"""How long it is looked for from above, once the unit is there."""
SETTLED_US: Final = 500_000
ABOVE_M: Final = 15.0
AROUND_SD_M: Final = 3.0
"""Standard deviation of the place of a located object, from below the unit."""
APART_M: Final = 0.5
"""A percept nearer to the place of another thing is that thing: boxes on a carrier stand close together."""


@dataclass(slots=True)
class _Look:
    start: StartAction
    name: str
    place: LandingPrior
    search: SightSearch
    begun_us: int
    looked_us: int
    step: int
    has_seen: bool = False
    climbs: bool = False
    why: str = ""
    above_us: int | None = None


class EffectLooks:
    """The looks of one mission."""

    def __init__(self, sights: UnitSights, units: Mapping[str, SearchingUnit]) -> None:
        self._sights, self._units = sights, units
        self._wanted: dict[int, StartAction] = {}
        self._looks: dict[int, _Look] = {}
        self._steps = count(FIRST_LOOK)

    def on_started(self, start: StartAction, now_us: int) -> None:
        """An action begins: percepts of the cameras are needed here when its commands are done."""
        if start.located:
            self._wanted[start.step] = start
            self._sights.look(start.unit, now_us, wanted=True)

    def on_performed(self, step: int, why: str, now_us: int, federation_us: int) -> ActionEnded | None:
        """Take the result of commands; returns the end of the action, unless its effects are looked at first."""
        look = next((each for each in self._looks.values() if each.step == step), None)
        if look is not None and look.climbs:
            look.why, look.above_us = why, federation_us
            return None
        start = self._wanted.pop(step, None)
        if start is None:
            return ActionEnded(step, not why, why)
        why = why or self._begin(start, now_us, federation_us)
        if why:
            self._sights.look(start.unit, now_us, wanted=False)
        return ActionEnded(step, succeeded=False, reason=why) if why else None

    def _begin(self, start: StartAction, now_us: int, federation_us: int) -> str:
        """Look from here; return why that is not possible, empty if it is."""
        objects = {objects_of(label) for label in start.located}
        place = self._sights.place(start.unit)
        if len(start.located) != 2 or len(objects) != 1 or place is None:
            labels = ", ".join(start.located)
            return (
                f"the place of {start.unit} is not known" if place is None else f"{labels}: not metres east and north"
            )
        (name,) = objects.pop()
        around = landing(Drop(*place, 0.0, place_sd_m=AROUND_SD_M))
        others = other_things(start.located, {name, start.unit}, start.values)
        search = SightSearch(around, others, wanted_colour(name, start.values), near_m=APART_M)
        from_us, step = federation_us + RESTS_US, next(self._steps)
        self._looks[start.step] = _Look(start, name, around, search, from_us, from_us, step)
        self._units[start.unit].perform(step, f"looks at {name}", (VehicleCommand("look-down"),), now_us)
        return ""

    def abort(self, step: int, now_us: int) -> None:
        """The plan is left."""
        start = self._wanted.pop(step, None) or (self._looks[step].start if step in self._looks else None)
        self._looks.pop(step, None)
        if start is not None:
            self._sights.look(start.unit, now_us, wanted=False)

    def end(self, now_us: int) -> None:
        """The mission is over, or waits."""
        for step in (*self._wanted, *self._looks):
            self.abort(step, now_us)

    def step(self, now_us: int, federation_us: int) -> list[ActionEnded]:
        """Look on (node clock, federation time): actions that have ended."""
        found = []
        for look in list(self._looks.values()):
            ended = self._step(look, now_us, federation_us)
            if ended is not None:
                self.abort(look.start.step, now_us)
                found.append(ended)
        return found

    def _step(self, look: _Look, now_us: int, federation_us: int) -> ActionEnded | None:
        start = look.start
        unit = self._units[start.unit]
        if unit.lost or unit.waits:
            return ActionEnded(start.step, succeeded=False, reason=f"{start.unit}: {unit.lost or unit.waits}")
        for valid_us, view_m, percepts in self._sights.looks(start.unit, look.looked_us, federation_us - SETTLED_US):
            nearest_first = sorted(percepts, key=lambda one: float(np.hypot(*(np.array(one[1:3]) - look.place.mean))))
            look.search.on_look(valid_us, view_m, nearest_first)
            look.looked_us, look.has_seen = valid_us, True
        found = look.search.found
        if found is not None:
            return ActionEnded(start.step, succeeded=True, seen=dict(zip(start.located, found[:2], strict=True)))
        if not look.climbs and federation_us - look.begun_us > NEAR_US + SETTLED_US:
            self._climb(look, now_us)
        elif look.climbs and look.why:
            return self._unseen(look, look.why)
        elif look.climbs and look.above_us is not None and federation_us - look.above_us > ABOVE_US + SETTLED_US:
            return self._unseen(look, "no percept" if look.has_seen else "no images come")
        return None

    def _climb(self, look: _Look, now_us: int) -> None:
        latitude_deg, longitude_deg, _ = self._sights.frame.from_ned(look.place.mean[1], look.place.mean[0], 0.0)
        above = VehicleCommand("goto", (latitude_deg, longitude_deg, ABOVE_M))
        look.climbs, look.step, look.above_us = True, next(self._steps), None
        unit, commands = self._units[look.start.unit], (VehicleCommand("look-down"), above)
        unit.perform(look.step, f"looks for {look.name}", commands, now_us)

    def _unseen(self, look: _Look, why: str) -> ActionEnded:
        reason = f"{look.name} is not seen where it was put down: {why}"
        return ActionEnded(look.start.step, succeeded=False, reason=reason)
