"""Monitors, their alarms, and formulas (thesis 9.4)."""

from typing import Annotated, Literal

from pydantic import Field

from federation.contents.parts import (
    MAX_LIST,
    Content,
    Conversation,
    Formula,
    Instant,
    Line,
    Part,
    Period,
    Prose,
    Seconds,
    Truth,
    Unit,
    Units,
    Values,
    Word,
)
from federation.wire import Count


class MonitorProximity(Content):
    """The task of 9.4: watch that platforms keep apart."""

    profile: Word | None = None
    avoidance: bool | None = None
    sample_period_s: Period | None = None
    delay_s: Seconds | None = None


class CreateMonitor(Content):
    """Set up a monitor by name, alone or as part of a task that `coordinator` leads and `delegator` asked for."""

    name: Word
    profile: Word | None = None
    task: Conversation | None = None
    coordinator: Unit | None = None
    delegator: Unit | None = None
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
    """One monitor: its verdict, and the state of its inputs (`which` are not fresh, since when).

    `states` says in KPL what its states are made of, unless that is long, `counted` how many lacked something, and what.
    """

    by: Unit
    name: Word
    units: Units
    verdict: Truth
    inputs: Literal["fresh", "stale", "missing"]
    shows: Word
    since_us: Instant | None = None
    which: Annotated[tuple[Line, ...], Field(max_length=MAX_LIST)] = ()
    task: Conversation | None = None
    states: Line = ""
    counted: Values = Field(default_factory=dict)


class MonitorList(Content):
    monitors: Annotated[tuple[Monitor, ...], Field(max_length=MAX_LIST)]
    more: bool = False


class Alarms(Content):
    """Subscribe: tell me of every alarm as it opens and closes."""


class Alarm(Content):
    """An alarm opened or closed: raised by a monitor of `by`, about `units`, for the state valid at `valid_us`.

    `samples`: valid times of the samples that this state was made of, by input, in microseconds.
    """

    id: Line
    event: Literal["opened", "closed"]
    monitor: Word
    by: Unit
    units: Units
    valid_us: Instant
    detected_us: Instant
    values: Values = Field(default_factory=dict)
    samples: Values = Field(default_factory=dict)


class AlarmList(Content):
    """The alarms that are remembered: asked without `alarms`, answered with them."""

    alarms: Annotated[tuple[Alarm, ...], Field(max_length=MAX_LIST)] | None = None
    more: bool = False


class CheckFormula(Content):
    """Check a formula over live states until it is decided, or for `timeout_s`."""

    text: Formula
    timeout_s: Period | None = None


class Because(Part):
    """One part of a formula that the deciding state settled: its samples, for which members, and within which temporal
    part of the formula, since when and until when.
    """

    part: Formula
    holds: bool
    samples: Values = Field(default_factory=dict)
    members: Values = Field(default_factory=dict)
    within: Formula | None = None
    since_us: Instant | None = None
    until_us: Instant | None = None


class Verdict(Content):
    """What a formula came to, and the state that decided it; `no_value` features had none, nor had `missing` inputs.

    `states` says in KPL what its states were made of; nothing where that is very long.
    """

    verdict: Truth
    valid_us: Instant | None = None
    index: Count | None = None
    because: Annotated[tuple[Because, ...], Field(max_length=MAX_LIST)] = ()
    no_value: Annotated[tuple[Line, ...], Field(max_length=MAX_LIST)] = ()
    missing: Annotated[tuple[Line, ...], Field(max_length=MAX_LIST)] = ()
    states: Prose = ""
