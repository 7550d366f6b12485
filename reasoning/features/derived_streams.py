"""Derived features as streams that are there while they are wanted: `xy_dist[0, 1]` of `heli-position[0]` and `[1]`."""

from collections.abc import Callable, Sequence
from math import prod
from typing import Final, TypeAlias

from dyknow.model.errors import UnknownLabel
from dyknow.model.labels import Label
from dyknow.model.sample import SURE, Quality, Sample, Value, oldest
from dyknow.model.values import NO_VALUE, Sort
from dyknow.network.network import Network
from dyknow.network.process import Input, Process
from dyknow.network.processes import OnDemand
from dyknow.objects.object_streams import ObjectFeature
from dyknow.policies.policy import Policy
from dyknow.policies.sampling import Grid
from dyknow.reasoning.features.derivation import FEATURES, Derivation, FeatureInput

Find: TypeAlias = Callable[[FeatureInput], tuple[Label, Callable[[Value], Value]]]
"""The local label of an input, and how its values become those of the semantic label."""
Demand: TypeAlias = Callable[[FeatureInput, bool], None]
"""An input is needed from now on, or no longer."""

UNPLACED: Final = "position_in_frame"
"""The sort of positions in a frame whose place is not known."""
DERIVED: Final = "derived."
"""Before the name of a feature: the derived one, where a stream of the instance has the name."""
MOST_ROWS: Final = 1024
"""Valid times at which an input is still missing; the oldest are dropped."""
PERIOD_US: Final = 100_000
MAX_DELAY_US: Final = 1_000_000
"""The grid on which objects, which are seen at times of their own, meet units, and how late they may be."""


def local_input(needed: FeatureInput) -> tuple[Label, Callable[[Value], Value]]:
    """An input in an instance by itself: the stream that is called like the semantic label."""
    return Label(needed.label, (needed.unit,)), lambda value: value


def derived_label(label: Label) -> Label | None:
    """The derived feature that a label names, without the prefix; None if it names none."""
    name = label.feature.removeprefix(DERIVED)
    feature = FEATURES.get(name)
    return label._replace(feature=name) if feature is not None and feature.arity == len(label.objects) else None


def is_own_input(label: Label) -> bool:
    """Whether a feature is derived from the stream that is called like it: `battery[0]` from `battery[0]`."""
    feature = FEATURES.get(label.feature)
    return feature is not None and label.feature in feature.needs


