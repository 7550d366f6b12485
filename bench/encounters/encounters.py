"""One encounter: vehicles that would meet, a platform each, a delegated task; flown, watched, and judged by the truth."""

import math
import random
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import dyknow
from bench.encounters.arducopter import Copter, Place, Seen
from console.commands.fleet.up import FleetStart
from console.processes.supervision import Fleet
from runtime.configuration.config import NodeConfig

LEAST_M, LONGEST = 10.0, 1.4
TOLD_S = 2.0
HALF_M = 120.0
UP_M = 45.0
"""High enough to climb or to descend by 25 m between floor (10 m) and ceiling (120 m)."""
THERE_M = 3.0
JOIN_S = 40.0
FAULTS = (
    "none", "fence", "refuses", "one AUTO", "both AUTO", "both AUTO, may interrupt", "streams", "both stream",
    "acks lost", "pilot takes over", "autopilot killed",
)  # fmt: skip
WARNED = ("proximity-warn", "opened")
NEITHER = frozenset({"both AUTO", "both stream"})
"""Where neither can avoid the other: both operators are to be told that, no more can be asked for."""
_TROUBLE = ("does not fly its manoeuvre", "does not avoid", "leaves all of it", "leaves the manoeuvre to")


class Case(NamedTuple):
    """What is flown: `geometry` of head-on, crossing, overtaking, at a speed, by two or three; `fault` of `FAULTS`."""

    geometry: str
    speed_m_s: float
    count: int = 2
    fault: str = "none"
    seed: int = 1

    @property
    def name(self) -> str:
        what = "" if self.fault == "none" else f", {self.fault}"
        return f"{self.count} {self.geometry}, {self.speed_m_s:.0f} m/s{what}, seed {self.seed}"


class Leg(NamedTuple):
    start: Place
    end: Place
    speed_m_s: float


@dataclass
class Flown:
    """What came of an encounter.

    Attributes:
        least_m: smallest true distance of any two; places of the pair then, by vehicle.
        factors: time to arrive as a multiple of the undisturbed one, by vehicle; None: it did not arrive.
        stops: how often each was diverted; resumes: how often each flew on after that.
        trouble_s: when a vehicle could not do its part, which the case arranges; None: that is not arranged, or was not.
        told_s: how long after the trouble the operator of each was told, by vehicle; None: not at all.
        modes: (time, vehicle, mode, mission item), each time one changed.
        track: (time, vehicle, north, east, up), twice a second.
    """

    case: Case
    least_m: float = math.inf
    least_at_s: float = 0.0
    factors: list[float | None] = field(default_factory=list)
    stops: list[int] = field(default_factory=list)
    resumes: list[int] = field(default_factory=list)
    alarms: list[tuple[float, str, str, tuple[str, ...]]] = field(default_factory=list)
    notes: list[tuple[float, str, str]] = field(default_factory=list)
    told: list[tuple[float, str, str]] = field(default_factory=list)
    orders: list[tuple[float, int, str]] = field(default_factory=list)
    after_takeover: int = 0
    trouble_s: float | None = None
    told_s: list[float | None] = field(default_factory=list)
    modes: list[tuple[float, int, str, int]] = field(default_factory=list)
    track: list[tuple[float, int, float, float, float]] = field(default_factory=list)

    @property
    def neither_s(self) -> float | None:
        """When it was told first that neither can avoid."""
        return next((at_s for at_s, monitor, event, _ in self.alarms if monitor == "neither-can-avoid"), None)

    @property
    def is_told(self) -> bool:
        """Whether both operators were told of the trouble in time."""
        return bool(self.told_s) and all(told_s is not None and told_s <= TOLD_S for told_s in self.told_s)

    @property
    def met(self) -> bool:
        """Apart, and all arrived in time, or it was told that one could not; where neither can, that was told at both."""
        if self.case.fault in NEITHER:
            return self.neither_s is not None and self.is_told
        in_time = all(factor is not None and factor <= LONGEST for factor in self.factors)
        return self.least_m > LEAST_M and (in_time or self.is_told) and self.after_takeover == 0


