"""One encounter: vehicles that would meet, a platform each, a delegated task; flown and watched."""

import os
import random
import signal
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import dyknow
from bench.encounters.arducopter import Copter
from bench.encounters.cases import (
    CEILING_M,
    FENCE_M,
    LOOK_S,
    LOW_FAULTS,
    MEETING_M,
    THERE_M,
    TROUBLES,
    YIELDS,
    Case,
    Leg,
    legs,
)
from bench.encounters.judging import LONGEST, Flown, judge
from dyknow.console.commands.fleet.up import FleetStart
from dyknow.console.processes.supervision import Fleet
from dyknow.model.errors import DyknowError
from dyknow.runtime.configuration.config import NodeConfig

JOIN_S = 40.0
RECORDS_S = 6.0
"""How long after the end the records of the encounter are waited for."""
_MOST, _LEAST_S = 2.5, 45.0
"""How long a flight with a trouble may last, in undisturbed times and at least."""
_REFUSED_S = 12.0


@contextmanager
def fleet_of(case: Case, copters: Sequence[Copter], directory: Path) -> Iterator[tuple[Fleet, str]]:
    """A platform for each vehicle, in a federation of their own."""
    federation = f"sitl-{random.Random().getrandbits(32):x}"
    fleet = Fleet(directory / "platforms", lifeline=True)
    try:
        for copter in copters:
            vehicle: dict[str, Any] = {
                "kind": "mavlink",
                "endpoint": f"udpin:127.0.0.1:{copter.tap.platform_port}",
                "control": "auto" if case.fault.endswith("may interrupt") else True,
            }
            if case.fault == "stations through the platforms":
                vehicle |= {"forward": f"udp://127.0.0.1:{copter.route}", "forward_commands": True}
            given: dict[str, Any] = {
                "unit": str(copter.number),
                "wire": {"federation": federation},
                "vehicle": vehicle,
                "encounters": str(directory / "kept"),
            }
            if case.fault == "ceiling 30 m":
                given["ceiling_m"] = CEILING_M
            config = NodeConfig.model_validate(given)
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
    copters = [Copter(n, leg.home, directory / f"vehicle{n}", case.seed) for n, leg in enumerate(routes)]

    def rise(copter: Copter) -> None:
        leg = routes[copter.number]
        copter.take_off(leg.start.up_m)
        copter.cruise(leg.speed_m_s)

    try:
        with ThreadPoolExecutor(len(copters)) as pool:
            list(pool.map(rise, copters))
    except BaseException:
        for copter in copters:
            copter.close()
        raise
    return copters


def undisturbed_s(copters: Sequence[Copter], routes: Sequence[Leg]) -> list[float]:
    """How long each takes for its leg alone: flown high above the others, in fast time; then back to the start."""

    def alone(copter: Copter) -> float:
        leg, up_m = routes[copter.number], 25.0 * copter.number
        if leg.stays:
            copter.fly(leg.start)
            return 0.0
        start, end = leg.start._replace(up_m=leg.start.up_m + up_m), leg.end._replace(up_m=leg.end.up_m + up_m)
        copter.fly(copter.place._replace(up_m=start.up_m))
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
    found = Flown(case)
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        directory = Path(name)
        copters = started(case, directory)
        for copter in copters:
            stack.callback(copter.close)
            if case.wind_m_s:
                copter.wind(case.wind_m_s)
        alone_s = undisturbed_s(copters, legs(case))
        for copter in copters:
            copter.speed(1.0)
        _prepare(case, copters)
        fleet, federation = stack.enter_context(fleet_of(case, copters, directory))
        centre = stack.enter_context(dyknow.connect(federation))
        flight = Flight(case, copters, alone_s, fleet, centre, found)
        flight.fly()
        flight.wait_for_records(directory / "kept")
        judge(found, copters, flight.routes, alone_s, flight.began_s, directory / "kept")
    return found


