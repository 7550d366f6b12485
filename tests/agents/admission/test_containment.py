"""What a part raises ends that act or step, never the platform; the others are stepped, and it is shown and counted."""

import pytest

from agents.admission.containment import DEAF_US, TRIES
from agents.flight.flight import FlightAgent
from agents.flight.giving_way import GivingWay
from agents.part import overrides
from agents.parts import PARTS
from federation.messages.contents import MonitorProximity, Tasks


def fail(*_args, **_more):
    raise RuntimeError("made to fail")


def pair(wire):
    for unit in "01":
        wire.fly(unit, 0.0, 300.0 * int(unit), contained=True)
    wire.centre()
    wire.run(1.5)
    wire.asked("cc", "0", MonitorProximity())
    wire.run(3)
    return wire.platform("0")


def shown(platform):
    return [each.text for each in platform._conditions() if each.text.startswith("impaired")]


@pytest.mark.parametrize("method", ["on_time", "on_peer", "on_alarm", "flush", "conditions"])
def test_whatever_part_raises_the_platform_goes_on_and_says_so(wire, method, monkeypatch):
    platform = pair(wire)
    for part in platform.parts:
        if overrides(part, method):
            monkeypatch.setattr(type(part), method, fail)
            break
    wire.kill("1") if method == "on_peer" else None
    wire.run(3)
    if method == "on_alarm":
        platform._on_alarm(None)
    assert platform.settle() is not None
    platform._conditions()
    assert platform.containment.failures
    assert shown(platform) or method == "conditions"


def test_a_step_that_raises_again_and_again_stays_out_and_the_others_are_stepped(wire, monkeypatch):
    platform = pair(wire)
    victim = next(part for part in platform.parts if type(part).__name__ == "Shedding")
    seen = []
    flight = platform.part(FlightAgent)
    before = flight.on_time
    monkeypatch.setattr(type(flight), "on_time", lambda _self, now_us: (seen.append(now_us), before(now_us)))
    monkeypatch.setattr(type(victim), "on_time", fail)
    for _ in range(TRIES + 2):
        platform.containment._paused_us.pop(victim, None) if platform.containment.failures[
            "Shedding.on_time"
        ] < TRIES else None
        platform.on_time(wire.now_us)
    assert platform.containment.failures["Shedding.on_time"] == TRIES
    assert len(seen) == TRIES + 2
    assert "is out" in shown(platform)[0]
    assert platform.part(GivingWay) is not None


def test_an_act_whose_handler_raises_is_answered_and_three_are_not_listened_to(wire, monkeypatch):
    platform = pair(wire)
    tasks = platform.part(next(kind for kind in PARTS if kind.__name__ == "TaskLife"))
    admission = platform.parts[[type(each).__name__ for each in platform.parts].index("Admission")]
    monkeypatch.setitem(admission._handlers, "tasks", fail)
    for _ in range(TRIES):
        assert wire.asked("cc", "0", Tasks()).performatives == ["failure"]
    assert platform.containment.senders["cc"] == TRIES
    assert any("not listened to" in each.text for each in platform._conditions())
    monkeypatch.setitem(admission._handlers, "tasks", tasks.on_tasks)
    wire.asked("cc", "0", Tasks())
    assert platform.refused["not listened to"]
    wire.run(DEAF_US / 1e6)
    assert wire.asked("cc", "0", Tasks()).performatives == ["inform"]
