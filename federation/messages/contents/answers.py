"""Answers of every kind, and the end of a conversation."""

from dyknow.federation.messages.contents.parts import Content, Generation, Prose, Unit, Word


class Reason(Content):
    """Why something was refused, failed or not understood.

    `text` is for users, `code` for programs: `led-by` (the `leader` of a task, in which `generation`), `cancelled`,
    `superseded`, `too-many-acts`, `role`, `public`/`protected`/`private` (visibility), `unknown-label`, ...
    """

    text: Prose
    code: Word | None = None
    leader: Unit | None = None
    generation: Generation | None = None


class Done(Content):
    """The request is done."""

    text: Prose | None = None


class Cancel(Content):
    """End the conversation's task, and all it set up."""


class Progress(Content):
    """A task that is being set up has come so far."""

    step: Prose
    unit: Unit | None = None
