"""Computational units: refinement processes with one output (thesis, 4.3.4, Def. 4.3.15)."""

from collections.abc import Callable, Mapping, Sequence
from math import prod
from typing import Protocol, TypeAlias, runtime_checkable

from dyknow.model.sample import SURE, Quality, Sample, Value, oldest
from dyknow.model.values import NO_VALUE

Inputs: TypeAlias = tuple[Sample | None, ...]
"""The last available sample of each input, None where none has arrived (Def. 4.3.16)."""
Output: TypeAlias = Sample | list[Sample] | None
"""One sample, several, such as the states of several objects, or none."""
UnitFunction: TypeAlias = Callable[[int, Inputs, Value], tuple[Output, Value]]
"""(time, last sample of each input, state) -> (output, new state); the first state is `NO_VALUE`."""


@runtime_checkable
class ClockedUnit(Protocol):
    """A unit that has something to say when time has passed, though nothing new has come.

    Attributes:
        due_us: when, in the time of its samples; None: not at all.
    """

    due_us: int | None

    def on_time(self, now_us: int) -> Value:
        """A value that is valid now; None: nothing new."""


class ClockedFunction:
    """The function of a clocked unit, with the unit."""

    __slots__ = ("step", "unit")

    def __init__(self, step: UnitFunction, unit: ClockedUnit) -> None:
        self.step, self.unit = step, unit

    def __call__(self, now_us: int, inputs: Inputs, state: Value) -> tuple[Output, Value]:
        return self.step(now_us, inputs, state)


class ComputationalUnit:
    """One instance of a computational unit: applies its function whenever its inputs have something new.

    Raises:
        ValueError: if `arity` is not positive.
    """

    __slots__ = ("_clocked", "_function", "_inputs", "state")

    def __init__(self, function: UnitFunction, arity: int) -> None:
        if arity < 1:
            raise ValueError(f"a computational unit has at least 1 input, got {arity}")
        clocked = function if isinstance(function, ClockedFunction) else None
        self._function = function if clocked is None else clocked.step
        self._clocked = None if clocked is None else clocked.unit
        self._inputs: list[Sample | None] = [None] * arity
        self.state: Value = NO_VALUE

    def on_sample(self, i: int, sample: Sample, now_us: int) -> Sample | None:
        """Input `i`, counted from 0, has a new sample; the output, if there is one."""
        return self.on_element({i: sample}, now_us)

    def on_element(self, element: Mapping[int, Sample], now_us: int) -> Sample | None:
        """The join of the inputs has a new element, in which these are new; the output, the last one of several."""
        outputs = self.outputs_of(element, now_us)
        return outputs[-1] if outputs else None

    @property
    def due_us(self) -> int | None:
        """When it wants to be asked without a sample; None: not at all."""
        return None if self._clocked is None else self._clocked.due_us

    def on_time(self, now_us: int) -> Sequence[Sample]:
        """Its outputs when time has passed."""
        made = None if self._clocked is None else self._clocked.on_time(now_us)
        return () if made is None else (Sample(now_us, now_us, made),)

    def outputs_of(self, element: Mapping[int, Sample], now_us: int) -> Sequence[Sample]:
        """The same; all outputs."""
        for i, sample in element.items():
            self._inputs[i] = sample
        output, self.state = self._function(now_us, tuple(self._inputs), self.state)
        if output is None:
            return ()
        return output if isinstance(output, list) else (output,)


def latest_valid_us(inputs: Inputs) -> int | None:
    """The latest valid time among the inputs: the default valid time of an output. None before any input."""
    return max([s.valid_us for s in inputs if s is not None], default=None)


def quality_of(inputs: Inputs) -> Quality:
    """A value is right when what it was computed from is, each by itself; predicted when any of it is."""
    qualities = [s.quality for s in inputs if s is not None and s.quality is not SURE]
    if not qualities:
        return SURE
    return Quality(prod(each.certainty for each in qualities), (), oldest(each.prediction for each in qualities))


def component(at: int, count: int) -> UnitFunction:
    """A unit for one of the `count` components of a value, with its own variance where the covariance is of all."""

    def step(now_us: int, inputs: Inputs, state: Value) -> tuple[Sample | None, Value]:
        (sample,) = inputs
        if sample is None:
            return None, state
        quality = quality_of(inputs)
        if sample.value is NO_VALUE:
            return Sample(now_us, sample.valid_us, NO_VALUE, quality), state
        if len(sample.quality.covariance) == count:
            quality = quality._replace(covariance=((sample.quality.covariance[at][at],),))
        return Sample(now_us, sample.valid_us, sample.value[at], quality), state

    return step


def of_values(function: Callable[..., Value]) -> UnitFunction:
    """A unit that computes a value from the values of its inputs, once all are there; `NO_VALUE` if one has none."""

    def step(now_us: int, inputs: Inputs, state: Value) -> tuple[Sample | None, Value]:
        if len(inputs) == 1 and (only := inputs[0]) is not None and only.quality is SURE:
            value = NO_VALUE if only.value is NO_VALUE else function(only.value)
            return Sample(now_us, only.valid_us, value), state
        values = [s.value for s in inputs if s is not None]
        valid_us = latest_valid_us(inputs)
        if valid_us is None or len(values) < len(inputs):
            return None, state
        value = NO_VALUE if any(v is NO_VALUE for v in values) else function(*values)
        return Sample(now_us, valid_us, value, quality_of(inputs)), state

    return step
