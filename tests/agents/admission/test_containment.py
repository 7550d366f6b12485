"""What is contained, how long it is left out, who is blamed for it, and what is shown."""

from typing import Any

import pytest

from dyknow import Network, Policy, Sample, Sort
from dyknow.agents.admission.admission import Admission
from dyknow.agents.containment import DEAF_US, QUIET_US, TRIES
from dyknow.agents.exchange.peer_motion import PeerMotion
from dyknow.agents.monitoring.unit_monitoring import UnitMonitoring
from dyknow.federation.messages.contents import Goto, MonitorProximity, Tasks
from tests.agents.rosters import trust
from tests.box import Box


def fail(*_args: object, **_more: object) -> Any:
    raise RuntimeError("made to\x1b[2J fail")


def pair(wire: Box, **config: Any) -> Any:
    for unit in "01":
        wire.fly(unit, 0.0, 300.0 * int(unit), contained=True, control=True, **config)
    wire.centre()
    wire.run(1.5)
    wire.asked("cc", "0", MonitorProximity())
    wire.run(1.5)
    return wire.platform("0")


def shown(wire: Box, by: str = "1") -> list[str]:
    """What others are told of 0."""
    entry = wire.member(by).directory.entry("0")
    assert entry is not None
    return [each.text for each in entry.conditions if each.text.startswith("impaired")]


def test_a_part_that_raises_by_time_is_out_after_three_times_and_is_well_again_after_a_quiet_minute(
    wire: Box, monkeypatch: pytest.MonkeyPatch
) -> None:
    platform = pair(wire)
    with monkeypatch.context() as patch:
        patch.setattr(PeerMotion, "on_time", fail)
        wire.run(0.9)
        (text,) = shown(wire)
        assert text.startswith(
            "impaired (failed): PeerMotion.fail: RuntimeError: made to [2J fail (test_containment.py:"
        )
        wire.run(30)
        assert platform.containment.failures["PeerMotion.fail"] == TRIES
        assert shown(wire)[0].startswith("impaired (is out, tried again each minute): PeerMotion.fail")
        wire.run(60)
        assert platform.containment.failures["PeerMotion.fail"] == TRIES + 1
    wire.run(QUIET_US / 1e6 + 2)
    assert shown(wire) == []
    assert wire.nodes["0"].notes[-1] == "no longer impaired: PeerMotion.fail"


def test_a_vital_part_is_tried_ten_times_a_second_however_often_it_raises(
    wire: Box, monkeypatch: pytest.MonkeyPatch
) -> None:
    platform = pair(wire)
    monkeypatch.setattr(UnitMonitoring, "on_time", fail)
    wire.run(30)
    assert 200 <= platform.containment.failures["UnitMonitoring.fail"] <= 301
    assert shown(wire)[0].startswith("impaired (failed 100 times and more): UnitMonitoring.fail")
    monkeypatch.undo()
    wire.run(1)
    (named,) = [each for each in platform.built.monitors.named.values() if each.instances][:1]
    assert {each.monitor.shows for each in named.instances.values()} == {"ok"}


def test_one_consumer_that_raises_does_not_keep_a_sample_from_the_others_and_is_tried_again() -> None:
    network, told, got = Network(), [], []
    network.add_source("a", Sort("number"))
    network.instant.contain = lambda do, label, error: told.append((do, label, str(error))) or 1_000

    def consumer(sample: Any) -> None:
        if sample.value < 3.0:
            raise ValueError(sample.value)
        got.append(("first", sample.value))

    network.connect("a", Policy(), consumer)
    network.connect("a", Policy(), lambda sample: got.append(("second", sample.value)))
    for at_us in range(6):
        network.push("a", Sample(at_us * 500, at_us * 500, float(at_us)))
    assert [value for who, value in got if who == "second"] == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert [value for who, value in got if who == "first"] == [4.0, 5.0]
    assert told == [(consumer, "a", "0.0"), (consumer, "a", "2.0")]


