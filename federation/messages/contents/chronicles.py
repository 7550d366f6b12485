"""Contents about chronicles: which platform watches for which, and what was recognised (thesis 8.2-8.4)."""

from typing import Annotated

from pydantic import AfterValidator, Field

from federation.messages.contents.parts import Content, Instant, Period, Seconds, Values, Word
from federation.messages.sexpr import QuotedText

LONGEST = 32_768
Chronicles = Annotated[str, Field(min_length=1, max_length=LONGEST), AfterValidator(QuotedText)]


class Recognise(Content):
    """Recognise the chronicles of a text over live streams for `timeout_s`; samples may be `delay_s` late."""

    text: Chronicles
    timeout_s: Period | None = None
    delay_s: Seconds | None = None


class Recognised(Content):
    """An instance of a chronicle: symbols by variable, times (us) by instant, and the time at which it was certain."""

    chronicle: Word
    bindings: Values = Field(default_factory=dict)
    instants: Values = Field(default_factory=dict)
    recognised_us: Instant
