"""A request that waits for a condition: done once and as its requester, bounded, listed, cancelled (FIPA SC00037J)."""

from typing import Any

import pytest

from dyknow.agents.effects import Fed
from dyknow.agents.monitoring.checks import MOST_OF_ONE, Checks
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import (
    CheckFormula,
    Content,
    CreateMonitor,
    CreateMulticast,
    Goto,
    Hold,
    Tasks,
    Verdict,
    When,
)
from dyknow.federation.messages.sexpr import Expr
from tests.agents.admission.test_hostile import trust
from tests.box import Box, Question, Vehicle

P = Performative
FED = "source number level\nstrmgen level[self] = level\n"
HIGH = "level[self] > 50"
ENERGY = CreateMonitor(name="energy")


@pytest.fixture
def fed(wire: Box) -> Box:
    """Platform 7 flies and is fed the levels of the test; 8 is another one, and there is a command centre."""
    wire.fly("7", 0.0, 0.0)
    wire.join("8")
    wire.centre()
    wire.specify("7", FED, "7.kpl")
    wire.run(1.0)
    return wire


def push(wire: Box, *levels: float, unit: str = "7") -> None:
    for level in levels:
        wire.run((100_000 - wire.now_us % 100_000) / 1e6)
        wire._reach(wire.nodes[unit], Fed(wire.now_us, "level", wire.now_us, level))
    wire.run(0.7)


def when(wire: Box, do: Content, condition: str = HIGH, by: str = "cc", to: str = "7", **given: Any) -> Question:
    question = wire.question(by, to, When(do=do.expr(), condition=condition, **given), P.REQUEST_WHEN)
    wire.run(0.2)
    return question


def tasks(wire: Box) -> list[tuple[str, str]]:
    return [(task.task, task.state) for task in wire.asked("cc", "7", Tasks(), P.QUERY_REF).contents[0].tasks]


def monitors(wire: Box) -> set[str]:
    return set(wire.platform("7").built.monitors.named)


def test_it_is_done_once_when_the_condition_becomes_true_and_is_the_task_that_was_asked_for(fed: Box) -> None:
    question = when(fed, ENERGY)
    assert question.performatives == [P.AGREE]
    assert tasks(fed) == [("when", "create-monitor when level[self] > 50")]
    push(fed, 10.0, 40.0)
    assert monitors(fed) == set()
    push(fed, 60.0)
    assert monitors(fed) == {"energy"}
    assert tasks(fed) == [("create-monitor", "running")]
    assert question.performatives[:2] == [P.AGREE, P.AGREE], "to wait, and to do it"
    push(fed, 10.0, 70.0)
    assert tasks(fed) == [("create-monitor", "running")]
    fed.cancel("cc", "7", question.conversation)
    fed.run(0.5)
    assert (monitors(fed), tasks(fed)) == (set(), [])


def test_a_condition_over_what_has_no_producer_says_within_two_seconds_what_it_waits_for(fed: Box) -> None:
    wire = fed
    when(wire, ENERGY)
    wire.run(1.5)
    waits = "create-monitor when level[self] > 50; waits for level[7], which has brought nothing here"
    assert tasks(wire) == [("when", waits)]
    wire.run(5.0)
    assert tasks(wire) == [("when", waits)]
    assert len([note for note in wire.nodes["7"].notes if "waits for level[7]" in note]) == 1
    push(wire, 10.0)
    wire.run(1.0)
    assert tasks(wire) == [("when", "create-monitor when level[self] > 50")]


def test_a_condition_over_a_feature_of_a_vehicle_that_is_not_there_says_so(wire: Box) -> None:
    wire.join("7", Vehicle(is_silent=True))
    wire.centre()
    wire.run(1.0)
    when(wire, ENERGY, "heli-altitude[self] > 1")
    wire.run(1.6)
    [(_, state)] = tasks(wire)
    assert "; waits for heli-altitude[" in state


def test_it_is_done_though_the_command_that_asked_has_ended(fed: Box) -> None:
    when(fed, CreateMulticast(semantic_labels=("battery",), sample_period_s=1.0, delay_s=1.0, to_units=("8",)))
    fed.end("cc")
    fed.run(5.0)
    push(fed, 60.0)
    fed.run(3.0)
    assert fed.platform("8").ports.network.has(fed.platform("8").ports.translation.local_label("battery", "7"))


def test_it_fails_when_its_time_is_over_and_ends_when_it_is_cancelled_and_leaves_nothing(fed: Box) -> None:
    question = when(fed, ENERGY, timeout_s=2.0)
    cancelled = when(fed, ENERGY)
    fed.cancel("cc", "7", cancelled.conversation)
    push(fed, 40.0)
    fed.run(2.0)
    assert question.performatives == [P.AGREE, P.FAILURE]
    assert question.reason == "level[self] > 50 was not true within 2 s"
    push(fed, 60.0)
    checks = fed.platform("7").part(Checks)
    assert (monitors(fed), tasks(fed), checks._open, checks.deadline_us) == (set(), [], {}, None)
    assert fed.platform("7").ports.agent.conversations.conversations() == []


