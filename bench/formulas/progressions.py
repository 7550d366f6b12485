"""The experiments of thesis 7.10: its two formulas, its state sequences, and what progresses them.

States come every 100 ms. `p` is a comparison, `speed <= 30`, as it is in a monitor; states are dictionaries of feature
values. Times are processor time: the machine is shared.
"""

import gc
from collections.abc import Callable
from itertools import cycle, islice
from time import process_time_ns
from typing import Any, Final, NamedTuple

from dyknow.kpl import read_formula
from dyknow.reasoning import make_progression
from dyknow.reasoning.formulas.skeletons import take_apart
from dyknow.reasoning.formulas.tree import Formula
from dyknow.reasoning.progression.automaton import Automaton

PERIOD_US: Final = 100_000
FAST, SLOW = 31.5, 29.5


class States(NamedTuple):
    """`false` states in which p is false, `true` ones in which it is true, again and again."""

    said: str
    false: int
    true: int

    @property
    def cycle(self) -> list[float]:
        return [FAST] * self.false + [SLOW] * self.true

    def speeds(self, count: int) -> list[float]:
        return list(islice(cycle(self.cycle), count))


class Experiment(NamedTuple):
    """One formula, the figures of its average time and of its time state by state, and the sequences they show."""

    section: str
    text: str
    average: str
    state_by_state: str
    sequences: tuple[States, ...]
    shown: tuple[int, ...]

    @property
    def formula(self) -> Formula:
        return read_formula(self.text)

    @property
    def worst(self) -> States:
        return self.sequences[-1]


ALWAYS: Final = States("p = true", 0, 1)
EXPERIMENTS: Final = (
    Experiment(
        "7.10.1",
        "always eventually[0, 1000] speed <= 30",
        "7.14",
        "7.15",
        (ALWAYS, States("p = (false*1, true*1)", 1, 1), States("p = (false*10, true*1)", 10, 1)),
        (0, 2),
    ),
    Experiment(
        "7.10.2",
        "always (not speed <= 30 -> eventually[0, 1000] always[0, 999] speed <= 30)",
        "7.16",
        "7.17",
        (
            ALWAYS,
            States("p = (false*1, true*10)", 1, 10),
            States("p = (false*1, true*40)", 1, 40),
            States("p = (false*10, true*10)", 10, 10),
        ),
        (0, 1, 2, 3),
    ),
)

Step = Callable[[int], None]
"""Progress everything through the state with this number."""


def one_by_one(experiment: Experiment, sequence: States, count: int, way: Any = "object") -> Step:
    """`count` formulas, each an object."""
    formula = experiment.formula
    formulas = [make_progression(formula, PERIOD_US, way=way).progress for _ in range(count)]
    states = [{"speed": speed} for speed in sequence.cycle]

    def step(number: int) -> None:
        valid_us, state = number * PERIOD_US, states[number % len(states)]
        for progress in formulas:
            progress(valid_us, state)

    return step


def from_assignments(experiment: Experiment, sequence: States) -> Step:
    """One formula on its automaton, from truth assignments that are ready: a whole cycle of the sequence a step."""
    shared = Automaton(take_apart(experiment.formula, {}).skeleton, PERIOD_US)
    assignments = [1 if speed <= 30 else 0 for speed in sequence.cycle]
    state = shared.beginning

    def step(_number: int) -> None:
        nonlocal state
        now = state
        for assignment in assignments:
            after = now.after.get(assignment)
            now = shared.step(now, assignment) if after is None else after
        state = now

    return step


def unseen_us(experiment: Experiment, sequence: States) -> float:
    """What a transition costs that nobody has met."""
    shared = Automaton(take_apart(experiment.formula, {}).skeleton, PERIOD_US)
    state, found = shared.beginning, []
    for speed in sequence.speeds(3 * len(sequence.cycle)):
        assignment = 1 if speed <= 30 else 0
        if assignment in state.after:
            state = state.after[assignment]
            continue
        began_ns = process_time_ns()
        state = shared.step(state, assignment)
        found.append(process_time_ns() - began_ns)
    return sum(found) / len(found) / 1000


def average_ns(step: Step, states: int, warm: int = 50) -> float:
    """Nanoseconds per step; the first `warm` do not count."""
    for number in range(warm):
        step(number)
    began_ns = process_time_ns()
    for number in range(warm, warm + states):
        step(number)
    return (process_time_ns() - began_ns) / states


def each_ns(step: Step, states: int, warm: int = 0) -> list[int]:
    """Nanoseconds of each step; garbage is collected before, not meanwhile."""
    found = []
    for number in range(warm):
        step(number)
    gc.collect()
    gc.disable()
    try:
        for number in range(warm, warm + states):
            began_ns = process_time_ns()
            step(number)
            found.append(process_time_ns() - began_ns)
    finally:
        gc.enable()
    return found
