"""B18: all pairs of 50 UAVs monitored in one process: 1225 instances, states at 10 Hz; what one core has left."""

import random
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from time import process_time

from bench.rows import Figures, Limit, Options, Side
from dyknow import Label, Network, Sample
from dyknow.agents.monitoring.monitor_plans import PlanBook
from dyknow.agents.monitoring.monitors import UnitMonitors
from dyknow.federation.sharing.ontology import default_ontology
from dyknow.federation.sharing.translation import LabelConversion
from dyknow.reasoning import AlarmEvent, builtin_profiles

TITLE = "50 UAVs, 1225 pairs, 10 Hz, one process: percent of a core, from pushed samples to alarms"
BARS = tuple(Limit("core_percent", 50.0, ours=side) for side in ("proximity", "proximity, proximity-warn"))
UNITS = 50
PERIOD_US, DELAY_US = 100_000, 20_000
LABELS = ("heli-position", "heli-altitude", "heli-velocity")
WARM = 20


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    states, units = max(5, round(50 * options.effort)), options.size(UNITS, 6)
    yield {
        "proximity": partial(_percent, ("proximity",), states, units),
        "proximity, proximity-warn": partial(_percent, ("proximity", "proximity-warn"), states, units),
    }


def _percent(profiles: tuple[str, ...], states: int, units: int) -> Figures:
    fleet = _Fleet(profiles, units)
    for number in range(WARM):
        fleet.pass_state(number)
    began_s = process_time()
    for number in range(WARM, WARM + states):
        fleet.pass_state(number)
    used_s = process_time() - began_s
    return {"core_percent": 100 * used_s / (states * PERIOD_US / 1e6), "pairs": float(fleet.pairs)}


class _Fleet:
    """Every UAV monitors those with greater numbers, so that each pair is monitored once."""

    def __init__(self, profiles: tuple[str, ...], units: int) -> None:
        self._units = tuple(map(str, range(units)))
        self._random = random.Random(1)
        self._network = Network(history=64)
        self.alarms: list[AlarmEvent] = []
        ontology = default_ontology()
        self._labels = {(name, unit): Label(name, (unit,)) for name in LABELS for unit in self._units}
        for (name, _), label in self._labels.items():
            self._network.add_source(label, ontology[name].sort, 64)
        self._positions = {unit: (58.4 + self._spread(0.02), 15.5 + self._spread(0.02)) for unit in self._units}
        self._velocities = {unit: (self._spread(5.0), self._spread(5.0), 0.0) for unit in self._units}
        self._monitors = [self._monitored_by(at, unit, profiles) for at, unit in enumerate(self._units)]

    def _spread(self, most: float) -> float:
        return self._random.uniform(-most, most)

    def _monitored_by(self, at: int, unit: str, profiles: tuple[str, ...]) -> UnitMonitors:
        source = lambda name, of: (self._labels[name, of], LabelConversion(None))  # noqa: E731
        monitors = UnitMonitors(unit, self._network, source, self.alarms.append)
        for other in self._units[at + 1 :]:
            monitors.join(other, 0)
        book = PlanBook(unit, builtin_profiles())
        for profile in profiles:
            monitors.create(book.named(profile), "bench", 0)
        return monitors

    @property
    def pairs(self) -> int:
        return max(
            sum(
                len(named.instances)
                for one in self._monitors
                for named in one.named.values()
                if named.plan.name == name
            )
            for name in {name for one in self._monitors for name in one.named}
        )

    def pass_state(self, number: int) -> None:
        valid_us = number * PERIOD_US
        now_us = valid_us + DELAY_US
        for at, unit in enumerate(self._units):
            (latitude, longitude), velocity = self._positions[unit], self._velocities[unit]
            self._positions[unit] = latitude + velocity[0] * 1e-6, longitude + velocity[1] * 1e-6
            values = (self._positions[unit], (100.0 + at,), velocity)
            for name, value in zip(LABELS, values, strict=True):
                self._network.push(self._labels[name, unit], Sample(now_us, valid_us, value))
        for one in self._monitors:
            one.on_time(now_us)
        self._network.on_time(now_us)
