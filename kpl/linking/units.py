"""Units of users as computational units of links: from the record of an object to that of the one above it (thesis 8.5.3).

    compunit car CarOf(world)            # of the state of `from`
    compunit car CarOf(world, car)       # and of that of `to`, as it is expected at that time; it has none while it is new

A unit is called where objects are linked. Its exceptions, and outputs that are no state of an object, are counted and
reported; then the object is at its expected place, or, while it is new, at the place of the object below it.
"""

from collections.abc import Callable, Mapping
from typing import Final

from dyknow import NO_VALUE, Label, Sample, Sort
from dyknow.anchoring.links.states import ObjectState
from dyknow.anchoring.links.structures import StateRecord
from dyknow.anchoring.percepts.records import ObjectRecords, PerceptRecords, lacks_of
from dyknow.kpl.checking.streams import Streams
from dyknow.kpl.checking.symbols import SymbolTable
from dyknow.kpl.syntax import specification as spec
from dyknow.model.errors import SortError, TextError, raised
from dyknow.navigation import LocalFrame
from dyknow.network.computational_unit import Inputs
from dyknow.network.prototypes import Prototype, UnitPrototype
from dyknow.network.refinement import SLOW_US

MOST_FAULTS: Final = 16
"""Kept until they are reported; all are counted."""


def linked_unit(
    prototype: Prototype | None, made: spec.Link, taken: Sort | None, sort: Sort | None, frame: LocalFrame | None
) -> "LinkedUnit":
    """The unit that a link names, over records of these sorts.

    Raises:
        TextError: it cannot be called here, or its inputs or output are no states of objects.
    """
    name = made.unit
    if not isinstance(prototype, UnitPrototype):
        repair = "--units MODULE, which has a unit of that name"
        raise TextError.at(made.place, f"nothing here implements {name}", repair=repair)
    if prototype.elsewhere is not None or (prototype.cost_us or 0) > SLOW_US:
        said = (
            f"{name} is called where objects are linked, and cannot be run by a host or take above {SLOW_US} us a call"
        )
        raise TextError.at(made.place, said, repair="a unit of --units that is fast")
    if len(prototype.inputs) > 2:
        said = (
            f"{name} takes {len(prototype.inputs)} streams; a unit of a link takes the state below, and its own before"
        )
        raise TextError.at(made.place, said, repair=f"compunit SORT {name}(BELOW, SORT)")
    for each in (taken, sort):
        lacking = ("symbol", "x_m", "y_m") if each is None else lacks_of(each)
        if lacking or each is None:
            which = "takes" if each is taken else "makes"
            said = f"what {name} {which} are no states of objects: their sort has no {', '.join(lacking)}"
            repair = "sort car(symbol in text, x_m in m, y_m in m, sd_m in m, end in bool)"
            raise TextError.at(made.place, said, repair=repair)
    assert taken is not None and sort is not None  # noqa: S101, PT018  (looked at above)
    return LinkedUnit(prototype, taken, sort, frame)


def unit_finder(
    symbols: SymbolTable, prototypes: Mapping[str, Prototype], frame: LocalFrame | None
) -> "Callable[[Label, spec.Link], LinkedUnit]":
    """The units of links among some prototypes, without an instance; it raises as `linked_unit`."""
    streams = Streams(symbols)

    def unit_of(label: Label, made: spec.Link) -> LinkedUnit:
        below = streams.objects(made.source) or streams.record(made.source)
        return linked_unit(prototypes.get(made.unit), made, below, streams.objects(label), frame)

    return unit_of


class LinkedUnit:
    """A unit at work in one link: a `StateUnit`.

    Args:
        taken: of the records of `from`.
        made: of the records of `to`.
        frame: about which positions in degrees are taken.

    Attributes:
        failed: how often it has made no state.
    """

    def __init__(self, prototype: UnitPrototype, taken: Sort, made: Sort, frame: LocalFrame | None) -> None:
        self.prototype = prototype
        self._takes_both = len(prototype.inputs) == 2
        self._made = made
        self._writers = ObjectRecords(taken, frame), ObjectRecords(made, frame)
        self._reader = PerceptRecords("", made, frame)
        self._names_deviation = any(each.name == "sd_m" for each in made.fields)
        self._faults: list[str] = []
        self.failed = 0
        self.restart()

    @property
    def is_recursive(self) -> bool:
        """Whether it weighs what it is given with the state before."""
        return self._takes_both

    def restart(self) -> None:
        """Forget everything."""
        self.failed = 0
        self._faults.clear()
        self._memory = NO_VALUE
        try:
            self._unit = self.prototype.make()
        except Exception as wrong:  # noqa: BLE001  (it is a user's code)
            self._fault(f"{self.prototype.name} cannot be made: {wrong!r}")
            self._unit = _no_output

    def take_faults(self) -> list[str]:
        """The faults since the last call."""
        found, self._faults = self._faults, []
        return found

    def __call__(self, state: ObjectState, before: ObjectState | None) -> ObjectState:
        made = self._state(state, before)
        if made is not None:
            return made
        return state if before is None else before._replace(valid_us=state.valid_us)

    def _state(self, state: ObjectState, before: ObjectState | None) -> ObjectState | None:
        """The unit's output as a state; None: no state."""
        given: tuple[Sample | None, ...] = (self._sample(0, state),)
        if self._takes_both:
            given = *given, None if before is None else self._sample(1, before)
        try:
            output, self._memory = self._unit(state.valid_us, given, self._memory)
            made = output[-1] if isinstance(output, list) and output else output
            if not isinstance(made, Sample) or made.value is NO_VALUE:
                return None
            self._made.check(made.value)
            percept = self._reader.percept(made._replace(valid_us=state.valid_us))
        except SortError as wrong:
            self._fault(f"{self.prototype.name} made what is not of its sort: {wrong}")
            return None
        except Exception as wrong:  # noqa: BLE001  (it is a user's code)
            self._fault(raised(self.prototype.name, wrong))
            return None
        if percept is None or percept.state is None:
            self._fault(f"{self.prototype.name} made a state without a place")
            return None
        found = percept.state
        covariance = found.covariance if self._names_deviation else state.covariance
        return found._replace(covariance=covariance, attributes={**state.attributes, **found.attributes})

    def _sample(self, which: int, state: ObjectState) -> Sample:
        record = StateRecord(state.valid_us, "", "", state, (), None)
        value = self._writers[which].value(record, is_anchored=True, ended=False)
        return Sample(state.valid_us, state.valid_us, value)

    def _fault(self, said: str) -> None:
        self.failed += 1
        if len(self._faults) < MOST_FAULTS:
            self._faults.append(said)


def _no_output(_now_us: int, _inputs: Inputs, memory: object) -> tuple[None, object]:
    """A placeholder for a unit that cannot be made."""
    return None, memory
