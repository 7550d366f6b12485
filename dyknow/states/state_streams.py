"""Streams of states: synchronised at sampled points (7.8.2), or one whenever the inputs have changed (7.8.1)."""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from math import prod
from typing import Literal, TypeAlias

from dyknow.model.errors import PolicyError
from dyknow.model.instants import earlier, print_duration
from dyknow.model.sample import SURE, Quality, Sample, Value, oldest
from dyknow.model.values import NO_VALUE
from dyknow.network.process import FAR_US, Input
from dyknow.network.processes import OnDemand
from dyknow.policies.policy import Policy
from dyknow.states.synchronization import (
    Awaited,
    Category,
    Manner,
    Origin,
    State,
    StateInput,
    StatePolicy,
    Synchronizer,
    recent,
)

When: TypeAlias = Literal["sampled", "any update", "any change", "all updated", "all changed"]
"""At sampled points; or whenever any input has a new sample, or another value; or when all of them have."""
KEPT = 64


class StateStreamProcess(OnDemand):
    """A process whose values are states: tuples of the values of its inputs, in their order, as certain as those together.

    Args:
        max_age_us: a value observed longer before a state is none there; a prediction was observed when it was made.

    Attributes:
        recent: the last states, each with how its values were obtained.

    Raises:
        PolicyError: sampled without a period, or without a delay after which a state is computed from the present
            samples.
    """

    def __init__(
        self, inputs: Sequence[Input], policy: StatePolicy | None, when: When = "sampled", max_age_us: int | None = None
    ) -> None:
        super().__init__()
        self._max_age_us = max_age_us
        self._wanted, self.when, self._policy = tuple(inputs), when, policy
        self.recent: deque[State] = deque(maxlen=KEPT)
        self._maker = self._make()

    def inputs(self) -> Sequence[Input]:
        return self._wanted

    def begin(self) -> None:
        self._maker = self._make()
        if self._network is not None:
            self._network.step(self)

    def on_sample(self, i: int, sample: Sample) -> None:
        self._hand_on(self._maker.on_sample(i, sample, sample.available_us))

    def on_time(self, now_us: int) -> None:
        self._hand_on(self._maker.on_time(now_us))

    @property
    def max_delay_us(self) -> int:
        """How long after its valid time a state is made at the latest; 0 for those that need not wait."""
        return 0 if self.when != "sampled" or self._policy is None else self._policy.max_delay_us

    @property
    def deadline_us(self) -> int | None:
        """Far away, and not none, while the first sample has yet to say where the states begin."""
        if not self.running or isinstance(self._maker, ChangeStates):
            return None
        return earlier(self._maker.deadline_us, FAR_US)

    def awaited(self) -> tuple[Awaited, ...]:
        """Why there is no state yet: the awaited samples, input by input."""
        return self._maker.awaited()

    def end(self) -> None:
        self.recent.clear()
        if self._network is not None:
            self._network.unstep(self)

    def _make(self) -> "Synchronizer | ChangeStates":
        if self.when == "sampled":
            named = [StateInput(str(each.label), each.policy) for each in self._wanted]
            if self._policy is None:
                raise PolicyError("sampled states need a period and a delay")
            return Synchronizer(named, self._policy, explains=True)
        exact = tuple(each.policy.exact for each in self._wanted)
        return ChangeStates(tuple(str(each.label) for each in self._wanted), self.when, exact)

    def _hand_on(self, states: list[State]) -> None:
        for state in [recent(each, self._max_age_us) for each in states]:
            self.recent.append(state)
            certainty = prod(each.certainty for each in state.origins)
            prediction = oldest(each.prediction for each in state.origins)
            quality = SURE if certainty == 1.0 and prediction is None else Quality(certainty, (), prediction)
            self.emit(Sample(state.available_us, state.valid_us, state.values, quality))