@pytest.mark.parametrize(
    ("content", "said", "performative"),
    [
        (
            Goto(latitude_deg=58.0, longitude_deg=15.0, altitude_m=100.0).expr(),
            "on a condition, unattended: expected a request",
            P.REFUSE,
        ),
        (Hold().expr(), "follow the condition", P.REFUSE),
        (When(do=ENERGY.expr(), condition=HIGH).expr(), "on a condition, unattended: expected a request", P.REFUSE),
        (Expr("create-monitor", {"name": "energy", "colour": "red"}), "colour", P.NOT_UNDERSTOOD),
    ],
)
def test_no_order_to_an_aircraft_waits_for_a_condition(
    fed: Box, content: Expr, said: str, performative: Performative
) -> None:
    question = fed.question("cc", "7", When(do=content, condition=HIGH), P.REQUEST_WHEN)
    fed.run(0.2)
    assert question.performatives == [performative]
    assert said in question.reason
    push(fed, 60.0)
    assert tasks(fed) == []


def test_what_is_wrong_with_the_condition_is_said_at_once(fed: Box) -> None:
    for condition, said in (("levl[self] > 50", "level"), ("level[self] >", "expected")):
        question = when(fed, ENERGY, condition)
        assert question.performatives == [P.NOT_UNDERSTOOD]
        assert said in question.reason
    assert tasks(fed) == []


def test_one_member_waits_for_no_more_than_a_few_and_leaves_room_for_others(fed: Box) -> None:
    asked = [when(fed, ENERGY) for _ in range(MOST_OF_ONE + 2)]
    assert [each.performatives[0] for each in asked] == [P.AGREE] * MOST_OF_ONE + [P.REFUSE] * 2
    assert when(fed, ENERGY, by="8").performatives == [P.AGREE]
    check = fed.question("cc", "7", CheckFormula(text="level[self] >= 0"), P.QUERY_IF)
    push(fed, 1.0)
    assert check.performatives == [P.AGREE, P.INFORM]


def test_observers_do_not_ask_for_it_and_limits_are_those_of_the_moment_in_which_it_is_done() -> None:
    wire = Box()
    wire.join("0", trust=trust("0"), acts_per_s=0.01, acts_burst=9.0)
    wire.join("1", trust=trust("1"))
    for unit in ("cc", "eye"):
        wire.centre(unit, trust=trust(unit))
    wire.specify("0", FED, "0.kpl")
    wire.run(1.0)
    refused = when(wire, ENERGY, by="eye", to="0")
    assert refused.performatives == [P.REFUSE]
    assert "an observer may ask and subscribe" in refused.reason
    question = when(wire, ENERGY, by="1", to="0")
    for _ in range(9):
        wire.question("1", "0", Tasks(), P.QUERY_REF)
    push(wire, 60.0, unit="0")
    assert question.performatives == [P.AGREE, P.REFUSE], "1 asks too much just then"
    assert question.contents[-1].code == "too-many-acts"


# Is it true? (query-if)


def test_query_if_is_answered_by_true_false_or_unknown(fed: Box) -> None:
    verdicts = []
    for text in ("level[self] > 50", "level[self] > 70", "eventually level[self] > 90"):
        question = fed.question("8", "7", CheckFormula(text=text, timeout_s=2.0), P.QUERY_IF)
        push(fed, 60.0)
        fed.run(2.0)
        assert question.performatives == [P.AGREE, P.INFORM]
        assert isinstance(question.contents[-1], Verdict)
        verdicts.append(question.contents[-1].verdict)
    assert verdicts == ["true", "false", "undecided"]


@pytest.mark.parametrize("performative", [P.QUERY_IF, P.REQUEST_WHEN])
def test_a_formula_does_not_tell_of_a_stream_what_its_requester_may_not_see(
    fed: Box, performative: Performative
) -> None:
    label = 'label own-level : number in m "how high it is"\n'
    fed.specify("7", f"{label}{FED}export own-level = level[self] to 9\n", "7.kpl")
    fed.run(0.6)
    content = CheckFormula(text=HIGH) if performative is P.QUERY_IF else When(do=ENERGY.expr(), condition=HIGH)
    question = fed.question("8", "7", content, performative)
    push(fed, 60.0)
    assert question.performatives == [P.REFUSE]
    assert question.contents[0].code == "no-receiver"
    assert fed.platform("7").part(Checks)._open == {}
