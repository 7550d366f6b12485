import pytest

from dyknow.agents.exchange.readings import merge_inverse_variance, merge_mean, select_best, select_newest
from dyknow.federation.messages.contents import Reading


def reading(valid_us: int, value: float, variance: float | None = None) -> Reading:
    stated = None if variance is None else {"altitude_m": variance}
    return Reading(valid_us=valid_us, available_us=valid_us + 1, value={"altitude_m": value}, variance=stated)


def test_readings_are_selected_and_merged_as_their_names_say() -> None:
    found = [(reading(3, 10.0, 4.0), 1.0), (reading(5, 20.0, 1.0), 1.0), (reading(9, 90.0), 1.0)]
    assert select_newest(found) == found[2][0]
    assert select_best(found) == found[1][0]
    mean, weighed = merge_mean(found), merge_inverse_variance(found)
    assert mean is not None
    assert weighed is not None
    assert mean.value == {"altitude_m": 40.0}
    assert weighed.value == {"altitude_m": 18.0}, "(10/4 + 20) / (1/4 + 1); one without a variance is left out"
    assert weighed.variance == {"altitude_m": pytest.approx(0.8)}
    assert mean.valid_us == 9
    assert [f([]) for f in (select_newest, select_best, merge_mean, merge_inverse_variance)] == [None] * 4


def test_a_platform_counts_as_far_as_it_is_trusted() -> None:
    found = [(reading(3, 10.0, 4.0), 1.0), (reading(5, 20.0, 1.0), 0.2), (reading(9, 90.0, 0.1), 0.0)]
    assert select_newest(found) == found[1][0], "one that is not trusted is not asked"
    assert select_best(found) == found[0][0], "4 is less than 1 / 0.2"
    mean, weighed = merge_mean(found), merge_inverse_variance(found)
    assert mean is not None
    assert weighed is not None
    assert mean.value == {"altitude_m": pytest.approx(14.0 / 1.2)}
    assert weighed.value == {"altitude_m": pytest.approx((10 / 4 + 20 * 0.2) / (1 / 4 + 0.2))}


@pytest.mark.parametrize("variance", [0.0, 5e-324, 1e-30, 1e30])
def test_a_variance_that_no_measurement_has_ends_no_merge(variance: float) -> None:
    found = [(reading(3, 10.0, 4.0), 1.0), (reading(5, 20.0, variance), 1.0)]
    weighed = merge_inverse_variance(found)
    assert weighed is not None
    assert weighed.value == {"altitude_m": pytest.approx(10.0)}
    assert select_best(found) is not None


def test_a_field_whose_variance_one_does_not_state_is_left_out() -> None:
    """A reading may state the variance of other fields than it has."""
    odd = Reading(valid_us=1, available_us=1, value={"altitude_m": 5.0, "a": 1.0}, variance={"b": 1.0, "a": 2.0})
    plain = Reading(
        valid_us=1, available_us=1, value={"altitude_m": 5.0, "a": 4.0}, variance={"altitude_m": 1.0, "a": 1.0}
    )
    weighed = merge_inverse_variance([(odd, 1.0), (plain, 1.0)])
    assert weighed is not None
    assert weighed.value == {"a": pytest.approx(3.0)}
