"""Places of all boxes and carriers: a function of their first places, of the seed, and of the handlings. Pure.

A change to a thing is a `Handling`. All processes of a federation fold the same list of them, in its order, into the
same world: the first that takes a thing has it, and a thing that is let go falls for each of them in the same way.
"""

from collections.abc import Iterable, Sequence
from itertools import starmap
from math import hypot, isfinite
from typing import Final, Literal, NamedTuple

import numpy as np

from dyknow import US_PER_S
from dyknow.sim_uavs.boxes.bodies import BUILDS, STEP_US, Air, BodyBuild, Place, Surface, fall
from dyknow.sim_uavs.dynamics.slung import Thing

SILENT_US: Final = 3 * US_PER_S
"""A UAV that carries a thing notes its place, now and then; after so long without a note it has lost the thing."""
_SLOTS: Final = ((-0.6, -0.6), (0.6, -0.6), (-0.6, 0.6), (0.6, 0.6))
_FALLS_RNG: Final = 41  # keeps the generators of falls apart from others of the same seed


class Handling(NamedTuple):
    """Something that a UAV did with a thing.

    Attributes:
        at_us: federation time.
        what: it took it, carries it there, or let it go.
        by: the UAV.
        place: of the thing's lower side.
        velocity: metres per second, east, north and up.
    """

    at_us: int
    what: Literal["take", "carry", "release"]
    thing: str
    by: str
    place: Place
    velocity: Place = (0.0, 0.0, 0.0)

    @property
    def is_sound(self) -> bool:
        """Whether all its numbers are numbers that a place can have."""
        return all(isfinite(each) and abs(each) < 1e6 for each in (*self.place, *self.velocity))


class SeenThing(NamedTuple):
    """A thing as a camera sees it."""

    x_m: float
    y_m: float
    bottom_m: float
    length_m: float
    height_m: float
    colour: str


class Placed(NamedTuple):
    """A thing where it is at an instant: `holder` is the UAV it hangs from, `on` the carrier it stands on."""

    thing: Thing
    place: Place
    holder: str | None = None
    on: str | None = None
    is_moving: bool = False

    @property
    def build(self) -> BodyBuild:
        return BUILDS[self.thing.kind]

    @property
    def top_m(self) -> float:
        """How high above the ground the magnet takes hold of it."""
        return self.place[2] + self.build.top_m

    @property
    def seen(self) -> SeenThing:
        x, y, up = self.place
        return SeenThing(x, y, up, self.build.side_m, self.build.height_m, self.thing.colour)


class _State(NamedTuple):
    """The state of a thing since the last handling that changed it."""

    place: Place
    holder: str | None = None
    heard_us: int = 0
    on: str | None = None
    slot: int = 0
    since_us: int = 0
    path: tuple[Place, ...] = ()


