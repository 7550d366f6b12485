"""Object linkage structures: all objects, all link processes, stepped by the percepts of one valid time after another.

    linkage = ObjectLinkage([vision_to_world, world_to_on_road])
    outcome = linkage.on_percepts(valid_us, percepts)     # states of objects and events of links at that time
    linkage.anchored("wo1"); linkage.explain("wo1"); linkage.recent  # the latest events

Within a tick percepts that ended are removed, the others take their states, objects that no percept shows are predicted,
and the processes are stepped, those into lower types first. The order of the percepts of one tick does not matter. Between
ticks that are farther apart than percepts come, objects are predicted at the sample period.
"""

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from itertools import count
from typing import Final, NamedTuple, TypeAlias

from dyknow import Value
from dyknow.anchoring.links.assignment import natural
from dyknow.anchoring.links.composites import CompositeObjects, CompositeSpecification, check_ends
from dyknow.anchoring.links.deciding.context import ConditionContext, ConditionStreams
from dyknow.anchoring.links.individuals import Habit, Individual
from dyknow.anchoring.links.objects import EventKind, LinkEvent, LinkObject, LinkReason, ObjectLink
from dyknow.anchoring.links.prediction import ConstantVelocity, ObjectPrediction, Predictor, certain
from dyknow.anchoring.links.processes import LinkProcess, updated
from dyknow.anchoring.links.rhythm import Rhythm
from dyknow.anchoring.links.specification import LinkSpecification, in_order, prefix_of
from dyknow.anchoring.links.states import ObjectState
from dyknow.anchoring.links.top_down import TopDown
from dyknow.reasoning.formulas.tree import Formula

MOST_TICKS: Final = 10_000
"""Most predictions at the sample period between two ticks."""
GENERAL: Final = ConstantVelocity(noise=4.0)
AnySpecification: TypeAlias = LinkSpecification | CompositeSpecification
_FORGOTTEN_KEPT, _NEARLY, _NEVER_US = 1000, 0.99, 2**62


class Percept(NamedTuple):
    """A sample of a percept, or its end."""

    symbol: str
    type: str
    state: ObjectState | None
    """None: it has ended."""


class StateRecord(NamedTuple):
    """A state of an object.

    Attributes:
        linked_to: the objects below it, or percepts, from whose states it comes; empty where it is predicted itself.
        prediction: None where it was observed.
        weight: how probable its links are.
        observed_us: the valid time of the latest state that was observed, by which it is known.
        late_us: how long after its time it is known to be of this object: from before that was established. Else 0.
    """

    valid_us: int
    symbol: str
    type: str
    state: ObjectState
    linked_to: tuple[str, ...]
    prediction: ObjectPrediction | None
    weight: float = 1.0
    observed_us: int = 0
    late_us: int = 0


class LinkOutcome(NamedTuple):
    """The results of one tick or several, in the order of time."""

    states: list[StateRecord]
    events: list[LinkEvent]


