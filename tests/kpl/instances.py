"""Instances to test with: what happens at their outputs, and everything that they hold."""

from types import MappingProxyType

from dyknow import Label, Network, Sort, SourcePrototype, UnitPrototype, of_values
from dyknow.kpl import parse_specification
from dyknow.kpl.running.instance import Instance
from dyknow.kpl.running.ports import Hooks
from dyknow.model.errors import SourceText
from dyknow.model.sample import Sample
from dyknow.model.values import NO_VALUE, Field
from dyknow.network.computational_unit import latest_valid_us
from tests.dyknow.networks import pass_time, state_of

POS = Sort("pos", (Field("north_m", "m"), Field("altitude_m", "m")))


def summing():
    def step(now_us, inputs, state):
        total = (0 if state is NO_VALUE else state) + sum(s.value for s in inputs if s is not None)
        return Sample(now_us, latest_valid_us(inputs), total), total

    return step


UNITS = (
    UnitPrototype("Double", "number", ("number",), lambda: of_values(lambda v: v * 2), samplewise=True),
    UnitPrototype("Triple", "number", ("number",), lambda: of_values(lambda v: v * 3), samplewise=True),
    UnitPrototype("Add", "number", ("number", "number"), lambda: of_values(lambda a, b: a + b)),
    UnitPrototype("Sum", "number", ("number",), summing),
    UnitPrototype("Ids", "object", ("number",), lambda: of_values(lambda n: tuple(f"c{i}" for i in range(int(n))))),
    UnitPrototype("Copy", "object", ("object",), lambda: of_values(lambda named: named)),
)


class Running:
    """An instance, and what it told."""

    def __init__(self, text="", prototypes=UNITS, history=1000, sorts=MappingProxyType({"pos": POS}), **more):
        self.outputs, self.links, self.alarms, self.faults = [], [], [], []
        self.network = Network(history)
        hooks = Hooks(
            lambda name, sample: self.outputs.append((name, sample)),
            lambda name, linked: self.links.append((name, linked)),
            self.alarms.append,
            on_fault=lambda label, said: self.faults.append((str(label), said)),
        )
        self.instance = Instance(self.network, unit="7", sorts=sorts, prototypes=prototypes, hooks=hooks, **more)
        if text:
            self.add(text)

    @property
    def now_us(self):
        return self.network.now_us

    def add(self, text):
        text = SourceText(text, "a.kpl")
        self.instance.add(parse_specification(text), self.now_us, text)

    def remove(self, text):
        self.instance.remove(parse_specification(text), self.now_us)

    def change(self, text):
        text = SourceText(text, "a.kpl")
        self.instance.change(parse_specification(text), self.now_us, text)

    def push(self, source, value, at_us=None):
        """A sample of a source; without a time 10 ms after now."""
        at_us = self.now_us + 10_000 if at_us is None else at_us
        pass_time(self.network, at_us)
        self.network.now_us = at_us
        self.instance.push(source, Sample(at_us, at_us, value))

    def wait(self, until_us):
        pass_time(self.network, until_us)

    def values(self, name):
        return [sample.value for each, sample in self.outputs if each == name]

    def state(self):
        """Everything that a declaration can leave behind."""
        instance = self.instance
        return {
            **state_of(self.network),
            "specification": instance.specification,
            "streams": {name: id(proxy) for name, proxy in instance.streams.items()},
            "monitors": {name: id(monitor) for name, monitor in instance.monitors.items()},
            "families": {str(label): tuple(family.members) for label, family in instance.families.members.items()},
            "undo": set(instance._undo),
            "fed": {name: sorted(labels) for name, labels in instance.parts.fed.items()},
            "of families": set(instance.parts.of_families),
            "held": dict(instance.parts.held),
            "symbols": {id(symbol.declaration) for symbol in instance.symbols.symbols()},
            "processes at work": {label: id(self.network.process(label)) for label in self.network.labels()},
        }


def source(name, sort="number"):
    return SourcePrototype(name, sort)


def label(text):
    return Label.parse(text)
