"""Each part raises in each of its callbacks: the platform flies and monitors on, and others are shown where it is impaired."""

import os
from random import Random
from typing import Any, NamedTuple

import pytest

from dyknow.agents.actions import Action
from dyknow.agents.admission import admission
from dyknow.agents.capabilities.flight.options import AvoidanceOptions
from dyknow.agents.directory.directory import DirectoryAgent
from dyknow.agents.extensions import own_parts
from dyknow.agents.options import Chosen
from dyknow.agents.part import Part
from dyknow.agents.platform import Platform
from dyknow.federation import keys
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Directory, Hold, MonitorProximity
from dyknow.federation.messages.protocols import OPENING
from dyknow.federation.messages.sexpr import Expr
from dyknow.federation.transport import Asked
from dyknow.navigation.vehicle import GoToOrder
from dyknow.reasoning import AlarmEvent
from tests.agents.admission.raising import CASES, Fuses, callbacks
from tests.agents.capabilities.separation.meetings import orders
from tests.box import Box, Vehicle

FULL = bool(os.environ.get("DYKNOW_FULL"))
PER_SEED = 80 if FULL else 25
OUT_OF_SIGHT = {("DirectoryAgent", name) for name in callbacks(DirectoryAgent)}
"""Without these a platform cannot say anything to others: it says it at home."""
FLYING = {"FlightAgent", "LocalInstance", "Admission", "DirectoryAgent"}
"""Parts without which no order reaches the vehicle."""
AVOIDING = {
    *FLYING, "GivingWay", "Neighbourhood", "UnitMonitoring", "ImportProxy", "FederationAgent", "ExportProxy", "SubscriptionKeeper",
    "Coordination", "TaskLife", "AlarmLog",
}  # fmt: skip
"""Parts without which nothing is known of an encounter, or done about it."""

_REAL = admission.read


class Blank(NamedTuple):
    """A content that says nothing: only its head counts."""

    head: str
    lasting = False

    def expr(self) -> Expr:
        return Expr(self.head, {})


def federation(wire: Box, **zero: Any) -> Platform:
    """Platform 0 flies and monitors 1 and 2; 1 and 2 follow it."""
    common = {
        "contained": True,
        "control": True,
        "simulated": True,
        "options": Chosen(AvoidanceOptions(avoidance=False)),
    }
    for at, unit in enumerate("012"):
        vehicle = Vehicle(east_m=(0.0, 150.0, 25.0)[at], altitude_m=100.0 + 2 * at, battery=0.8)
        wire.join(unit, vehicle, **{**common, **(zero if unit == "0" else {})})
    wire.centre()
    wire.run(1.0)
    for unit in "01":
        wire.asked("cc", unit, MonitorProximity())
    wire.run(1.0)
    return wire.platform("0")


def actions(kind: str, method: str) -> list[Action]:
    part = next(each for each in own_parts() if each.__name__ == kind)
    return [action for offer in part.offers for action in offer.actions if action.handler == method]


def provoke(wire: Box, kind: str, method: str) -> None:
    """Have that callback called on platform 0."""
    part = next(each for each in own_parts() if each.__name__ == kind)
    for action in actions(kind, method):
        said: Any = Blank(action.head)
        if Performative.INFORM in action.performatives:
            wire.speak("cc", lambda member, now_us, said=said: member.acts.tell("0", said, now_us))  # type: ignore[misc]
        elif action.performatives & OPENING:
            wire.question("cc", "0", said, min(action.performatives & OPENING))
    for event, name in part.takes.items():
        if name == method and issubclass(event, tuple):
            if event in {keys.ClockKey, keys.DescribeKey, keys.HistoryKey}:
                key = {keys.ClockKey: keys.clock("0"), keys.DescribeKey: keys.describe("0")}.get(event)
                key = key or keys.history("0", "battery")
                wire.happens("0", Asked(10**9, key, wire.now_us, b""))
            else:
                wire.happens("0", tuple.__new__(event, (wire.now_us,) * len(event._fields)))  # type: ignore[attr-defined]
    if method == "on_act":
        wire.question("cc", "0", Hold())
    elif method == "on_cancel":
        wire.cancel_task("cc", "0", "cc-0.77")
    elif method in {"labels", "conditions"}:
        wire.call("0", lambda platform, now_us: platform.ports.offer(now_us))
    elif method == "on_alarm":
        event = AlarmEvent("a1", "opened", "proximity", ("0", "1"), wire.now_us, wire.now_us, {})
        wire.call("0", lambda platform, _now_us: platform.ports.on_alarm(event))
    elif method in {"on_lost", "on_peer"}:
        wire.question("2", "0", Directory(), Performative.SUBSCRIBE)
        wire.run(0.2)
        wire.kill("2")
        wire.run(8)
        wire.restart("2")


def heard_of(wire: Box, by: str = "1") -> str:
    """What another platform is told of the state of 0."""
    entry = wire.member(by).directory.entry("0")
    assert entry is not None
    return "\n".join(each.text for each in entry.conditions)


def is_said(wire: Box, case: tuple[str, str]) -> bool:
    """Whether somebody is told that the part is impaired."""
    return case[0] in (heard_of(wire) if case not in OUT_OF_SIGHT else "\n".join(wire.nodes["0"].notes))


