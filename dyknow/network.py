"""The local instance: sources, computational units, stream generators and streams, wired (thesis, ch. 4 and 5.4)."""

from collections.abc import Callable, Sequence
from functools import partial

from dyknow.compunits import ComputationalUnit, UnitFunction
from dyknow.errors import LabelAlreadyExists, UnknownLabel
from dyknow.generator import Consumer, Generator, Subscription
from dyknow.labels import Label
from dyknow.policy import Policy
from dyknow.sample import SURE, Quality, Sample, Value
from dyknow.values import Sort


class Network:
    """Samples flow by plain calls: a push returns when every unit and consumer behind it has run.

    A unit names its inputs, which exist already, so what flows never comes back. Consumers may subscribe, cancel,
    add and remove while they are called. Call `on_time` at `deadline_us`. Times: microseconds of federation time.
    """

    __slots__ = ("_generators", "_history", "_timed", "_unit_inputs")

    def __init__(self, history: int = 4096) -> None:
        self._history = history
        self._generators: dict[Label, Generator] = {}
        self._unit_inputs: dict[Label, list[Subscription]] = {}
        self._timed: list[Subscription] = []  # replaced, never changed: consumers may subscribe while it is walked

    def add_source(self, label: Label, sort: Sort, history: int | None = None) -> Generator:
        """A generator fed by `push`, with its own length of history if one is given.

        Raises:
            LabelAlreadyExists: the label is taken.
        """
        if label in self._generators:
            raise LabelAlreadyExists(str(label))
        generator = Generator(label, sort, history or self._history)
        self._generators[label] = generator
        return generator

    def push(self, label: Label, valid_us: int, value: Value, now_us: int, quality: Quality = SURE) -> None:
        """A source has a new sample.

        Raises:
            UnknownLabel: no generator carries `label`.
        """
        generator = self._generators.get(label)
        if generator is None:
            raise self._unknown(label)
        generator.push(valid_us, value, now_us, quality)

    def add_unit(
        self, label: Label, sort: Sort, function: UnitFunction, inputs: Sequence[tuple[Label, Policy]]
    ) -> Generator:
        """A generator fed by a computational unit over streams of other generators (Def. 4.5.8).

        Raises:
            LabelAlreadyExists: the label is taken.
            UnknownLabel: an input does not exist.
            ValueError: there is no input.
        """
        unit = ComputationalUnit(function, len(inputs))
        sources = [self.generator(name) for name, _ in inputs]
        generator = self.add_source(label, sort)

        def on_input(i: int, sample: Sample) -> None:
            output = unit.on_sample(i, sample, sample.available_us)
            if output is not None:
                generator.push(output.valid_us, output.value, sample.available_us, output.quality)

        self._unit_inputs[label] = [
            self._watch(source.subscribe(policy, partial(on_input, i)))
            for i, (source, (_, policy)) in enumerate(zip(sources, inputs, strict=True))
        ]
        return generator

    def subscribe(
        self, label: Label, policy: Policy, consumer: Consumer, on_end: Callable[[], None] | None = None
    ) -> Subscription:
        """A stream for `consumer`; `on_end` is called when the generator is removed.

        Raises:
            UnknownLabel: no generator carries `label`.
        """
        return self._watch(self.generator(label).subscribe(policy, consumer, on_end))

    def remove(self, label: Label) -> None:
        """Take a generator away, with the unit that feeds it; its streams end.

        Raises:
            UnknownLabel: no generator carries `label`.
        """
        generator = self.generator(label)
        del self._generators[label]
        for subscription in self._unit_inputs.pop(label, ()):
            subscription.cancel()
        generator.end()

    def generator(self, label: Label) -> Generator:
        """The generator that carries `label`.

        Raises:
            UnknownLabel: there is none.
        """
        generator = self._generators.get(label)
        if generator is None:
            raise self._unknown(label)
        return generator

    def has(self, label: Label) -> bool:
        """Whether a generator carries `label`."""
        return label in self._generators

    def labels(self) -> tuple[Label, ...]:
        """Every label, in the order they were added."""
        return tuple(self._generators)

    def on_time(self, now_us: int) -> None:
        """Hand on what policies owe at `now_us`."""
        for subscription in self._timed:
            due_us = subscription.deadline_us
            if due_us is not None and due_us <= now_us:
                subscription.on_time(now_us)

    @property
    def deadline_us(self) -> int | None:
        """Next instant at which `on_time` has work, or None."""
        if not self._timed:
            return None
        return min((due_us for s in self._timed if (due_us := s.deadline_us) is not None), default=None)

    def _watch(self, subscription: Subscription) -> Subscription:
        """Remember the streams that make samples when time passes, and forget those that will not again."""
        if subscription.deadline_us is not None:
            self._timed = [*(s for s in self._timed if s.deadline_us is not None), subscription]
        return subscription

    def _unknown(self, label: Label) -> UnknownLabel:
        return UnknownLabel(str(label), tuple(map(str, self._generators)))
