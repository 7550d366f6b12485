"""Simple temporal networks: differences between instants, closed under their consequences (thesis 8.4).

The network of instants 0 ... n-1 holds constraints t_j - t_i <= w. It is kept *minimal*: `bounds[i][j]` is the least
bound that follows, so an assignment can be found instant by instant without going back (Dechter, Meiri and Pearl).
Each new constraint is propagated at once (incremental path consistency) in O(n^2).
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from dyknow.model.errors import ChronicleError

UNBOUNDED: Final = 1 << 62
"""The bound that bounds nothing; sums of bounds that are less stay far below it."""


class Difference(NamedTuple):
    """t_to - t_from <= at_most; `said` is its text."""

    from_: int
    to: int
    at_most: int
    said: str = ""


class TemporalNetwork:
    """Constraints between `size` instants; `bounds` is the minimal network."""

    def __init__(self, size: int) -> None:
        self.bounds: list[list[int]] = [[0 if i == j else UNBOUNDED for j in range(size)] for i in range(size)]

    def copy(self) -> "TemporalNetwork":
        other = TemporalNetwork(0)
        other.bounds = [row[:] for row in self.bounds]
        return other

    def add(self, from_: int, to: int, at_most: int) -> bool:
        """Add t_to - t_from <= at_most; False, and nothing is added, if it contradicts the rest."""
        bounds = self.bounds
        if at_most >= bounds[from_][to]:
            return True
        if bounds[to][from_] + at_most < 0:
            return False
        onward = [(j, at_most + bound) for j, bound in enumerate(bounds[to]) if bound < UNBOUNDED]
        for row in bounds:
            before = row[from_]
            if before < UNBOUNDED:
                for j, bound in onward:
                    row[j] = min(row[j], before + bound)
        return True


def minimal_network(size: int, constraints: Sequence[Difference]) -> TemporalNetwork:
    """The minimal network of the constraints.

    Raises:
        ChronicleError: if they contradict each other; it names those of one contradiction.
    """
    network = TemporalNetwork(size)
    for index, (from_, to, at_most, _) in enumerate(constraints):
        if not network.add(from_, to, at_most):
            cycle = negative_cycle(size, constraints[: index + 1])
            said = "; ".join(dict.fromkeys(one.said for one in cycle))
            raise ChronicleError(f"these times contradict each other: {said}; take one of them out or widen it")
    return network


def negative_cycle(size: int, constraints: Iterable[Difference]) -> tuple[Difference, ...]:
    """Constraints that follow each other in a circle and sum up to less than 0; () if there are none (Bellman, Ford)."""
    edges = tuple(constraints)
    distance = [0] * size
    came: list[Difference | None] = [None] * size
    last: Difference | None = None
    for _ in range(size + 1):
        last = None
        for edge in edges:
            if distance[edge.from_] + edge.at_most < distance[edge.to]:
                distance[edge.to] = distance[edge.from_] + edge.at_most
                came[edge.to] = last = edge
        if last is None:
            return ()
    return _circle(came, last, size)


def _circle(came: Sequence[Difference | None], last: Difference | None, size: int) -> tuple[Difference, ...]:
    edge = last
    for _ in range(size):
        edge = came[edge.from_] if edge else None
    found: list[Difference] = []
    while edge is not None and edge not in found:
        found.append(edge)
        edge = came[edge.from_]
    return tuple(reversed(found))


def holds(times: Sequence[int], constraints: Iterable[Difference]) -> bool:
    """Whether the times of all instants satisfy the constraints."""
    return all(times[to] - times[from_] <= at_most for from_, to, at_most, _ in constraints)


def chained(operators: Sequence[str], points: Sequence[tuple[int, int]], said: str) -> list[Difference]:
    """`p1 < p2 <= p3 ...` as differences; a point is (instant, shift in ms)."""
    found: list[Difference] = []
    for operator, ((i, shift_i), (j, shift_j)) in zip(operators, pairwise(points), strict=True):
        strict = 1 if operator in {"<", ">"} else 0
        if operator in {"<", "<=", "="}:
            found.append(Difference(j, i, shift_j - shift_i - strict, said))
        if operator in {">", ">=", "="}:
            found.append(Difference(i, j, shift_i - shift_j - strict, said))
    return found