def legs(case: Case) -> list[Leg]:
    """Where each flies, drawn about the geometry: a few metres aside, a few seconds early."""
    rng = random.Random(f"{case.geometry} {case.count} {case.seed}")

    def about(north_m: float, east_m: float, up_m: float = UP_M) -> Place:
        return Place(north_m + rng.uniform(-2.0, 2.0), east_m + rng.uniform(-4.0, 4.0), up_m + rng.uniform(-1.5, 1.5))

    drawn: list[Place] = []

    def leg(from_: tuple[float, float], to: tuple[float, float], speed_m_s: float) -> Leg:
        start = about(*from_)
        if case.fault != "none" and not drawn:
            start = start._replace(up_m=UP_M + 3.0)  # the fault is that of vehicle 0, which is to climb
        drawn.append(start)
        return Leg(start, Place(*to, start.up_m), speed_m_s)

    v, r = case.speed_m_s, HALF_M
    if case.geometry == "head-on":
        found = [leg((0, -r), (0, r), v), leg((0, r), (0, -r), v)]
        if case.count > 2:
            found.append(leg((r, 0), (-r, 0), v))
    elif case.geometry == "crossing":
        found = [leg((-r, 0), (r, 0), v), leg((0, -r), (0, r), v)]
        if case.count > 2:
            found.append(leg((0.7 * r, -0.7 * r), (-0.7 * r, 0.7 * r), v))
    else:
        slow = v / 2.0
        found = [leg((0, -r), (0, 2 * r), v), leg((0, -r + 85.0), (0, 1.2 * r), slow)]
        if case.count > 2:
            found.append(leg((0, 2 * r), (0, -r), v))
    return found


@contextmanager
def fleet_of(case: Case, copters: Sequence[Copter], directory: Path) -> Iterator[tuple[Fleet, str]]:
    """A platform for each vehicle, in a federation of their own."""
    federation = f"sitl-{random.Random().getrandbits(32):x}"
    fleet = Fleet(directory / "platforms", lifeline=True)
    try:
        for copter in copters:
            auto = case.fault == "both AUTO, may interrupt"
            vehicle: dict[str, Any] = {
                "kind": "mavlink",
                "endpoint": f"udpin:127.0.0.1:{copter.tap.platform_port}",
                "control": "auto" if auto else True,
            }
            config = NodeConfig.model_validate(
                {"unit": str(copter.number), "wire": {"federation": federation}, "vehicle": vehicle}
            )
            fleet.start(config.unit, config.model_dump_json())
        gathering = FleetStart([str(copter.number) for copter in copters])
        if not fleet.follow(gathering.all_found, gathering.on_heard, JOIN_S):
            raise TimeoutError("the platforms did not find each other")
        yield fleet, federation
    finally:
        fleet.end()


def started(case: Case, directory: Path) -> list[Copter]:
    """The vehicles, in the air at their starts."""
    routes = legs(case)
    copters = [Copter(n, leg.start, directory / f"vehicle{n}", case.seed) for n, leg in enumerate(routes)]

    def rise(copter: Copter) -> None:
        leg = routes[copter.number]
        copter.take_off(UP_M)
        copter.cruise(leg.speed_m_s)

    with ThreadPoolExecutor(len(copters)) as pool:
        list(pool.map(rise, copters))
    return copters


def undisturbed_s(copters: Sequence[Copter], routes: Sequence[Leg]) -> list[float]:
    """How long each takes for its leg alone: flown high above the others, in fast time; then back to the start."""

    def alone(copter: Copter) -> float:
        leg, up_m = routes[copter.number], 25.0 * copter.number
        start, end = leg.start._replace(up_m=leg.start.up_m + up_m), leg.end._replace(up_m=leg.end.up_m + up_m)
        copter.fly(start)
        since_s = copter.sim_s
        copter.goto(end)
        copter._until(lambda: copter.place.distance_m(end) < THERE_M, 60.0, lambda: None)
        took_s = copter.sim_s - since_s
        copter.fly(start)
        copter.fly(leg.start)
        return took_s

    with ThreadPoolExecutor(len(copters)) as pool:
        return list(pool.map(alone, copters))


