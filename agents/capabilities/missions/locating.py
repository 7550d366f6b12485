"""Objects that a mission has lost, looked for by sight: the unit that acted last on one flies over where it can lie.

The first place comes from the unit's position and velocity when its line became light (`navigation/searching`). The first
label of a lost object is its position east, the second one north, in metres. After a pause a search continues at the same
place. Times of streams are federation time.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Final, Protocol

import numpy as np

from dyknow import NO_VALUE, Sample, Value
from dyknow.agents.capabilities.flight.vehicle_streams import LOAD
from dyknow.agents.capabilities.missions.command_run import VehicleCommand
from dyknow.agents.capabilities.missions.sensing import HEIGHT, HELD_KG, MAX_DELAY_US, PERIOD_US, POSITION
from dyknow.agents.exchange.gateway import Gateway
from dyknow.agents.exchange.local_instance import LocalInstance
from dyknow.agents.exchange.subscription_keeper import SubscriptionKeeper
from dyknow.model.errors import DyknowError
from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.searching.landing import Drop, LandingPrior, landing
from dyknow.navigation.searching.search import PlacedPercept, SearchPlace, SightSearch
from dyknow.planning.execution import events
from dyknow.planning.recovery.situation import objects_of
from dyknow.planning.search.plans import PlannedAction

PERCEPTS: Final = "vision-percepts"
VIEW: Final = "camera-view"
COLOUR: Final = "colour"
"""The feature of an object that says by which colour detectors know it."""
LOOK_US: Final = 100_000
FIRST_STEP: Final = 1_000_000
"""Steps of searches are numbered from here on, those of plans below."""
NOTICED_US: Final = 5_000_000
"""A line that became light so long before is what the search is about."""
HANGS_M: Final = 0.4
"""The lower side of what hangs on a line is so far below its end."""
LAID_SD_M: Final = 3.0
"""Standard deviation of the place of an object that was not dropped: it lies near the vehicle."""
SETTLED_US: Final = 500_000
"""Images are looked at when their percepts have had so long to come."""
RESTS_US: Final = 3_000_000
"""A fallen object lies still by then: while it falls and slides images show it elsewhere."""
BLIND_US: Final = 15_000_000
"""A unit that shows no image for so long does not see."""


class SearchingUnit(Protocol):
    """A vehicle that can look."""

    waits: str
    lost: str

    @property
    def is_ready(self) -> bool: ...
    def perform(self, step: int, action: str, commands: tuple[VehicleCommand, ...], now_us: int) -> None: ...
    def hold(self, how: str, now_us: int, /) -> None: ...


class UnitSights:
    """The flights of vehicles, and the percepts of their cameras.

    Args:
        frame: of the mission's origin.
        platforms: by unit of the problem, the platform that has the vehicle.
    """

    def __init__(
        self,
        own: str,
        frame: LocalFrame,
        platforms: Mapping[str, str],
        gateway: Gateway,
        local: LocalInstance,
        keeper: SubscriptionKeeper,
    ) -> None:
        self._own, self.frame, self._platforms = own, frame, dict(platforms)
        self._gateway, self._local, self._keeper = gateway, local, keeper

    def need(self, now_us: int, *, wanted: bool) -> None:
        """Have the flights of other vehicles come, or no longer (node clock)."""
        for platform in sorted(set(self._platforms.values())):
            self._need(platform, {POSITION: PERIOD_US, HEIGHT: PERIOD_US}, now_us, wanted=wanted)

    def look(self, unit: str, now_us: int, *, wanted: bool) -> None:
        """Have what its cameras show come, or no longer (node clock)."""
        self._need(self._platforms[unit], {PERCEPTS: LOOK_US, VIEW: LOOK_US}, now_us, wanted=wanted)

    def _need(self, platform: str, labels: Mapping[str, int], now_us: int, *, wanted: bool) -> None:
        for label, period_us in labels.items() if platform != self._own else ():
            self._local.source(label, platform)
            self._keeper.need(platform, (label, period_us, MAX_DELAY_US), now_us, wanted=wanted)

    def drop(self, unit: str, federation_us: int) -> Drop | None:
        """How it flew when its line became light, or where it is, if it did not; None: that is not known."""
        platform = self._platforms[unit]
        held = [
            each
            for each in self._between(LOAD, platform, federation_us - NOTICED_US, federation_us)
            if each.value[0] >= HELD_KG
        ]
        at_us = held[-1].valid_us if held else federation_us
        flown = [
            (each.valid_us / 1e6, *self.frame.to_ned(each.value[0], each.value[1], 0.0)[:2])
            for each in self._between(POSITION, platform, at_us - NOTICED_US, at_us)[-4:]
        ]
        if not flown:
            return None
        _, y_m, x_m = flown[-1]
        heights = self._between(HEIGHT, platform, at_us - NOTICED_US, at_us)
        if not held or not heights:
            return Drop(x_m, y_m, 0.0, place_sd_m=LAID_SD_M)
        spans_s = flown[-1][0] - flown[0][0]
        vx_m_s, vy_m_s = ((x_m - flown[0][2]) / spans_s, (y_m - flown[0][1]) / spans_s) if spans_s > 0.0 else (0.0, 0.0)
        height_m = float(heights[-1].value[0]) - float(held[-1].value[1]) - HANGS_M
        return Drop(x_m, y_m, max(0.0, height_m), vx_m_s, vy_m_s)

    def place(self, unit: str) -> tuple[float, float] | None:
        """Where it is, metres east and north; None: that is not known."""
        try:
            sample = self._gateway.latest(POSITION, self._platforms[unit])
        except DyknowError:
            return None
        if sample.value is NO_VALUE:
            return None
        north_m, east_m, _ = self.frame.to_ned(sample.value[0], sample.value[1], 0.0)
        return float(east_m), float(north_m)

    def looks(self, unit: str, from_us: int, to_us: int) -> list[tuple[int, np.ndarray | None, list[PlacedPercept]]]:
        """The looks after one time, up to another: each time with the corners in view (4, 2), and percepts."""
        platform = self._platforms[unit]
        views = self._between(VIEW, platform, from_us - SETTLED_US, to_us)
        seen: dict[int, list[PlacedPercept]] = {each.valid_us: [] for each in views if each.valid_us > from_us}
        for each in self._between(PERCEPTS, platform, from_us + 1, to_us):
            symbol, x_m, y_m, sd_m, colour, is_end = each.value
            if not is_end:
                percept = PlacedPercept(symbol, x_m, y_m, sd_m, None if colour is NO_VALUE else colour)
                seen.setdefault(each.valid_us, []).append(percept)
        found = []
        for valid_us, percepts in sorted(seen.items()):
            before = [each for each in views if valid_us - SETTLED_US <= each.valid_us <= valid_us]
            found.append((valid_us, np.array(before[-1].value).reshape(4, 2) if before else None, percepts))
        return found

    def _between(self, label: str, platform: str, from_us: int, to_us: int) -> list[Sample]:
        """Samples as far as they are held, without those that have no value."""
        try:
            history = self._gateway.network.snapshot(self._gateway.local(label, platform))
            from_us = max(from_us, history.starts_us or 0)
            found = [] if to_us < from_us else self._gateway.between(label, from_us, to_us, to_us, platform)
        except DyknowError:
            return []
        return [each for each in found if each.value is not NO_VALUE]


def other_things(
    labels: Sequence[str], without: set[str], values: Mapping[str, Value]
) -> Iterable[tuple[float, float]]:
    """Places of other things, metres east and north, which are not what is looked for."""
    x_name, y_name = (label.partition("[")[0] for label in labels)
    for label, x_m in values.items():
        if label.partition("[")[0] == x_name and objects_of(label)[0] not in without:
            y_m = values.get(f"{y_name}[{objects_of(label)[0]}]")
            if isinstance(x_m, int | float) and isinstance(y_m, int | float):
                yield float(x_m), float(y_m)


def wanted_colour(name: str, values: Mapping[str, Value]) -> str | None:
    """By which detectors know it; None: that is not stated."""
    colour = values.get(f"{COLOUR}[{name}]")
    return colour if isinstance(colour, str) else None


@dataclass(slots=True)
class SoughtObject:
    """An object that is looked for, by which unit."""

    name: str
    labels: tuple[str, str]
    unit: str
    prior: LandingPrior
    search: SightSearch
    failed: set[str] = field(default_factory=set)
    there: SearchPlace | None = None
    step: int = 0
    stops: int = 0
    why: str = ""
    looked_us: int = 0
    saw_us: int = 0


class Locating:
    """The searches of one mission.

    Attributes:
        is_looking: whether units fly for it now.
        vague: the wanted objects without a colour in the problem.
    """

    def __init__(self, sights: UnitSights, units: Mapping[str, SearchingUnit]) -> None:
        self._sights, self._units = sights, units
        self._acted: dict[str, str] = {}
        self._sought: dict[str, SoughtObject] = {}
        self._wanted: list[str] = []
        self._refused = ""
        self._steps = count(FIRST_STEP)
        self._watched: str | None = None
        self.is_looking, self.vague = False, list[str]()

    def on_started(self, unit: str, action: PlannedAction) -> None:
        """A unit acts on objects: where they were thought to lie is of the past."""
        for name in action.objects:
            self._acted[name] = unit
            self._sought.pop(name, None)

    def locate(self, effect: events.Locate, federation_us: int) -> None:
        """Look for objects; searches that have begun continue, those that were in vain begin again where they began."""
        self.is_looking, self._refused, self._wanted = True, "", list(effect.objects)
        self.vague = [name for name in effect.objects if wanted_colour(name, effect.values) is None]
        for name in effect.objects:
            sought = self._sought.get(name)
            if sought is None or sought.search.is_exhausted:
                self._refused = self._refused or self._begin(name, effect, federation_us)
            else:
                sought.there, sought.looked_us, sought.saw_us, sought.why = None, federation_us, federation_us, ""

    def _begin(self, name: str, effect: events.Locate, federation_us: int) -> str:
        """Begin a search; return why it cannot be looked for, empty if it can."""
        labels = [label for label in effect.labels if objects_of(label) == (name,)]
        if len(labels) != 2:
            return (
                f"{name} cannot be looked for: its labels are {', '.join(labels) or 'none'}, not metres east and north"
            )
        unit, before = self._unit_for(name, ()), self._sought.get(name)
        prior = before.prior if before is not None else self._prior(self._acted.get(name) or unit, federation_us)
        if unit is None or prior is None:
            why = "no unit can look" if unit is None else f"the place of {unit} is not known"
            return f"{name} cannot be looked for: {why}"
        others = other_things(labels, {*effect.objects, unit}, effect.values)
        search = SightSearch(prior, others, wanted_colour(name, effect.values))
        self._sought[name] = SoughtObject(
            name, (labels[0], labels[1]), unit, prior, search, looked_us=federation_us + RESTS_US, saw_us=federation_us
        )
        return ""

    def _prior(self, unit: str | None, federation_us: int) -> LandingPrior | None:
        drop = None if unit is None else self._sights.drop(unit, federation_us)
        return None if drop is None else landing(drop)

    def _unit_for(self, name: str, failed: Iterable[str]) -> str | None:
        """The unit that acted last on it, or the first one that can look."""
        able = [unit for unit, each in self._units.items() if each.is_ready and not each.lost and unit not in failed]
        last = self._acted.get(name)
        return last if last in able else next(iter(able), None)

    def pause(self, now_us: int) -> None:
        """The mission does something else: units that look hold, those that their pilots have are left alone."""
        self.is_looking = False
        self._watch(None, now_us)
        for sought in self._sought.values():
            unit = self._units[sought.unit]
            if sought.there is not None and not unit.waits:
                unit.hold("loiter", now_us)
            sought.there = None

    def on_performed(self, step: int, why: str) -> bool:
        """Take the result of a flight; return whether it was one of a search."""
        for sought in self._sought.values():
            if sought.step == step:
                sought.why = why
        return step >= FIRST_STEP

    def step(self, now_us: int, federation_us: int) -> list[events.MissionEvent]:
        """Look on (node clock, federation time); returns the located objects, or why there are none."""
        if not self.is_looking:
            return []
        if self._refused:
            return [events.NotLocated(self._refused)]
        name = next((name for name in self._wanted if name in self._sought), None)
        return [] if name is None else self._look(self._sought[name], now_us, federation_us)

    def _look(self, sought: SoughtObject, now_us: int, federation_us: int) -> list[events.MissionEvent]:
        unit, search = self._units[sought.unit], sought.search
        if unit.waits:
            sought.looked_us = sought.saw_us = federation_us
            return []
        why = unit.lost or sought.why
        if not why and federation_us - sought.saw_us > BLIND_US:
            why = f"no images come for {BLIND_US // 1_000_000} s"
        if why:
            return self._hand_over(sought, why, now_us, federation_us)
        self._watch(sought.unit, now_us)
        for valid_us, view_m, percepts in self._sights.looks(sought.unit, sought.looked_us, federation_us - SETTLED_US):
            search.on_look(valid_us, view_m, percepts)
            sought.looked_us = valid_us
            sought.saw_us = federation_us
        if search.found is not None:
            return self._found(sought, now_us, federation_us)
        if search.is_exhausted:
            seen = f"{search.coverage:.0%} of where it can lie was in view"
            return [events.NotLocated(f"{sought.name} was not found from {sought.stops} places: {seen}")]
        if search.waypoint is not None and search.waypoint != sought.there:
            self._fly(sought, search.waypoint, now_us)
        return []

    def _found(self, sought: SoughtObject, now_us: int, federation_us: int) -> list[events.MissionEvent]:
        found = sought.search.found
        assert found is not None  # noqa: S101 - the caller has looked
        del self._sought[sought.name]
        self._watch(None, now_us)
        return [
            events.StateSampled(federation_us, dict(zip(sought.labels, (found.x_m, found.y_m), strict=True))),
        ]

    def _hand_over(self, sought: SoughtObject, why: str, now_us: int, federation_us: int) -> list[events.MissionEvent]:
        """Have another unit continue to look, if there is one."""
        sought.failed.add(sought.unit)
        self._watch(None, now_us)
        other = self._unit_for(sought.name, sought.failed)
        if other is None:
            sought.failed.clear()
            return [events.NotLocated(f"{sought.name} was not found: {sought.unit}: {why}")]
        sought.unit, sought.there, sought.why = other, None, ""
        sought.looked_us = sought.saw_us = federation_us
        return []

    def _fly(self, sought: SoughtObject, place: SearchPlace, now_us: int) -> None:
        latitude_deg, longitude_deg, _ = self._sights.frame.from_ned(place.y_m, place.x_m, 0.0)
        goto = VehicleCommand("goto", (latitude_deg, longitude_deg, place.height_m))
        climb = () if sought.there is not None else (VehicleCommand("take-off", (place.height_m,)),)
        down = VehicleCommand("look-down")
        sought.there, sought.step, sought.stops = place, next(self._steps), sought.stops + 1
        self._units[sought.unit].perform(sought.step, f"looks for {sought.name}", (down, *climb, goto), now_us)

    def _watch(self, unit: str | None, now_us: int) -> None:
        """Have what the cameras of one unit show come."""
        if unit == self._watched:
            return
        for each, wanted in ((self._watched, False), (unit, True)):
            if each is not None:
                self._sights.look(each, now_us, wanted=wanted)
        self._watched = unit
