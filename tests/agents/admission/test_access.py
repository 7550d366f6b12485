"""Who reaches which service, in which way (thesis 9.3.2), and what is made of acts that are nobody's business."""

import pytest

from dyknow.agents.actions import COORDINATION, Action, Offer, ServiceTable
from dyknow.agents.admission.admission import NOT_TAKEN, Admission
from dyknow.agents.capabilities.separation.giving_way import GivingWay
from dyknow.agents.monitoring.alarm_log import AlarmLog
from dyknow.agents.platform import Platform
from dyknow.federation.members.offers import Visibility
from dyknow.federation.messages.acts import Act, AgentName, Performative, print_act
from dyknow.federation.messages.codec import encode_act
from dyknow.federation.messages.contents import (
    Alarms,
    Avoid,
    Goto,
    Hold,
    MonitorProximity,
    Query,
    Reason,
    Search,
    Tasks,
    read,
)
from dyknow.federation.messages.sexpr import Expr, QuotedText
from dyknow.model.errors import ContentError
from tests.box import Box
from tests.federation.expressions import parse_expr

P = Performative
ASKED = {
    Visibility.PUBLIC: ("directory", Search(service="alarms")),
    Visibility.PROTECTED: ("federation", Query(semantic_label="heli-position")),
}


def said(wire: Box, to: str, content: Expr | None, performative: Performative = P.QUERY_REF, **given: object) -> Act:
    """An act as a stranger `9` would say it, put on the wire; answers are in the log."""
    numbered = {"boot": 7, "seq": next(wire.numbers), "created_us": wire.now_us, "conversation_id": "9-7-1", **given}
    act = Act(performative, AgentName("interface", "9"), AgentName.parse(to), content, **numbered)  # type: ignore[arg-type]
    wire.put(act.key, encode_act(act))
    wire.run(0.01)
    return act


def answers(wire: Box, unit: str = "9") -> list[Act]:
    return wire.acts(receiver=unit)


@pytest.mark.parametrize("visibility", list(Visibility))
def test_the_rules_of_9_3_2_another_platform_directly_uses_public_services_only(
    wire: Box, node: Platform, visibility: Visibility
) -> None:
    wire.run(1.0)
    agent, content = ASKED[visibility]
    said(wire, f"{agent}@0", content.expr())
    (answer,) = answers(wire)
    if visibility is Visibility.PUBLIC:
        assert answer.performative is P.INFORM
        assert answer.sender == AgentName(agent, "0")
    else:
        assert answer.performative is P.REFUSE
        assert f"is {visibility} on 0" in str(answer.content)
        assert ("ask interface@0" in str(answer.content)) is (visibility is Visibility.PROTECTED)
        assert node.ports.agent.audit_log.refused == {visibility: 1}


@pytest.mark.parametrize("visibility", list(Visibility))
def test_another_platform_uses_protected_services_through_the_interface(
    wire: Box, node: Platform, visibility: Visibility
) -> None:
    wire.run(1.0)
    said(wire, "interface@0", ASKED[visibility][1].expr())
    (answer,) = answers(wire)
    assert answer.performative is P.INFORM
    assert node.ports.agent.audit_log.refused == {}


def test_a_service_is_asked_of_the_agent_that_provides_it(wire: Box, node: Platform) -> None:
    said(wire, "alarms@0", Search(service="alarms").expr())
    said(wire, "pilot@0", Alarms().expr(), P.SUBSCRIBE, conversation_id="9-7-2")
    said(wire, "nobody@0", Search(service="alarms").expr(), conversation_id="9-7-3")
    assert [act.performative for act in answers(wire)] == [P.NOT_UNDERSTOOD] * 3
    assert node.ports.agent.audit_log.refused == {"not understood": 3}


@pytest.mark.parametrize(
    "text",
    [
        "(make-tea)",
        "(query)",
        "(query semantic-label: heli-position op: at)",
        "(create-multicast semantic-labels: (sequence) sample-period: 1.0 delay: 1.0 to-units: (sequence 1))",
        "(monitor-proximity sample-period: 0.0)",
        "(monitor-proximity colour: red)",
        "(done)",
        "(cancel)",
    ],
)
def test_what_no_service_understands_is_not_understood(wire: Box, node: Platform, text: str) -> None:
    said(wire, "interface@0", parse_expr(text), P.REQUEST)
    (answer,) = answers(wire)
    assert answer.performative is P.NOT_UNDERSTOOD
    assert isinstance(read(answer.content), Reason)  # type: ignore[arg-type]
    assert node.ports.agent.audit_log.refused == {"not understood": 1}


@pytest.mark.parametrize("performative", [p for p in P if p not in {P.REQUEST, P.CANCEL, P.AGREE}])
def test_a_command_is_carried_out_only_if_it_is_requested(
    wire: Box, node: Platform, performative: Performative
) -> None:
    wire.run(1.0)
    said(wire, "interface@0", Goto(latitude_deg=58.0, longitude_deg=15.0, altitude_m=100.0).expr(), performative)
    assert wire.vehicle("0").commands == []
    assert node.ports.agent.audit_log.refused == {"performative" if performative in NOT_TAKEN else "not understood": 1}


