"""Contents about chronicles: which platform watches for which, and recognised instances (thesis 8.2-8.4)."""

from typing import Annotated

from pydantic import Field

from dyknow.federation.messages.contents.parts import (
    MAX_LIST,
    TO_PARSE,
    Content,
    Instant,
    Line,
    Seconds,
    Timeout,
    Values,
    Word,
)

LONGEST = 32_768
Chronicles = Annotated[str, Field(min_length=1, max_length=LONGEST), TO_PARSE]


class Recognise(Content):
    """Recognise the chronicles of a text over live streams for `timeout_s`; samples may be `delay_s` late.

    `partial`: tell as well what may become an instance.
    """

    text: Chronicles
    timeout_s: Timeout | None = None
    delay_s: Seconds | None = None
    partial: bool | None = None


class Recognised(Content):
    """An instance of a chronicle: symbols by variable, times (us) by instant, and the time at which it was certain.

    `made_us`: when the oldest prediction was made on which one of its events rests.
    """

    chronicle: Word
    bindings: Values = Field(default_factory=dict)
    instants: Values = Field(default_factory=dict)
    recognised_us: Instant
    made_us: Instant | None = None


class Expected(Content):
    """A partial instance: symbols and times (us) so far, the `missing` events, and until when it is waited for.

    With `over` it is expected no more: it has become another one, an instance, or is given up.
    """

    chronicle: Word
    bindings: Values = Field(default_factory=dict)
    instants: Values = Field(default_factory=dict)
    missing: Annotated[tuple[Line, ...], Field(max_length=MAX_LIST)] = ()
    until_us: Instant | None = None
    over: bool = False
