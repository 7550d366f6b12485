"""Streams about units that are there while they are wanted: derived features, and `units`, the platforms of the federation."""

from collections.abc import Callable, Sequence

from agents.monitoring.monitors import UnitMonitors
from dyknow import Label, Sample, Sort, Value
from dyknow.network.process import Input, Process
from dyknow.network.processes import OnDemand
from federation.sharing.translation import Translation
from kpl.checking.symbols import OF_A_PLATFORM
from reasoning.features.derivation import FeatureInput
from reasoning.features.derived_streams import Demand, derived_stream

UNITS = Label(OF_A_PLATFORM)


class UnitStreams:
    """Makes them: `features` of an `Instance`.

    Args:
        translation: the platform's own labels and units.
        monitors: knows the other units.
        demand: called when an input of another unit is needed, and when it is no longer.
    """

    def __init__(self, unit: str, translation: Translation, monitors: UnitMonitors, demand: Demand) -> None:
        self._unit, self._translation, self._monitors, self._demand = unit, translation, monitors, demand

    def __call__(self, label: Label) -> tuple[Sort, Process] | None:
        if label == UNITS:
            return Sort("object", is_open=True), UnitsStream(self._unit, self._monitors)
        return derived_stream(label, self._find, self._need)

    def _find(self, needed: FeatureInput) -> tuple[Label, Callable[[Value], Value]]:
        local = self._translation.local_label(needed.label, needed.unit)
        return local, self._translation.to_semantic(needed.label)

    def _need(self, needed: FeatureInput, wanted: bool) -> None:
        if needed.unit != self._unit:
            self._demand(needed, wanted)


class UnitsStream(OnDemand):
    """The units in the federation, this one first: a sample whenever one joins or leaves."""

    def __init__(self, unit: str, monitors: UnitMonitors) -> None:
        super().__init__()
        self._unit, self._monitors = unit, monitors

    def inputs(self) -> Sequence[Input]:
        return ()

    def begin(self) -> None:
        self._monitors.on_members.append(self._tell)
        self._tell()

    def on_sample(self, i: int, sample: Sample) -> None:
        """It takes no streams."""

    def since_us(self) -> int:
        """Earlier members are not kept."""
        return super().since_us() if self.running or self._network is None else self._network.now_us

    def end(self) -> None:
        self._monitors.on_members.remove(self._tell)

    def _tell(self) -> None:
        if self._network is not None:
            now_us = self._network.now_us
            self.emit(now_us, (self._unit, *self._monitors.members), now_us)