def flown(case: Case) -> Flown:
    """Fly one encounter, in real time, and look at what became of it."""
    found, routes = Flown(case), legs(case)
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        directory = Path(name)
        copters = started(case, directory)
        for copter in copters:
            stack.callback(copter.close)
        alone_s = undisturbed_s(copters, routes)
        for copter in copters:
            copter.speed(1.0)
        _prepare(case, copters, routes)
        fleet, federation = stack.enter_context(fleet_of(case, copters, directory))
        centre = stack.enter_context(dyknow.connect(federation))
        task = centre.delegate("monitor-proximity", to="0", within="5s")
        alarms = centre.alarms()
        time.sleep(2.0)  # streams of all pairs are set up
        for copter in copters:
            copter.track.clear()
        began_s = time.monotonic()
        _begin(case, copters, routes)
        _watch(case, copters, routes, alone_s, began_s, fleet, alarms, task, found)
    _judge(found, copters, routes, alone_s, began_s)
    return found


def _prepare(case: Case, copters: Sequence[Copter], routes: Sequence[Leg]) -> None:
    first = copters[0]
    if case.fault == "fence":
        for name, value in (("FENCE_ALT_MAX", UP_M + 20.0), ("FENCE_TYPE", 1.0), ("FENCE_ENABLE", 1.0)):
            first.set(name, value)
    elif case.fault == "refuses":
        first.tap.refuses = True
    elif case.fault == "acks lost":
        for copter in copters:
            copter.tap.ack_loss = 0.3
    for copter in copters:
        if _flies_auto(case, copter):
            copter.mission([routes[copter.number].start, routes[copter.number].end])


def _flies_auto(case: Case, copter: Copter) -> bool:
    return case.fault.startswith("both AUTO") or (case.fault == "one AUTO" and copter.number == 1)


def _begin(case: Case, copters: Sequence[Copter], routes: Sequence[Leg]) -> None:
    for copter in copters:
        if _flies_auto(case, copter):
            copter.set_mode("AUTO")
        else:
            copter.goto(routes[copter.number].end)
        if case.fault == "both stream" or (case.fault == "streams" and copter.number == 0):
            copter.target = routes[copter.number].end


def _watch(
    case: Case,
    copters: Sequence[Copter],
    routes: Sequence[Leg],
    alone_s: Sequence[float],
    began_s: float,
    fleet: Fleet,
    alarms: Any,
    task: Any,
    found: Flown,
) -> None:
    """Until all have arrived, or the time is over; what happens in the middle happens then."""
    until_s = began_s + LONGEST * max(alone_s) + 15.0
    diverted_s, acted_s, given_s = None, None, None
    while time.monotonic() < until_s:
        now_s = time.monotonic() - began_s
        for unit, event in fleet.heard():
            if event.get("event") == "note":
                found.notes.append((now_s, unit, str(event["text"])))
        while (alarm := alarms.get(0.0)) is not None:
            found.alarms.append((now_s, alarm.monitor, alarm.event, alarm.units))
        while (said := task.events.get(0.0)) is not None:
            if hasattr(said, "step"):
                found.told.append((now_s, said.unit, said.step))
        if diverted_s is None and any(c.tap.orders for c in copters):
            diverted_s = now_s
        if acted_s is None and diverted_s is not None and now_s > diverted_s + 2.0:
            acted_s = now_s
            if case.fault in {"pilot takes over", "autopilot killed"}:
                found.trouble_s = now_s
            if case.fault == "pilot takes over":
                copters[0].set_mode("LOITER")
                given_s = now_s + 8.0
            elif case.fault == "autopilot killed":
                copters[0].kill()
        if given_s is not None and now_s > given_s:
            found.after_takeover = sum(sent.at_s - began_s > (acted_s or 0.0) + 0.5 for sent in copters[0].tap.orders)
            copters[0].set_mode("GUIDED")
            given_s = math.inf
        for copter in copters:
            copter.stand()
        if all(c.place.distance_m(routes[c.number].end) < THERE_M / 2 for c in copters):
            break
        time.sleep(0.05)
    if case.fault == "pilot takes over":
        found.after_takeover = sum(sent.at_s - began_s > (acted_s or 0.0) + 0.5 for sent in copters[0].tap.orders)