class ObjectLinkage:
    """The structures of one set of link specifications.

    Args:
        specifications: any order; their types make a graph without cycles.
        period_us: the sample period; None: learnt for each type of percepts.
        silence_us: percepts without a sample for so long have ended; None: by their period.
        streams: the streams that conditions may read.

    Attributes:
        into: the link processes that lead into each type; `composites`: the makers of composites, by type.

    Raises:
        ValueError: the types of the specifications are in a circle, or two specifications link the same types; parts of
            composites need not be near each other.
    """

    def __init__(
        self,
        specifications: Sequence[AnySpecification],
        period_us: int | None = None,
        silence_us: int | None = None,
        streams: ConditionStreams | None = None,
    ) -> None:
        self.into: dict[str, list[LinkProcess]] = {}
        self._from: dict[str, list[LinkProcess]] = {}
        self.composites: dict[str, CompositeObjects] = {}
        specified = in_order(specifications)
        check_ends(specified)
        below = dict.fromkeys(each.source for each in specified)
        self._order = tuple(dict.fromkeys(each.target for each in specified))
        self._objects: dict[str, dict[str, LinkObject]] = {type_: {} for type_ in (*below, *self._order)}
        self.context = ConditionContext(self._objects, streams)
        for each in specified:
            if isinstance(each, CompositeSpecification):
                self.composites[each.target] = CompositeObjects(each, self)
            else:
                process = LinkProcess(each, self)
                self.into.setdefault(each.target, []).append(process)
                self._from.setdefault(each.source, []).append(process)
        self._speeds = {one: Habit(0.0) for one in self._order}
        self._types = {one: one if one in self.composites else prefix_of(one, self.into) for one in self._order}
        self._rhythms = {type_: Rhythm(period_us, silence_us) for type_ in below if type_ not in self._order}
        self._numbers = {prefix: count(1) for prefix in set(self._types.values())}
        self._latest_us: int | None = None
        self._events: list[LinkEvent] = []
        self._top_down = TopDown(self, self._objects, self.into, self._from, self.composites)
        self._forgotten: deque[LinkObject] = deque(maxlen=_FORGOTTEN_KEPT)
        self.recent: deque[LinkEvent] = deque(maxlen=_FORGOTTEN_KEPT)

    # Time and percepts

    @property
    def percept_types(self) -> tuple[str, ...]:
        """The types that percepts may have."""
        return tuple(self._rhythms)

    @property
    def deadline_us(self) -> int | None:
        """When objects are to be predicted if no percept comes before; None: there is nothing to predict."""
        period_us = self._period_us
        if self._latest_us is None or period_us is None or not any(self._objects.values()):
            return None
        return self._latest_us + period_us + period_us // 2

    @property
    def _period_us(self) -> int | None:
        return min((each.period_us for each in self._rhythms.values() if each.period_us is not None), default=None)

    def on_time(self, now_us: int) -> LinkOutcome:
        """Predict, forget and time out until `now_us`, at the sample period."""
        outcome = LinkOutcome([], [])
        for _ in range(MOST_TICKS):
            deadline_us = self.deadline_us
            if deadline_us is None or deadline_us > now_us or self._latest_us is None or self._period_us is None:
                break
            self._tick(self._latest_us + self._period_us, (), outcome)
        return outcome

    def on_percepts(self, valid_us: int, percepts: Iterable[Percept]) -> LinkOutcome:
        """Take all percepts of one valid time, each at most once, later than everything before.

        Raises:
            ValueError: time goes backwards.
        """
        outcome = self.on_time(valid_us)
        if self._latest_us is not None and valid_us <= self._latest_us:
            raise ValueError(f"percepts go forward in time: {valid_us} us after {self._latest_us} us")
        self._tick(valid_us, sorted(percepts, key=lambda one: (one.type, natural(one.symbol))), outcome)
        return outcome

    def _tick(self, valid_us: int, percepts: Sequence[Percept], outcome: LinkOutcome) -> None:
        self._latest_us, self._events, before = valid_us, outcome.events, len(outcome.events)
        self._end_percepts(valid_us, percepts)
        self._top_down.release(valid_us)
        for percept in percepts:
            if percept.state is not None:
                self._observe(valid_us, percept, percept.state)
        self._predict(valid_us)
        fresh = {type_: updated(self._objects[type_].values(), valid_us) for type_ in self._rhythms}
        for type_ in self._order:
            for process in self.into.get(type_, ()):
                sources = fresh[process.specification.source]
                process.update(valid_us, sources)
                self._top_down.seek(valid_us, process, sources)
                process.decide(valid_us, sources)
            objects = self._objects[type_]
            if (composites := self.composites.get(type_)) is not None:
                composites.step(valid_us, self._objects[composites.specification.source], objects)
                self._top_down.seek_composites(valid_us, composites, updated(objects.values(), valid_us))
            fresh[type_] = updated(objects.values(), valid_us)
            self._forget(valid_us, type_)
            outcome.states.extend(
                record_of(one) for one in fresh[type_] if one.symbol in objects and self._has_state(one, valid_us)
            )
        self._top_down.observe(valid_us)
        self.recent.extend(outcome.events[before:])

    def _end_percepts(self, valid_us: int, percepts: Iterable[Percept]) -> None:
        """Remove percepts that have ended, and those without a sample for too long."""
        present = {(each.type, each.symbol) for each in percepts if each.state is not None}
        for percept in percepts:
            if percept.state is None:
                self._rhythms[percept.type].on_end(percept.symbol)
                if one := self._objects[percept.type].get(percept.symbol):
                    self._remove(valid_us, one, LinkReason("ended"))
        for type_, rhythm in self._rhythms.items():
            for one in list(self._objects[type_].values()):
                silent_us, silence_us = valid_us - one.state.valid_us, rhythm.silence_us(one.symbol)
                if silent_us > silence_us or (silent_us == silence_us and (type_, one.symbol) not in present):
                    self._remove(valid_us, one, LinkReason("silent", for_us=silent_us))

    def _observe(self, valid_us: int, percept: Percept, state: ObjectState) -> None:
        one = self._objects[percept.type].get(percept.symbol)
        if one is None:
            one = self._added(LinkObject(percept.symbol, percept.type, valid_us, state))
        self._rhythms[percept.type].on_sample(percept.symbol, valid_us)
        one.observe(state)
        one.anchored_us = valid_us

    # Prediction

    def _predict(self, valid_us: int) -> None:
        """Predict objects that are not linked, or whose percepts are late."""
        period_us = self._period_us
        if period_us is None:
            return
        shown = set[LinkObject]()
        for type_ in self._order:
            for one in self._objects[type_].values():
                sources = [link.source for link in one.incoming.values()]
                if any(each in shown or self._is_shown(each, valid_us) for each in sources):
                    shown.add(one)
                elif type_ in self.into and valid_us - one.state.valid_us >= _NEARLY * period_us:
                    owner, prediction = self._predicted(one, valid_us)
                    owner.expect(prediction)
                    if one is not owner:
                        one.expect(prediction.described(one.state.attributes))

    def _is_shown(self, one: LinkObject, valid_us: int) -> bool:
        """Whether it is a percept with a sample at this time."""
        return one.type in self._rhythms and one.state.valid_us == valid_us

    def expected(self, one: LinkObject, valid_us: int) -> ObjectPrediction:
        """Where an object is at a time, by its latest state or its predictor."""
        if one.state.valid_us == valid_us:
            return one.whereabouts
        if one.prediction is None and one.incoming:
            return certain(next(iter(one.incoming.values())).process.specification.later(one.state, valid_us))
        return self._predicted(one, valid_us)[1]

    def foreseen(self, one: LinkObject, valid_us: int) -> ObjectPrediction:
        """Where an object will be at a later time, if nothing shows it until then."""
        return self._predicted(one, valid_us)[1]

    def _predicted(self, one: LinkObject, valid_us: int) -> tuple[LinkObject, ObjectPrediction]:
        """The highest object above one that has a predictor (rule L8), or itself, and where that is."""
        owner, predictor = one, self._predictor(one.type)
        above = one
        while above.outgoing and not (link := next(iter(above.outgoing.values()))).is_doubtful:
            above = link.target
            if (higher := self._predictor(above.type)) is not None and above.observed:
                owner, predictor = above, higher
        if owner.state.valid_us == valid_us and owner.prediction is not None:
            return owner, owner.prediction
        history = list(owner.observed)
        return owner, (predictor or GENERAL).predict(history, valid_us, owner.prediction, owner.individual)

    def _predictor(self, type_: str) -> Predictor | None:
        return next((each.specification.predictor for each in self.into[type_] if each.specification.predictor), None)

    # Objects and links

    def create(self, valid_us: int, target: str, state: ObjectState, symbol: str | None = None) -> LinkObject:
        """A new object, with a symbol of its own if none is given."""
        named = symbol or self.new_symbol(target)
        return self._added(LinkObject(named, target, valid_us, state, individual=Individual(self._speeds[target])))

    def new_symbol(self, type_: str) -> str:
        """A symbol that no object of the type has, and none is wanted by."""
        prefix = self._types[type_]
        while (symbol := f"{prefix}{next(self._numbers[prefix])}") in self._objects[type_] or symbol in self.wanted:
            pass
        return symbol

    def _added(self, one: LinkObject) -> LinkObject:
        self._objects[one.type][one.symbol] = one
        one.anchored_us = one.created_us
        for process in self._from.get(one.type, ()):
            process.on_source(one, one.created_us)
        for process in self.into.get(one.type, ()):
            process.on_target(one, one.created_us)
        return one

    def on_linked(
        self, valid_us: int, kind: EventKind, link: ObjectLink, reason: LinkReason, weight: float = 1.0
    ) -> None:
        """A link was made; processes that it excludes have nothing to decide about its source."""
        for other in self._excluded(link):
            other.drop_source(link.source.symbol)
        self.on_event(valid_us, kind, link, reason, weight)
        if group := link.process.specification.exclusive:
            before = link.source.classes.get(group, link.target.type)
            link.source.classes[group] = link.target.type
            if before != link.target.type:
                self.on_event(valid_us, "reclassified", link, reason, weight)

    def on_unlinked(self, valid_us: int, link: ObjectLink, reason: LinkReason) -> None:
        """A link was removed; if its source is alive, its evaluations start at the next state."""
        if not link.target.incoming and link.target.individual is not None:
            link.target.individual.pause()
        if link.source.symbol in self._objects[link.source.type]:
            for process in self._from[link.source.type]:
                if process is link.process or process in self._excluded(link):
                    process.on_source(link.source, valid_us + 1)
        self.on_event(valid_us, "unlinked", link, reason)

    def _excluded(self, link: ObjectLink) -> list[LinkProcess]:
        group = link.process.specification.exclusive
        others = self._from[link.source.type] if group else ()
        return [each for each in others if each.specification.exclusive == group and each is not link.process]

    def _remove(self, valid_us: int, one: LinkObject, reason: LinkReason) -> None:
        del self._objects[one.type][one.symbol]
        for link in [*one.outgoing.values(), *one.incoming.values()]:
            link.process.unlink(valid_us, link, reason)
        for process in self._from.get(one.type, ()):
            process.drop_source(one.symbol)
            self._top_down.drop(process.name, one.symbol)
        for process in self.into.get(one.type, ()):
            process.drop_target(one.symbol)
        if (composites := self.composites.get(one.type)) is not None:
            self._top_down.drop(composites.name, one.symbol)

    def _forget(self, valid_us: int, type_: str) -> None:
        """Remove objects of a type that were not anchored for too long."""
        kept = [each.specification.kept_us for each in self.into.get(type_, ())]
        for one in list(self._objects[type_].values()):
            anchors = [
                link
                for link in one.incoming.values()
                if link.source.anchored_us == valid_us or link.source.type in self._rhythms
            ]
            if anchors:
                one.anchor(valid_us, min(link.since_us for link in anchors))
            elif valid_us - one.anchored_us >= max((each(one.seen_us) for each in kept), default=_NEVER_US):
                self.discard(valid_us, one, LinkReason("forgotten", for_us=valid_us - one.anchored_us))

    def _has_state(self, one: LinkObject, valid_us: int) -> bool:
        """Whether it is seen, or was for so long that it is still predicted."""
        unseen_us, into = valid_us - one.anchored_us, self.into.get(one.type)
        return not into or any(unseen_us <= each.specification.predicted_us(one.seen_us) for each in into)

    def discard(self, valid_us: int, one: LinkObject, reason: LinkReason) -> None:
        """An object is gone; its history is kept for a while."""
        self._remove(valid_us, one, reason)
        self.tell(LinkEvent(valid_us, "forgotten", "", "", one.symbol, one.type, reason), one)
        self._forgotten.append(one)

    def on_event(
        self, valid_us: int, kind: EventKind, link: ObjectLink, reason: LinkReason, weight: float = 1.0
    ) -> None:
        """Something has happened to a link."""
        source, target = link.source, link.target
        event = LinkEvent(valid_us, kind, source.symbol, source.type, target.symbol, target.type, reason, weight)
        self.tell(event, source, target)

    def tell(self, event: LinkEvent, *about: LinkObject) -> None:
        """Something happened to these objects."""
        for one in about:
            one.history.append(event)
        self._events.append(event)

    # Top-down identification

    def want(
        self,
        symbol: str,
        type_: str,
        description: Formula | Mapping[str, Value],
        place: ObjectState | None = None,
        only: str | None = None,
    ) -> None:
        """Look for an object that is described; see `TopDown.want`."""
        self._top_down.want(symbol, type_, description, place, only)

    def unwant(self, symbol: str) -> None:
        """Look for it no more; see `TopDown.unwant`."""
        self._top_down.unwant(symbol)

    @property
    def wanted(self) -> tuple[str, ...]:
        """The symbols of objects that are looked for."""
        return self._top_down.sought

    # Questions

    def objects(self, type_: str) -> Mapping[str, LinkObject]:
        """The live objects of a type, by symbol."""
        return self._objects.get(type_, {})

    def find(self, symbol: str) -> LinkObject | None:
        """A live object, or percept, by its symbol; objects before percepts."""
        found = (self._objects[type_].get(symbol) for type_ in (*self._order, *self._rhythms))
        return next((one for one in found if one is not None), None)

    def anchored(self, symbol: str) -> bool:
        """Whether live links lead from a percept to this object."""
        one = self.find(symbol)
        return one is not None and one.is_anchored(self._rhythms)

    def explain(self, symbol: str) -> tuple[LinkEvent, ...]:
        """The history of an object's links, also of one of those forgotten last; empty if there is none."""
        one = self.find(symbol) or next((each for each in self._forgotten if each.symbol == symbol), None)
        return () if one is None else tuple(one.history)


def record_of(one: LinkObject) -> StateRecord:
    """The newest state of an object."""
    links = one.incoming.values()
    linked = tuple(link.source.symbol for link in links if link.source.state.valid_us == one.state.valid_us)
    weight = min((link.weight for link in links), default=1.0)
    observed_us = one.observed[-1].valid_us if one.observed else one.created_us
    return StateRecord(one.state.valid_us, one.symbol, one.type, one.state, linked, one.prediction, weight, observed_us)
