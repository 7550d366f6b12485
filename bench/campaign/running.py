"""One run of the campaign: a situation, flown without neighbours and then together, and what came of it."""

import gc
import traceback
from dataclasses import dataclass, field
from math import inf
from statistics import median
from time import process_time

from bench.campaign.drawing import situation
from bench.campaign.flying import CampaignFlight, S
from bench.campaign.situations import HOVER, Situation
from bench.campaign.watching import STEP_US, Watch
from dyknow.agents.platform import Platform

SELDOM = 100_000, 50, 1_000
"""When garbage is collected during a run: nearly all that a world makes stays until its end."""
LONGEST_ALONE_S = 200.0
LEAST_S = 35.0
"""Each flight lasts at least so long: until all that goes wrong has begun."""
LATE, LATE_S = 3.0, 60.0
"""A vehicle is stuck that needs longer than so many times its time alone, or the least time of a flight, and so many seconds more."""
CALM_S, EXPLAINED_S = 2.0, 15.0


@dataclass(slots=True)
class CampaignRun:
    """What came of one seed. Times in seconds since setting out, distances in metres.

    Attributes:
        factors: time to arrive over the time alone, of each vehicle that arrived.
        stuck, untold, breaches, violations: in words; empty: the invariant holds.
        told: pairs that came too near where nothing could be done, and both were told in time.
        flown_s: simulated seconds, of all its worlds together.
        track: equal if two runs are.
    """

    seed: int
    what: str
    causes: tuple[str, ...] = ()
    least_m: float = 1e9
    breaches: list[str] = field(default_factory=list)
    untold: list[str] = field(default_factory=list)
    told: list[str] = field(default_factory=list)
    stuck: list[str] = field(default_factory=list)
    explained: list[str] = field(default_factory=list)
    violations: list[str] = field(default_factory=list)
    factors: list[float] = field(default_factory=list)
    manoeuvres: int = 0
    lasted_s: float = 0.0
    flown_s: float = 0.0
    cpu_s: float = 0.0
    track: float = 0.0

    @property
    def is_met(self) -> bool:
        return not (self.breaches or self.untold or self.stuck or self.violations)

    def line(self) -> str:
        """One line for a reader."""
        counts = (
            f"breaches {len(self.breaches)}  untold {len(self.untold)}  told {len(self.told)}  stuck {len(self.stuck)}"
        )
        factor = f"x {median(self.factors):.2f}" if self.factors else "x  -  "
        least = f"{self.least_m:5.1f} m" if self.least_m < 1e4 else "    -  "
        return (
            f"{self.seed:5d} {'met    ' if self.is_met else 'NOT met'} {least}  {counts}  violations "
            f"{len(self.violations)}  {factor}  {self.lasted_s:4.0f} s  {self.cpu_s:5.1f} CPU s  {self.what}"
        )


def run(seed: int, drawn: Situation | None = None, *, longest_s: float = inf) -> CampaignRun:
    """Fly the situation of that seed, or the one that is given; what is raised is a violation.

    It ends by itself; after `longest_s` it is ended, and what has not arrived by then counts as stuck.
    """
    drawn = situation(seed) if drawn is None else drawn
    found = CampaignRun(seed, str(drawn), drawn.causes)
    began_s, thresholds = process_time(), gc.get_threshold()
    gc.set_threshold(*SELDOM)
    try:
        alone_s = _alone(drawn, found)
        _together(drawn, alone_s, found, longest_s)
    except Exception as error:  # noqa: BLE001  (that is what is looked for)
        place = traceback.extract_tb(error.__traceback__)[-1]
        found.violations.append(f"raised {type(error).__name__}: {error} ({place.filename}:{place.lineno})")
    finally:
        gc.set_threshold(*thresholds)
        gc.collect()
    found.cpu_s = process_time() - began_s
    return found


