"""Minimal networks against the definition: bounds that follow from all constraints, found by trying all paths."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.model.errors import ChronicleError
from dyknow.reasoning.chronicles.definition.network import (
    UNBOUNDED,
    Difference,
    TemporalNetwork,
    chained,
    minimal_network,
)

SIZE = 5
INSTANTS = st.integers(0, SIZE - 1)
DIFFERENCES = st.lists(st.builds(Difference, INSTANTS, INSTANTS, st.integers(-5, 9), st.just("")), max_size=12)


def shortest(constraints: list[Difference]) -> list[list[int]] | None:
    """Floyd and Warshall; None if some sum around a circle is negative."""
    bounds = [[0 if i == j else UNBOUNDED for j in range(SIZE)] for i in range(SIZE)]
    for one in constraints:
        bounds[one.from_][one.to] = min(bounds[one.from_][one.to], one.at_most)
    for k in range(SIZE):
        for i in range(SIZE):
            for j in range(SIZE):
                if UNBOUNDED not in {bounds[i][k], bounds[k][j]}:
                    bounds[i][j] = min(bounds[i][j], bounds[i][k] + bounds[k][j])
    return None if any(bounds[i][i] < 0 for i in range(SIZE)) else bounds


def contradictory(constraints: list[Difference]) -> bool:
    return shortest(constraints) is None


@given(DIFFERENCES)
def test_the_network_is_minimal_after_every_constraint(constraints: list[Difference]) -> None:
    network = TemporalNetwork(SIZE)
    for count, one in enumerate(constraints, 1):
        if not network.add(one.from_, one.to, one.at_most):
            assert contradictory(constraints[:count])
            return
        assert network.bounds == shortest(constraints[:count])


@given(DIFFERENCES)
def test_a_contradiction_is_told_by_constraints_that_contradict_each_other(constraints: list[Difference]) -> None:
    named = [one._replace(said=f"constraint {number}") for number, one in enumerate(constraints)]
    try:
        minimal_network(SIZE, named)
    except ChronicleError as error:
        culprits = [one for one in named if one.said in str(error).replace(";", " ;").split(": ", 1)[1]]
        assert contradictory(culprits)
    else:
        assert not contradictory(named)


@given(DIFFERENCES)
def test_the_earliest_times_of_a_minimal_network_are_a_solution(constraints: list[Difference]) -> None:
    """No going back: each instant takes the least time that those before it leave."""
    network = TemporalNetwork(SIZE)
    held = [one for one in constraints if network.add(*one[:3])]
    times: list[int] = []
    for instant in range(SIZE):
        lows = [time - network.bounds[instant][at] for at, time in enumerate(times)]
        highs = [time + network.bounds[at][instant] for at, time in enumerate(times)]
        lows = [low for low in lows if low > -UNBOUNDED // 2]
        times.append(max(lows) if lows else min([0, *highs]))
    assert all(times[one.to] - times[one.from_] <= one.at_most for one in held)


@pytest.mark.parametrize(
    ("operator", "right", "wrong"), [("<", 1, 0), ("<=", 0, -1), ("=", 0, 1), (">=", 0, 1), (">", -1, 0)]
)
def test_a_relation_is_differences(operator: str, right: int, wrong: int) -> None:
    """Point 0 + 10 stands left of point 1, `right` or `wrong` later."""
    constraints = chained((operator,), ((0, 10), (1, 0)), "")
    for later, holds in ((right, True), (wrong, False)):
        times = (0, 10 + later)
        assert all(times[one.to] - times[one.from_] <= one.at_most for one in constraints) is holds
