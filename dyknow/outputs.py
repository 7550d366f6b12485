"""Processes with more than one output (thesis 3.3): one computation, a stream generator for each of its outputs."""

from collections.abc import Sequence
from typing import Final

from dyknow.labels import Label
from dyknow.network import Network
from dyknow.processes import Input, OnDemand, Refinement
from dyknow.prototypes import UnitPrototype
from dyknow.sample import Sample
from dyknow.values import Sort

NO_OUTPUT: Final = ()
"""In place of a value: this output has no sample this time."""


def add_outputs(
    network: Network,
    label: Label,
    outputs: Sequence[tuple[Label, Sort]],
    prototype: UnitPrototype,
    inputs: Sequence[Input],
) -> None:
    """A process whose unit makes tuples, one value for each output; `label` carries the tuples themselves.

    It computes while any of its outputs is wanted, once for all of them. Remove all of the labels to take it away.

    Raises:
        LabelAlreadyExists: a label is taken; nothing is added then.
    """
    added: list[Label] = []
    try:
        network.add_process(label, Sort(prototype.sort, is_open=True), Refinement(prototype, inputs))
        added.append(label)
        for i, (name, sort) in enumerate(outputs):
            network.add_process(name, sort, Output(Input(label), i))
            added.append(name)
    except Exception:
        for name in added:
            network.remove(name)
        raise


class Output(OnDemand):
    """One of several outputs."""

    def __init__(self, source: Input, index: int) -> None:
        super().__init__()
        self._source, self._index = source, index

    def inputs(self) -> Sequence[Input]:
        return (self._source,)

    def on_sample(self, i: int, sample: Sample) -> None:
        del i
        values = sample.value
        if not isinstance(values, tuple) or self._index >= len(values):
            self.fault(f"its process has no output {self._index}: it made {values!r}")
        elif values[self._index] != NO_OUTPUT:
            self.emit(sample.valid_us, values[self._index], sample.available_us, sample.quality)
