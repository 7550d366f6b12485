"""The messages that chapter 9 prints, character for character."""

import pytest

from dyknow.federation.messages import contents
from dyknow.federation.messages.acts import Act, AgentName, Performative, parse_act
from dyknow.federation.messages.contents import CreateMonitor, CreateMulticast, MonitorProximity
from tests.federation.expressions import parse_expr

CREATE_MULTICAST = "(create-multicast semantic-labels: (sequence heli-position heli-altitude) sample-period: 1.0 delay: 1.0 to-units: (sequence 0))"


@pytest.mark.parametrize("text", ["(monitor-proximity)", CREATE_MULTICAST, "(create-monitor name: proximity)"])
def test_9_4_1_messages_read_as_printed_and_parse_back(text: str) -> None:
    found = contents.read(parse_expr(text))
    assert str(found.expr()) == text
    assert parse_expr(str(found.expr())) == parse_expr(text)


def test_9_4_1_the_line_breaks_of_the_book_do_not_matter() -> None:
    printed = """(create-multicast
        semantic-labels: (sequence heli-position heli-altitude)
        sample-period: 1.0 delay: 1.0
        to-units: (sequence 0))"""
    assert str(parse_expr(printed)) == CREATE_MULTICAST


def test_9_4_1_platform_0_understands_what_it_is_delegated() -> None:
    multicast = contents.read(parse_expr(CREATE_MULTICAST))
    assert multicast == CreateMulticast(
        semantic_labels=("heli-position", "heli-altitude"), sample_period_s=1.0, delay_s=1.0, to_units=("0",)
    )
    assert contents.read(parse_expr("(create-monitor name: proximity)")) == CreateMonitor(name="proximity")


def test_9_4_1_the_command_centre_delegates_to_the_interface_agent_of_platform_0() -> None:
    act = Act(
        Performative.REQUEST, AgentName("interface", "cc-1"), AgentName("interface", "0"), MonitorProximity().expr()
    )
    assert str(act) == "(request :sender interface@cc-1 :receiver interface@0 :content (monitor-proximity))"
    assert parse_act(str(act)) == act
