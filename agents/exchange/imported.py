"""Streams of other units in the instance of a specification: asked for while they have subscribers here."""

from collections.abc import Callable

from dyknow import Inputs, Sample, Sort, UnitPrototype, Value
from dyknow.federation.sharing.translation import LabelConversion
from dyknow.model.values import without_nan
from dyknow.network.generator import Generator
from dyknow.network.process import Input
from dyknow.network.processes import EVER_US
from dyknow.network.refinement import RefinementProcess


class Imported(RefinementProcess):
    """A stream of another unit under a label of our own; it is asked for while it has a subscriber here."""

    def __init__(self, unit: UnitPrototype, taken: Input, ask: Callable[[bool], None]) -> None:
        super().__init__(unit, [taken])
        self._ask = ask

    def begin(self) -> None:
        super().begin()
        self._ask(True)

    def end(self) -> None:
        super().end()
        self._ask(False)


class ImportDemand:
    """Demand of a source that itself has the label: it is requested while it has a subscriber; its samples are kept."""

    def __init__(self, generator: Generator, ask: Callable[[bool], None]) -> None:
        self._generator, self._ask, self._asks = generator, ask, False
        generator.owner = self
        self.on_demand()

    def on_demand(self) -> None:
        """Request the source if the generator has subscribers, else release it."""
        self._tell(bool(self._generator.subscriptions))

    def reach(self, from_us: int | None) -> None:
        """Do nothing: the past of an imported stream is what its history holds."""

    def since_us(self) -> int:
        """`EVER_US`: the beginning is known only to the history."""
        return EVER_US

    def stop(self) -> None:
        """End the import."""
        self._generator.owner = None
        self._tell(False)

    def _tell(self, asks: bool) -> None:
        if asks is not self._asks:
            self._asks = asks
            self._ask(asks)


def converting(sort: Sort, conversion: LabelConversion) -> UnitPrototype:
    """Values in other units, with their quality; of object states what is not a number is not known."""

    def step(now_us: int, inputs: Inputs, state: Value) -> tuple[Sample | None, Value]:
        (sample,) = inputs
        if sample is None:
            return None, state
        if sort.is_of_objects:
            sample = sample._replace(value=without_nan(sample.value))
        return conversion.sample(sample)._replace(available_us=now_us), state

    return UnitPrototype("as exported", sort.name, (sort.name,), lambda: step, samplewise=True, cost_us=0)
