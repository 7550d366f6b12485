"""The ways there are to progress a formula, each as a function from states to the verdict after every one of them."""

from functools import partial

from dyknow.reasoning import make_progression
from tests.reasoning.plain import Progression


def progression(formula, period_us=None, no_value="undecided", way=None):
    """What progresses the formula; `plain` is the tests' own reference."""
    if way == "plain":
        return Progression(formula, period_us, no_value)
    return make_progression(formula, period_us, no_value, way)


def verdicts(formula, states, period_us=None, no_value="undecided", way=None):
    one, found = progression(formula, period_us, no_value, way), []
    for state in states:
        one.progress(state.valid_us, state.values, state.domains, state.events)
        found.append(one.verdict)
    return found


WAYS = {way: partial(verdicts, way=way) for way in ("plain", "object", "deadlines")}