def _prepare(case: Case, copters: Sequence[Copter]) -> None:
    fences = {"fence": ([copters[YIELDS]], case.up_m + 10.0), "fences 40 m": (copters, FENCE_M)}
    fenced, up_m = fences.get(case.fault, ((), 0.0))
    for copter in fenced:
        for name, value in (("FENCE_ALT_MAX", up_m), ("FENCE_TYPE", 1.0), ("FENCE_ENABLE", 1.0)):
            copter.set(name, value)
    if case.fault == "refuses":
        copters[YIELDS].tap.refuses = True
    elif case.fault == "acks lost":
        for copter in copters:
            copter.tap.ack_loss = 0.3
    for copter, leg in zip(copters, legs(case), strict=True):
        if leg.begins == "AUTO":
            copter.mission([leg.start, *([leg.via] if leg.via else []), leg.end])


class Flight:
    """The flight itself: what is begun, what happens in the middle, and what is said meanwhile.

    Attributes:
        routes: where each flies; began_s: since when.
    """

    def __init__(
        self,
        case: Case,
        copters: Sequence[Copter],
        alone_s: Sequence[float],
        fleet: Fleet,
        centre: dyknow.FederationClient,
        found: Flown,
    ) -> None:
        self._case, self._copters, self._fleet, self._centre, self._found = case, copters, fleet, centre, found
        self.routes, self.began_s = legs(case), 0.0
        self._task = centre.delegate("monitor-proximity", to="0", within="5s")
        self._alarms, self._task_is_over = centre.alarms(), False
        most = LONGEST if case.fault not in LOW_FAULTS and case.up_m > 30.0 else _MOST
        self._most_s = max(_LEAST_S, most * max(alone_s)) + 15.0
        self._diverted_s: float | None = None
        self._acted_s: float | None = None
        self._given_s: float | None = None
        self._troubled: Copter | None = None
        self._refused_s: float | None = None

    def fly(self) -> None:
        """Until all have arrived, or the time is over."""
        time.sleep(2.0)  # streams of all pairs are set up
        for copter in self._copters:
            copter.track = copter.track[-1:]
        self.began_s = time.monotonic()
        self._found.began = time.time()
        self._found.load.append(os.getloadavg()[0])
        for copter, leg in zip(self._copters, self.routes, strict=True):
            self._begin(copter, leg)
        while self._now_s < self._most_s:
            self._hear()
            self._happen(self._now_s)
            for copter in self._copters:
                copter.stand()
            if self._is_over():
                break
            time.sleep(0.05)
        self._found.lasted_s = self._now_s
        self._found.load.append(os.getloadavg()[0])
        if self._case.fault == "pilot takes over":
            self._count_after_takeover()

    def wait_for_records(self, directory: Path) -> None:
        """Platforms write an encounter down a few seconds after it is over."""
        until_s = time.monotonic() + (RECORDS_S if any(copter.tap.orders for copter in self._copters) else 0.0)
        while time.monotonic() < until_s and len(list(directory.glob("*.mcap"))) < len(self._copters):
            time.sleep(0.2)

    @property
    def _now_s(self) -> float:
        return time.monotonic() - self.began_s

    def _begin(self, copter: Copter, leg: Leg) -> None:
        if self._case.fault == "stations through the platforms":
            copter.is_routed = True
        if leg.begins in {"AUTO", "RTL", "LAND"}:
            copter.set_mode(leg.begins)
        elif leg.begins == "land task":
            try:
                self._centre.delegate("land", to=str(copter.number), within="5s")
            except DyknowError as refused:
                self._found.refused.append((self._now_s, str(copter.number), str(refused)))
                self._refused_s = self._now_s
        elif leg.begins == "goto":
            copter.goto(leg.end)
        if self._case.fault == "both stream" or (self._case.fault == "streams" and copter.number == YIELDS):
            copter.target = leg.end

    def _hear(self) -> None:
        for unit, event in self._fleet.heard():
            if event.get("event") == "note":
                self._found.notes.append((self._now_s, unit, str(event["text"])))
        while (alarm := self._alarms.get(0.0)) is not None:
            self._found.alarms.append((self._now_s, alarm.monitor, alarm.event, alarm.units))
        while (said := self._said()) is not None:
            by, step = getattr(said, "unit", None), getattr(said, "step", None)
            if by is not None and step is not None:
                self._found.told.append((self._now_s, by, step))

    def _said(self) -> Any:
        """What the task reports; its platform may be gone by now."""
        try:
            return None if self._task_is_over else self._task.events.get(0.0)
        except DyknowError as over:
            self._task_is_over = True
            self._found.events.append((self._now_s, str(over)))
            return None

    def _is_over(self) -> bool:
        """All that can still arrive have; after a refusal a few seconds show that nothing is flown."""
        if self._refused_s is not None:
            return self._now_s > self._refused_s + _REFUSED_S
        return all(
            leg.is_there(copter.place, THERE_M / 2)
            for copter, leg in zip(self._copters, self.routes, strict=True)
            if copter.number not in self._found.lost
        )

    # -- what happens in the middle ----------------------------------------------------------------------------

    def _happen(self, now_s: float) -> None:
        if self._diverted_s is None and any(copter.tap.orders for copter in self._copters):
            self._diverted_s = now_s
        trouble = TROUBLES.get(self._case.fault)
        if trouble is not None:
            self._trouble(now_s)
            return
        if self._acted_s is None and self._diverted_s is not None and now_s > self._diverted_s + 2.0:
            self._acted_s = now_s
            if self._case.fault in {"pilot takes over", "autopilot killed"}:
                self._found.trouble_s = now_s
            if self._case.fault == "pilot takes over":
                self._copters[YIELDS].set_mode("LOITER")
                self._given_s = now_s + 8.0
            elif self._case.fault == "autopilot killed":
                self._copters[YIELDS].kill()
        if self._given_s is not None and now_s > self._given_s:
            self._count_after_takeover()
            self._copters[YIELDS].set_mode("GUIDED")
            self._given_s = float("inf")

    def _count_after_takeover(self) -> None:
        since_s = self.began_s + (self._acted_s or 0.0) + 0.5
        self._found.after_takeover = sum(sent.at_s > since_s for sent in self._copters[YIELDS].tap.orders)

    def _trouble(self, now_s: float) -> None:
        trouble = TROUBLES[self._case.fault]
        if self._troubled is not None:
            if self._acted_s is not None and now_s > self._acted_s + trouble.lasts_s and self._troubled.tap.is_cut:
                self._troubled.tap.is_cut = False
                self._found.events.append((now_s, f"link of {self._troubled.number} is back"))
            return
        if trouble.before_s is not None:
            due = self._meeting_s() <= LOOK_S + trouble.before_s
        else:
            due = self._diverted_s is not None and now_s > self._diverted_s + trouble.after_s
        if not due:
            return
        at = trouble.vehicle
        self._troubled = copter = (
            next(each for each in self._copters if each.tap.orders) if at is None else self._copters[at]
        )
        self._acted_s = now_s
        if trouble.what == "cut link":
            copter.tap.is_cut = True
        else:
            os.kill(self._fleet.running[str(copter.number)].pid, signal.SIGKILL)
        if trouble.what == "kill platform" or trouble.lasts_s == float("inf"):
            self._found.lost.append(copter.number)
        self._found.events.append((now_s, f"{trouble.what} of {copter.number}"))

    def _meeting_s(self) -> float:
        """In how many seconds the first two come near each other, as they fly."""
        one, other = (copter.track[-20:] for copter in self._copters[:2])
        if min(len(one), len(other)) < 20:
            return float("inf")
        before_m, now_m = (a.place.distance_m(b.place) for a, b in ((one[0], other[0]), (one[-1], other[-1])))
        closing_m_s = (before_m - now_m) / max(0.1, one[-1].at_s - one[0].at_s)
        return (now_m - MEETING_M) / closing_m_s if closing_m_s > 0.5 else float("inf")
