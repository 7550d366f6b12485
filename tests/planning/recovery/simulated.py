"""Missions of the logistics domain in a simulated world: deterministic from a seed, with noise, delays and one fault.

UAVs fly, climb and lift as the executor's commands say; what is sensed comes once a period, a little late, with noise. A fault
is visible from the first state that shows it on, or from the end of the time that an action may take.
"""

import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from itertools import count
from math import hypot
from typing import Any

from dyknow.model.values import NO_VALUE
from dyknow.planning import Declarations, PlanFound, find_plan, parse_problem
from dyknow.planning.execution import events
from dyknow.planning.recovery.mission import Mission
from dyknow.planning.recovery.options import MissionOptions
from tests.planning.logistics import domain

PERIOD_US = 500_000
STEP_US = 100_000
DELAY_US = 150_000
FAULTS = ("drop", "take-off", "no attach", "slow attach", "misplaced", "late")


@dataclass
class Craft:
    """A simulated UAV, and the action that it does."""

    x: float
    y: float
    altitude: float = 0.0
    cargo: str | None = None
    step: int | None = None
    act: Iterator[tuple[bool, str] | None] | None = None


@dataclass
class Injected:
    """A fault; `visible_us` is the valid time of the first state that shows it."""

    kind: str
    unit: str
    visible_us: int | None = None


@dataclass
class Flown:
    """What became of a mission."""

    outcome: str
    injected: Injected | None
    faults: list[tuple[int, str]]
    notes: list[str]
    delivered_us: dict[str, int]
    end_us: int
    log: list[Any] = field(default_factory=list)


@cache
def asked(boxes: int, uavs: int, seed: int, extra: str = "") -> Declarations:
    rng = random.Random(seed)
    lines = [f"#objects uav = uav1 .. uav{uavs}", f"#objects box = b1 .. b{boxes}"]
    lines += [f"#init xpos(uav{at + 1}) := {-15 * at}, ypos(uav{at + 1}) := -10" for at in range(uavs)]
    for at in range(boxes):
        x, y = round(rng.uniform(10, 50), 1), round(rng.uniform(-40, 40) + 60 * at, 1)
        gx, gy = round(x + rng.uniform(40, 90), 1), round(y + rng.uniform(-30, 30), 1)
        lines.append(f"#init xpos(b{at + 1}) := {x}, ypos(b{at + 1}) := {y}")
        lines.append(f"#init goal-x(b{at + 1}) := {gx}, goal-y(b{at + 1}) := {gy}")
    lines.append(extra or "#goal deliver: forall box: delivered(box)")
    return parse_problem("\n".join(lines) + "\n", domain())