def _judge(
    found: Flown, copters: Sequence[Copter], routes: Sequence[Leg], alone_s: Sequence[float], began_s: float
) -> None:
    for one in range(len(copters)):
        for other in range(one):
            for at_s, metres in separations(copters[one].track, copters[other].track):
                if metres < found.least_m:
                    found.least_m, found.least_at_s = metres, at_s - began_s
    for copter, leg, alone in zip(copters, routes, alone_s, strict=True):
        there = [seen for seen in copter.track if seen.place.distance_m(leg.end) < THERE_M]
        found.factors.append((there[0].at_s - began_s) / alone if there else None)
        found.orders += [(sent.at_s - began_s, copter.number, _in_words(sent.message)) for sent in copter.tap.orders]
        said = [text for _, unit, text in found.notes if unit == str(copter.number)]
        found.stops.append(sum(" holds" in text or " goes to " in text for text in said))
        found.resumes.append(sum("flies on" in text for text in said))
        found.modes += [(mode.at_s - began_s, copter.number, mode.name, mode.item) for mode in copter.modes]
        at_s = -math.inf
        for seen in copter.track:
            if seen.at_s >= at_s + 0.5:
                at_s = seen.at_s
                where = (round(metres, 1) for metres in seen.place)
                found.track.append((round(at_s - began_s, 1), copter.number, *where))  # type: ignore[arg-type]
    found.orders.sort()
    found.modes = sorted(mode for mode in found.modes if mode[0] >= 0.0)
    found.track.sort()
    found.trouble_s = found.trouble_s or _trouble_s(found, copters, began_s)
    if found.trouble_s is not None:
        found.told_s = [_told_s(found, copter.number, found.trouble_s) for copter in copters]


def _trouble_s(found: Flown, copters: Sequence[Copter], began_s: float) -> float | None:
    """When the vehicles that are to fail have failed: refused, could not be commanded, or their last order was overwritten."""
    fault = found.case.fault
    if fault in {"one AUTO", "both AUTO"}:
        return next((at_s for at_s, monitor, event, _ in found.alarms if (monitor, event) == WARNED), None)
    if fault == "refuses":
        return next((at_s for at_s, number, _ in found.orders if number == 0), None)
    ordered_s = {number: at_s for at_s, number, _ in found.orders if at_s <= (found.neither_s or math.inf)}
    overwritten_s = [
        next((at_s - began_s for at_s in copter.streamed_s if at_s - began_s > ordered_s[copter.number]), math.inf)
        for copter in copters
        if copter.target is not None and copter.number in ordered_s
    ]
    return max(overwritten_s, default=None)


def _told_s(found: Flown, number: int, trouble_s: float) -> float | None:
    """How long after the trouble the operator of that vehicle was told of it, or before it (0)."""
    words = ("neither",) if found.case.fault in NEITHER else _TROUBLE
    told = [at_s for at_s, unit, text in found.notes if unit == str(number) and any(map(text.count, words))]
    if found.case.fault == "autopilot killed":  # nothing is known of it any more: its pairs are not monitored
        told += [at_s for at_s, _, event, units in found.alarms if event == "unknown" and units[:1] == (str(number),)]
    return max(0.0, min(told) - trouble_s) if told else None


def separations(one: Sequence[Seen], other: Sequence[Seen]) -> Iterator[tuple[float, float]]:
    """(time, metres) at every fix of the one, the other interpolated."""
    at = 0
    for seen in one:
        while at + 1 < len(other) and other[at + 1].at_s <= seen.at_s:
            at += 1
        if at + 1 >= len(other) or other[at].at_s > seen.at_s:
            continue
        before, after = other[at], other[at + 1]
        part = (seen.at_s - before.at_s) / max(1e-6, after.at_s - before.at_s)
        place = Place(*(a + part * (b - a) for a, b in zip(before.place, after.place, strict=True)))
        yield seen.at_s, seen.place.distance_m(place)


def _in_words(message: Any) -> str:
    known = {"command": "command", "z": "z", "custom_mode": "mode"}
    return (
        message.get_type()
        + " "
        + " ".join(f"{k} {getattr(message, a)}" for k, a in known.items() if hasattr(message, a))
    )
