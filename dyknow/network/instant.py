"""Instants of a network: the samples of one push are one element of every join (Def. 4.3.16, 4.5.8).

A unit with several inputs is called once they all have what the instant brings, however many of them go back to one
source and over how many units: units upstream come first. The output of a worker comes in a later instant. Of units
that have all they need the one of the highest priority is called first (5.3).
"""

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol, TypeAlias

from dyknow.model.sample import Sample

Contain: TypeAlias = Callable[[Callable[..., object], str, Exception], int]


class Joining(Protocol):
    """A unit that waits for its turn, or until all of its inputs have come."""

    @property
    def rank(self) -> int:
        """The largest number of units between a source and its output."""

    @property
    def arity(self) -> int:
        """How many inputs it has."""

    @property
    def priority(self) -> int:
        """Of units that can be called the highest is called first."""

    def on_instant(self) -> None:
        """All samples of this instant have come."""


class Instant:
    """The present instant of one network.

    Attributes:
        joins: how many units with several inputs, or of a priority, are at work; without one nothing waits.
        priorities: how many units of a priority are at work; without one a unit of one input does not wait.
        is_open: whether more may come.
        contain: takes the raiser, the label of its stream and the exception; returns for how long it is left out, in
            us. None: the push raises the exceptions of consumers and units.
    """

    __slots__ = ("_come", "_waiting", "contain", "is_open", "joins", "priorities")

    def __init__(self) -> None:
        self._waiting: dict[int, deque[Joining]] = {}  # by rank: there are few ranks, and perhaps hundreds of units
        self._come = set[Joining]()
        self.joins = self.priorities = 0
        self.is_open = False
        self.contain: Contain | None = None

    def raised(self, do: Callable[..., object], label: object, error: Exception) -> int:
        """Something raised; for how long it is to be left out, in us."""
        if self.contain is None:
            raise error
        return self.contain(do, str(label), error)

    def put(self, unit: Joining) -> None:
        """Call the unit when all has come; at once outside an instant."""
        if not self.is_open:
            unit.on_instant()
        elif unit not in self._come:
            self._come.add(unit)
            self._waiting.setdefault(unit.rank, deque()).append(unit)

    def close(self) -> None:
        """All has come from outside: call what waits, upstream first."""
        try:
            while self._waiting:
                unit = self._taken()
                try:
                    unit.on_instant()
                except Exception as error:  # noqa: BLE001  (contained)
                    self.raised(unit.on_instant, "its inputs", error)
        finally:
            self.is_open = False

    def _taken(self) -> Joining:
        """The unit to call next, taken out: no waiting unit can bring it more inputs, the highest priority first."""
        waiting = self._waiting
        least = min(waiting)
        if self.priorities:
            able = [(rank, each) for rank in waiting for each in waiting[rank] if rank == least or each.arity == 1]
            rank, unit = min(able, key=lambda one: (-one[1].priority, one[0]))
            waiting[rank].remove(unit)
        else:
            rank, unit = least, waiting[least].popleft()
        if not waiting[rank]:
            del waiting[rank]
        self._come.discard(unit)
        return unit

    @contextmanager
    def whole(self) -> Iterator[None]:
        """Several pushes are one instant."""
        if self.is_open:
            yield
            return
        self.is_open = True
        try:
            yield
        finally:
            self.close()


class JoinElements:
    """Elements of a join that were not taken yet: the n-th sample that an instant brings of an input is in the n-th."""

    __slots__ = ("_elements",)

    def __init__(self) -> None:
        self._elements: list[dict[int, Sample]] = []

    def put(self, i: int, sample: Sample) -> None:
        for element in self._elements:
            if i not in element:
                element[i] = sample
                return
        self._elements.append({i: sample})

    def take(self) -> list[dict[int, Sample]]:
        taken, self._elements = self._elements, []
        return taken
