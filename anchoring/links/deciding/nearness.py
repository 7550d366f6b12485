"""Objects by place: which are within a bound of a state."""

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from math import floor

from dyknow.anchoring.links.prediction import ObjectPrediction
from dyknow.anchoring.links.states import ObjectState


class NearObjects:
    """Objects at one time, on a grid whose cells are as wide as the bound.

    Args:
        expected: symbols, with all hypotheses about where each is.
        bound_m: None: all are near.
        keeps_all: objects that were near once stay so.
    """

    def __init__(self, expected: Mapping[str, ObjectPrediction], bound_m: float | None, keeps_all: bool) -> None:
        self._expected = expected
        self._bound_m, self._keeps_all = bound_m, keeps_all
        self._cells: dict[tuple[int, int], list[str]] = defaultdict(list)
        if bound_m is not None and bound_m > 0.0:
            for symbol, whereabouts in self._expected.items():
                cells = {self._cell(each.state) for each in whereabouts.hypotheses}
                for cell in cells:
                    self._cells[cell].append(symbol)

    def _cell(self, state: ObjectState) -> tuple[int, int]:
        assert self._bound_m is not None  # noqa: S101 - tells the type checker what its callers made sure of
        return floor(state.x_m / self._bound_m), floor(state.y_m / self._bound_m)

    def of(self, state: ObjectState, before: Collection[str]) -> Iterator[tuple[str, ObjectPrediction]]:
        """The objects near a state, now or before."""
        if self._bound_m is None:
            yield from self._expected.items()
            return
        met = {symbol for symbol in before if symbol in self._expected} if self._keeps_all else set[str]()
        if self._cells:
            column, row = self._cell(state)
            for cell in ((column + dx, row + dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1)):
                for symbol in self._cells.get(cell, ()):
                    if state.distance_m(self._expected[symbol].nearest(state)) < self._bound_m:
                        met.add(symbol)
        for symbol in sorted(met):
            yield symbol, self._expected[symbol]