def _alone(drawn: Situation, found: CampaignRun) -> list[float | None]:
    """How long each vehicle takes without neighbours; None: it does not arrive, with what goes wrong."""
    flight = CampaignFlight(drawn, is_alone=True)
    watch = Watch(flight)
    flight.world.run_until(flight.begin_us)
    while flight.seconds() < LONGEST_ALONE_S:
        if all(
            unit.arrived_s is not None or drawn.vehicles[at].way.kind == HOVER for at, unit in enumerate(watch.units)
        ):
            break
        flight.world.run_until(flight.world.now_us + STEP_US)
        watch.step()
    found.flown_s += (flight.world.now_us - flight.world.start_us) / S
    return [unit.arrived_s for unit in watch.units]


def _together(drawn: Situation, alone_s: list[float | None], found: CampaignRun, longest_s: float) -> None:
    flight = CampaignFlight(drawn)
    watch = Watch(flight)
    try:
        _fly(flight, watch, alone_s, longest_s)
    finally:
        found.least_m, found.breaches, found.untold, found.told = (
            watch.least_m,
            watch.breaches,
            watch.untold,
            watch.told,
        )
        found.violations = [*watch.violations, *_contained(flight)]
        found.manoeuvres, found.track = watch.manoeuvres, watch.track + watch.orders
        found.lasted_s = flight.seconds()
        found.flown_s += (flight.world.now_us - flight.world.start_us) / S
    for number, (unit, undisturbed_s) in enumerate(zip(watch.units, alone_s, strict=True)):
        way = drawn.vehicles[number].way
        if undisturbed_s is None:
            continue
        if unit.arrived_s is not None:
            if way.kind != HOVER:
                found.factors.append(unit.arrived_s / undisturbed_s)
        elif unit.explained:
            found.explained.append(f"{number}: {unit.explained}")
        elif flight.world.nodes[str(number)].process is not None:
            found.stuck.append(f"{number} by {way.kind}, {undisturbed_s:.0f} s alone, {flight.seconds():.0f} s later")


def _fly(flight: CampaignFlight, watch: Watch, alone_s: list[float | None], longest_s: float) -> None:
    """Until all have arrived that may, and no vehicle manoeuvres; or one is late."""
    world = flight.world
    least_s = max([LEAST_S, *(2.0 + each for each in alone_s if each is not None)])
    calm_since_s = explained_since_s = 0.0
    while flight.seconds() < longest_s:
        world.run_until(world.now_us + STEP_US)
        watch.step()
        now_s = flight.seconds()
        if now_s < least_s:
            continue
        awaited = [
            number
            for number, unit in enumerate(watch.units)
            if alone_s[number] is not None and unit.arrived_s is None and _may_arrive(flight, number, now_s)
        ]
        if awaited or not watch.is_calm:
            calm_since_s = now_s
        if not all(watch.units[number].explained for number in awaited):
            explained_since_s = now_s
        is_late = now_s > LATE_S + LATE * max([least_s, *(alone_s[number] or 0.0 for number in awaited)])
        if is_late or now_s - calm_since_s >= CALM_S or (awaited and now_s - explained_since_s >= EXPLAINED_S):
            return


def _may_arrive(flight: CampaignFlight, number: int, now_s: float) -> bool:
    """Whether its platform runs, or will."""
    if flight.world.nodes[str(number)].process is not None:
        return True
    return any(
        trouble.unit == number and trouble.for_s is not None and now_s <= trouble.at_s + trouble.for_s + 1.0
        for trouble in flight.drawn.troubles
        if trouble.kind == "process dies"
    )


def _contained(flight: CampaignFlight) -> list[str]:
    """What parts have raised, and processes that ended by themselves."""
    found = []
    for unit, node in flight.world.nodes.items():
        found += [f"{unit} ended: {reason}" for reason in node.halted]
        for life in node.lives:
            if isinstance(life, Platform):
                found += [
                    f"{unit} raised in {where}, {count} times" for where, count in life.containment.failures.items()
                ]
    return found
