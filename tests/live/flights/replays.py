"""Recorded flights replayed by platform processes: what was federated, and what the same filter gives offline."""

import itertools
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dyknow.agents.effects import Reported
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.messages.contents import Alarm, Alarms, MonitorEntry
from dyknow.navigation.vehicle import PositionReport, Report
from dyknow.proxies.recordings.journal_file import Stepped, read_journal
from tests.live.flights.federated import Federated, Track, federated, separations
from tests.live.flights.test_real_flights import Place
from tests.navigation.offline import run_filter

PERIOD_US = 100_000
LEAD_US = 14_000_000
ASK_EVERY_US = 250_000
LATE_S = 5.0
PROFILE = "separation-20m"
NEAR_M = 20.0


@dataclass
class Flown:
    """What came of a replay: `live` as the command centre imported it, `offline` by the journals.

    `watched` are the monitors as platforms told them: (federation time of the answer, monitor).
    """

    epoch_us: int
    clock: FederationClock
    ends_us: int
    units: list[str]
    live: dict[str, Track] = field(default_factory=dict)
    offline: dict[str, Track] = field(default_factory=dict)
    reports: dict[str, list[Report]] = field(default_factory=dict)
    alarms: list[Alarm] = field(default_factory=list)
    watched: list[tuple[int, MonitorEntry]] = field(default_factory=list)
    answers: dict[str, list[Any]] = field(default_factory=dict)

    def live_apart(self, a: str, b: str) -> dict[int, float]:
        return self._until(separations(self.live[a], self.live[b]))

    def offline_apart(self, a: str, b: str) -> dict[int, float]:
        return self._until(separations(self.offline[a], self.offline[b]))

    def _until(self, found: dict[int, float]) -> dict[int, float]:
        return {at: apart for at, apart in found.items() if at <= self.ends_us}

    def edges(self, by: str) -> list[tuple[str, int]]:
        """Openings and closings of the profile's alarm, as `by` raised them."""
        own = sorted((a.valid_us, a.event) for a in self.alarms if a.by == by and a.monitor == PROFILE)
        return [(event, at) for at, event in own if at <= self.ends_us]


def file(name: str) -> str:
    return str(Path(os.environ["DYKNOW_FLIGHT_DATA"]) / name)


@contextmanager
def flying(
    directory: Path, vehicles: dict[str, dict[str, Any]], speed: float, patience_s: float = 2.0
) -> Iterator[tuple[Federated, Flown]]:
    """One platform per vehicle on a clock that begins in a moment; replays begin at its epoch.

    Monitors wait `patience_s` of wall time for their inputs: what a message needs on a busy machine is wall time, and
    a federation that runs ten times as fast has ten times as much of it. Entered with positions streamed to the command centre and the profile monitored, before the first sample.
    """
    epoch_us = time.time_ns() // 1000 + LEAD_US
    configs = [
        {
            "unit": unit,
            "vehicle": {**vehicle, **({"epoch_us": epoch_us} if vehicle["kind"] == "replay" else {})},
            "journal": str(directory / f"{unit}.mcap"),
            "shedding": False,  # samples are counted
        }
        for unit, vehicle in vehicles.items()
    ]
    units = list(vehicles)
    flown = Flown(epoch_us, FederationClock(epoch_us, speed), epoch_us, units)
    with federated(directory, configs, {"epoch_us": epoch_us, "speed": speed}) as federation:
        federation.stream_positions(units, delay_s=2.0 * speed)
        federation.follow_alarms(units, Alarms())
        federation.monitor(units[0], profile=PROFILE, avoidance=False, delay_s=patience_s * speed)
        assert federation.client.federation_us() < epoch_us, "set up in time"
        yield federation, flown
        flown.live = {unit: federation.track(unit) for unit in units}
        flown.alarms = [alarm for alarm, _ in federation.alarms]
    for unit in units:
        journal = list(journalled(directory / f"{unit}.mcap", flown.clock))
        flown.reports[unit] = [report for report, _ in journal]
        flown.offline[unit] = {s.valid_us: tuple(s.value[:3]) for s in run_filter(journal, PERIOD_US)}


def journalled(path: Path, clock: FederationClock) -> Iterator[tuple[Report, int]]:
    """The vehicle's reports in a journal, each with the federation time at which it was available."""
    for entry in read_journal(path):
        if isinstance(entry, Stepped) and isinstance(entry.event, Reported):
            yield entry.event.report, clock.federation_us(entry.now_us)


def watch(federation: Federated, flown: Flown, until_us: int) -> None:
    """Ask all platforms for their monitors, over and over, until an instant."""
    while federation.client.federation_us() < until_us:
        for unit in list(federation.fleet.running):
            for monitor in federation.monitors(unit):
                flown.watched.append((federation.client.federation_us(), monitor))
        pause_us = round(ASK_EVERY_US * flown.clock.speed)
        federation.until_us(min(until_us, federation.client.federation_us() + pause_us))


def fly_out(federation: Federated, flown: Flown, beyond_us: int) -> None:
    """Until a while after the end, and then until what was federated of it is here: a busy machine is late."""
    federation.until_us(flown.ends_us + beyond_us)
    federation.wait_for(
        lambda: all(max(federation.track(unit), default=0) >= flown.ends_us for unit in flown.units), LATE_S
    )


def crossings(apart: dict[int, float], near_m: float = NEAR_M) -> list[tuple[str, int]]:
    """When an alarm for `apart` < `near_m` opens and closes: at the first bad state, at the first of two good ones.

    Instants without a separation decide nothing and interrupt a run of good ones.
    """
    found: list[tuple[str, int]] = []
    is_open, good_us = False, None
    for at_us in range(min(apart), max(apart) + 1, PERIOD_US):
        metres = apart.get(at_us)
        if metres is None or metres < near_m:
            if metres is not None and not is_open:
                is_open = True
                found.append(("opened", at_us))
            good_us = None
        elif is_open and good_us is not None:
            is_open = False
            found.append(("closed", good_us))
        elif is_open:
            good_us = at_us
    return found


def gaps(track: Track, longer_than_us: int) -> list[tuple[int, int]]:
    """(last before, first after) where a track pauses."""
    return [(a, b) for a, b in itertools.pairwise(sorted(track)) if b - a > longer_than_us]


def fixes(reports: list[Report], source: str) -> tuple[list[int], list[Place]]:
    """Raw positions of one source, in order."""
    found = {
        r.valid_us: Place(r.latitude_deg, r.longitude_deg, r.altitude_m)
        for r in reports
        if isinstance(r, PositionReport) and r.source == source and r.altitude_m is not None
    }
    return sorted(found), [found[at] for at in sorted(found)]
