import pytest
from hypothesis import given

from dyknow.federation import keys
from dyknow.federation.messages.acts import Act, AgentName, Performative, parse_act, print_act
from dyknow.federation.messages.sexpr import Expr
from dyknow.model.errors import NameRefused, TextError
from tests.federation import schema
from tests.federation.strategies import ACTS


def test_there_are_the_22_performatives_of_fipa() -> None:
    assert {str(performative) for performative in Performative} == schema.PERFORMATIVES


@given(ACTS)
def test_an_act_that_is_printed_parses_back(act: Act) -> None:
    assert parse_act(print_act(act)) == act
    assert print_act(act).isprintable()


@given(ACTS)
def test_the_key_of_an_act_says_who_speaks_to_whom(act: Act) -> None:
    assert keys.parse_key(act.key) == keys.ActKey(act.receiver.unit, act.sender.unit, act.receiver.agent)


def test_an_act_reads_as_fipa_has_it() -> None:
    act = Act(
        Performative.REQUEST,
        AgentName("interface", "1"),
        AgentName("interface", "0"),
        Expr("monitor-proximity"),
        conversation_id="1-1-1",
        protocol="fipa-request",
        seq=3,
        acks=(7, 8),
    )
    assert str(act) == (
        "(request :sender interface@1 :receiver interface@0 :content (monitor-proximity) :conversation-id 1-1-1 "
        ":protocol fipa-request :X-seq 3 :X-acks (sequence 7 8))"
    )


def test_the_order_of_parameters_is_free() -> None:
    text = "(inform\n  :content (done)\n  :receiver alarms@all\n  :sender interface@1)"
    assert parse_act(text) == Act(
        Performative.INFORM, AgentName("interface", "1"), AgentName("alarms", "all"), Expr("done")
    )


@pytest.mark.parametrize(
    "text",
    [
        "",
        "request",
        "(shout :sender a@1 :receiver b@2)",
        "(request :sender a@1)",
        "(request :sender a@1 :sender a@1 :receiver b@2)",
        "(request :sender a@1 :receiver b)",
        "(request :sender a@1 :receiver b@2/3)",
        "(request :sender a@1 :receiver b@2 :content done)",
        "(request :sender a@1 :receiver b@2 :X-seq 1.5)",
        "(request :sender a@1 :receiver b@2 :X-seq true)",
        "(request :sender a@1 :receiver b@2 :X-acks (sequence 1 a))",
        "(request :sender a@1 :receiver b@2 :protocol 5)",
        "(request :sender a@1 :receiver b@2 :colour red)",
        "(request :sender a@1 :receiver b@2) (done)",
    ],
)
def test_a_text_that_is_no_act_is_refused(text: str) -> None:
    with pytest.raises(TextError):
        parse_act(text)


@pytest.mark.parametrize(
    ("agent", "unit"), [("interface", "a/b"), ("Interface", "0"), ("", "0"), ("interface", "x"), ("a@b", "0")]
)
def test_an_agent_is_named_so_that_a_key_can_carry_it(agent: str, unit: str) -> None:
    with pytest.raises(NameRefused):
        AgentName(agent, unit)
    with pytest.raises(NameRefused):
        AgentName.parse(f"{agent}@{unit}")
