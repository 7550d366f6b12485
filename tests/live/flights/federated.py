"""Platform processes of one federation and a command centre beside them, for tests: real Zenoh, real clocks."""

import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from dyknow.console.commands.fleet.up import FleetStart
from dyknow.console.processes.supervision import Fleet
from dyknow.federation.members.command_centre import CommandCentre
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import (
    Alarm,
    CreateMulticast,
    MonitorEntry,
    MonitorList,
    MonitorProximity,
    Monitors,
)
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.navigation.geodesy import distance_m
from dyknow.proxies.zenoh.configuration import ZenohOptions
from dyknow.proxies.zenoh.edge import ZenohEdge
from dyknow.runtime.client import Client, ClientPorts
from dyknow.runtime.clock import NodeClock
from dyknow.runtime.configuration.config import NodeConfig

JOIN_S = 40.0
ANSWER_S = 5.0
POSITION, ALTITUDE, VELOCITY = "heli-position", "heli-altitude", "heli-velocity"
_NUMBERS = count()
Track = dict[int, tuple[float, float, float]]
"""(latitude_deg, longitude_deg, altitude_m) by valid time."""


class Federated:
    """The platforms, and what a command centre hears of them.

    Attributes:
        positions: by unit, what its streams said, as this command centre imported them.
        alarms: (alarm, federation time when it came here), by unit that raised it, in order of arrival.
    """

    def __init__(self, fleet: Fleet | None, client: Client) -> None:
        self.fleet, self.client = fleet, client
        self.said: list[tuple[str, dict[str, Any]]] = []
        self._parts: dict[tuple[str, str], dict[int, tuple[float, ...]]] = {}
        self._told: dict[str, int] = {}
        self._subscriptions: dict[str, Dialogue] = {}
        self.alarms: list[tuple[Alarm, int]] = []
        client.centre.on_sample = self._on_sample

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        def stepped() -> bool:
            self._hear()
            return condition()

        return self.client.wait_for(stepped, timeout_s)

    def until_us(self, federation_us: int, beyond_s: float = 5.0) -> None:
        """Go on until federation time reaches an instant."""
        clock, now_us = self.client.centre.clock, self.client.now_us()
        wait_s = max(0, clock.wall_us(federation_us) - now_us) / 1e6
        assert self.wait_for(lambda: self.client.federation_us() >= federation_us, wait_s + beyond_s)

    def _hear(self) -> None:
        if self.fleet is not None:
            self.said += self.fleet.heard()
        for unit, subscription in self._subscriptions.items():
            results = subscription.results
            now_us = self.client.federation_us()
            for said in results[self._told[unit] :]:
                if isinstance(said, Alarm):
                    self.alarms.append((said, now_us))
            self._told[unit] = len(results)

    def _on_sample(self, name: tuple[str, str, str], sample: Any, _at_us: int) -> None:
        self._parts.setdefault(name[:2], {})[sample.valid_us] = sample.value

    def values(self, unit: str, label: str) -> dict[int, tuple[float, ...]]:
        return self._parts.get((unit, label), {})

    def track(self, unit: str) -> Track:
        places, heights = self.values(unit, POSITION), self.values(unit, ALTITUDE)
        return {at: (*places[at], *heights[at]) for at in sorted(places.keys() & heights.keys())}

    # Asking

    def stream_positions(self, units: list[str], delay_s: float = 2.0, *labels: str) -> None:
        """Have them streamed to this command centre every 100 ms, with further labels if wanted."""
        content = CreateMulticast(
            semantic_labels=(POSITION, ALTITUDE, *labels),
            sample_period_s=0.1,
            delay_s=delay_s,
            to_units=(self.client.centre.unit,),
        )
        self._standing(units, Performative.REQUEST, content)

    def follow_alarms(self, units: list[str], content: Any) -> None:
        found = self._standing(units, Performative.SUBSCRIBE, content)
        self._subscriptions |= found
        self._told |= dict.fromkeys(found, 0)

    def monitor(self, leader: str, **asked: Any) -> Dialogue:
        """Delegate (monitor-proximity) and wait until it is agreed to."""
        return self._standing([leader], Performative.REQUEST, MonitorProximity(**asked))[leader]

    def _standing(self, units: list[str], performative: Performative, content: Any) -> dict[str, Dialogue]:
        asked = {u: self.client.say(u, performative, content, within_s=ANSWER_S, standing=True) for u in units}
        done = self.wait_for(lambda: all(d.agreed or d.trouble for d in asked.values()), ANSWER_S + 1)
        assert done and not any(d.trouble for d in asked.values()), {u: d.trouble for u, d in asked.items()}
        return asked

    def ask(self, unit: str, content: Any, timeout_s: float = ANSWER_S) -> list[Any]:
        """Query-ref, and what is informed; its trouble as text if there is some."""
        for dialogue in self.client.ask([unit], content, Performative.QUERY_REF, timeout_s):
            return [dialogue.trouble] if dialogue.trouble else list(dialogue.results)
        return []

    def monitors(self, unit: str) -> list[MonitorEntry]:
        return [each for said in self.ask(unit, Monitors()) if isinstance(said, MonitorList) for each in said.monitors]

    def opened(self, monitor: str, by: str | None = None) -> list[Alarm]:
        return self._alarms("opened", monitor, by)

    def closed(self, monitor: str, by: str | None = None) -> list[Alarm]:
        return self._alarms("closed", monitor, by)

    def _alarms(self, event: str, monitor: str, by: str | None) -> list[Alarm]:
        return [a for a, _ in self.alarms if a.event == event and a.monitor == monitor and by in {None, a.by}]


@contextmanager
def federated(
    directory: Path,
    configs: list[dict[str, Any]],
    clock: dict[str, Any] | None = None,
    module: str = "dyknow.runtime.node",
) -> Iterator[Federated]:
    """Start a platform for each configuration; entered when all have found each other and the command centre them."""
    name = f"test-{os.getpid()}-{next(_NUMBERS)}"
    fleet = Fleet(directory, lifeline=True)
    wire = {"federation": name}
    try:
        for given in configs:
            config = NodeConfig.model_validate({"wire": wire, "clock": clock or {}, **given})
            fleet.start(config.unit, config.model_dump_json(), module)
        units = [str(given["unit"]) for given in configs]
        gathering = FleetStart(units)
        assert fleet.follow(gathering.all_found, gathering.on_heard, JOIN_S), "they did not find each other"
        with command_centre(name) as client:
            there = {seen.unit for seen in client.settle(5.0)}
            assert there >= set(units), there
            yield Federated(fleet, client)
    finally:
        fleet.end()


def command_centre(federation: str) -> Client:
    """Beside the platforms of a federation; to be entered."""

    def opened(post: Callable[[Any], None], now_us: Callable[[], int]) -> ZenohEdge:
        edge = ZenohEdge(ZenohOptions(federation), post, now_us)
        edge.open()
        return edge

    around = ClientPorts(SimpleQueue(), NodeClock().now_us, opened)
    return Client(around, lambda zid, now_us: CommandCentre(f"cc-{os.getpid()}", now_us, zid=zid))


def separations(a: Track, b: Track) -> dict[int, float]:
    """3-D distance in metres at every valid time both have."""
    return {
        at: math.dist(
            (distance_m(*a[at][:2], *b[at][:2]), a[at][2]),
            (0.0, b[at][2]),
        )
        for at in sorted(a.keys() & b.keys())
    }
