"""What acts say: one strict model for each head an expression may have. `read` understands, `expr()` says.

Periods and delays are seconds (`_s`), as the thesis prints them; instants are microseconds since the epoch (`_us`).
Names print with hyphens, but for those that name a quantity (`altitude_m`).
"""

import re
from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from dyknow.errors import ContentError, NameRefused
from dyknow.instants import US_PER_S
from dyknow.values import NoValue
from federation import keys
from federation.acts import AgentName
from federation.sexpr import Expr, ExprValue, Text
from federation.wire import Count, Hash, SemanticLabel
from federation.wire import Unit as UnitName

MAX_LIST = 512


def _unit(value: Any) -> Any:
    """The thesis writes units as numbers: `(sequence 0)`."""
    return str(value) if type(value) is int else value


def _unit_said(name: str) -> ExprValue:
    return int(name) if name.isdigit() and len(name) < 19 else name


def _truth(value: Any) -> Any:
    return str(value).lower() if type(value) is bool else value


def _truth_said(word: str) -> ExprValue:
    return {"true": True, "false": False}.get(word, word)


def _speaker(value: str) -> str:
    try:
        return str(AgentName.parse(value))
    except NameRefused as refused:
        raise ValueError(str(refused)) from None


def _conversation(value: str) -> str:
    try:
        return keys.conversation(value)
    except NameRefused as refused:
        raise ValueError(str(refused)) from None


Unit = Annotated[UnitName, BeforeValidator(_unit)]
Units = Annotated[tuple[Unit, ...], Field(max_length=MAX_LIST)]
SemanticLabels = Annotated[tuple[SemanticLabel, ...], Field(min_length=1, max_length=MAX_LIST)]
Word = Annotated[str, Field(min_length=1, max_length=64)]
Line = Annotated[str, Field(max_length=1024)]
Prose = Annotated[str, Field(max_length=4096), AfterValidator(Text)]
Formula = Annotated[str, Field(max_length=8192), AfterValidator(Text)]
Conversation = Annotated[str, AfterValidator(_conversation)]
Agent = Annotated[str, AfterValidator(_speaker)]
Truth = Annotated[Literal["true", "false", "undecided"], BeforeValidator(_truth)]
Period = Annotated[float, Field(gt=0, le=86_400)]
Seconds = Annotated[float, Field(ge=0, le=86_400)]
Instant = Annotated[int, Field(ge=-(2**63), lt=2**63)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Scalar: TypeAlias = bool | int | Number | Line | NoValue
Values = Annotated[dict[Annotated[str, Field(min_length=1, max_length=256)], Scalar], Field(max_length=256)]


def _alias(name: str) -> str:
    stem = name.removesuffix("_us").removesuffix("_s") if name.endswith(("_us", "_s")) else name
    return stem.replace("_", "-")


class Part(BaseModel):
    """An expression with a fixed head; `expr()` prints it, parameters left out that are as they would be without."""

    model_config = ConfigDict(
        strict=True,
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        arbitrary_types_allowed=True,
        alias_generator=_alias,
        validate_by_name=True,
        validate_by_alias=True,
        defer_build=True,
    )
    head: ClassVar[str]

    @classmethod
    def __pydantic_init_subclass__(cls, **_given: Any) -> None:
        cls.head = re.sub(r"(?<!^)(?=[A-Z])", "-", cls.__name__).lower()

    @model_validator(mode="before")
    @classmethod
    def _open(cls, found: Any) -> Any:
        """Parts of a content come as expressions."""
        if not isinstance(found, Expr):
            return found
        if found.head != cls.head:
            raise ValueError(f"({cls.head} ...) is expected, not ({found.head} ...)")
        return dict(found.arguments)

    def expr(self) -> Expr:
        """What to put into an act."""
        arguments: dict[str, ExprValue] = {}
        for name, field in type(self).model_fields.items():
            value = getattr(self, name)
            if field.is_required() or value != field.get_default(call_default_factory=True):
                arguments[field.alias or name] = _said(value, _WORDS.get(name))
        return Expr(self.head, arguments)


def _said(value: Any, word: Callable[[str], ExprValue] | None) -> ExprValue:
    if isinstance(value, Part):
        return value.expr()
    if isinstance(value, tuple):
        return tuple([_said(member, word) for member in value])
    said: ExprValue = value if word is None else word(value)
    return said


class Content(Part):
    """A part that can be the whole content of an act; the others only occur inside."""

    @classmethod
    def __pydantic_init_subclass__(cls, **given: Any) -> None:
        super().__pydantic_init_subclass__(**given)
        _CONTENTS[cls.head] = cls


_CONTENTS: dict[str, type[Content]] = {}
_UNIT_FIELDS = ("by", "climber", "coordinator", "owner", "to_units", "unit", "units")
_WORDS: dict[str, Callable[[str], ExprValue]] = {**dict.fromkeys(_UNIT_FIELDS, _unit_said), "verdict": _truth_said}
"""Fields whose strings are printed as something else."""


def heads() -> tuple[str, ...]:
    """Every head that `read` understands."""
    return tuple(_CONTENTS)


def read(expr: Expr) -> Content:
    """What an expression says.

    Raises:
        ContentError: its head or a parameter is unknown, missing, or not what it should be; the message names it.
    """
    kind = _CONTENTS.get(expr.head)
    if kind is None:
        raise ContentError(f"({expr.head} ...) is not understood here")
    try:
        return kind.model_validate(dict(expr.arguments))
    except ValidationError as wrong:
        first = wrong.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(step) for step in first["loc"])
        message = first["msg"].removeprefix("Value error, ")
        more = f" (and {wrong.error_count() - 1} more)" if wrong.error_count() > 1 else ""
        raise ContentError(f"({expr.head} ...): {f'{place}: ' if place else ''}{message}{more}"[:400]) from None