class BoxWorld:
    """The things of a scenario.

    Args:
        seed: of how they fall.
    """

    def __init__(
        self, things: Iterable[Thing], seed: int, air: Air | None = None, surface: Surface | None = None
    ) -> None:
        self.things = {each.name: each for each in things}
        self._order = {name: number for number, name in enumerate(self.things)}
        self._seed, self._air, self._surface = seed, air or Air(), surface or Surface()
        self._states = {each.name: _State((each.x_m, each.y_m, 0.0)) for each in self.things.values()}
        self._now_us = 0

    def on_handling(self, handling: Handling) -> bool:
        """Take the next of the list; whether it was possible. An impossible one changes nothing."""
        thing = self.things.get(handling.thing)
        if thing is None or not handling.is_sound:
            return False
        self._now_us = max(self._now_us, handling.at_us)
        self._lose()
        state = self._states[thing.name]
        if handling.what == "take":
            if state.holder is not None or self._is_moving(state, self._now_us):
                return False
            self._states[thing.name] = _State(handling.place, handling.by, self._now_us)
            return True
        if state.holder != handling.by:
            return False
        if handling.what == "carry":
            self._states[thing.name] = state._replace(place=handling.place, heard_us=self._now_us)
        else:
            self._let_go(thing, handling.place, handling.velocity, self._now_us)
        return True

    def at(self, now_us: int) -> list[Placed]:
        """All things; a thing that hangs from a UAV is at the place that the UAV noted last."""
        if now_us > self._now_us + SILENT_US:
            self._now_us = now_us - SILENT_US
            self._lose()
        return list(starmap(self._placed, ((thing, now_us) for thing in self.things.values())))

    def load_kg(self, name: str) -> float:
        """The mass of a thing with the things on it."""
        onto = sum(BUILDS[self.things[other].kind].mass_kg for other, each in self._states.items() if each.on == name)
        return BUILDS[self.things[name].kind].mass_kg + onto

    def holder(self, name: str) -> str | None:
        return self._states[name].holder

    def _placed(self, thing: Thing, now_us: int) -> Placed:
        state = self._states[thing.name]
        if state.on is not None and state.on in self.things:
            x, y, up = self._placed(self.things[state.on], now_us).place
            off_x, off_y = _SLOTS[state.slot]
            deck_m = BUILDS[self.things[state.on].kind].deck_m
            place = (x + off_x, y + off_y, up + deck_m)
            if not self._is_moving(state, now_us):
                return Placed(thing, place, self._states[state.on].holder, state.on)
        if self._is_moving(state, now_us):
            step = max(0, (now_us - state.since_us) // STEP_US - 1)
            return Placed(thing, state.path[step], is_moving=True)
        return Placed(thing, state.place, state.holder)

    def _is_moving(self, state: _State, now_us: int) -> bool:
        return bool(state.path) and now_us < state.since_us + (len(state.path) + 1) * STEP_US

    def _lose(self) -> None:
        """Things that are no longer carried fall from their last place."""
        for name, state in list(self._states.items()):
            if state.holder is not None and self._now_us - state.heard_us > SILENT_US:
                self._let_go(self.things[name], state.place, (0.0, 0.0, 0.0), state.heard_us + SILENT_US)

    def _let_go(self, thing: Thing, place: Place, velocity: Place, at_us: int) -> None:
        rng = np.random.default_rng((self._seed, self._order[thing.name], at_us, _FALLS_RNG))
        decks = self._decks(at_us) if thing.kind == "box" else []

        def caught(at: Place) -> bool:
            return any(_is_over(deck, at) and at[2] <= deck.place[2] + deck.build.deck_m for deck, _ in decks)

        path = fall(BUILDS[thing.kind], place, velocity, rng, self._air, self._surface, caught)
        rests = path[-1] if path else place
        under = next((deck for deck in decks if rests[2] > 0.0 and _is_over(deck[0], rests)), None)
        on, slot = (None, 0) if under is None else (under[0].thing.name, under[1])
        self._states[thing.name] = _State(rests, on=on, slot=slot, since_us=at_us, path=tuple(path))

    def _decks(self, now_us: int) -> list[tuple[Placed, int]]:
        """Carriers that stand and have a place left, and which that is."""
        found = []
        for thing in self.things.values():
            deck = self._placed(thing, now_us)
            taken = {each.slot for each in self._states.values() if each.on == thing.name}
            free = [slot for slot in range(deck.build.capacity) if slot not in taken]
            if free and deck.holder is None and not deck.is_moving:
                found.append((deck, free[0]))
        return found


def _is_over(deck: Placed, place: Place) -> bool:
    half_m = deck.build.side_m / 2.0
    return abs(place[0] - deck.place[0]) <= half_m and abs(place[1] - deck.place[1]) <= half_m


def within_reach(placed: Sequence[Placed], hook: Place, reach_m: float) -> Placed | None:
    """The thing that the magnet of a hook takes: the nearest one that stands still and that the hook touches."""
    near = [
        (hypot(each.place[0] - hook[0], each.place[1] - hook[1]), number)
        for number, each in enumerate(placed)
        if each.holder is None and not each.is_moving and hook[2] <= each.top_m + 0.05
    ]
    found = min(near, default=None)
    return None if found is None or found[0] > reach_m else placed[found[1]]
