"""A simulated UAV over things that stand on the ground, some with a mark that can be seen from one side only."""

from collections.abc import Sequence
from math import atan2, hypot, pi
from typing import Any, NamedTuple

from dyknow import NO_VALUE
from dyknow.agents.effects import Fed, Reported
from dyknow.federation.messages.contents import (
    MissionEntry,
    MissionList,
    MissionQuery,
    ObjectEvents,
    ObjectList,
    TaskList,
    Tasks,
    WantObject,
)
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.navigation.vehicle import ImageReport
from tests.agents.capabilities.attention.chase import Chase, said

SEEN = """
sort vision-object(symbol in text, x_m in m, y_m in m, colour in text, mark in bool, end in bool)
sort car(symbol in text, x_m in m, y_m in m, colour in text, mark in bool, anchored in bool, end in bool)
source vision-object camera
compunit car WorldObject(vision-object)
strmgen percepts = camera
strmgen cars = link(percepts, WorldObject,
  eventually [1000, oo] true, eventually [0, 1000] xy_dist[from, to] < thresh, true)
"""
MARKED = 'colour[suspect] = "red" and mark[suspect]'
SEEN_M = 70.0


class Standing(NamedTuple):
    """Something on the ground, `x_m` east and `y_m` north of where the vehicle began; its mark is seen from that bearing."""

    x_m: float
    y_m: float
    colour: str | None = "red"
    mark_deg: float | None = None


class Field(Chase):
    """Percepts of what is within `seen_m` of the vehicle, and empty images of the ground that the camera shows."""

    def __init__(self, things: dict[str, Standing], seen_m: float = SEEN_M, **config: Any) -> None:
        super().__init__(SEEN, **config)
        self.things, self.seen_m = dict(things), seen_m
        self.hidden: set[str] = set()
        self.is_blind = False
        self._tracks: dict[str, str] = {}
        self._count = 0

    def pass_time(self, seconds: float) -> None:
        for _ in range(round(seconds * 10)):
            now_us = self.world.now_us
            if now_us % 200_000 == 0 and not self.is_blind:
                self.happens(Reported(now_us, ImageReport(now_us, ())))
            for number, (name, one) in enumerate(() if self.is_blind else sorted(self.things.items())):
                self._show(name, one, now_us + number)
            self.world.run_for(0.1)

    def _show(self, name: str, one: Standing, now_us: int) -> None:
        x_m, y_m = one.x_m + self.start_m[0], one.y_m + self.start_m[1]
        own_x_m, own_y_m = self.at_m
        is_seen = name not in self.hidden and hypot(own_x_m - x_m, own_y_m - y_m) <= self.seen_m
        track = self._tracks.get(name)
        if not is_seen:
            if track is not None:
                del self._tracks[name]
                self.happens(Fed(now_us, "camera", now_us, (track, x_m, y_m, NO_VALUE, NO_VALUE, True)))
            return
        if track is None:
            self._count += 1
            track = self._tracks[name] = f"vp{self._count}"
        mark: Any = NO_VALUE
        if one.mark_deg is not None:
            bearing_deg = atan2(own_x_m - x_m, own_y_m - y_m) * 180.0 / pi
            off_deg = abs((bearing_deg - one.mark_deg + 180.0) % 360.0 - 180.0)
            mark = True if off_deg < 50.0 and hypot(own_x_m - x_m, own_y_m - y_m) > 5.0 else NO_VALUE
        colour = NO_VALUE if one.colour is None else one.colour
        self.happens(Fed(now_us, "camera", now_us, (track, x_m, y_m, colour, mark, False)))

    def want(self, description: str = MARKED, recover: str = "yes", **more: Any) -> Dialogue:
        content = WantObject(symbol="suspect", type="cars", description=description, recover=recover, **more)
        return self.ask(content, 1.0)

    def until(self, dialogue: Dialogue, text: str, within_s: int = 200) -> list[str]:
        """What was told, once it has this."""
        for _ in range(within_s * 2):
            told = [each for _, each in said(dialogue)]
            if any(text in each for each in told):
                return told
            self.pass_time(0.5)
        raise AssertionError(f"not within {within_s} s: {said(dialogue)}")

    def tasks(self) -> Sequence[str]:
        ((_, listed),) = self.ask(Tasks(), 1.0).said
        assert isinstance(listed, TaskList)
        return [each.state for each in listed.tasks]

    def entry(self) -> MissionEntry:
        ((_, listed),) = self.ask(MissionQuery(), 1.0).said
        assert isinstance(listed, MissionList)
        return listed.missions[0]

    def marked(self) -> list[tuple[str, object]]:
        """Objects, each with its mark."""
        ((_, listed),) = self.ask(ObjectList(), 1.0).said
        assert isinstance(listed, ObjectList)
        return [(each.symbol, each.attributes.get("mark")) for each in listed.objects or ()]

    def explained(self) -> list[str]:
        """What `dyknow explain suspect` has, by kind."""
        ((_, listed),) = self.ask(ObjectEvents(symbol="suspect"), 1.0).said
        assert isinstance(listed, ObjectEvents)
        return [each.event for each in listed.events or ()]
