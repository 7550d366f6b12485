"""Knowledge process prototypes of computational units and sources (thesis 5.3.1).

Users write them as functions and classes:

    @computational_unit("speed", "pos")
    class SpeedEst:
        def __call__(self, now_us, pos): ...      # samples in; a value, a sample, or None for nothing

    @value_unit("distance", "pos", "pos")
    def distance(one, other): ...                 # values in, a value out, no memory

    @source("pos")
    def gps(from_us): yield valid_us, value       # each is read when its valid time has come

A sort is a name, or a `Sort` with its unit or fields, `Sort("gas", unit="ppm")`: then values are checked.

The parameters of a class are its settings; `variant` makes a prototype of its own of other settings:

    smooth_speed = variant(MovingAverage, "SmoothSpeed", "speed", "speed", seconds=2.0)
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Protocol, TypeAlias, TypeVar

from dyknow.model.labels import Label
from dyknow.model.sample import Sample, Value
from dyknow.model.values import Sort
from dyknow.network.computational_unit import (
    ClockedFunction,
    ClockedUnit,
    Inputs,
    Output,
    UnitFunction,
    latest_valid_us,
    of_values,
    quality_of,
)
from dyknow.network.process import Input, Process
from dyknow.policies.policy import Policy

Reading: TypeAlias = tuple[int | None, Value | list[Value]]
"""Valid time and value of one sample of a source, or the values of several, such as the percepts of one image: they come at
one instant. In a host the time may be None: when it was read."""


@dataclass(frozen=True, slots=True)
class UnitPrototype:
    """A class of refinement processes: `compunit sort name(inputs)` (Def. 4.4.5).

    Attributes:
        name: how specifications call it.
        sort: of the output. A sort that begins with `?` stands for any, the same one wherever it is repeated.
        inputs: sort of each input; their number is the arity.
        make: a new instance, with a memory of its own; takes the settings of the unit, which all have defaults.
        samplewise: one input, no memory, and the output is valid when the input is: then nothing is computed
            without demand, also where only every n-th sample is asked for.
        history_us: how much of the past of its inputs an instance wants when it begins.
        cheaper: name of a unit over the same sorts that may stand in for it when there is too much to do.
        supports: whether it can provide its output under a policy.
        priority: of units that have something to do at the same time the one with the higher number is first.
        elsewhere: the process over these inputs, under an output policy, where another host runs it (5.3).
        checked_sorts: the values of those of its sorts that were declared with units or fields.
        cost_us: how long a call takes. In simulated time it takes that long, None: no time. On a platform one that
            takes above `SLOW_US` runs in a worker, and so does None until calls have shown to be faster.
    """

    name: str
    sort: str
    inputs: tuple[str, ...]
    make: Callable[..., UnitFunction]
    samplewise: bool = False
    history_us: int = 0
    cheaper: str = ""
    supports: Callable[[Policy], bool] = lambda _policy: True
    priority: int = 0
    elsewhere: Callable[[Sequence[Input], Policy | None], Process] | None = None
    cost_us: int | None = None
    checked_sorts: tuple[Sort, ...] = ()

    def __post_init__(self) -> None:
        if not self.inputs:
            raise ValueError(f"{self.name}: a computational unit has at least 1 input")
        if self.samplewise and len(self.inputs) != 1:
            raise ValueError(f"{self.name}: a unit that works sample by sample has 1 input, not {len(self.inputs)}")
        if self.history_us < 0:
            raise ValueError(f"{self.name}: a history is a time >= 0 us, got {self.history_us}")
        if self.cost_us is not None and self.cost_us < 0:
            raise ValueError(f"{self.name}: a call takes a time >= 0 us, got {self.cost_us}")

    @property
    def of_any_sort(self) -> bool:
        """Whether a declaration must give its sorts."""
        return any(each.startswith("?") for each in (self.sort, *self.inputs))

    def fits(self, sort: str, inputs: Sequence[str]) -> bool:
        """Whether it can be declared with these sorts."""
        stands_for: dict[str, str] = {}
        return len(inputs) == len(self.inputs) and all(
            declared == (stands_for.setdefault(own, declared) if own.startswith("?") else own)
            for own, declared in zip((self.sort, *self.inputs), (sort, *inputs), strict=True)
        )


@dataclass(frozen=True, slots=True)
class SourcePrototype:
    """A class of primitive processes: `source sort name` (Def. 4.4.4).

    Attributes:
        name: how specifications call it.
        sort: of its samples.
        read: from a time on, its samples, ordered by valid time; None: samples are pushed from outside.
        label: of the stream generator that a host registers for it, `self` for the unit; empty: specifications say.
        elsewhere: the process, where another host runs it (5.3).
        checked_sorts: its values, if the sort was declared with a unit or fields.
    """

    name: str
    sort: str
    read: Callable[[int], Iterator[Reading]] | None = None
    label: str = ""
    elsewhere: Callable[[], Process] | None = None
    checked_sorts: tuple[Sort, ...] = ()

    def __post_init__(self) -> None:
        if self.label:
            Label.parse(self.label)


Prototype: TypeAlias = UnitPrototype | SourcePrototype


class SampleUnit(Protocol):
    """The interface under `computational_unit`: called with the time and the last sample of each input, once all are
    there.

    Where it does not need all, it is called before that, too, with None (no_sample) for an input that has none yet.
    It returns a value, which is valid at the latest valid time of its inputs (P7), a `Sample`, a list of them, such as the
    states of several objects, or None for no output.
    """

    def __call__(self, now_us: int, /, *samples: Sample) -> Any: ...


Made = TypeVar("Made", bound=Callable[..., Any])
_PROTOTYPE = "__dyknow_prototype__"


def computational_unit(
    sort: str | Sort,
    *inputs: str | Sort,
    name: str = "",
    samplewise: bool = False,
    history_us: int = 0,
    cheaper: str = "",
    supports: Callable[[Policy], bool] = lambda _policy: True,
    priority: int = 0,
    cost_us: int | None = None,
    needs_all: bool = True,
) -> Callable[[Made], Made]:
    """Declare a class, instantiated once per process, or a function of the time and samples (`SampleUnit`)."""
    return _declared(
        lambda made: UnitPrototype(
            name or made.__name__,
            _name(sort),
            tuple(map(_name, inputs)),
            partial(_function, partial(of_samples, needs_all=needs_all), made),
            samplewise,
            history_us,
            cheaper,
            supports,
            priority,
            cost_us=cost_us,
            checked_sorts=_checked(sort, *inputs),
        )
    )


def value_unit(
    sort: str | Sort,
    *inputs: str | Sort,
    name: str = "",
    cheaper: str = "",
    priority: int = 0,
    cost_us: int | None = None,
) -> Callable[[Made], Made]:
    """Declare a function from the values of the inputs to a value; where an input has no value, it is not called.

    Or a class whose objects are such functions, and have no memory but their settings.
    """
    return _declared(
        lambda made: UnitPrototype(
            name or made.__name__,
            _name(sort),
            tuple(map(_name, inputs)),
            partial(_function, of_values, made),
            samplewise=len(inputs) == 1,
            cheaper=cheaper,
            priority=priority,
            cost_us=cost_us,
            checked_sorts=_checked(sort, *inputs),
        )
    )


def variant(unit: Any, name: str, *sorts: str, history_us: int | None = None, **settings: Any) -> UnitPrototype:
    """A unit under another name and with other settings; `sorts` are of the output and of each input, if others too.

    Raises:
        TypeError: `unit` is none, or has no such setting.
        ValueError: the number of sorts is wrong, or the unit refuses a setting.
    """
    prototype = unit if isinstance(unit, UnitPrototype) else getattr(unit, _PROTOTYPE, None)
    if not isinstance(prototype, UnitPrototype):
        raise TypeError(f"{name}: {unit!r} is not a computational unit; decorate it with @computational_unit")
    if sorts and len(sorts) != 1 + len(prototype.inputs):
        raise ValueError(f"{name}: expected the sort of the output and of {len(prototype.inputs)} inputs, got {sorts}")
    sort, *inputs = sorts or (prototype.sort, *prototype.inputs)
    checked_sorts = tuple(each for each in prototype.checked_sorts if each.name in {sort, *inputs})
    make = partial(prototype.make, **settings)
    make()  # settings that are wrong are wrong here, not when the first process is made
    history_us = prototype.history_us if history_us is None else history_us
    return replace(
        prototype,
        name=name,
        sort=sort,
        inputs=tuple(inputs),
        make=make,
        history_us=history_us,
        checked_sorts=checked_sorts,
    )


def source(sort: str | Sort, name: str = "", label: str = "") -> Callable[[Made], Made]:
    """Declare a function from a time to an iterator of (valid time, value), ordered by valid time.

    In a host (an operating system process of its own) it may block until there is something to be read, and give None
    for a valid time that is the time of the reading; with a `label` its stream is there without being declared.
    """
    return _declared(
        lambda made: SourcePrototype(name or made.__name__, _name(sort), made, label, checked_sorts=_checked(sort))
    )


def _name(sort: str | Sort) -> str:
    if not isinstance(sort, Sort | str):
        raise TypeError(f'{sort!r} is not a sort; list the sorts one by one: @value_unit("number", "number", "number")')
    return sort.name if isinstance(sort, Sort) else sort


def _checked(*sorts: str | Sort) -> tuple[Sort, ...]:
    """The sorts that declare their values, or the first of them."""
    return tuple(sort for sort in sorts if isinstance(sort, Sort) and (sort.fields or not sort.is_open))


def prototypes_in(names: Iterable[Any]) -> list[Prototype]:
    """The prototypes among the members of a module, or among any objects; each name once."""
    found: dict[str, Prototype] = {}
    for each in names:
        prototype = each if isinstance(each, UnitPrototype | SourcePrototype) else getattr(each, _PROTOTYPE, None)
        if isinstance(prototype, UnitPrototype | SourcePrototype):
            found.setdefault(prototype.name, prototype)
    return list(found.values())


def _declared(prototype: Callable[[Any], Prototype]) -> Callable[[Made], Made]:
    """A decorator that notes what a class or function is the prototype of."""

    def declare(made: Made) -> Made:
        setattr(made, _PROTOTYPE, prototype(made))
        return made

    return declare


def _function(form: Callable[..., UnitFunction], made: Callable[..., Any], **settings: Any) -> UnitFunction:
    """A unit of a form; a class gives an object, which has the settings, a function is what it is."""
    if isinstance(made, type):
        return form(made(**settings))
    if settings:
        raise TypeError(
            f"{made.__name__} is a function and has no settings, got {', '.join(settings)}; make it a class"
        )
    return form(made)


def of_samples(unit: SampleUnit, *, needs_all: bool = True) -> UnitFunction:
    """A unit in the form of Def. 4.3.15; its memory is its own. Unless it needs all, it meets no_sample, as None."""

    def step(now_us: int, inputs: Inputs, state: Value) -> tuple[Output, Value]:
        if None in inputs and (needs_all or latest_valid_us(inputs) is None):
            return None, state
        made = unit(now_us, *inputs)  # type: ignore[arg-type]  # it says that it takes None
        if made is None or isinstance(made, Sample):
            return made, state
        if type(made) is list and all(isinstance(each, Sample) for each in made):
            return made, state
        valid_us = latest_valid_us(inputs)
        if valid_us is None:  # it has no inputs at all
            return None, state
        return Sample(now_us, valid_us, made, quality_of(inputs)), state

    return ClockedFunction(step, unit) if isinstance(unit, ClockedUnit) else step
