"""The local instance of a platform as a part: it lives by time."""

from collections.abc import Callable
from typing import NamedTuple

from dyknow import Label
from dyknow.agents.effects import Compute, Computed, Effect
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.sharing.translation import LabelConversion
from dyknow.network.process import Work

IMPORTED_HISTORY = 600
"""How many samples of an imported stream are kept."""


class UnitWorkers(NamedTuple):
    """Workers of the process, and its clock, as the network of streams sees them."""

    now_us: Callable[[], int]
    emit: Callable[[Effect], None]

    def start(self, number: int, work: Work) -> None:
        """Ask for it."""
        self.emit(Compute(number, work))


class LocalInstance(Part):
    """Steps the network of streams, which lives in federation time."""

    vital = heeds_samples = True
    takes = {Computed: "on_computed"}  # noqa: RUF012  (a declaration)

    def __init__(self, ports: Ports, _parts: PartRegistry) -> None:
        self._unit, self.network, self._clock = ports.unit, ports.network, ports.clock
        self._translation = ports.translation
        if ports.stopwatch is not None:
            ports.network.calls.workers = UnitWorkers(ports.stopwatch, ports.emit)

    def source(self, semantic_label: str, unit: str) -> tuple[Label, LabelConversion]:
        """The local label of a unit's stream, its source declared if it is not there and comes from elsewhere.

        Returns as well how its values become semantic.
        """
        local = self._translation.local_label(semantic_label, unit)
        if unit != self._unit and not self.network.has(local):
            self.network.add_source(local, self._translation.local_sort(semantic_label), IMPORTED_HISTORY)
        return local, self._translation.to_semantic(semantic_label)

    @property
    def deadline_us(self) -> int | None:
        due_us = self.network.deadline_us
        return None if due_us is None else self._clock.wall_us(due_us)

    def on_time(self, now_us: int) -> None:
        self.network.on_time(self._clock.federation_us(now_us))

    def on_computed(self, event: Computed, now_us: int) -> None:
        """A worker has called a unit."""
        took_us = round(event.took_us * self._clock.speed)
        self.network.on_computed(event.number, event.outcome, took_us, self._clock.federation_us(now_us))
