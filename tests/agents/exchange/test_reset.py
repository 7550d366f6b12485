"""A client has the samples of a stream forgotten: which streams, by whom, and that no monitor is blinded by it."""

from typing import Any

import pytest

from dyknow.agents.actions import Role
from dyknow.agents.effects import Fed
from dyknow.agents.specification.remote_changes import CHANGES_BURST
from dyknow.agents.tasks.requests import RESET
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import AlarmList, Done, QueryStream, Reason, Reset
from tests.agents.exchange.test_declared_streams import MAKES, sensor, specify
from tests.box import Box, Question

P = Performative
__all__ = ["sensor"]
FED = "source number level\nstrmgen level[self] = level\nmonitor low = always level[self] < 50\n"


@pytest.fixture
def fed(wire: Box) -> Box:
    """Platform 7 is fed the levels of the test, and watches them."""
    wire.join("7")
    wire.join("8")
    wire.centre()
    specify(wire, FED)
    return wire


def reset(wire: Box, stream: str, by: str = "cc") -> Question:
    question = wire.question(by, "7", Reset(stream=stream))
    wire.run(0.2)
    return question


def values(wire: Box, stream: str = "level[self]", **which: Any) -> list[float]:
    question = wire.question("8", "7", QueryStream(stream=stream, **which), P.QUERY_REF)
    wire.run(0.2)
    return [each.value["value"] for said in question.contents if not isinstance(said, Reason) for each in said.samples]


def alarms(wire: Box) -> list[Any]:
    return wire.asked("cc", "7", AlarmList(), P.QUERY_REF).contents[0].alarms


def push(wire: Box, *levels: float) -> None:
    for level in levels:
        wire.run((100_000 - wire.now_us % 100_000) / 1e6)
        wire._reach(wire.nodes["7"], Fed(wire.now_us, "level", wire.now_us, level))
        wire.run(0.01)


def test_what_a_specification_declares_is_forgotten_and_comes_again(fed: Box) -> None:
    push(fed, 1.0, 2.0, 3.0)
    assert values(fed, op="last", n=9) == [1.0, 2.0, 3.0]
    then_us = fed.now_us
    question = reset(fed, "level[self]")
    assert question.performatives == [P.AGREE, P.INFORM]
    assert question.contents[-1] == Done(text="3 samples of level[7] are forgotten")
    assert values(fed, op="last", n=9) == []
    push(fed, 4.0)
    assert values(fed, op="slice", i=0, j=0) == [4.0]
    asked = fed.question("8", "7", QueryStream(stream="level[self]", op="at", at_us=then_us), P.QUERY_REF)
    fed.run(0.2)
    assert "before the first level[7] that is held" in asked.reason
    notes = [str(effect) for effect in fed.platform("7").ports.agent.audit_log.entries]
    assert any("reset" in note for note in notes)


def test_who_resets_again_and_again_is_refused_in_the_end(fed: Box) -> None:
    push(fed, 40.0)
    refused = [each for each in [reset(fed, "level[self]") for _ in range(20)] if each.performatives == [P.REFUSE]]
    assert 0 < len(refused) <= 20 - CHANGES_BURST
    assert {each.contents[0].code for each in refused} == {"too-many-changes"}


def test_no_monitor_is_blinded_or_delayed_by_who_resets_what_it_watches() -> None:
    def watched(*, robbed: bool) -> list[tuple[str, int, int]]:
        wire = Box()
        wire.join("7")
        wire.centre()
        specify(wire, FED)
        for level in (40.0, 41.0, 60.0, 61.0, 40.0, 40.0, 40.0):
            push(wire, level)
            if robbed:
                assert reset(wire, "level[self]").performatives == [P.AGREE, P.INFORM]
            else:
                wire.run(0.2)
        wire.run(2.0)
        return [(each.event, each.valid_us, each.detected_us) for each in alarms(wire)]

    told = watched(robbed=True)
    assert [event for event, _, _ in told] == ["opened", "closed"]
    assert told == watched(robbed=False)


@pytest.mark.parametrize(
    ("stream", "code", "said"),
    [
        ("gas[9]", "unknown-label", "no stream generator"),
        ("secret[self]", "private", "gas-secret"),
    ],
)
def test_what_is_not_declared_or_not_to_be_seen_is_not_reset(sensor: Box, stream: str, code: str, said: str) -> None:
    sensor.centre()
    label = 'label gas-secret : gas in ppm "gas in here"\n'
    specify(
        sensor, f"{label}{MAKES}strmgen secret[self] = Doubled(gas[self])\nexport private gas-secret = secret[self]\n"
    )
    question = reset(sensor, stream)
    assert question.performatives == [P.REFUSE]
    assert said in question.reason
    assert question.contents[0].code == code
    assert reset(sensor, "gas[self]").performatives == [P.AGREE, P.INFORM]


@pytest.mark.parametrize("stream", ["altitude[self]", "xy_dist[7, 8]"])
def test_streams_of_the_vehicle_and_derived_ones_keep_their_past_which_others_count_on(wire: Box, stream: str) -> None:
    wire.fly("7", 0.0, 0.0, 3.0)
    wire.fly("8", 0.0, 300.0)
    wire.centre()
    wire.run(2.0)
    question = reset(wire, stream)
    assert question.performatives == [P.REFUSE]
    assert question.contents[0].code == "not-declared"


def test_it_is_for_those_who_may_replace_the_declaration() -> None:
    assert (RESET.role, RESET.typed, RESET.lasting) == (Role.COMMAND_CENTRE, True, False)