def shows(platform: Platform) -> set[str]:
    """What the monitors over 1 show."""
    return {
        each.instances["1"].monitor.shows for each in platform.built.monitors.named.values() if "1" in each.instances
    }


def fail_once(wire: Box, fuses: Fuses, cases: set[tuple[str, str]], rng: Random) -> None:
    """Arm, provoke, look, disarm."""
    platform = wire.platform("0")
    fuses.armed, before = cases, fuses.fired.copy()
    wire.run(rng.uniform(0.0, 0.3))
    for case in cases:
        provoke(wire, *case)
    wire.run(2.0)
    assert wire.platform("0") is platform, "the process ended"
    for case in cases:
        if fuses.fired[case] > before[case]:
            assert is_said(wire, case), (case, heard_of(wire))
    if not {kind for kind, _ in cases} & FLYING:
        flown = len(orders(wire, "0"))
        wire.question("cc", "0", Hold())
        wire.run(0.5)
        assert len(orders(wire, "0")) > flown, cases
    if not {kind for kind, _ in cases} & AVOIDING:
        assert shows(platform) and "unknown" not in shows(platform), cases
    fuses.armed = set()
    platform.containment.impaired.clear()  # so that what comes is shown, of which there are many
    platform.containment.paused_us.clear()
    wire.run(0.2 if not any(kind in AVOIDING for kind, _ in cases) else 3.0)


@pytest.fixture
def fuses(monkeypatch: pytest.MonkeyPatch) -> Fuses:
    """All parts can be made to raise; contents that say nothing are read."""
    monkeypatch.setattr(admission, "read", _read)
    return Fuses(monkeypatch)


def _read(expr: Expr) -> Any:
    try:
        return _REAL(expr)
    except Exception:  # noqa: BLE001  (it lacks what it must have)
        return Blank(expr.head)


@pytest.mark.timeout(1800)
def test_each_callback_of_each_part_can_raise(wire: Box, fuses: Fuses) -> None:
    rng = Random(1)
    fuses.platforms.append(federation(wire))
    cases = CASES if FULL else rng.sample(CASES, PER_SEED)
    for case in cases:
        fail_once(wire, fuses, {case}, rng)
    reached = {kind for kind, _ in CASES} & {type(part).__name__ for part in wire.platform("0").parts}
    missed = [case for case in cases if case[0] in reached and not fuses.fired[case]]
    assert len(missed) <= len(cases) // 10, missed


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("seed", [2, *(pytest.param(seed, marks=pytest.mark.full) for seed in range(3, 12))])
def test_several_at_a_time_can_raise_at_any_moment(wire: Box, fuses: Fuses, seed: int) -> None:
    rng = Random(seed)
    fuses.platforms.append(federation(wire))
    for _ in range(PER_SEED // 3):
        fail_once(wire, fuses, set(rng.sample(CASES, rng.randint(2, 4))), rng)
    assert fuses.fired


def test_whatever_takes_a_sample_or_an_answer_can_raise(wire: Box, fuses: Fuses) -> None:
    platform = wire.join("0", Vehicle(battery=0.8), contained=True, control=True)
    fuses.platforms.append(platform)
    wire.join("1", Vehicle(east_m=150.0, battery=0.8), contained=True, control=True)
    wire.centre()
    wire.run(1.0)
    wire.asked("cc", "0", MonitorProximity())
    wire.run(2.0)
    assert {sort for sort, _ in fuses.seen} == {"consumer", "answer"}
    for case in sorted(fuses.seen):
        fuses.armed = {case}
        if case[0] == "answer":
            wire.kill("1")
            wire.run(8)
            wire.restart("1")
        wire.run(2.0)
        assert fuses.fired[case], case
        assert case[1] in heard_of(wire), (case, heard_of(wire))
        fuses.armed = set()
        wire.run(70.0)
        assert shows(platform) == {"ok"}, case


PARTS_SHORT = ["GivingWay", "UnitMonitoring", "Shedding", "Checks", "MessageLog", "Cooperation"]
NAMES = [kind.__name__ for kind in own_parts()]


@pytest.mark.parametrize(
    "kind", [*PARTS_SHORT, *(pytest.param(name, marks=pytest.mark.full) for name in NAMES if name not in PARTS_SHORT)]
)
def test_two_that_converge_give_way_whichever_part_raises_in_everything(wire: Box, fuses: Fuses, kind: str) -> None:
    common = {"contained": True, "control": True}
    wire.join("0", Vehicle(east_m=-100.0, east_m_s=4.0, altitude_m=102.0), **common)
    wire.join("1", Vehicle(east_m=100.0, east_m_s=-4.0), **common)
    wire.centre()
    wire.run(1.0)
    wire.question("cc", "0", MonitorProximity())
    wire.run(3.0)
    fuses.platforms += [wire.platform("0"), wire.platform("1")]
    part = next(each for each in own_parts() if each.__name__ == kind)
    fuses.armed = {(kind, name) for name in callbacks(part)}
    wire.run(30.0)
    assert set(wire.platforms) == {"0", "1"}
    climbed = any(isinstance(order, GoToOrder) for unit in "01" for order in orders(wire, unit))
    assert climbed or (kind in AVOIDING and is_impaired(wire, part)), kind
    fuses.armed = set()
    wire.run(0.5)


def is_impaired(wire: Box, part: type[Part]) -> bool:
    return any(part.__name__ in note for note in wire.nodes["0"].notes)