class World:
    """UAVs, boxes and what is sensed of them."""

    def __init__(self, problem: Declarations, seed: int, fault: str | None, box: str | None) -> None:
        self.rng = random.Random(seed * 7919 + 1)
        initial = {(one.target.name, *(arg.name for arg in one.target.args)): one.value.value for one in problem.init}  # type: ignore[attr-defined]
        uavs, boxes = (next(one.names for one in problem.objects if one.sort == sort) for sort in ("uav", "box"))
        self.craft = {name: Craft(float(initial["xpos", name]), float(initial["ypos", name])) for name in uavs}
        self.boxes = {name: (float(initial["xpos", name]), float(initial["ypos", name])) for name in boxes}
        self.goals = {name: (initial["goal-x", name], initial["goal-y", name]) for name in boxes}
        self.known = set(boxes)
        self.now_us = 1_000_000_000
        self.fault = fault
        self.injected: Injected | None = None
        self.box = box or (self.rng.choice(boxes) if fault != "take-off" else "")
        self.pending = ""
        self.ended: list[events.ActionEnded] = []

    def injects(self, kind: str, action: Any) -> bool:
        """Whether this is where the fault is to happen: once, with one of the boxes."""
        if self.fault != kind or self.injected is not None or (self.box and self.box not in action.objects):
            return False
        self.injected = Injected(kind, action.unit)
        return True

    def visible_now(self) -> None:
        """The next state shows the fault."""
        assert self.injected is not None
        self.injected.visible_us = -(-self.now_us // PERIOD_US) * PERIOD_US

    def start(self, effect: events.StartAction) -> None:
        craft = self.craft[effect.unit]
        name = effect.action.operator.name
        doing: dict[str, Callable[..., Iterator[tuple[bool, str] | None]]] = {
            "climb-for-flying-empty": self._climb,
            "climb-for-flying-with": self._climb,
            "fly-empty-to-box": self._fly,
            "fly-box-to-goal": self._fly,
            "adjust-for-attach": self._adjust,
            "adjust-for-detach": self._adjust,
            "attach-box": self._attach,
            "detach-box": self._detach,
        }
        craft.step, craft.act = effect.step, doing[name](craft, effect.action)

    def stop(self, unit: str) -> None:
        self.craft[unit].step = self.craft[unit].act = None

    def advance(self) -> list[events.ActionEnded]:
        """A tenth of a second; what has ended."""
        self.now_us += STEP_US
        ended = []
        for craft in self.craft.values():
            if craft.act is None:
                continue
            result = next(craft.act)
            if craft.cargo is not None:
                self.boxes[craft.cargo] = (craft.x, craft.y)
            if result is not None and craft.step is not None:
                ended.append(events.ActionEnded(craft.step, *result))
                craft.step = craft.act = None
        return ended

    def _climb(self, craft: Craft, action: Any) -> Iterator[tuple[bool, str] | None]:
        stuck = action.operator.name == "climb-for-flying-empty" and self.injects("take-off", action)
        rate = self.rng.uniform(1.6, 2.6)
        while craft.altitude < 7.0 and not stuck:
            craft.altitude = min(7.0, craft.altitude + rate * STEP_US / 1e6)
            yield None
        for _ in range(20 if stuck else 3):
            yield None
        if stuck:
            self.visible_now()
        yield True, ""

    def _fly(self, craft: Craft, action: Any) -> Iterator[tuple[bool, str] | None]:
        values = dict(action.values)
        is_late = action.operator.name == "fly-empty-to-box" and self.injects("late", action)
        drops = action.operator.name == "fly-box-to-goal" and self.injects("drop", action)
        x, y = values["tox"] + self.rng.gauss(0, 0.2), values["toy"] + self.rng.gauss(0, 0.2)
        way = hypot(x - craft.x, y - craft.y)
        speed = 0.02 if is_late else self.rng.uniform(8, 11)
        if is_late:
            expected = hypot(values["tox"] - values["fromx"], values["toy"] - values["fromy"])
            limit_us = 10_000_000 + 1.5 * expected / 10 * 1e6
            self.pending = f"limit {limit_us}"
        drop_at = way * self.rng.uniform(0.2, 0.9)
        while way > 0.3:
            move = min(way, speed * STEP_US / 1e6)
            craft.x, craft.y = craft.x + (x - craft.x) * move / way, craft.y + (y - craft.y) * move / way
            way -= move
            if drops and way < drop_at and craft.cargo is not None:
                self.boxes[craft.cargo] = (craft.x + self.rng.gauss(0, 4), craft.y + self.rng.gauss(0, 4))
                self.known.discard(craft.cargo)
                craft.cargo = None
                self.visible_now()
            yield None
        yield True, ""

    def _adjust(self, craft: Craft, _action: Any) -> Iterator[tuple[bool, str] | None]:
        while craft.altitude > 3.5:
            craft.altitude = max(3.5, craft.altitude - 1.8 * STEP_US / 1e6)
            yield None
        yield True, ""

    def _attach(self, craft: Craft, action: Any) -> Iterator[tuple[bool, str] | None]:
        box = action.objects[1]
        fails, slow = self.injects("no attach", action), self.injects("slow attach", action)
        if slow:
            self.pending = "limit 5000000"
        for _ in range(80 if slow else self.rng.randrange(8, 25)):
            yield None
        x, y = self.boxes[box]
        if hypot(x - craft.x, y - craft.y) < 1.5 and not fails:
            craft.cargo = box
        elif fails:
            self.visible_now()
        yield True, ""

    def _detach(self, craft: Craft, action: Any) -> Iterator[tuple[bool, str] | None]:
        box = action.objects[1]
        rolls = self.injects("misplaced", action)
        for _ in range(self.rng.randrange(6, 18)):
            yield None
        away = self.rng.uniform(6, 12) if rolls else 0.0
        craft.cargo = None
        self.boxes[box] = (craft.x + away + self.rng.gauss(0, 0.1), craft.y + self.rng.gauss(0, 0.1))
        if rolls:
            self.visible_now()
        yield True, ""

    def sensed(self) -> events.StateSampled:
        """A state: places to 0.2 m, heights to 0.15 m; a value in fifty is missing."""
        values: dict[str, Any] = {}
        noise = self.rng.gauss
        for name, craft in self.craft.items():
            values[f"xpos[{name}]"], values[f"ypos[{name}]"] = craft.x + noise(0, 0.2), craft.y + noise(0, 0.2)
            values[f"altitude[{name}]"] = craft.altitude + noise(0, 0.15)
            for box in self.boxes:
                values[f"attached[{name}, {box}]"] = craft.cargo == box
        for box, (x, y) in self.boxes.items():
            is_seen = box in self.known
            values[f"xpos[{box}]"] = x + noise(0, 0.2) if is_seen else NO_VALUE
            values[f"ypos[{box}]"] = y + noise(0, 0.2) if is_seen else NO_VALUE
        missing = [label for label in values if self.rng.random() < 0.02]
        return events.StateSampled(self.now_us, values | dict.fromkeys(missing, NO_VALUE))


def fly(
    seed: int,
    fault: str | None = None,
    boxes: int = 1,
    uavs: int = 2,
    extra: str = "",
    script: Callable[[int, Mission], events.MissionEvent | None] | None = None,
    limit_s: int = 900,
    box: str | None = None,
) -> Flown:
    """A mission from its start to its end; `script` may add an event at a time, in seconds since the start."""
    problem = asked(boxes, uavs, seed, extra)
    world = World(problem, seed, fault, box)
    mission = Mission(f"m{seed}", domain(), problem, MissionOptions(period_us=PERIOD_US))
    begun_us = world.now_us
    flown = Flown("none", None, [], [], {}, 0)
    due: list[tuple[int, int, events.MissionEvent]] = []
    order = count()

    def post(at_us: int, event: events.MissionEvent) -> None:
        due.append((at_us, next(order), event))

    def perform(effects: list[Any]) -> None:
        for effect in effects:
            flown.log.append((world.now_us, effect))
            match effect:
                case events.StartAction():
                    world.start(effect)
                case events.AbortAction(_, unit, _) | events.HoldUnit(unit, _, _):
                    world.stop(unit)
                case events.SearchPlan(number, asked_domain, asked_problem, units, _, _):
                    polls = count()
                    found = find_plan(
                        asked_domain,
                        asked_problem,
                        stop=lambda c=polls: "enough" if next(c) > 20 else "",
                        units=units,  # type: ignore[misc]
                    )
                    plan = found.plan if isinstance(found, PlanFound) else None
                    reason = "" if isinstance(found, PlanFound) else found.reason
                    post(world.now_us + 400_000, events.PlanSearched(number, plan, reason))
                case events.Locate(objects, _, _, _):
                    for one in objects:
                        if one in world.boxes:
                            world.known.add(one)
                case events.MissionNote("fault", text, _):
                    flown.faults.append((world.now_us, text))
                case events.MissionEnded(outcome, _, _):
                    flown.outcome = outcome
            if isinstance(effect, events.MissionNote):
                flown.notes.append(f"{(world.now_us - begun_us) / 1e6:.1f} {effect.kind}: {effect.text}")

    perform(mission.start(world.now_us))
    while mission.ended is None and world.now_us < begun_us + limit_s * 1_000_000:
        for event in world.advance():
            post(world.now_us + DELAY_US, event)
        if world.now_us % PERIOD_US == 0:
            state = world.sensed()
            post(world.now_us + DELAY_US, state)
        if world.pending.startswith("limit"):
            begin_us = next(at for at, one in reversed(flown.log) if isinstance(one, events.StartAction))
            assert world.injected is not None
            first_us = (begin_us - DELAY_US) // PERIOD_US * PERIOD_US
            wanted_us = first_us + float(world.pending.split()[1])
            world.injected.visible_us = int(-(-wanted_us // PERIOD_US) * PERIOD_US)
            world.pending = ""
        scripted = script((world.now_us - begun_us) // 1_000_000, mission) if script else None
        if scripted is not None:
            perform(mission.on_event(scripted, world.now_us))
        for entry in sorted(one for one in due if one[0] <= world.now_us):
            due.remove(entry)
            perform(mission.on_event(entry[2], world.now_us))
        deadline_us = mission.deadline_us
        if deadline_us is not None and world.now_us >= deadline_us:
            perform(mission.on_time(world.now_us))
        for one, (x, y) in world.boxes.items():
            near = hypot(x - world.goals[one][0], y - world.goals[one][1]) <= 2
            if near and one not in flown.delivered_us and all(each.cargo != one for each in world.craft.values()):
                flown.delivered_us[one] = world.now_us - begun_us
    flown.injected, flown.end_us = world.injected, world.now_us - begun_us
    return flown
