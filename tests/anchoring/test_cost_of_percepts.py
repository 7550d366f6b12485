"""What linking percepts costs, as bench.percepts measures it, at a tenth: work by their number, memory over time."""

import pytest

from bench.percepts.__main__ import cost, hours


@pytest.mark.parametrize("roads", [False, True])
def test_conditions_that_are_evaluated_grow_as_percepts_do(roads: bool) -> None:
    few, many = (cost(count, 1.0, roads=roads, packed=False) for count in (5, 20))
    assert many["shown"] == pytest.approx(4 * few["shown"], rel=0.4)
    ratio = few["evaluations_per_tick"] / few["shown"]
    assert many["evaluations_per_tick"] <= 2.0 * ratio * many["shown"] + 5.0


def test_memory_is_as_it_was_while_percepts_appear_and_vanish() -> None:
    found = hours(0.01, appear=30)
    assert found["percepts"] == 30
    assert found["established"] > 10
    assert found["met"]
