"""Streams set up, and values asked for (thesis 9.3.3)."""

from typing import Annotated, ClassVar, Literal, Self, TypeAlias

from pydantic import AfterValidator, Field, model_validator

from dyknow.federation.messages.contents import parts
from dyknow.federation.messages.descriptions import Count, Hash, SemanticLabel
from dyknow.model.errors import DyknowError
from dyknow.model.instants import US_PER_S
from dyknow.model.sample import MAX_BRANCH
from dyknow.model.values import NoValue
from dyknow.policies.policy import MAX_POLICY, Policy


def _policy(value: str) -> str:
    """The text of a policy that a stream can have, at a period that is borne here."""
    try:
        policy = Policy.parse(value)
    except DyknowError as wrong:
        raise ValueError(str(wrong).splitlines()[0]) from None
    if policy.sample_us is not None and policy.sample_us < parts.LEAST_PERIOD_S * US_PER_S:
        raise ValueError(f"a stream has at most a sample every {parts.LEAST_PERIOD_S} s")
    return value


PolicyText = Annotated[str, Field(max_length=MAX_POLICY), AfterValidator(_policy)]


class CreateMulticast(parts.Content):
    """Export the streams of some labels to some units: every `sample_period_s`, not later than `delay_s`."""

    lasting: ClassVar[bool] = True
    semantic_labels: parts.SemanticLabels
    sample_period_s: parts.Period
    delay_s: parts.Seconds
    to_units: parts.Units
    from_us: parts.Instant | None = None
    to_us: parts.Instant | None = None

    @property
    def sample_us(self) -> int:
        return round(self.sample_period_s * US_PER_S)

    @property
    def delay_us(self) -> int:
        return round(self.delay_s * US_PER_S)


class StopMulticast(parts.Content):
    """Stop exporting some labels; to all receivers unless some are named, and in `task` alone if that is given.

    `task` is the conversation in which the export was asked for.
    """

    semantic_labels: parts.SemanticLabels
    to_units: parts.Units | None = None
    task: parts.Conversation | None = None


class Stream(parts.Content):
    """For a receiver: these labels of `owner` come under this policy, on keys with this hash."""

    owner: parts.Unit
    semantic_labels: parts.SemanticLabels
    policy: PolicyText
    hash: Hash


class EndStream(parts.Content):
    """For a receiver: no more samples will come."""

    owner: parts.Unit
    semantic_labels: parts.SemanticLabels
    hash: Hash
    reason: parts.Prose | None = None


Op: TypeAlias = Literal["latest", "at", "between", "nth", "last", "slice"]
"""A question to a stream: by valid time the latest value, that at an instant, all between two; by available time the
n-th before the latest (0: the latest), the last n, the i-th to the j-th that are held, the oldest being the 0-th.
"""
_NEEDED = {
    "latest": frozenset[str](), "at": {"at_us"}, "between": {"from_us", "to_us"}, "nth": {"n"}, "last": {"n"},
    "slice": {"i", "j"},
}  # fmt: skip


class Query(parts.Content):
    """Values of a label, one or several by `op`; here, or of all platforms."""

    semantic_label: SemanticLabel
    op: Op = "latest"
    at_us: parts.Instant | None = None
    from_us: parts.Instant | None = None
    to_us: parts.Instant | None = None
    n: Count | None = None
    i: Count | None = None
    j: Count | None = None
    scope: Literal["local", "global"] = "local"
    select: Literal["newest", "best"] | None = None
    merge: Literal["mean", "inverse-variance"] | None = None

    @model_validator(mode="after")
    def _is_one_question(self) -> Self:
        _check_question(self)
        if self.select and self.merge:
            raise ValueError("select one value, or merge all: not both")
        return self


class QueryStream(parts.Content):
    """The same of a stream that need not be exported, by the label that the platform's own instance has for it."""

    stream: parts.Formula
    op: Op = "latest"
    at_us: parts.Instant | None = None
    from_us: parts.Instant | None = None
    to_us: parts.Instant | None = None
    n: Count | None = None
    i: Count | None = None
    j: Count | None = None

    @model_validator(mode="after")
    def _is_one_question(self) -> Self:
        _check_question(self)
        return self


def _check_question(query: Query | QueryStream) -> None:
    given = {name for names in _NEEDED.values() for name in names if getattr(query, name) is not None}
    needed = _NEEDED[query.op]
    if given != needed:
        names = sorted(name.removesuffix("_us") for name in needed)
        raise ValueError(f"op {query.op} needs {' and '.join(names) or 'no instant'}, and nothing else")
    if query.from_us is not None and query.to_us is not None and query.from_us > query.to_us:
        raise ValueError("from lies after to")
    if query.i is not None and query.j is not None and query.i > query.j:
        raise ValueError("i lies after j")


class Reading(parts.ContentPart):
    """One sample: when it held, when it was available, its value by field, and its variance where it is known.

    Of a predicted one also when it was made, and its branch and the weight of that, if there are several.
    """

    valid_us: parts.Instant
    available_us: parts.Instant
    value: parts.Values | NoValue
    variance: parts.Variances | None = None
    made_us: parts.Instant | None = None
    branch: Annotated[parts.Line, Field(max_length=MAX_BRANCH)] = ""
    weight: parts.Share = 1.0


class Missing(parts.ContentPart):
    """A platform whose answer is not among these, and why."""

    unit: parts.Unit
    reason: parts.Prose


class Samples(parts.Content):
    """The answer of one platform to a query; `more`: the rest follows in further acts."""

    unit: parts.Unit
    semantic_label: SemanticLabel
    samples: Annotated[tuple[Reading, ...], Field(max_length=parts.MAX_LIST)]
    more: bool = False


class StreamSamples(parts.Content):
    """The answer to a query for a stream by its own label; `more`: the rest follows in further acts."""

    unit: parts.Unit
    stream: parts.Formula
    samples: Annotated[tuple[Reading, ...], Field(max_length=parts.MAX_LIST)]
    more: bool = False


class Answers(parts.Content):
    """The answer to a global query: the answer of each platform, the platforms without one, and the one value of them
    all.

    `more`: the rest follows in further acts; `missing` and the one value come with the last.
    """

    semantic_label: SemanticLabel
    answers: Annotated[tuple[Samples, ...], Field(max_length=parts.MAX_LIST)]
    missing: Annotated[tuple[Missing, ...], Field(max_length=parts.MAX_LIST)] = ()
    merged: Reading | None = None
    more: bool = False


class ImportCounts(parts.ContentPart):
    """The counts of the samples of one imported stream, by number (`dyknow.federation.sharing.streams.StreamCounts`).

    `missing` are known to exist and asked for, `lost` are no longer held; both 0: no gap. Of each `every` samples of its
    period one is sent: more than 1 while the owner has too much to do. `delay_s` is from the valid time of the newest to its
    arrival.
    """

    head: ClassVar[str] = "import-account"
    owner: parts.Unit
    semantic_label: SemanticLabel
    hash: Hash
    received: Count
    recovered: Count = 0
    duplicates: Count = 0
    stale: Count = 0
    lost: Count = 0
    missing: Count = 0
    every: Count = 1
    delay_s: parts.Number | None = None


class ImportList(parts.Content):
    """The streams a platform imports: the query is without `imports`, the answer with them."""

    imports: Annotated[tuple[ImportCounts, ...], Field(max_length=parts.MAX_LIST)] | None = None
    more: bool = False
