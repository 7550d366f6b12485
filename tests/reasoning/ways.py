"""The ways there are to progress a formula, each as a function from states to the verdict after every one of them."""

from reasoning import Progression


def plain(formula, states, period_us=None, no_value="undecided"):
    progression, found = Progression(formula, period_us, no_value), []
    for state in states:
        progression.progress(state.valid_us, state.values, state.domains, state.events)
        found.append(progression.verdict)
    return found


WAYS = {"plain": plain}
