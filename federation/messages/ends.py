"""Cancels by events, not by users: the loss of a peer, or a missing answer."""

from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.sexpr import Expr

LOST = Expr("cancel", {"because": "lost"})
"""The content of a cancel that follows from the loss of a peer."""
GIVEN_UP = Expr("cancel", {"because": "silence"})
"""The content of a cancel that follows from an answer that did not come in time."""


def is_lost(cancel: Act) -> bool:
    """Whether a cancel was sent only because its sender had lost sight of the receiver, not because a user wants it."""
    return cancel.content == LOST


def is_given_up(cancel: Act) -> bool:
    """Whether a cancel was sent only because its sender got no answer: it, or another platform, may ask again."""
    return cancel.content == GIVEN_UP


def cancel_of(opening: Act, content: Expr | None = None) -> Act:
    """The cancel of what we had opened."""
    return Act(
        Performative.CANCEL,
        opening.sender,
        opening.receiver,
        content or Expr("cancel"),
        opening.conversation_id,
        opening.protocol,
        ontology=opening.ontology,
    )
