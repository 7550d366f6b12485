"""Monitors, their alarms, and formulas (thesis 9.4)."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, Field

from dyknow.federation.messages.contents import parts
from dyknow.federation.messages.descriptions import Count
from dyknow.federation.messages.sexpr import Expr


class MonitorProximity(parts.Content):
    """The task of 9.4: watch that platforms keep apart."""

    lasting: ClassVar[bool] = True
    profile: parts.Word | None = None
    avoidance: bool | None = None
    sample_period_s: parts.Period | None = None
    delay_s: parts.Seconds | None = None


class CreateMonitor(parts.Content):
    """Set up a monitor by name, alone or as part of a task that `coordinator` leads; the act carries the evidence for it.

    `generation` counts its coordinators from 1.
    """

    lasting: ClassVar[bool] = True
    name: parts.Word
    profile: parts.Word | None = None
    task: parts.Conversation | None = None
    coordinator: parts.Unit | None = None
    generation: parts.Generation | None = None
    sample_period_s: parts.Period | None = None
    delay_s: parts.Seconds | None = None
    avoidance: bool | None = None
    parameters: parts.Values | None = None


class HandOver(parts.Content):
    """The coordinator of a task leaves it to another one, in its life `boot`."""

    task: parts.Conversation
    coordinator: parts.Unit
    boot: Count
    generation: parts.Generation


class RemoveMonitor(parts.Content):
    name: parts.Word
    task: parts.Conversation | None = None


class Because(parts.ContentPart):
    """One part of a formula that the deciding state settled: its samples, for which members, and within which temporal
    part of the formula, since when and until when.
    """

    part: parts.Printed
    holds: bool
    samples: parts.Values = Field(default_factory=dict)
    members: parts.Values = Field(default_factory=dict)
    within: parts.Printed | None = None
    since_us: parts.Instant | None = None
    until_us: parts.Instant | None = None


class Monitors(parts.Content):
    """Which monitors are there? With `explain`, also why the formulas of those in alarm do not hold."""

    explain: bool | None = None


IDLE = "idle"
"""The state of a monitor that has no other platform to watch."""


class MonitorEntry(parts.ContentPart):
    """One monitor: its verdict, and the state of its inputs (`which` are not fresh, since when).

    `states` says in KPL what its states are made of, unless that is long, `counted` how many lacked something, and
    what. `because` are the parts of the formula that opened the alarm that is open, if that was asked for. `margin`:
    how far the formula is from being violated, in the units of its comparison.
    """

    head: ClassVar[str] = "monitor"
    by: parts.Unit
    name: parts.Word
    units: parts.Units
    verdict: parts.Truth
    inputs: Literal["fresh", "stale", "missing"]
    shows: parts.Word
    since_us: parts.Instant | None = None
    which: Annotated[tuple[parts.Line, ...], Field(max_length=parts.MAX_LIST)] = ()
    task: parts.Conversation | None = None
    states: parts.Text = ""
    counted: parts.Values = Field(default_factory=dict)
    because: Annotated[tuple[Because, ...], Field(max_length=parts.MAX_LIST)] = ()
    margin: parts.Number | None = None


class MonitorList(parts.Content):
    monitors: Annotated[tuple[MonitorEntry, ...], Field(max_length=parts.MAX_LIST)]
    more: bool = False


class MonitorChanges(parts.Content):
    """Subscribe: tell me of every monitor that becomes unknown, is known again or ends; first of those unknown now."""


class MonitorChange(parts.Content):
    """A monitor of `by` about `units` is unknown since `which` inputs lack, is known again, or has ended.

    `since_us`: since when its inputs are as they are.
    """

    event: Literal["unknown", "known", "ended"]
    monitor: parts.Word
    by: parts.Unit
    units: parts.Units
    at_us: parts.Instant
    which: Annotated[tuple[parts.Line, ...], Field(max_length=parts.MAX_LIST)] = ()
    since_us: parts.Instant | None = None

    @property
    def values(self) -> parts.Values:
        """None: it is read where alarms are."""
        return {}


class Alarms(parts.Content):
    """Subscribe: tell me of every alarm as it opens and closes."""


class Alarm(parts.Content):
    """An alarm opened or closed: raised by a monitor of `by`, about `units`, for the state valid at `valid_us`.

    Or it `ended`, open, since its monitor was removed then.

    `samples`: valid times of the samples that this state was made of, by input, in microseconds. `unseen_by`: the
    others of its units, where none of them has raised it within a second; the coordinator passes it on once more then.
    `because`: the parts of the formula that opened it. `made_us`: the state is predicted, from samples valid until then.
    """

    id: parts.Line
    event: Literal["opened", "closed", "ended"]
    monitor: parts.Word
    by: parts.Unit
    units: parts.Units
    valid_us: parts.Instant
    detected_us: parts.Instant
    values: parts.Values = Field(default_factory=dict)
    samples: parts.Values = Field(default_factory=dict)
    unseen_by: parts.Units = ()
    because: Annotated[tuple[Because, ...], Field(max_length=parts.MAX_LIST)] = ()
    made_us: parts.Instant | None = None


class AlarmList(parts.Content):
    """The alarms that are remembered: the query is without `alarms`, the answer with them."""

    alarms: Annotated[tuple[Alarm, ...], Field(max_length=parts.MAX_LIST)] | None = None
    more: bool = False


class CheckFormula(parts.Content):
    """Check a formula over live states until it is decided, or for `timeout_s`."""

    text: parts.Formula
    timeout_s: parts.Timeout | None = None


def _expression(value: Any) -> Expr:
    if not isinstance(value, Expr):
        raise ValueError("an expression is expected, e.g. (create-monitor name: energy)")  # noqa: TRY004  (pydantic)
    return value


class When(parts.Content):
    """Do what `do` asks for, once, as soon as the formula `condition` is true; give up after `timeout_s`."""

    lasting: ClassVar[bool] = True
    do: Annotated[Any, AfterValidator(_expression)]
    condition: parts.Formula
    timeout_s: Annotated[float, Field(gt=0, le=3600)] = 600.0


class Verdict(parts.Content):
    """The verdict of a formula, and the state that decided it; `no_value` features had none, nor had `missing` inputs.

    `states` says in KPL what its states were made of; nothing where that is very long.
    """

    verdict: parts.Truth
    valid_us: parts.Instant | None = None
    index: Count | None = None
    because: Annotated[tuple[Because, ...], Field(max_length=parts.MAX_LIST)] = ()
    no_value: Annotated[tuple[parts.Line, ...], Field(max_length=parts.MAX_LIST)] = ()
    missing: Annotated[tuple[parts.Line, ...], Field(max_length=parts.MAX_LIST)] = ()
    states: parts.Prose = ""
