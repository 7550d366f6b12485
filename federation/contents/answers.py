"""Answers of every kind, and the end of a conversation."""

from federation.contents.parts import Content, Prose, Unit


class Reason(Content):
    """Why something was refused, failed or not understood."""

    text: Prose


class Done(Content):
    """What was asked for is done."""

    text: Prose | None = None


class Cancel(Content):
    """End the conversation's task, and all it set up."""


class Progress(Content):
    """A task that is being set up has come so far."""

    step: Prose
    unit: Unit | None = None
