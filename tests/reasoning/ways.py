"""The ways there are to progress a formula, each as a function from states to the verdict after every one of them."""

from functools import partial

from reasoning import make_progression


def verdicts(formula, states, period_us=None, no_value="undecided", way=None):
    progression, found = make_progression(formula, period_us, no_value, way), []
    for state in states:
        progression.progress(state.valid_us, state.values, state.domains, state.events)
        found.append(progression.verdict)
    return found


WAYS = {way: partial(verdicts, way=way) for way in ("plain", "object", "batch", "deadlines")}
