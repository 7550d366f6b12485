"""One instance of a unit at work, whatever it raises."""

from collections.abc import Mapping
from typing import Final

from dyknow.model.errors import raised
from dyknow.model.sample import Sample
from dyknow.network.computational_unit import ComputationalUnit
from dyknow.network.process import Outcome
from dyknow.network.prototypes import UnitPrototype

NOTHING_MADE: Final = Outcome()


class UnitAtWork:
    """One instance of a unit, for one thread at a time. Its exceptions are faults, and end nothing.

    Attributes:
        unit: the instance, once it is made.
    """

    __slots__ = ("_arity", "_asked_us", "_has_failed", "_prototype", "unit")

    def __init__(self, prototype: UnitPrototype, arity: int) -> None:
        self._prototype, self._arity = prototype, arity
        self.unit: ComputationalUnit | None = None
        self._has_failed, self._asked_us = False, -1

    @property
    def due_us(self) -> int | None:
        """When it wants to be asked, later than it was asked last; None: not at all."""
        due_us = None if self.unit is None else self.unit.due_us
        return None if due_us is None or due_us <= self._asked_us else due_us

    def on_time(self, now_us: int) -> Outcome:
        """Ask it without a sample."""
        self._asked_us = now_us
        try:
            return NOTHING_MADE if self.unit is None else Outcome(tuple(self.unit.on_time(now_us)))
        except Exception as wrong:  # noqa: BLE001  (it is a user's code)
            return Outcome((), (raised(self._prototype.name, wrong),))

    def make(self) -> tuple[str, ...]:
        """Make the instance, which may take its time: a unit imports what it needs; returns what went wrong."""
        try:
            self.unit = ComputationalUnit(self._prototype.make(), self._arity)
        except Exception as wrong:  # noqa: BLE001  (it is a user's code)
            self._has_failed = True
            return (f"{self._prototype.name} cannot be made: {wrong!r}",)
        return ()

    def take(self, element: Mapping[int, Sample], available_us: int) -> Outcome:
        """Call it with the next element of its join."""
        faults = () if self.unit is not None or self._has_failed else self.make()
        if self.unit is None:
            return Outcome((), faults)
        try:
            outputs = self.unit.outputs_of(element, available_us)
        except Exception as wrong:  # noqa: BLE001  (it is a user's code)
            return Outcome((), (raised(self._prototype.name, wrong),))
        return Outcome(tuple(outputs)) if outputs else NOTHING_MADE