# Answers of every kind


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


# Streams (thesis 9.3.3)


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
    """The answer to a global query: what each platform said, who did not, and the one value that was asked for."""

    semantic_label: SemanticLabel
    answers: Annotated[tuple[Samples, ...], Field(max_length=MAX_LIST)]
    missing: Annotated[tuple[Missing, ...], Field(max_length=MAX_LIST)] = ()
    merged: Reading | None = None


# Monitors and alarms (thesis 9.4)


class MonitorProximity(Content):
    """The task of 9.4: watch that platforms keep apart."""

    profile: Word | None = None
    avoidance: bool | None = None
    sample_period_s: Period | None = None
    delay_s: Seconds | None = None


class CreateMonitor(Content):
    """Set up a monitor by name, alone or as part of a task that `coordinator` leads."""

    name: Word
    profile: Word | None = None
    task: Conversation | None = None
    coordinator: Unit | None = None
    generation: Count | None = None
    sample_period_s: Period | None = None
    delay_s: Seconds | None = None
    avoidance: bool | None = None
    parameters: Values | None = None


class RemoveMonitor(Content):
    name: Word
    task: Conversation | None = None


class Monitors(Content):
    """Which monitors are there?"""


class Monitor(Part):
    """One monitor: its verdict, and the state of its inputs (`which` are not fresh, since when)."""

    by: Unit
    name: Word
    units: Units
    verdict: Truth
    inputs: Literal["fresh", "stale", "missing"]
    shows: Word
    since_us: Instant | None = None
    which: Annotated[tuple[Line, ...], Field(max_length=MAX_LIST)] = ()
    task: Conversation | None = None


class MonitorList(Content):
    monitors: Annotated[tuple[Monitor, ...], Field(max_length=MAX_LIST)]


class Alarms(Content):
    """Subscribe: tell me of every alarm as it opens and closes."""


class Alarm(Content):
    """An alarm opened or closed: raised by a monitor of `by`, about `units`, for the state valid at `valid_us`."""

    id: Line
    event: Literal["opened", "closed"]
    monitor: Word
    by: Unit
    units: Units
    valid_us: Instant
    detected_us: Instant
    values: Values = Field(default_factory=dict)


