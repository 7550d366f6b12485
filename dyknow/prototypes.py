"""Knowledge process prototypes: what computational units and sources are made from (thesis 5.3.1).

Users write them as functions and classes:

    @computational_unit("speed", "pos")
    class SpeedEst:
        def __call__(self, now_us, pos): ...      # samples in; a value, a sample, or None for nothing

    @value_unit("distance", "pos", "pos")
    def distance(one, other): ...                 # values in, a value out, no memory

    @source("pos")
    def gps(from_us): yield valid_us, value       # each is read when its valid time has come
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias, TypeVar

from dyknow.compunits import UnitFunction, latest_valid_us, of_values, quality_of
from dyknow.join import Inputs
from dyknow.policy import Policy
from dyknow.sample import Sample, Value

Reading: TypeAlias = tuple[int, Value]
"""Valid time and value of one sample of a source."""


@dataclass(frozen=True, slots=True)
class UnitPrototype:
    """A class of refinement processes: `compunit sort name(inputs)` (Def. 4.4.5).

    Attributes:
        name: how specifications call it.
        sort: of the output.
        inputs: sort of each input; their number is the arity.
        make: a new instance, with a memory of its own.
        samplewise: one input, no memory, and the output is valid when the input is: then nothing is computed that
            nobody asked for, also where only every n-th sample is asked for.
        history_us: how much of the past of its inputs an instance wants when it begins.
        cheaper: name of a unit over the same sorts that may stand in for it when there is too much to do.
        supports: whether it can provide its output under a policy.
        priority: of units that have something to do at the same time the one with the higher number is first.
    """

    name: str
    sort: str
    inputs: tuple[str, ...]
    make: Callable[[], UnitFunction]
    samplewise: bool = False
    history_us: int = 0
    cheaper: str = ""
    supports: Callable[[Policy], bool] = lambda _policy: True
    priority: int = 0

    def __post_init__(self) -> None:
        if not self.inputs:
            raise ValueError(f"{self.name}: a computational unit has at least 1 input")
        if self.samplewise and len(self.inputs) != 1:
            raise ValueError(f"{self.name}: a unit that works sample by sample has 1 input, not {len(self.inputs)}")
        if self.history_us < 0:
            raise ValueError(f"{self.name}: a history is a time >= 0 us, got {self.history_us}")


@dataclass(frozen=True, slots=True)
class SourcePrototype:
    """A class of primitive processes: `source sort name` (Def. 4.4.4).

    Attributes:
        name: how specifications call it.
        sort: of its samples.
        read: from a time on, its samples, ordered by valid time; None: samples are pushed from outside.
    """

    name: str
    sort: str
    read: Callable[[int], Iterator[Reading]] | None = None


Prototype: TypeAlias = UnitPrototype | SourcePrototype


class SampleUnit(Protocol):
    """What `computational_unit` decorates: called with the time and the last sample of each input, once all are there.

    It returns a value, which is valid at the latest valid time of its inputs (P7), a `Sample`, or None for no output.
    """

    def __call__(self, now_us: int, /, *samples: Sample) -> Any: ...


Made = TypeVar("Made", bound=Callable[..., Any])
_PROTOTYPE = "__dyknow_prototype__"


def computational_unit(
    sort: str,
    *inputs: str,
    name: str = "",
    history_us: int = 0,
    cheaper: str = "",
    supports: Callable[[Policy], bool] = lambda _policy: True,
    priority: int = 0,
) -> Callable[[Made], Made]:
    """Declare a class, one object of which is made per process, or a function of the time and samples (`SampleUnit`)."""

    def declare(made: Made) -> Made:
        def make() -> UnitFunction:
            return of_samples(made() if isinstance(made, type) else made)

        prototype = UnitPrototype(
            name or made.__name__, sort, inputs, make, False, history_us, cheaper, supports, priority
        )
        setattr(made, _PROTOTYPE, prototype)
        return made

    return declare


def value_unit(sort: str, *inputs: str, name: str = "", cheaper: str = "", priority: int = 0) -> Callable[[Made], Made]:
    """Declare a function from the values of the inputs to a value; where an input has no value, it is not called."""

    def declare(made: Made) -> Made:
        prototype = UnitPrototype(
            name or made.__name__,
            sort,
            inputs,
            lambda: of_values(made),
            samplewise=len(inputs) == 1,
            cheaper=cheaper,
            priority=priority,
        )
        setattr(made, _PROTOTYPE, prototype)
        return made

    return declare


def source(sort: str, name: str = "") -> Callable[[Made], Made]:
    """Declare a function from a time to an iterator of (valid time, value), ordered by valid time."""

    def declare(made: Made) -> Made:
        setattr(made, _PROTOTYPE, SourcePrototype(name or made.__name__, sort, made))
        return made

    return declare


def prototypes_in(names: Iterable[Any]) -> list[Prototype]:
    """The prototypes among the members of a module, or among any objects; each name once."""
    found: dict[str, Prototype] = {}
    for each in names:
        prototype = each if isinstance(each, UnitPrototype | SourcePrototype) else getattr(each, _PROTOTYPE, None)
        if isinstance(prototype, UnitPrototype | SourcePrototype):
            found.setdefault(prototype.name, prototype)
    return list(found.values())


def of_samples(unit: SampleUnit) -> UnitFunction:
    """A unit in the form of Def. 4.3.15; its memory is its own."""

    def step(now_us: int, inputs: Inputs, state: Value) -> tuple[Sample | None, Value]:
        samples = [sample for sample in inputs if sample is not None]
        valid_us = latest_valid_us(inputs)
        if valid_us is None or len(samples) < len(inputs):
            return None, state
        made = unit(now_us, *samples)
        if made is None or isinstance(made, Sample):
            return made, state
        return Sample(now_us, valid_us, made, quality_of(inputs)), state

    return step
