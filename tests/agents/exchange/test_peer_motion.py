"""A member that states a motion that no vehicle flies is named by every platform that imports it; honest ones are not."""

from collections.abc import Callable
from typing import Any

import pytest

from dyknow import Policy
from dyknow.agents.capabilities.flight.flight import FlightAgent
from dyknow.agents.exchange.peer_motion import SHOWN_US
from dyknow.federation.messages.contents import MonitorProximity
from dyknow.model.sample import Sample
from dyknow.navigation.fusion import Estimate, PositionFilter
from dyknow.navigation.vehicle import Report
from tests.box import METRE_DEG, Box, Vehicle

LIAR, HONEST = "3", ("0", "1", "2")
Lie = Callable[[Estimate, float], Estimate]
S = 1_000_000


class LyingFilter:
    """A filter whose estimates are changed on their way out: what its platform then exports."""

    def __init__(self, own: PositionFilter, box: Box) -> None:
        self._own, self._box = own, box
        self.lie: Lie | None = None
        self.since_us = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._own, name)

    def begin(self, lie: Lie) -> None:
        self.lie, self.since_us = lie, self._box.now_us

    def _changed(self, samples: list[Sample]) -> list[Sample]:
        lie = self.lie
        if lie is None:
            return samples
        return [one._replace(value=lie(one.value, (one.valid_us - self.since_us) / 1e6)) for one in samples]

    def on_report(self, report: Report, now_us: int) -> list[Sample]:
        return self._changed(self._own.on_report(report, now_us))

    def on_time(self, now_us: int) -> list[Sample]:
        return self._changed(self._own.on_time(now_us))


def monitored(box: Box, *, speed: float = 4.0) -> LyingFilter:
    """Three honest platforms and one that will lie, all in flight over one field; each imports the others' positions."""
    for number, unit in enumerate((*HONEST, LIAR)):
        box.join(unit, Vehicle(north_m=150.0 * number, east_m_s=speed, altitude_m=100.0 + 30.0 * number))
    box.centre()
    box.run(1.0)
    box.question("cc", "0", MonitorProximity(avoidance=False))
    box.run(6.0)
    streams = box.platform(LIAR).part(FlightAgent).streams
    liar = streams.filter = LyingFilter(streams.filter, box)  # type: ignore[assignment]
    assert said(box) == {}
    return liar


def said(box: Box) -> dict[str, list[str]]:
    """What a command centre is shown of the members' motion, by platform."""
    found: dict[str, list[str]] = {}
    for unit in box.platforms:
        entry = box.member("cc").directory.entry(unit)
        assert entry is not None
        texts = [one.text for one in entry.conditions if "state" in one.text and one.text.startswith("platform")]
        if texts:
            found[unit] = texts
    return found


def moved(north_m: float = 0.0, east_m: float = 0.0, up_m: float = 0.0) -> Lie:
    return lambda one, _s: one._replace(
        latitude_deg=one.latitude_deg + north_m * METRE_DEG,
        longitude_deg=one.longitude_deg + east_m * METRE_DEG / 0.53,
        altitude_m=one.altitude_m + up_m,
    )


def racing(one: Estimate, s: float) -> Estimate:
    return one._replace(latitude_deg=one.latitude_deg + 400.0 * s * METRE_DEG, north_m_s=400.0)


LIES: list[tuple[str, Lie, str, float]] = [
    ("leap", moved(north_m=900.0), "positions that no vehicle flies: 9", 2.0),
    ("a large deviation does not excuse it", lambda one, s: moved(east_m=900.0)(one, s)._replace(var_n=1e9, var_e=1e9), "positions that no vehicle flies: 9", 2.0),
    ("speed", racing, "positions that no vehicle flies: ", 5.0),
    ("off the earth", lambda one, _s: one._replace(latitude_deg=4000.0), "positions that are no place on earth", 2.0),
    ("climb", moved(up_m=300.0), "altitudes that no vehicle flies: 300 m in ", 2.0),
    ("stands by its velocity", lambda one, s: racing(one, s / 20.0)._replace(north_m_s=0.0, east_m_s=0.0), "velocities that contradict its positions: ", 6.0),
    ("flies by its velocity", lambda one, _s: one._replace(north_m_s=40.0), "velocities that contradict its positions: ", 6.0),
    ("sinks by its velocity", lambda one, _s: one._replace(down_m_s=40.0), "velocities that contradict its positions: ", 6.0),
]  # fmt: skip


@pytest.mark.parametrize(("lie", "text", "within_s"), [each[1:] for each in LIES], ids=[each[0] for each in LIES])
def test_each_lie_is_named_by_each_platform_and_by_no_other_name(wire: Box, lie: Lie, text: str, within_s: float):
    liar = monitored(wire)
    liar.begin(lie)
    wire.run(within_s)
    shown = said(wire)
    assert shown.keys() == set(HONEST), "one that lies imports the honest ones, and has nothing to say of them"
    for unit in HONEST:
        assert shown[unit][0].startswith(f"platform {LIAR} states {text}"), shown
        assert all(each.startswith(f"platform {LIAR} ") for each in shown[unit])
        noted = [note for note in wire.nodes[unit].notes if text in note]
        assert len(noted) == 1, noted


def test_what_it_states_is_still_traffic_and_it_is_named_no_longer_once_it_is_honest(wire: Box):
    liar = monitored(wire)
    liar.begin(moved(north_m=900.0))
    wire.run(2.0)
    assert said(wire)
    latest = wire.platform("0").built.gateway.latest("heli-position", LIAR)
    assert wire.now_us - latest.valid_us < S, "its samples are taken as before"
    wire.run(SHOWN_US / 1e6 + 1.0)
    assert said(wire) == {}


def test_who_repeats_the_positions_of_another_is_named_by_all_and_by_the_other(wire: Box):
    liar = monitored(wire)
    network = wire.platform("1").part(FlightAgent).streams._network
    estimates: dict[int, Any] = {}
    network.connect(
        wire.platform("1").part(FlightAgent).streams.estimate,
        Policy(),
        lambda one: estimates.setdefault(one.valid_us, one.value),
    )

    def repeated(one: Estimate, s: float) -> Estimate:
        taken = estimates.get(liar.since_us + round(s * 1e6))
        return one if taken is None else one._replace(latitude_deg=taken[0], longitude_deg=taken[1])

    liar.begin(repeated)
    wire.run(4.0)
    shown = said(wire)
    assert shown.keys() >= set(HONEST)
    assert any("states the positions of this platform" in text for text in shown["1"])
    for unit in ("0", "2"):
        assert any("the positions of 1" in text or "the same positions" in text for text in shown[unit]), shown