class DerivedStream(OnDemand):
    """One derived feature: a sample for each valid time at which every input has brought one, in order.

    Args:
        label: of the feature, `xy_dist[0, 1]`.
        find: where its inputs are.
        demand: called for each input when the stream begins to be computed, and when it ends.

    Raises:
        UnknownLabel: there is no such feature of this number of units.
    """

    def __init__(self, label: Label, find: Find = local_input, demand: Demand | None = None) -> None:
        super().__init__()
        feature = derived_label(label)
        if feature is None:
            raise UnknownLabel(str(label), tuple(FEATURES))
        self._name = str(feature)
        self._derivation, self._demand = Derivation([self._name]), demand
        found = [find(each) for each in self._derivation.inputs]
        self._wanted = tuple(Input(local) for local, _ in found)
        self._converters = tuple(convert for _, convert in found)
        self._rows: dict[int, list[Sample | None]] = {}
        self._last_us = 0
        self._missing: dict[str, None] = {}
        self._is_nowhere = False

    @property
    def sort(self) -> Sort:
        """Its values are numbers: of durations microseconds."""
        return Sort(FEATURES[self._name.partition("[")[0]].sort, is_open=True)

    @property
    def needed(self) -> tuple[FeatureInput, ...]:
        """Its inputs, by semantic labels."""
        return self._derivation.inputs

    @property
    def missing(self) -> tuple[str, ...]:
        """The inputs that have brought no value yet, by their semantic labels."""
        return tuple(self._missing)

    def inputs(self) -> Sequence[Input]:
        return self._wanted

    def taken_with(self, policy: Policy) -> list[Input]:
        """Its inputs, with the policy of its subscriber; states of objects as they are put on the grid."""
        grids = {proxy.label: proxy.policy for proxy in self.proxies if proxy.policy.approximation == "linear"}
        return [Input(label, grids.get(label, policy)) for label, _ in self._wanted]

    def begin(self) -> None:
        self._rows, self._last_us = {}, -(2**80)
        self._missing = dict.fromkeys(self._derivation.input_names)
        self._ask(wanted=True)

    def end(self) -> None:
        self._rows = {}
        self._ask(wanted=False)

    def want(self, grid: Grid | None) -> bool:
        """States of objects are put on the grid, on the line between two of them; of objects alone only if it is wanted."""
        of_objects = [self._is_of_object(proxy.label) for proxy in self.proxies]
        meets = any(of_objects) and not all(of_objects)
        self._is_nowhere = meets and any(self._is_unplaced(proxy.label) for proxy in self.proxies)
        meeting = Grid(PERIOD_US, 0) if meets else None
        for proxy, is_of_object in zip(self.proxies, of_objects, strict=True):
            if is_of_object:
                proxy.change(_on_grid(grid or meeting))
            else:
                proxy.want(grid)
        return grid is not None

    def _is_unplaced(self, label: Label) -> bool:
        """Whether it is not known where the metres lie in which an object is seen; reported when that first matters."""
        generator = None if self._network is None else self._network.behind(label)
        if generator is None or generator.sort.name != UNPLACED:
            return False
        if not self._is_nowhere:
            self.fault(f"{label} is in metres of a frame; define ORIGIN_LATITUDE_DEG and ORIGIN_LONGITUDE_DEG")
        return True

    def _is_of_object(self, label: Label) -> bool:
        return self._network is not None and isinstance(self._network.process(label), ObjectFeature)

    def on_sample(self, i: int, sample: Sample) -> None:
        value = self._converters[i](sample.value)
        if self._missing and value is not NO_VALUE:
            self._missing.pop(self._derivation.input_names[i], None)
        if sample.valid_us <= self._last_us:
            return
        row = self._rows.setdefault(sample.valid_us, [None] * len(self._wanted))
        row[i] = sample._replace(value=value)
        samples = [each for each in row if each is not None]
        if len(samples) == len(row):
            self._hand_on(sample.valid_us, samples, sample.available_us)
        elif len(self._rows) > MOST_ROWS:
            del self._rows[min(self._rows)]

    def _hand_on(self, valid_us: int, samples: list[Sample], now_us: int) -> None:
        self._last_us = valid_us
        self._rows = {at_us: row for at_us, row in self._rows.items() if at_us > valid_us}
        certainty = prod(each.quality.certainty for each in samples)
        value = NO_VALUE if self._is_nowhere else self._derivation.values([each.value for each in samples])[self._name]
        prediction = oldest(each.quality.prediction for each in samples)
        quality = SURE if certainty == 1.0 and prediction is None else Quality(certainty, (), prediction)
        self.emit(Sample(now_us, valid_us, value, quality))

    def _ask(self, *, wanted: bool) -> None:
        if self._demand is not None:
            for needed in self._derivation.inputs:
                self._demand(needed, wanted)
        elif wanted and self._network is not None:
            for label, _ in self._wanted:
                if self._network.find(label) is None:
                    self.fault(f"derived from {label}, which has no producer here; the stream begins when there is one")


def _on_grid(grid: Grid | None) -> Policy:
    if grid is None:
        return Policy()
    return Policy(
        change="sample",
        sample_us=grid.period_us,
        from_us=grid.anchor_us,
        approximation="linear",
        max_delay_us=MAX_DELAY_US,
    )


def derived_stream(label: Label, find: Find = local_input, demand: Demand | None = None) -> tuple[Sort, Process] | None:
    """The sort and the process of a derived feature; None if the label names none."""
    if derived_label(label) is None or is_own_input(label):
        return None
    process = DerivedStream(label, find, demand)
    return process.sort, process


def stream_of(network: Network, feature: Label) -> Label:
    """The stream that a formula means by a feature: where a stream of records is called like it, the derived one."""
    if derived_label(feature) is None:
        return feature
    if network.has(feature) and not network.is_implicit(feature):
        is_record = bool(network.generator(feature).sort.fields)
    else:
        is_record = is_own_input(feature)
    return feature._replace(feature=f"{DERIVED}{feature.feature}") if is_record else feature