def test_what_raises_in_a_network_that_contains_nothing_is_raised_by_the_push() -> None:
    network = Network()
    network.add_source("a", Sort("number"))
    network.connect("a", Policy(), fail)
    with pytest.raises(RuntimeError, match="made to"):
        network.push("a", Sample(0, 0, 1.0))


def test_an_answer_whose_taker_raises_ends_that_conversation_and_is_the_answerers(wire: Box) -> None:
    platform = pair(wire)
    told: list[str] = []
    conversation = wire.call(
        "0",
        lambda platform, now_us: platform.ports.agent.delegate(
            "1", Tasks(), now_us, on_reply=fail, on_silence=lambda why, _at_us: told.append(why)
        ),
    )
    wire.run(0.2)
    assert told == ["what 1 answered could not be taken"]
    assert conversation not in {
        each.opening.conversation_id for each in platform.member.acts.conversations.conversations()
    }
    assert platform.containment.senders == {"1": 1}


def three(wire: Box, *, is_signed: bool = True) -> Any:
    """Platform 0 of three, and a command centre."""
    for unit in "012":
        given = {"trust": trust(unit)} if is_signed else {}
        wire.fly(unit, 0.0, 300.0 * int(unit), contained=True, control=True, **given)
    wire.centre("cc", trust("cc") if is_signed else None)
    wire.run(2)
    return wire.platform("0")


def break_tasks(platform: Any, patch: pytest.MonkeyPatch) -> None:
    """Whoever asks for its tasks makes a part raise."""
    patch.setitem(platform.part(Admission)._handlers, "tasks", fail)


def test_acts_of_a_member_that_made_parts_fail_three_times_are_refused_for_a_minute(
    wire: Box, monkeypatch: pytest.MonkeyPatch
) -> None:
    platform = three(wire)
    with monkeypatch.context() as patch:
        break_tasks(platform, patch)
        for _ in range(TRIES):
            question = wire.asked("1", "0", Tasks())
            assert (question.performatives, question.contents[0].code) == (["failure"], "failed")
    question = wire.asked("1", "0", Tasks())
    assert (question.performatives, question.contents[0].code) == (["refuse"], "not-heard")
    assert wire.asked("2", "0", Tasks()).performatives == ["inform"]
    wire.run(2)
    assert "impaired: acts of 1 are refused for a minute: parts failed over them" in shown(wire, "2")
    before = wire.samples("0")
    wire.run(1)
    assert wire.samples("0") >= before
    wire.run(DEAF_US / 1e6)
    assert wire.asked("1", "0", Tasks()).performatives == ["inform"]


@pytest.mark.parametrize("who", ["cc", "another, too", "unsigned"])
def test_nobody_is_silenced_that_commands_or_may_be_blamed_for_others(
    wire: Box, monkeypatch: pytest.MonkeyPatch, who: str
) -> None:
    break_tasks(three(wire, is_signed=who != "unsigned"), monkeypatch)
    if who == "another, too":
        wire.asked("2", "0", Tasks())
    asker = "cc" if who == "cc" else "1"
    for _ in range(2 * TRIES):
        assert wire.asked(asker, "0", Tasks()).performatives == ["failure"]
    if who == "cc":
        question = wire.asked("cc", "0", Goto(latitude_deg=58.0, longitude_deg=15.0, altitude_m=60.0))
        assert question.performatives[0] == "agree"
        assert wire.vehicle("0").commands


def test_the_pilot_flies_on_though_giving_way_raises(wire: Box, monkeypatch: pytest.MonkeyPatch) -> None:
    platform = pair(wire)
    platform.ports.moved[:] = [fail]
    question = wire.asked("cc", "0", Goto(latitude_deg=58.0, longitude_deg=15.0, altitude_m=60.0))
    wire.run(2)
    assert question.performatives == ["agree", "inform"]
    assert shown(wire)[0].startswith("impaired (failed 10 times and more): fail: RuntimeError")
