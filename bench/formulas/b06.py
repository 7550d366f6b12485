"""B6: progression of the two formulas of thesis 7.10 through its worst sequences, from states of feature values."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

from bench.formulas.progression_peers import HORIZONS, MODULES, present, python_monitors, reelay, rtamt
from bench.formulas.progressions import (
    EXPERIMENTS,
    FAST,
    PERIOD_US,
    SLOW,
    Experiment,
    States,
    Step,
    average_ns,
    each_ns,
    from_assignments,
    one_by_one,
    unseen_us,
)
from bench.rows import Figures, Limit, Options, Ratio, Side
from dyknow.reasoning import make_progression

TITLE = "progression of the formulas of thesis 7.10, worst sequences, ns per formula and state (thesis: 30 to 72 us)"
BARS = tuple(
    bar
    for one in EXPERIMENTS
    for bar in (
        Limit(f"{one.section}_ns", 500.0, ours="object"),
        Ratio(f"{one.section}_ns", 1.0, ours="object", peer="reelay"),
        Limit(f"{one.section}_us", 30.0, ours="unseen residual"),
    )
)
COUNTS = (1, 500, 1000, 1500, 2000, 2500)
THOUSAND = 1000
SHOWN_STATES = 41
BEFORE = 50
QUIET = ("figures",)
EXTRA = dict(MODULES)


def points(found: Figures, figure: str, said: str, way: str) -> list[tuple[float, float]]:
    """What one round found of one curve: (number of formulas or of the state, microseconds)."""
    start = f"{figure} {way} {said} "
    return sorted((float(name.removeprefix(start)), us) for name, us in found.items() if name.startswith(start))


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    states = max(50, round(1000 * options.effort))
    peers: dict[str, Callable[[Experiment], Step]] = {
        "rtamt": partial(_peer, rtamt),
        "python-monitors": partial(_peer, python_monitors),
        "reelay": _reelay,
    }
    made: dict[str, Side] = {
        name: partial(_averages, step, 20 * states if name == "reelay" else states // 4)
        for name, step in peers.items()
        if name in present()
    }
    yield {
        "object": partial(_averages, lambda one: one_by_one(one, one.worst, 1), 20 * states),
        **made,
        "deadlines": partial(_averages, lambda one: one_by_one(one, one.worst, 1, "deadlines"), states),
        "object, letters": partial(_averages, lambda one: from_assignments(one, one.worst), states, None),
        "unseen residual": _unseen,
        "verdict late": _lateness,
        "figures": partial(_figures, COUNTS[: options.size(len(COUNTS), 2)], options.size(THOUSAND, 20)),
    }


def _averages(made: Callable[[Experiment], Step], states: int, formulas: int | None = 1) -> Figures:
    """Per formula and state; None: a step is a whole cycle of the sequence."""
    return {
        f"{one.section}_ns": average_ns(made(one), states) / (formulas or len(one.worst.cycle)) for one in EXPERIMENTS
    }


def _reelay(one: Experiment) -> Step:
    update, _ = reelay(one.section)
    states = [{"speed": speed} for speed in one.worst.cycle]
    return lambda number: update(states[number % len(states)])


def _peer(peer: Callable[[str], Any], one: Experiment) -> Step:
    update, speeds = peer(one.section), one.worst.cycle
    return lambda number: update(number, speeds[number % len(speeds)])


def _unseen() -> Figures:
    return {f"{one.section}_us": unseen_us(one, one.worst) for one in EXPERIMENTS}


def _lateness() -> Figures:
    """How long after ours, which is at the earliest state that decides, each says that speeds stay too high."""
    found: Figures = {}
    for one in EXPERIMENTS:
        speeds = [SLOW] * BEFORE + [FAST] * BEFORE
        first = {
            name: next(at for at, speed in enumerate(speeds) if says(at, speed) and at >= HORIZONS[one.section])
            for name, says in _answers(one)
        }
        for name, at in first.items():
            found[f"{one.section} {name}_ms"] = (at - first["object"]) * PERIOD_US / 1000
    return found


def _answers(one: Experiment) -> Iterator[tuple[str, Callable[[int, float], bool]]]:
    """For each, whether it says false after one more state."""
    ours = make_progression(one.formula, PERIOD_US)

    def progressed(number: int, speed: float) -> bool:
        ours.progress(number * PERIOD_US, {"speed": speed})
        return ours.verdict == "false"

    yield "object", progressed
    if "reelay" in present():
        update, read = reelay(one.section)
        yield "reelay", lambda _number, speed: read(update({"speed": speed})) is False
    if "rtamt" in present():
        margin = rtamt(one.section)
        yield "rtamt", lambda number, speed: margin(number, speed) < 0
    if "python-monitors" in present():
        holds = python_monitors(one.section)
        yield "python-monitors", lambda number, speed: not holds(number, speed)


def _figures(counts: Sequence[int], thousand: int) -> Figures:
    """What Figures 7.14 to 7.17 show, in microseconds: all formulas through a state."""
    found: Figures = {}
    for one in EXPERIMENTS:
        for sequence in one.sequences:
            states = 2 * len(sequence.cycle) + 20
            for count in counts:
                step = one_by_one(one, sequence, count)
                found[f"{one.average} object {sequence.said} {count}"] = round(average_ns(step, states, 25) / 1000, 3)
        for sequence in (one.sequences[at] for at in one.shown):
            _state_by_state(
                found, one, sequence, "deadlines", one_by_one(one, sequence, thousand // 20, "deadlines"), 20
            )
        _state_by_state(found, one, one.worst, "object", one_by_one(one, one.worst, thousand), 1)
    return found


def _state_by_state(found: Figures, one: Experiment, sequence: States, way: str, step: Step, times: int) -> None:
    """Each state; what is measured stands for `times` as many formulas."""
    for number, ns in enumerate(each_ns(step, SHOWN_STATES), 1):
        found[f"{one.state_by_state} {way} {sequence.said} {number}"] = round(ns / 1000 * times, 2)
