"""State synchronisation: from several streams one stream of states, as early as can be (thesis 7.8.2)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from math import gcd
from typing import Final, Literal, NamedTuple, TypeAlias

from dyknow.model.errors import PolicyError
from dyknow.model.instants import print_duration
from dyknow.model.sample import Predicted, Sample, Value, oldest
from dyknow.model.values import NO_VALUE
from dyknow.policies.lines import interpolate
from dyknow.policies.policy import Approximation, Policy
from dyknow.policies.upcoming import Upcoming

CATCH_UP = 1024
"""States computed at once after a silence of the caller; older synchronisation points are skipped and counted."""

_NEVER_US = 2**80


class Category(Enum):
    """The knowledge about one input at the synchronisation point."""

    EXACT = "exact value available"
    APRX_FINAL = "approximation available, no further information expected"
    APRX_MORE = "approximation available, further information may arrive"
    NOAPRX_FINAL = "no approximation available, no further information expected"
    NOAPRX_MORE = "no approximation available, further information may arrive"


Manner: TypeAlias = Literal["exact", "most recent", "linear", "no value"]


class Origin(NamedTuple):
    """How a value of a state was obtained, and the valid time, certainty and prediction of the sample it is, or comes from."""

    manner: Manner
    valid_us: int | None
    certainty: float = 1.0
    prediction: Predicted | None = None

    @property
    def observed_us(self) -> int | None:
        """When the newest observation was made from which it comes; None where there is no value."""
        return self.valid_us if self.prediction is None else self.prediction.made_us


LACKING: Final = Origin("no value", None)


class State(NamedTuple):
    """The values of all inputs at one valid time, in the order of the inputs; `NO_VALUE` where there is none.

    `origins` says how each was obtained, where the synchronizer was asked for that.
    """

    available_us: int
    valid_us: int
    values: tuple[Value, ...]
    origins: tuple[Origin, ...] = ()


class Awaited(NamedTuple):
    """Why there is no state yet: the category of one input, and when it is waited for no longer (None: not known)."""

    name: str
    category: Category
    until_us: int | None
    last_us: int | None

    def __str__(self) -> str:
        if self.last_us is None:
            return f"{self.name}: {self.category.value} (nothing has come)"
        until = (
            ""
            if self.until_us is None
            else f", at most {print_duration(self.until_us - self.last_us)} after its last sample"
        )
        return f"{self.name}: {self.category.value} (waited for{until})"


class StateInput(NamedTuple):
    """One input: its name, and the policy its samples satisfy, from which finality is concluded.

    With `no approximation` in its policy it has a value only where a sample is valid at the synchronisation point.
    """

    name: str
    policy: Policy


@dataclass(frozen=True, slots=True)
class StatePolicy:
    """The state stream wanted (Def. 7.8.6). None is derived from the inputs, or means no bound.

    Attributes:
        sample_us: period of the synchronisation points; None: the greatest common divisor of the inputs' periods.
        max_delay_us: a state is computed at the latest so long after its valid time.
        delay_before_us: how long to wait before an approximation is used while better may come; None: `max_delay_us`.
        from_us: first synchronisation point; None: the latest `from` of the inputs, if all have one, else the first
            multiple of the period at or after the valid time of the first sample.
        to_us: last synchronisation point; None: the latest `to` of the inputs, if all have one, else no end.
        approximation: for inputs whose policy does not set it; with `none` only exact samples give a value.

    Raises:
        PolicyError: a time is negative, or the period is not positive.
    """

    sample_us: int | None
    max_delay_us: int
    delay_before_us: int | None = None
    from_us: int | None = None
    to_us: int | None = None
    approximation: Approximation = "most recent"

    def __post_init__(self) -> None:
        if self.sample_us is not None and self.sample_us <= 0:
            raise PolicyError(f"a state stream's period must be > 0 us, got {self.sample_us}")
        if min(self.max_delay_us, self.delay_before_us or 0) < 0:
            raise PolicyError("the delays of a state stream must be >= 0 us")
        if self.from_us is not None and self.to_us is not None and self.to_us < self.from_us:
            raise PolicyError(f"a state stream cannot end at {self.to_us} us, before it starts at {self.from_us} us")


class _Input:
    """One input: its buffer, and how far it is known.

    Attributes:
        known_us: everything valid up to here has arrived, by the order of the stream.
        ahead_us: the effect of a sample valid at v on known_us: v + ahead_us; None if the stream has no order.
        delay_us: so long after a valid time everything about it has arrived.
        final: nothing more can come about the synchronisation point.
    """

    __slots__ = ("ahead_us", "approximation", "buffer", "delay_us", "final", "known_us")

    def __init__(self, policy: Policy, approximation: Approximation) -> None:
        self.buffer = Upcoming()
        self.approximation = approximation
        self.known_us = -_NEVER_US
        self.final = False
        self.ahead_us: int | None = {"strict": 0, "monotone": -1, "any": None}[policy.order]
        self.delay_us = _NEVER_US if policy.max_delay_us is None else policy.max_delay_us
        if policy.sample_us is not None:
            if approximation == "linear":
                self.delay_us += policy.sample_us  # the end of the line comes a period later
            else:
                self.ahead_us = policy.sample_us - 1  # the next sample is valid a period later

    def is_exact(self, sync_us: int) -> bool:
        best = self.buffer.best
        return best is not None and best.valid_us == sync_us

    def has_approximation(self) -> bool:
        """Besides an exact value: a sample before and, for a line, one after."""
        if self.approximation == "none":
            return False
        return self.buffer.best is not None and (self.approximation == "most recent" or bool(self.buffer.later))

    def value_at(self, sync_us: int) -> Value:
        best = self.buffer.best
        if best is not None and best.valid_us == sync_us:
            return best.value
        if best is None or not self.has_approximation():
            return NO_VALUE
        return best.value if self.approximation == "most recent" else interpolate(best, self.buffer.later[0], sync_us)

    def origin_at(self, sync_us: int) -> Origin:
        """How `value_at` obtains its value."""
        best = self.buffer.best
        if best is not None and best.valid_us == sync_us:
            return Origin("exact", sync_us, best.quality.certainty, best.quality.prediction)
        if best is None or not self.has_approximation() or self.approximation == "none":
            return LACKING
        used = (best, self.buffer.later[0]) if self.approximation == "linear" else (best,)
        prediction = oldest(each.quality.prediction for each in used)
        return Origin(self.approximation, best.valid_us, min(each.quality.certainty for each in used), prediction)

    def category(self, sync_us: int) -> Category:
        if self.is_exact(sync_us):
            return Category.EXACT
        if self.has_approximation():
            return Category.APRX_FINAL if self.final else Category.APRX_MORE
        return Category.NOAPRX_FINAL if self.final else Category.NOAPRX_MORE


class Synchronizer:
    """Computes a state at every synchronisation point: at once when all inputs are exact or final, at its valid time +
    `delay_before_us` if all have an approximation, at + `max_delay_us` with the present samples.

    Call `on_sample` as samples arrive and `on_time` at `deadline_us`. At one instant inputs come before timers. States
    leave in order of valid time with strictly increasing available times.

    Attributes:
        sync_us: the synchronisation point; None before the first sample, if nothing says where to start.
        skipped: synchronisation points without a state: due before the first call, or more than `CATCH_UP` behind.

    Raises:
        PolicyError: there is no input, or no period is given and not all inputs are sampled.
    """

    __slots__ = (
        "_approximate_us", "_delay_before_us", "_delays", "_due_us", "_inputs", "_last_us", "_lead_us", "_listening",
        "_max_delay_us", "_open", "_refused", "_sync_us", "_to_us", "explains", "names", "period_us", "skipped",
    )  # fmt: skip

    def __init__(self, inputs: Sequence[StateInput], policy: StatePolicy, *, explains: bool = False) -> None:
        self.explains = explains
        if not inputs:
            raise PolicyError("a state has at least one input")
        policies = [i.policy for i in inputs]
        self.names = tuple(i.name for i in inputs)
        self.period_us = policy.sample_us or _common_period_us(policies)
        self._max_delay_us = policy.max_delay_us
        self._delay_before_us = policy.max_delay_us if policy.delay_before_us is None else policy.delay_before_us
        self._inputs = tuple(
            _Input(p, p.approximation if p.exact or p.approximation != "none" else policy.approximation)
            for p in policies
        )
        delays = {self._max_delay_us, self._delay_before_us, *(i.delay_us for i in self._inputs)}
        self._delays = tuple(sorted(d for d in delays if d <= policy.max_delay_us))  # the timers of each point
        from_us = _latest(p.from_us for p in policies) if policy.from_us is None else policy.from_us
        to_us = _latest(p.to_us for p in policies) if policy.to_us is None else policy.to_us
        self._sync_us = _NEVER_US if from_us is None else from_us
        self._to_us = _NEVER_US - 1 if to_us is None else to_us
        self._approximate_us = self._sync_us
        self._due_us = -_NEVER_US  # the first call looks where it is
        self._lead_us = CATCH_UP * self.period_us
        self._refused = 0
        self._last_us = -_NEVER_US
        self._listening = False
        self._open = len(inputs)
        self.skipped = 0

    def on_sample(self, i: int, sample: Sample, now_us: int) -> list[State]:
        """A sample of input `i`, counted from 0, became available at `now_us`."""
        valid_us = sample.valid_us
        if valid_us > now_us + self._lead_us:
            self._refused += 1
            return []
        if self._due_us < now_us:
            if self._sync_us == _NEVER_US:
                self._sync_us = -(-valid_us // self.period_us) * self.period_us
            states = self._settle(now_us, now_us - 1)  # states due before this sample came
        else:
            states = []
        sync_us = self._sync_us
        if sync_us > self._to_us:
            return states
        found = self._inputs[i]
        found.buffer.add(sample, sync_us)
        if found.ahead_us is not None and valid_us + found.ahead_us > found.known_us:
            found.known_us = valid_us + found.ahead_us
        if not found.final and (valid_us == sync_us or found.known_us >= sync_us):
            found.final = True
            self._open -= 1
        if self._open and now_us <= self._approximate_us:
            return states
        return states + self._settle(now_us, now_us - 1)

    def on_time(self, now_us: int) -> list[State]:
        """The states that are due at `now_us`; more often than at `deadline_us` is harmless."""
        return [] if now_us < self._due_us or self._sync_us == _NEVER_US else self._settle(now_us, now_us)

    @property
    def deadline_us(self) -> int | None:
        """Next instant at which `on_time` has work, or None."""
        if self._sync_us > self._to_us:
            return None
        return self._due_us if self._listening else self._sync_us + self._delays[0]

    @property
    def sync_us(self) -> int | None:
        """The synchronisation point; None before the start (if only the first sample can say where) and after the end."""
        return None if self._sync_us > self._to_us else self._sync_us

    @property
    def categories(self) -> tuple[Category, ...]:
        """The category of each input at the synchronisation point, as of the last call."""
        return tuple(i.category(self._sync_us) for i in self._inputs)

    def awaited(self) -> tuple[Awaited, ...]:
        """Why there is no state at the synchronisation point yet: the inputs that are not known there for sure."""
        sync_us = self._sync_us
        started = sync_us != _NEVER_US
        found = []
        for name, each in zip(self.names, self._inputs, strict=True):
            category = each.category(sync_us)
            if category in {Category.APRX_MORE, Category.NOAPRX_MORE}:
                patience_us = self._delay_before_us if category is Category.APRX_MORE else self._max_delay_us
                until_us = sync_us + min(each.delay_us, patience_us) if started else None
                newest = each.buffer.later[-1] if each.buffer.later else each.buffer.best
                found.append(Awaited(name, category, until_us, None if newest is None else newest.valid_us))
        return tuple(found)

    @property
    def refused(self) -> int:
        """Samples too far ahead: valid more than `CATCH_UP` periods from now, or too many to be kept.

        In an ordered stream one sample from the far future would say that all before it is known.
        """
        return self._refused + sum(i.buffer.refused for i in self._inputs)

    def _settle(self, now_us: int, clock_us: int) -> list[State]:
        """Compute the states that are ready when every timer up to `clock_us` has gone off."""
        states: list[State] = []
        if now_us > self._sync_us + self._max_delay_us or not self._listening:
            self._skip(now_us)
        while self._sync_us <= self._to_us and self._ready(clock_us):
            sync_us = self._sync_us
            self._last_us = now_us if now_us > self._last_us else self._last_us + 1
            values = tuple([i.value_at(sync_us) for i in self._inputs])
            origins = tuple([i.origin_at(sync_us) for i in self._inputs]) if self.explains else ()
            states.append(State(self._last_us, sync_us, values, origins))
            self._move(sync_us + self.period_us, clock_us)
        sync_us = self._sync_us
        self._approximate_us = sync_us + self._delay_before_us
        self._due_us = _NEVER_US
        if sync_us <= self._to_us:
            for delay_us in self._delays:
                if sync_us + delay_us > clock_us:
                    self._due_us = sync_us + delay_us
                    break
        return states

    def _ready(self, clock_us: int) -> bool:
        """`synchronized(now)` of 7.8.2."""
        if not self._open:
            return True
        sync_us = self._sync_us
        for found in self._inputs:
            if not found.final and clock_us >= sync_us + found.delay_us:
                found.final = True
                self._open -= 1
        if not self._open or clock_us >= sync_us + self._max_delay_us:
            return True
        return clock_us >= sync_us + self._delay_before_us and all(
            i.final or i.has_approximation() for i in self._inputs
        )

    def _move(self, sync_us: int, clock_us: int) -> None:
        """Move to the next synchronisation point; the inputs are classified at once."""
        self._sync_us = sync_us
        self._open = 0
        for found in self._inputs:
            if found.buffer.later:
                found.buffer.advance(sync_us)
                found.final = found.known_us >= sync_us or found.is_exact(sync_us)
            else:
                found.final = found.known_us >= sync_us
            if not found.final and clock_us < sync_us + found.delay_us:
                self._open += 1
            else:
                found.final = True

    def _skip(self, now_us: int) -> None:
        """Leave out what was due before there was a listener, and all but the last points after a silence of the caller."""
        overdue = -((self._sync_us + self._max_delay_us - now_us) // self.period_us)
        spared = CATCH_UP if self._listening else 0
        self._listening = True
        count = min(overdue - spared, (self._to_us - self._sync_us) // self.period_us + 1)
        if count > 0:
            self.skipped += count
            self._move(self._sync_us + count * self.period_us, now_us - 1)


def recent(state: State, max_age_us: int | None) -> State:
    """The state without the values, and their origins, that were observed more than `max_age_us` before it."""
    if max_age_us is None:
        return state
    oldest_us = state.valid_us - max_age_us
    old = [
        observed_us is not None and observed_us < oldest_us for observed_us in (o.observed_us for o in state.origins)
    ]
    if not any(old):
        return state
    values = tuple([NO_VALUE if is_old else value for value, is_old in zip(state.values, old, strict=True)])
    origins = tuple([LACKING if is_old else origin for origin, is_old in zip(state.origins, old, strict=True)])
    return state._replace(values=values, origins=origins)


def _common_period_us(policies: Sequence[Policy]) -> int:
    periods = [p.sample_us for p in policies if p.sample_us is not None]
    if len(periods) < len(policies):
        raise PolicyError("a state stream needs `sample every` when not all its inputs are sampled")
    return gcd(*periods)


def _latest(times: Iterable[int | None]) -> int | None:
    """The latest, if all are known."""
    found = list(times)
    known = [t for t in found if t is not None]
    return max(known) if len(known) == len(found) else None
