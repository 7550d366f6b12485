"""The streams of chronicles: recognised instances, and partial ones (thesis 8.4, 8.7.3).

The instances of a chronicle `overtake` are the stream `chronicle[overtake]`, valid at the recognition; its values are
the arguments of the chronicle, then its variables and its instants (ms); an instance is predicted if one of its events
is. `chronicle[overtake, car1, car2]` has the instances with these arguments.

`partial[overtake]` is the stream of partial instances. Its value is their list: the variables and instants (ms) of each
so far, the missing events, and the clock at which it is given up at the latest. There is a sample when that changes.
"""

from typing import Final

from dyknow import (
    NO_VALUE,
    SURE,
    Inputs,
    Label,
    Network,
    Policy,
    Predicted,
    Quality,
    Sample,
    Sort,
    UnitPrototype,
    Value,
)
from dyknow.kpl.diagnostics.collector import nearest
from dyknow.kpl.running.chronicle_watch import ChronicleWatch, PartialWatch
from dyknow.kpl.syntax.specification import PARTIAL, RECOGNISED, ChronicleDeclaration
from dyknow.model.errors import ChronicleError, TextError
from dyknow.model.instants import US_PER_MS, US_PER_S
from dyknow.network.process import Input, Process
from dyknow.network.processes import OnDemand
from dyknow.network.refinement import RefinementProcess
from dyknow.reasoning import chronicles

SORT: Final = Sort("recognition", is_open=True)
PARTIAL_SORT: Final = Sort("partial", is_open=True)
MAX_DELAY_US: Final = US_PER_S


class ChronicleStreams:
    """The chronicles of one file in a specification, `content`, with their streams."""

    def __init__(self, network: Network, declaration: ChronicleDeclaration, content: chronicles.ChronicleFile) -> None:
        delay_us = declaration.policy.max_delay_us
        self._network, self.content = network, content
        self._out = {name: network.add_source(Label(RECOGNISED, (name,)), SORT) for name in content.chronicles}
        self.watch = ChronicleWatch(
            network,
            content,
            MAX_DELAY_US if delay_us is None else delay_us,
            self._push,
            self._fault,
            max_age_ms=declaration.max_age_ms,
            initially=declaration.since_ever,
        )
        for name in content.chronicles:
            network.add_process(Label(PARTIAL, (name,)), PARTIAL_SORT, Prediction(self.watch, name))

    @property
    def labels(self) -> tuple[Label, ...]:
        """The streams of instances, and of partial instances."""
        return tuple(Label(feature, (name,)) for feature in (RECOGNISED, PARTIAL) for name in self._out)

    def cancel(self) -> None:
        """Recognise nothing from now on."""
        self.watch.cancel()
        for name in self.content.chronicles:
            self._network.remove(Label(PARTIAL, (name,)))
        for generator in self._out.values():
            self._network.remove(generator.label)

    def _fault(self, label: Label, said: str) -> None:
        self._network.on_fault(label, said)

    def _push(self, found: chronicles.ChronicleInstance, prediction: Predicted | None, now_us: int) -> None:
        parameters = self.content.chronicles[found.chronicle].parameters
        arguments = [
            found.bindings.get(str(one), NO_VALUE) if isinstance(one, chronicles.ChronicleVariable) else one
            for one in parameters
        ]
        value = tuple(arguments), tuple(found.bindings.items()), tuple(found.instants.items())
        quality = SURE if prediction is None else Quality(prediction=prediction)
        self._out[found.chronicle].push(Sample(now_us, found.recognised_ms * US_PER_MS, value, quality))


class Prediction(OnDemand):
    """The stream of the partial instances of one chronicle; they are looked for while it is wanted."""

    def __init__(self, watch: ChronicleWatch, name: str) -> None:
        super().__init__()
        self._watch, self._name = watch, name
        self._partials: PartialWatch | None = None

    def begin(self) -> None:
        if self._network is not None:
            self._partials = PartialWatch(self._watch.network, self._watch, self._name, self._tell)

    def since_us(self) -> int:
        """There was no list before."""
        return super().since_us() if self.running or self._network is None else self._network.now_us

    def end(self) -> None:
        if self._partials is not None:
            self._partials.cancel()
            self._partials = None

    def _tell(self, found: tuple[chronicles.Partial, ...], valid_us: int, now_us: int) -> None:
        self.emit(Sample(now_us, valid_us, tuple(map(_value, found))))


def check_chronicles(declaration: ChronicleDeclaration) -> None:
    """Whether they can be recognised.

    Raises:
        TextError: they cannot, with the place of the declaration.
    """
    wrong, repair = _mistake(declaration)
    if wrong:
        raise TextError.at(declaration.place, wrong, repair=repair)


def _mistake(declaration: ChronicleDeclaration) -> tuple[str, str]:
    """Message and repair for a declaration that cannot run; both empty if it can."""
    path, content = declaration.path, declaration.content
    if content is None:
        return f"{path} was not read", "chronicles go with the file that names them"
    if not content.chronicles:
        return f"{path} declares no chronicle", "chronicle name[?x] { ... }"
    if declaration.policy != Policy(max_delay_us=declaration.policy.max_delay_us):
        return "chronicles know max delay, max age and first values since ever", "with max delay 500"
    try:
        recogniser = chronicles.Recogniser.of(content, max_age_ms=declaration.max_age_ms)
    except ChronicleError as wrong:
        return f"{path}: {wrong}", ""
    if isinstance(declaration.since_ever, tuple):
        names = {name for name, _ in recogniser.attributes}
        known = sorted(names | {name.rpartition(".")[0] for name in names} - {""})
        for unknown in (each for each in declaration.since_ever if each not in known):
            near = nearest(unknown, known)
            return f"{path} has no attribute of {unknown}", f"first values of {near} since ever" if near else ""
    return "", ""


def _value(partial: chronicles.Partial) -> Value:
    given_up = NO_VALUE if partial.dies_ms is None else partial.dies_ms
    return tuple(partial.bindings.items()), tuple(partial.instants.items()), partial.missing, given_up


def recognitions(network: Network, label: Label) -> tuple[Sort, Process] | None:
    """The process of `chronicle[NAME, ARGUMENT, ...]`; None if the label is none."""
    every = Label(RECOGNISED, label.objects[:1])
    if label.feature != RECOGNISED or len(label.objects) < 2 or not network.has(every):
        return None
    arguments = label.objects[1:]

    def step(now_us: int, inputs: Inputs, state: Value) -> tuple[Sample | None, Value]:
        (found,) = inputs
        is_so = found is not None and found.value is not NO_VALUE and found.value[0] == arguments
        return (found._replace(available_us=now_us) if found is not None and is_so else None), state

    unit = UnitPrototype("recognised with these arguments", SORT.name, (SORT.name,), lambda: step, cost_us=0)
    return SORT, RefinementProcess(unit, [Input(every)])
