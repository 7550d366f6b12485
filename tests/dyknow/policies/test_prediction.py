"""Predicted samples: `predict T`, `max age of prediction T`, branches, and what is made of them (thesis 12.3)."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import NO_VALUE, SURE, Policy, PolicyAdapter, Predicted, Quality, Sample, independent
from dyknow.model.errors import PolicyError
from dyknow.model.sample import MAX_BRANCH, oldest
from dyknow.network.computational_unit import of_values, quality_of

S = 1_000_000
STEPS = st.lists(st.integers(1, 3 * S), min_size=2, max_size=12)
AHEAD = st.integers(1, 60 * S)


def run(policy: str, samples: list[Sample]) -> list[Sample]:
    adapter = PolicyAdapter(Policy.parse(policy))
    return [found for sample in samples for found in adapter.on_sample(sample, sample.available_us)]


@given(STEPS, AHEAD, st.floats(-100, 100), st.floats(-1000, 1000), st.integers(0, S))
def test_of_what_moves_along_a_line_each_prediction_comes_true(
    steps: list[int], ahead_us: int, speed: float, start: float, delay_us: int
) -> None:
    times = [sum(steps[:at]) for at in range(len(steps))]
    samples = [Sample(at_us + delay_us, at_us, (start + speed * at_us / S,)) for at_us in times]
    found = run(f"predict {ahead_us}us", samples)
    assert [each.valid_us for each in found] == [at_us + ahead_us for at_us in times[1:]]
    assert [each.quality.prediction for each in found] == [Predicted(at_us) for at_us in times[1:]]
    assert [each.available_us for each in found] == [each.available_us for each in samples[1:]]
    for each in found:
        assert math.isclose(each.value[0], start + speed * each.valid_us / S, rel_tol=1e-6, abs_tol=1e-3)


@given(STEPS, AHEAD)
def test_what_comes_out_satisfies_the_policy(steps: list[int], ahead_us: int) -> None:
    policy = Policy.parse(f"predict {ahead_us}us, max age of prediction 500ms, any change")
    samples = [Sample(sum(steps[:at]) + at * 200_000, sum(steps[:at]), float(at)) for at in range(len(steps))]
    last = None
    for each in run(str(policy), samples):
        assert all(holds(each, last) for _, holds in policy.named_constraints())
        last = each


def test_the_further_ahead_the_less_is_known() -> None:
    samples = [Sample(at * S, at * S, float(at), independent(0.25)) for at in range(3)]
    deviations = [run(f"predict {ahead}s", samples)[-1].quality.deviation for ahead in (1, 2, 10)]
    assert deviations == sorted(deviations)
    assert math.isclose(deviations[0], math.sqrt(2**2 * 0.25 + 0.25))
    assert run("predict 10s, max deviation 3", samples) == []


def test_what_is_predicted_already_stays_as_it_is_and_too_old_is_dropped_and_counted() -> None:
    old, new = (Sample(10 * S, 12 * S, 1.0, Quality(prediction=Predicted(made * S))) for made in (5, 9))
    adapter = PolicyAdapter(Policy.parse("predict 3s, max age of prediction 2s"))
    assert adapter.on_sample(old, 10 * S) == []
    assert adapter.on_sample(new, 10 * S) == [new]
    assert adapter.dropped == {"old prediction": 1}
    measured = Sample(20 * S, 1, 1.0)
    assert run("max age of prediction 1s", [measured]) == [measured], "the age of a measured sample is its delay"


def test_words_are_not_predictable_and_that_is_counted() -> None:
    adapter = PolicyAdapter(Policy.parse("predict 3s"))
    assert [adapter.on_sample(Sample(at, at, "red"), at) for at in (1, 2)] == [[], []]
    assert adapter.dropped == {"not predictable": 1}


def test_on_the_grid_of_its_period_each_point_once() -> None:
    samples = [Sample(at * 100_000, at * 100_000, float(at)) for at in range(20)]
    found = run("sample every 500ms, from 0 to oo, predict 5s", samples)
    assert [each.valid_us for each in found] == [5 * S + at * 500_000 for at in (1, 2, 3)]


def test_several_branches_are_of_one_time() -> None:
    left, right = (
        Sample(at, 9 * S, value, Quality(prediction=Predicted(S, branch, weight)))
        for at, value, branch, weight in ((1, 1.0, "left", 0.7), (2, 2.0, "right", 0.3))
    )
    assert run("max age of prediction 5s", [left, right]) == [left, right]
    both = of_values(lambda a, b: a + b)(5, (left, right), NO_VALUE)[0]
    assert isinstance(both, Sample)
    assert both.quality.prediction == Predicted(S, "left+right", pytest.approx(0.21))


PREDICTIONS = st.none() | st.builds(
    Predicted, st.integers(0, 99), st.sampled_from(["", "left", "right" * 12]), st.floats(0, 1)
)


@given(st.lists(PREDICTIONS, max_size=6))
def test_what_is_made_from_predictions_is_as_old_as_the_oldest(found: list[Predicted | None]) -> None:
    made = oldest(found)
    stated = [each for each in found if each is not None]
    assert (made is None) == (not stated)
    if made is not None:
        assert made.made_us == min(each.made_us for each in stated)
        assert 0 <= made.weight <= 1
        assert len(made.branch) <= MAX_BRANCH
    samples = tuple(Sample(1, 1, 1.0, Quality(prediction=each)) for each in found)
    assert quality_of(samples).prediction == made


def test_the_text_of_a_policy_is_read_back() -> None:
    text = "sample every 100, predict 5s, max age of prediction 250"
    policy = Policy.parse(text)
    assert (policy.predict_us, policy.prediction_age_us) == (5 * S, 250_000)
    assert Policy.parse(str(policy)) == policy
    assert policy.content_hash() != Policy.parse("sample every 100").content_hash()
    with pytest.raises(PolicyError, match="after now"):
        Policy.parse("predict 0")
    assert SURE.prediction is None
