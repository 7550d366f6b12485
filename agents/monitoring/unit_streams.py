"""Streams about units that are there while they are wanted: derived features, and `units`, the platforms of the federation."""

from collections.abc import Callable, Sequence

from dyknow import Label, Sample, Sort, Value
from dyknow.agents.monitoring.monitors import UnitMonitors
from dyknow.federation.sharing.translation import Translation
from dyknow.kpl.checking.symbols import OF_A_PLATFORM
from dyknow.network.process import Input, Process
from dyknow.network.processes import OnDemand
from dyknow.objects.object_streams import ObjectStreams
from dyknow.reasoning.features.derivation import POSITION, FeatureInput
from dyknow.reasoning.features.derived_streams import Demand, derived_stream, local_input
from dyknow.reasoning.formulas.tree import Feature, Formula, walk

UNITS = Label(OF_A_PLATFORM)


class UnitStreams:
    """Makes them: `features` of an `Instance`.

    Args:
        translation: the platform's own labels and units.
        monitors: knows the other units.
        demand: called when an input of another unit is needed, and when it is no longer.
        objects: knows the objects in streams of object states; a name that is no unit's may be one of theirs.
    """

    def __init__(
        self,
        unit: str,
        translation: Translation,
        monitors: UnitMonitors,
        demand: Demand,
        objects: Callable[[], ObjectStreams],
    ) -> None:
        self._unit, self._translation, self._monitors, self._demand = unit, translation, monitors, demand
        self._objects = objects
        monitors.on_joined.append(lambda member: objects().renew(member))

    def __call__(self, label: Label) -> tuple[Sort, Process] | None:
        if label == UNITS:
            return Sort("object", is_open=True), UnitsStream(self._unit, self._monitors)
        others = {name for name in label.objects if self._may_be_object(name)}

        def need(needed: FeatureInput, wanted: bool) -> None:
            if needed.unit != self._unit and needed.unit not in others:
                self._demand(needed, wanted)

        return derived_stream(label, self._find, need)

    def is_unit(self, name: str) -> bool:
        """Whether a platform of the federation is called so."""
        return name == self._unit or self._monitors.has_member(name)

    def are_objects(self, formula: Formula) -> bool:
        """Whether a formula names what may be objects that are seen, and no units that are known."""
        named = {one for node in walk(formula) if isinstance(node, Feature) for one in node.objects}
        return any(isinstance(one, str) and self._may_be_object(one) for one in named)

    def _may_be_object(self, name: str) -> bool:
        return not self.is_unit(name) and bool(self._objects().bearers(POSITION))

    def _find(self, needed: FeatureInput) -> tuple[Label, Callable[[Value], Value]]:
        if self._may_be_object(needed.unit):
            return local_input(needed)
        local = self._translation.local_label(needed.label, needed.unit)
        return local, self._translation.to_semantic(needed.label)


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
        """Never called: the stream has no inputs."""

    def since_us(self) -> int:
        """Earlier members are not kept."""
        return super().since_us() if self.running or self._network is None else self._network.now_us

    def end(self) -> None:
        self._monitors.on_members.remove(self._tell)

    def _tell(self) -> None:
        if self._network is not None:
            now_us = self._network.now_us
            self.emit(Sample(now_us, now_us, (self._unit, *self._monitors.members)))