class AlarmList(Content):
    """The alarms that are remembered: asked without `alarms`, answered with them."""

    alarms: Annotated[tuple[Alarm, ...], Field(max_length=MAX_LIST)] | None = None
    more: bool = False


class CheckFormula(Content):
    """Check a formula over live states until it is decided, or for `timeout_s`."""

    text: Formula
    timeout_s: Period | None = None


class Verdict(Content):
    """What a formula came to, and the state that decided it."""

    verdict: Truth
    valid_us: Instant | None = None
    index: Count | None = None


# Tasks, the account and the directory


class Tasks(Content):
    """Which delegated tasks are there?"""


class Task(Part):
    conversation: Conversation
    task: Word
    unit: Unit
    state: Line
    delegator: Agent | None = None
    since_us: Instant | None = None


class TaskList(Content):
    tasks: Annotated[tuple[Task, ...], Field(max_length=MAX_LIST)]


class Acts(Content):
    """Subscribe: tell me of every act that enters or leaves."""


class ActLog(Content):
    """One act as it passed the Interface Agent; `act` is its text, missing for bytes that were no act."""

    at_us: Instant
    direction: Literal["in", "out"]
    peer: Line
    outcome: Prose
    act: Formula | None = None


class ActList(Content):
    """The acts that are remembered: asked without `acts`, answered with them."""

    acts: Annotated[tuple[ActLog, ...], Field(max_length=MAX_LIST)] | None = None
    more: bool = False


class Directory(Content):
    """Subscribe: tell me when a platform, a service or a label appears or goes."""


class DirectoryEvent(Content):
    """Something in the directory changed: e.g. `platform-appeared`, `service-gone`; `what` is the service or label."""

    event: Word
    unit: Unit
    at_us: Instant
    what: Word | None = None


class Search(Content):
    """Who provides a service, or has a label?"""

    service: Word | None = None
    semantic_label: SemanticLabel | None = None


class Found(Content):
    agents: Annotated[tuple[Agent, ...], Field(max_length=MAX_LIST)]


class Labels(Content):
    """Which labels has the local instance? For agents of the same platform."""


class LabelList(Content):
    labels: Annotated[tuple[Line, ...], Field(max_length=MAX_LIST)]


class Latest(Content):
    """The latest value of a local label? For agents of the same platform."""

    label: Line


class Leave(Content):
    """Leave the federation; streams that are set up go on (thesis 9.3.4)."""


class Rejoin(Content):
    """Come back to the federation."""


# Flight


class Goto(Content):
    """Fly to a point: WGS-84, metres above mean sea level."""

    latitude_deg: Annotated[float, Field(ge=-90, le=90)] = Field(alias="latitude_deg")
    longitude_deg: Annotated[float, Field(ge=-180, le=180)] = Field(alias="longitude_deg")
    altitude_m: Annotated[float, Field(ge=-1000, le=100_000)] = Field(alias="altitude_m")


class TakeOff(Content):
    """Take off to a height above home."""

    height_m: Annotated[float, Field(gt=0, le=10_000)] = Field(alias="height_m")


class Hold(Content):
    """Stay where you are."""


class Land(Content):
    """Land where you are."""


class ReturnHome(Content):
    """Fly home and land."""


class Resume(Content):
    """Fly on along the route."""


class Avoid(Content):
    """Propose a manoeuvre: because of `alarm`, `climber` climbs by `climb_m` and the other of `units` holds."""

    alarm: Line
    climber: Unit
    climb_m: Annotated[float, Field(ge=0, le=1000)] = Field(alias="climb_m")
    units: Units


class AvoidDone(Content):
    """The manoeuvre because of `alarm` is over."""

    alarm: Line


class Fault(Content):
    """Make a simulated vehicle fail: `kind` e.g. `gps-loss`; `value` where the kind needs one; for `duration_s`."""

    kind: Word
    value: bool | int | Number | Line | None = None
    duration_s: Period | None = None
