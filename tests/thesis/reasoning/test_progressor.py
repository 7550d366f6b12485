"""Section 7.10: the formulas that its experiments describe, step by step, and the plateaus of their size."""

import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.kpl import print_formula, read_formula
from dyknow.reasoning import make_progression, remaining
from tests.reasoning.meaning import State
from tests.reasoning.typed_formulas import UNIT_US, VOCABULARY, nested_operators, traces

FULL = bool(os.environ.get("DYKNOW_FULL"))
PERIOD_US = 100_000
PHI_1 = "always eventually[0, 1s] p"
PHI_2 = "always (not p -> eventually[0, 1s] always[0, 999ms] p)"
STATES = 36_000 if FULL else 3_000
"""One hour at 10 Hz, or five minutes."""


def left(text, *values, way="object"):
    """What is left of a formula after p has had these values, 100 ms apart."""
    progression = make_progression(read_formula(text), PERIOD_US, way=way)
    for at, value in enumerate(values):
        progression.progress(at * PERIOD_US, {"p": value})
    return print_formula(remaining(progression))


@pytest.mark.parametrize("way", ["object", "deadlines"])
def test_7_10_1_true_collapses_at_once_to_the_original_formula(way):
    assert [left(PHI_1, *[True] * count, way=way) for count in range(1, 5)] == [PHI_1] * 4


@pytest.mark.parametrize("way", ["object", "deadlines"])
def test_7_10_1_false_conjoins_an_eventually_and_true_collapses_it(way):
    assert left(PHI_1, True, False, way=way) == f"(eventually[0, 900ms] p) and {PHI_1}"
    assert left(PHI_1, True, False, True, way=way) == PHI_1


@pytest.mark.parametrize("way", ["object", "deadlines"])
def test_7_10_1_in_the_worst_case_only_the_strictest_eventually_is_kept_up_to_clamping_at_zero(way):
    for falses in range(1, 10):
        rest = f"{1000 - 100 * falses}ms"
        assert left(PHI_1, *[False] * falses, way=way) == f"(eventually[0, {rest}] p) and {PHI_1}"
    assert left(PHI_1, *[False] * 10, way=way) == f"(eventually[0, 0] p) and {PHI_1}"
    assert left(PHI_1, *[False] * 10, True, way=way) == PHI_1
    assert left(PHI_1, *[False] * 11, way=way) == "false"


@pytest.mark.parametrize("way", ["object", "deadlines"])
def test_7_10_2_a_false_state_leaves_900_ms_to_begin_the_required_interval(way):
    assert left(PHI_2, True, way=way) == PHI_2
    assert left(PHI_2, False, way=way) == f"(eventually[0, 900ms] always[0, 999ms] p) and {PHI_2}"


@pytest.mark.parametrize("way", ["object", "deadlines"])
def test_7_10_2_a_true_state_gives_two_ways_until_p_has_been_true_for_long_enough(way):
    for trues in range(1, 10):
        i, j = 999 - 100 * trues, 900 - 100 * trues
        later = f"eventually[0, {f'{j}ms' if j else 0}] always[0, 999ms] p"
        expected = f"(always[0, {i}ms] p) or {later}"
        assert left(PHI_2, False, *[True] * trues, way=way) == f"({expected}) and {PHI_2}"
    assert left(PHI_2, False, *[True] * 10, way=way) == PHI_2


@pytest.mark.parametrize("way", ["object", "deadlines"])
def test_7_10_2_another_false_state_is_subsumed_and_the_last_in_time_decides(way):
    assert left(PHI_2, False, False, way=way) == f"(eventually[0, 800ms] always[0, 999ms] p) and {PHI_2}"
    assert left(PHI_2, *[False] * 10, *[True] * 10, way=way) == PHI_2
    assert left(PHI_2, *[False] * 11, way=way) == "false"
    assert left(PHI_2, *[False] * 10, *[True] * 9, False, way=way) == "false"


SEQUENCES = {
    "7.10.1 true": (PHI_1, (True,), 1),
    "7.10.1 true,false": (PHI_1, (True, False), 2),
    "7.10.1 false*10,true*1": (PHI_1, (False,) * 10 + (True,), 2),
    "7.10.1 an hour": ("always eventually[0, 1h] p", (False,) * 600 + (True,), 2),
    "7.10.2 true": (PHI_2, (True,), 1),
    "7.10.2 false*1,true*10": (PHI_2, (False,) + (True,) * 10, 3),
    "7.10.2 false*1,true*40": (PHI_2, (False,) + (True,) * 40, 3),
    "7.10.2 false*10,true*10": (PHI_2, (False,) * 10 + (True,) * 10, 2),
}


@pytest.mark.parametrize("way", ["object", "deadlines"])
@pytest.mark.parametrize("name", sorted(SEQUENCES))
def test_7_10_the_size_stays_on_its_plateaus(name, way):
    text, pattern, largest = SEQUENCES[name]
    progression = make_progression(read_formula(text), PERIOD_US, way=way)
    kept = []
    for at in range(STATES if way == "object" else STATES // 5):
        progression.progress(at * PERIOD_US, {"p": pattern[at % len(pattern)]})
        kept.append(progression.kept)
    assert progression.verdict == "undecided"
    assert max(kept) == largest
    assert kept[: len(pattern)] == kept[-len(pattern) - len(kept) % len(pattern) :][: len(pattern)]


@given(nested_operators(), traces(max_size=8, irregular=False), st.integers(1, 7))
@settings(max_examples=2_000 if FULL else 60)
def test_7_5_2_the_formula_holds_iff_what_is_left_holds_in_the_rest(text, trace, seen):
    """In the next state, which lies one period later."""
    found, _ = trace
    states = [State(at * UNIT_US, *state[1:]) for at, state in enumerate(found)]
    progression, whole = (
        make_progression(read_formula(text, VOCABULARY), UNIT_US),
        make_progression(read_formula(text, VOCABULARY), UNIT_US),
    )
    for state in states[:seen]:
        progression.progress(state.valid_us, state.values)
        whole.progress(state.valid_us, state.values)
    rest = make_progression(read_formula(print_formula(remaining(progression)), VOCABULARY), UNIT_US)
    for state in states[seen:]:
        whole.progress(state.valid_us, state.values)
        rest.progress(state.valid_us, state.values)
        assert rest.verdict == whole.verdict