class ChangeStates:
    """A state when any input has a new sample or value, or when all have, as soon as each has brought one.

    A state is valid at the latest valid time among its inputs; each value is the most recent that came, or, of an input
    that is `exact`, the one of that time if it came.
    """

    deadline_us = None

    def __init__(self, names: tuple[str, ...], when: When, exact: tuple[bool, ...] = ()) -> None:
        self._exact = exact or (False,) * len(names)
        self.names, self._of_all, self._of_values = names, when.startswith("all"), when.endswith(("change", "changed"))
        self._last: list[Sample | None] = [None] * len(names)
        self._news = set[int]()
        self._last_us = -(2**80)

    def on_sample(self, i: int, sample: Sample, now_us: int) -> list[State]:
        """A sample of input `i`, counted from 0, became available at `now_us`."""
        before, self._last[i] = self._last[i], sample
        if before is None or not self._of_values or before.value != sample.value:
            self._news.add(i)
        samples = [each for each in self._last if each is not None]
        enough = len(self._news) == len(self.names) if self._of_all else bool(self._news)
        if len(samples) < len(self.names) or not enough:
            return []
        self._news.clear()
        self._last_us = max(now_us, self._last_us + 1)
        valid_us = max(each.valid_us for each in samples)
        samples = [
            each._replace(value=NO_VALUE) if is_exact and each.valid_us < valid_us else each
            for each, is_exact in zip(samples, self._exact, strict=True)
        ]
        values: tuple[Value, ...] = tuple(each.value for each in samples)
        return [State(self._last_us, valid_us, values, tuple(_origin(each, valid_us) for each in samples))]

    def on_time(self, _now_us: int) -> list[State]:
        """Time alone changes nothing."""
        return []

    def awaited(self) -> tuple[Awaited, ...]:
        """The inputs without which there is no next state."""
        missing = [i for i, each in enumerate(self._last) if each is None]
        if not missing and self._of_all:
            missing = [i for i in range(len(self.names)) if i not in self._news]
        return tuple(
            Awaited(
                self.names[i], Category.NOAPRX_MORE, None, None if (last := self._last[i]) is None else last.valid_us
            )
            for i in missing
        )


def _origin(sample: Sample, valid_us: int) -> Origin:
    if sample.value is NO_VALUE:
        return Origin("no value", sample.valid_us)
    manner: Manner = "exact" if sample.valid_us == valid_us else "most recent"
    return Origin(manner, sample.valid_us, sample.quality.certainty, sample.quality.prediction)


def exactly(policy: Policy, inputs: Sequence[Input]) -> Sequence[Input]:
    """The inputs of states with `policy`: `no approximation` there holds for every input that does not set it."""
    if not policy.exact:
        return inputs
    return [
        each if each.policy.approximation != "none" else each._replace(policy=replace(each.policy, exact=True))
        for each in inputs
    ]


def state_policy(policy: Policy, inputs: Sequence[Policy]) -> tuple[StatePolicy | None, When]:
    """The states that a policy asks for (Def. 7.8.4), and when they are made.

    Without `sample every` the period is that of the inputs, if all are sampled; else there is a state per update of any
    input, or per change with `any change`; with `all updated` and `all changed` when every input has one. Without `max delay` it is the longest of the inputs'.

    Raises:
        PolicyError: sampled, and nothing says how long to wait for the inputs; or what waits for approximations is not
            sampled, or waits longer for them than for anything (Def. 7.8.5).
    """
    sampled = policy.sample_us is not None or (
        policy.change == "any update" and all(each.sample_us is not None for each in inputs)
    )
    if not sampled and policy.delay_before_us is not None:
        raise PolicyError(
            "`delay before approximation` needs `sample every`: only a sampled state waits for its values",
            f"with sample every 100, delay before approximation {print_duration(policy.delay_before_us)}",
        )
    if not sampled:
        return None, "any update" if policy.change == "sample" else policy.change
    delays = [each.max_delay_us for each in inputs]
    longest_us = None if None in delays else max(delay for delay in delays if delay is not None)
    max_delay_us = longest_us if policy.max_delay_us is None else policy.max_delay_us
    if max_delay_us is None:
        raise PolicyError(
            "a sampled state needs `max delay`: how long after its valid time it is made with what there is",
            "with sample every 100, max delay 200",
        )
    check_delay_before(policy.delay_before_us, max_delay_us)
    approximation = policy.approximation if policy.exact or policy.approximation != "none" else "most recent"
    made = StatePolicy(
        policy.sample_us, max_delay_us, policy.delay_before_us, policy.from_us, policy.to_us, approximation
    )
    return made, "sampled"


def check_delay_before(delay_before_us: int | None, max_delay_us: int) -> None:
    """Check that approximations are used before a state is made without them (Def. 7.8.5); raises PolicyError."""
    if delay_before_us is not None and delay_before_us > max_delay_us:
        before, longest = print_duration(delay_before_us), print_duration(max_delay_us)
        raise PolicyError(
            f"`delay before approximation {before}` and `max delay {longest}` collide: the state is made before it may be approximated",
            f"delay before approximation {longest}",
        )
