"""Whose a conversation is: nobody opens one that another could open."""

import pytest

from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.codec import encode_act
from dyknow.federation.messages.contents import Hold
from dyknow.federation.messages.conversations import Conversations
from dyknow.federation.messages.protocols import OPENING, Incoming

P = Performative
NOW_US = 1_700_000_000_000_000


@pytest.mark.parametrize("performative", sorted(OPENING))
@pytest.mark.parametrize(
    "conversation", ["cc-1-5f-1.0", "1-2-1.0", "3-5-9.0", "3", "33-2-1.0", "c1"], ids=lambda one: one
)
def test_a_conversation_is_opened_by_the_one_that_it_is_called_after(
    performative: Performative, conversation: str
) -> None:
    """Platform 3 in its life 2."""
    talks = Conversations("0", 1, encode_act, lambda _to, _receipt: b"")
    act = Act(
        performative, AgentName("interface", "3"), AgentName("interface", "0"), Hold().expr(), conversation,
        boot=2, seq=1, reply_with="r1", created_us=NOW_US,
    )  # fmt: skip
    assert not [each for each in talks.on_act(act, NOW_US) if isinstance(each, Incoming)]
    assert not talks.conversations()
    own = act._replace(conversation_id="3-2-1.0", seq=2)
    assert [each for each in talks.on_act(own, NOW_US) if isinstance(each, Incoming)]
