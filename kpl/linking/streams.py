"""Streams of linked objects: the states of all objects of one type, as records that begin with the symbol.

A process takes the streams of percepts at the beginning of its chain, which are records with at least `x_m` and `y_m`, and
links them as all chained declarations say; every type's stream is worked out by itself, and all agree on the symbols. A
state comes when its tick is complete, at the end of the instant that brought it; objects that no percept shows have one at
the sample period. With the last state of an object the field `end` is true.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

from anchoring.links.specification import LinkSpecification
from anchoring.links.states import ObjectState, diagonal
from anchoring.links.structures import LinkOutcome, ObjectLinkage, Percept, StateRecord
from anchoring.percepts.reading import FARTHEST_M, LEAST_SD_M, USUAL_SD_M, VELOCITY_SD_M_S
from dyknow import NO_VALUE, Sample, Sort, Value
from dyknow.model.values import END, SYMBOL, Field
from dyknow.network.process import FAR_US, Input
from dyknow.network.processes import OnDemand
from reasoning.formulas.evaluation import is_missing

_STATE: Final = ("x_m", "y_m", "vx_m_s", "vy_m_s")
_OWN: Final = frozenset({SYMBOL, END, "sd_m", *_STATE})


class PerceptInput(NamedTuple):
    """A stream at the beginning of the chain, and what its records are."""

    taken: Input
    sort: Sort


def object_sort(name: str) -> Sort:
    """What the states of linked objects are unless it is declared."""
    units = {SYMBOL: "text", "x_m": "m", "y_m": "m", "vx_m_s": "m/s", "vy_m_s": "m/s", "sd_m": "m", "anchored": "bool"}
    return Sort(name, tuple(Field(*each) for each in (*units.items(), (END, "bool"))))


def lacks_of(sort: Sort) -> tuple[str, ...]:
    """The fields without which a record is no percept."""
    named = {each.name for each in sort.fields}
    return tuple(each for each in (SYMBOL, "x_m", "y_m") if each not in named)


class LinkStream(OnDemand):
    """Makes the stream of one type.

    Args:
        type_: as it is called in the specifications.
        inputs: the streams of percepts, in the order of their types.
        sort: of the states that it makes.
    """

    arity, priority = 1, 0

    def __init__(
        self, type_: str, specifications: Sequence[LinkSpecification], inputs: Sequence[PerceptInput], sort: Sort
    ) -> None:
        super().__init__()
        self._type, self._specifications, self._inputs, self._sort = type_, tuple(specifications), tuple(inputs), sort
        self._readers = [_PerceptRecord(str(each.taken.label), each.sort) for each in inputs]
        self.linkage = ObjectLinkage(self._specifications)
        self._ticks: dict[int, dict[tuple[str, str], Percept]] = {}
        self._latest_us: int | None = None
        self._delay_us = 0
        self._now_step_us = 0

    @property
    def specifications(self) -> Sequence[LinkSpecification]:
        """What links the whole chain."""
        return self._specifications

    def inputs(self) -> Sequence[Input]:
        return [each.taken for each in self._inputs]

    def begin(self) -> None:
        self.linkage, self._latest_us, self._delay_us = ObjectLinkage(self._specifications), None, 0
        self._ticks.clear()
        if self._network is not None:
            self._network.step(self)

    def end(self) -> None:
        self._ticks.clear()
        if self._network is not None:
            self._network.unstep(self)

    def on_sample(self, i: int, sample: Sample) -> None:
        percept = self._readers[i].percept(sample)
        if percept is None:
            return
        if self._latest_us is not None and sample.valid_us <= self._latest_us:
            self.fault(f"a state of {percept.symbol} came after those of a later time and is left out")
            return
        self._now_step_us = max(self._now_step_us, sample.available_us)
        self._delay_us = max(self._delay_us, sample.available_us - sample.valid_us)
        self._ticks.setdefault(sample.valid_us, {})[percept.type, percept.symbol] = percept
        if self._network is not None:
            self._network.instant.put(self)

    @property
    def rank(self) -> int:
        """After the streams of percepts."""
        network = self._network
        return 0 if network is None else 1 + max(network.rank(each.taken.label) for each in self._inputs)

    def on_instant(self) -> None:
        for valid_us in sorted(self._ticks):
            self._latest_us = valid_us
            self._tell(self.linkage.on_percepts(valid_us, self._ticks[valid_us].values()), self._now_step_us)
        self._ticks.clear()

    def on_time(self, now_us: int) -> None:
        """Objects are predicted up to the valid time that percepts cannot come before."""
        outcome = self.linkage.on_time(now_us - self._delay_us)
        times_us = [each.valid_us for each in outcome.states] + [each.valid_us for each in outcome.events]
        self._latest_us = max(times_us, default=self._latest_us)
        self._tell(outcome, now_us)

    @property
    def deadline_us(self) -> int | None:
        """Far away, and not none, while there is nothing to predict."""
        if not self.running:
            return None
        deadline_us = self.linkage.deadline_us
        return FAR_US if deadline_us is None else deadline_us + self._delay_us

    def _tell(self, outcome: LinkOutcome, now_us: int) -> None:
        states = {(each.type, each.symbol): each for each in outcome.states}
        for record in outcome.states:
            if record.type == self._type:
                self.emit(record.valid_us, self._value(record, ended=False), max(now_us, record.valid_us))
        for event in outcome.events:
            if event.kind == "forgotten" and event.target_type == self._type:
                known = states.get((self._type, event.target))
                value = self._ended(event.target) if known is None else self._value(known, ended=True)
                self.emit(event.valid_us, value, max(now_us, event.valid_us))

    def _value(self, record: StateRecord, *, ended: bool) -> Value:
        state = record.state
        own = {SYMBOL: record.symbol, END: ended, "sd_m": state.deviation_m / 2**0.5, **_moving(state)}
        own["anchored"] = self.linkage.anchored(record.symbol)
        return tuple(own.get(each.name, state.attributes.get(each.name, NO_VALUE)) for each in self._sort.fields)

    def _ended(self, symbol: str) -> Value:
        known: dict[str, Value] = {SYMBOL: symbol, END: True}
        return tuple(known.get(each.name, NO_VALUE) for each in self._sort.fields)


def _moving(state: ObjectState) -> dict[str, Value]:
    return dict(zip(_STATE, state[1:5], strict=True))


class _PerceptRecord:
    """Reads the records of one stream."""

    def __init__(self, type_: str, sort: Sort) -> None:
        self._type = type_
        self._names = tuple(each.name for each in sort.fields)

    def percept(self, sample: Sample) -> Percept | None:
        """None: it has no value, or no place."""
        if sample.value is NO_VALUE:
            return None
        record: dict[str, Value] = dict(zip(self._names, sample.value, strict=True))
        symbol = record[SYMBOL]
        if record.get(END) is True:
            return Percept(symbol, self._type, None)
        x_m, y_m = record["x_m"], record["y_m"]
        if not (abs(x_m) <= FARTHEST_M and abs(y_m) <= FARTHEST_M):
            return None
        velocity = record.get("vx_m_s", NO_VALUE), record.get("vy_m_s", NO_VALUE)
        moves = not any(map(is_missing, velocity))
        sd_m = record.get("sd_m", NO_VALUE)
        deviation_m = USUAL_SD_M if is_missing(sd_m) else max(LEAST_SD_M, float(sd_m))
        attributes = {name: value for name, value in record.items() if name not in _OWN}
        vx_m_s, vy_m_s = map(float, velocity) if moves else (0.0, 0.0)
        covariance = diagonal(deviation_m, VELOCITY_SD_M_S if moves else None)
        state = ObjectState(sample.valid_us, float(x_m), float(y_m), vx_m_s, vy_m_s, covariance, attributes)
        return Percept(symbol, self._type, state)
