"""Streams set up, and values asked for (thesis 9.3.3)."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from dyknow.instants import US_PER_S
from dyknow.values import NoValue
from federation.contents.parts import (
    MAX_LIST,
    Content,
    Instant,
    Line,
    Part,
    Period,
    Prose,
    Seconds,
    SemanticLabels,
    Unit,
    Units,
    Values,
)
from federation.wire import Count, Hash, SemanticLabel


class CreateMulticast(Content):
    """Export the streams of some labels to some units: every `sample_period_s`, not later than `delay_s`."""

    semantic_labels: SemanticLabels
    sample_period_s: Period
    delay_s: Seconds
    to_units: Units
    from_us: Instant | None = None
    to_us: Instant | None = None

    @property
    def sample_us(self) -> int:
        return round(self.sample_period_s * US_PER_S)

    @property
    def delay_us(self) -> int:
        return round(self.delay_s * US_PER_S)


class StopMulticast(Content):
    """Stop exporting some labels; to all receivers unless some are named."""

    semantic_labels: SemanticLabels
    to_units: Units | None = None


class Stream(Content):
    """Told to a receiver: these labels of `owner` come under this policy, on keys with this hash."""

    owner: Unit
    semantic_labels: SemanticLabels
    policy: Line
    hash: Hash


class EndStream(Content):
    """Told to a receiver: no more samples will come."""

    owner: Unit
    semantic_labels: SemanticLabels
    hash: Hash
    reason: Prose | None = None


class Query(Content):
    """The latest value of a label, its value at an instant, or all between two; here, or of all platforms."""

    semantic_label: SemanticLabel
    op: Literal["latest", "at", "between"] = "latest"
    at_us: Instant | None = None
    from_us: Instant | None = None
    to_us: Instant | None = None
    scope: Literal["local", "global"] = "local"
    select: Literal["newest", "best"] | None = None
    merge: Literal["mean", "inverse-variance"] | None = None

    @model_validator(mode="after")
    def _instants_fit(self) -> Self:
        given = {name for name in ("at", "from", "to") if getattr(self, f"{name}_us") is not None}
        needed = {"latest": set[str](), "at": {"at"}, "between": {"from", "to"}}[self.op]
        if given != needed:
            raise ValueError(f"op {self.op} needs {' and '.join(sorted(needed)) or 'no instant'}, and nothing else")
        if self.from_us is not None and self.to_us is not None and self.from_us > self.to_us:
            raise ValueError("from lies after to")
        if self.select and self.merge:
            raise ValueError("select one value, or merge all: not both")
        return self


class Reading(Part):
    """One sample: when it held, when it was available, its value by field, and its variance where it is known."""

    valid_us: Instant
    available_us: Instant
    value: Values | NoValue
    variance: Values | None = None


class Missing(Part):
    """A platform whose answer is not among these, and why."""

    unit: Unit
    reason: Prose


class Samples(Content):
    """The answer of one platform to a query; `more`: the rest follows in further acts."""

    unit: Unit
    semantic_label: SemanticLabel
    samples: Annotated[tuple[Reading, ...], Field(max_length=MAX_LIST)]
    more: bool = False


class Answers(Content):
    """The answer to a global query: what each platform said, who did not, and the one value that was asked for.

    `more`: the rest follows in further acts; who is missing and the one value come with the last.
    """

    semantic_label: SemanticLabel
    answers: Annotated[tuple[Samples, ...], Field(max_length=MAX_LIST)]
    missing: Annotated[tuple[Missing, ...], Field(max_length=MAX_LIST)] = ()
    merged: Reading | None = None
    more: bool = False


class ImportAccount(Part):
    """What became of the samples of one imported stream, by number (`federation.streams.StreamAccount`).

    `missing` are known to exist and asked for, `lost` are held by nobody any more; both 0: no gap.
    """

    owner: Unit
    semantic_label: SemanticLabel
    hash: Hash
    received: Count
    recovered: Count = 0
    duplicates: Count = 0
    stale: Count = 0
    lost: Count = 0
    missing: Count = 0


class ImportList(Content):
    """The streams a platform imports: asked without `imports`, answered with them."""

    imports: Annotated[tuple[ImportAccount, ...], Field(max_length=MAX_LIST)] | None = None
    more: bool = False