@pytest.mark.parametrize(
    ("performative", "reason"),
    [
        (P.PROXY, "not that of its sender"),
        (P.REQUEST_WHENEVER, "ask once by request-when"),
    ],
)
def test_what_no_service_takes_is_refused_with_the_reason_and_nothing_is_passed_on(
    wire: Box, node: Platform, performative: Performative, reason: str
) -> None:
    wire.run(1.0)
    before = len(wire.acts(sender="0", receiver="1"))
    inner = print_act(
        Act(P.REQUEST, AgentName("interface", "9"), AgentName("interface", "1"), MonitorProximity().expr())
    )
    for content in (None, Expr("proxy", {"act": QuotedText(inner)}), Hold().expr()):
        said(wire, "interface@0", content, performative, conversation_id=f"9-7-{next(wire.numbers)}")
    heard = answers(wire)
    assert [act.performative for act in heard] == [P.REFUSE] * 3
    assert all(reason in str(act.content) for act in heard)
    assert len(wire.acts(sender="0", receiver="1")) == before
    assert node.ports.agent.audit_log.refused == {"performative": 3}


def test_a_not_understood_answers_no_other(wire: Box, node: Platform) -> None:
    for performative in (P.NOT_UNDERSTOOD, P.REFUSE, P.FAILURE, P.INFORM, P.PROPAGATE):
        said(wire, "interface@0", parse_expr("(make-tea)"), performative)
    assert answers(wire) == []
    assert node.ports.agent.audit_log.refused == {"not understood": 5}


def test_two_platforms_do_not_misunderstand_each_other_for_ever(wire: Box, node: Platform) -> None:
    before = len(wire.acts())
    act = Act(P.NOT_UNDERSTOOD, AgentName("interface", "1"), AgentName("interface", "0"), parse_expr("(what)"))
    (put,) = wire.member("1").acts.conversations.send(act, wire.now_us)[1]
    wire.wire.put("1", put)  # type: ignore[arg-type]
    wire.run(5.0)
    assert len(wire.acts()) == before + 1


def test_what_lasts_needs_a_conversation_in_which_it_can_be_ended(wire: Box, node: Platform) -> None:
    for performative, content in [(P.REQUEST, MonitorProximity()), (P.SUBSCRIBE, Alarms())]:
        said(wire, "interface@0", content.expr(), performative, conversation_id=None)
    assert [act.performative for act in answers(wire)] == [P.NOT_UNDERSTOOD] * 2
    assert node.built.tasks.all() == []
    assert node.part(AlarmLog).subscribers._acts == {}


def test_answers_go_to_who_asks_and_to_nobody_else(wire: Box, node: Platform) -> None:
    said(wire, "interface@0", Tasks().expr(), reply_to=AgentName("interface", "1"))
    assert [act.performative for act in answers(wire)] == [P.REFUSE]
    assert wire.acts(sender="0", receiver="1") == []
    assert node.ports.agent.audit_log.refused == {"reply to another": 1}


def test_every_head_belongs_to_one_service(node: Platform) -> None:
    table = node.part(Admission).table
    heads = [action.head for _, action in table.actions]
    assert len(heads) == len(set(heads))
    assert table.of("query", P.QUERY_REF)[0].service == "dyknow-federation"
    with pytest.raises(ContentError, match="understood as subscribe"):
        table.of("alarms", P.REQUEST)
    with pytest.raises(ContentError, match="by two parts"):
        ServiceTable([*GivingWay.offers, Offer(COORDINATION, (Action(Avoid, "on_avoid"),))])


def test_a_conversation_id_is_not_a_key_to_the_task_of_another(wire: Box, node: Platform) -> None:
    task = wire.asked("cc", "0", MonitorProximity())
    said(wire, "interface@0", MonitorProximity(profile="energy").expr(), P.REQUEST, conversation_id=task.conversation)
    assert [act.performative for act in answers(wire)] == [P.REFUSE]
    said(wire, "interface@0", Alarms().expr(), P.SUBSCRIBE, conversation_id=task.conversation)
    assert [act.performative for act in answers(wire)] == [P.REFUSE] * 2
    assert [t.initiator for t in node.built.tasks.all()] == ["cc"]
    assert set(node.built.monitors.named) == {"proximity", "proximity-warn"}


def test_subscriptions_of_two_that_share_a_conversation_id_are_two(wire: Box, node: Platform) -> None:
    wire.centre("cc-2")
    wire.run(1.0)
    first = wire.asked("cc", "0", Alarms(), P.SUBSCRIBE)
    said(wire, "interface@0", Alarms().expr(), P.SUBSCRIBE, conversation_id=first.conversation)
    said(wire, "interface@0", None, P.CANCEL, conversation_id=first.conversation)
    assert list(node.part(AlarmLog).subscribers) == [("cc", first.conversation)]
