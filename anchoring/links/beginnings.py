"""The states of objects before they were established: those of their percepts until then.

A percept makes no object before the condition holds, so that clutter makes none. An object has states from its first
sighting, as soon as it is established.
"""

from collections import deque
from collections.abc import Iterable, Iterator
from itertools import islice
from math import inf
from typing import Final

from dyknow import US_PER_S
from dyknow.anchoring.links.deciding.trials import LASTS_US
from dyknow.anchoring.links.objects import LinkEvent
from dyknow.anchoring.links.specification import LinkSpecification
from dyknow.anchoring.links.states import ObjectState
from dyknow.anchoring.links.structures import AnySpecification, LinkOutcome, ObjectLinkage, Percept, StateRecord

MOST_STATES: Final = 1024
"""Most that are kept of one percept, or object, that is not linked."""
_STILL_OPEN: Final = frozenset({"weighed", "another"})
"""Why a link is removed whose percept may have been another since it was seen first."""
_REMEMBERED_US: Final = 60 * US_PER_S

_Key = tuple[str, str]


class ObjectBeginnings:
    """The states of unlinked percepts and objects, by type and symbol, until an object is made."""

    def __init__(self, linkage: ObjectLinkage, specifications: Iterable[AnySpecification]) -> None:
        self._linkage = linkage
        links = [each for each in specifications if isinstance(each, LinkSpecification)]
        self._links = {(each.source, each.target): each for each in links}
        self._sources = {each.source for each in links}
        self._until_us: dict[_Key, float] = {}
        self._known: dict[_Key, deque[ObjectState]] = {}

    def completed(self, percepts: Iterable[Percept], outcome: LinkOutcome) -> LinkOutcome:
        """The outcome of a tick of these percepts, with the earlier states of the objects that it established."""
        for each in percepts:
            if each.state is not None:
                self._note((each.type, each.symbol), each.state)
        earlier = [state for event in outcome.events for state in self._of(event)]
        for record in outcome.states:
            if record.prediction is None and record.type in self._sources:
                self._note((record.type, record.symbol), record.state)
        return outcome._replace(states=[*earlier, *outcome.states])

    def _note(self, key: _Key, state: ObjectState) -> None:
        if state.valid_us > self._until_us.get(key, inf):
            self._known.pop(key, None)
            return
        states = self._known.pop(key, None) or deque(maxlen=MOST_STATES)
        states.append(state)
        self._known[key] = states
        for old, of_old in list(islice(self._known.items(), 2)):
            if state.valid_us - of_old[-1].valid_us > _REMEMBERED_US:
                del self._known[old]

    def _of(self, event: LinkEvent) -> Iterator[StateRecord]:
        source, target = (event.source_type, event.source), (event.target_type, event.target)
        if event.kind == "unlinked":
            self._until_us.pop(source, None)
            if event.reason.cause not in _STILL_OPEN:
                self._known.pop(source, None)
        elif event.kind == "reestablished":
            self._until_us[source] = event.valid_us + LASTS_US
        elif event.kind == "established":
            self._until_us[source] = -inf
            states, link = self._known.pop(source, ()), self._links.get((source[0], target[0]))
            if link is None:
                return
            state, began_us = None, self._began_us(source)
            for each in states:
                if began_us <= each.valid_us < event.valid_us:
                    state = link.unit(each, None if state is None else link.later(state, each.valid_us))
                    if target[0] in self._sources:
                        self._note(target, state)
                    yield StateRecord(
                        each.valid_us,
                        event.target,
                        event.target_type,
                        state,
                        (event.source,),
                        None,
                        observed_us=each.valid_us,
                        late_us=event.valid_us - each.valid_us,
                    )

    def _began_us(self, source: _Key) -> float:
        """Since when a percept has had its name, before which another had it. Of objects: since their first state."""
        type_, symbol = source
        percept = self._linkage.objects(type_).get(symbol) if type_ in self._linkage.percept_types else None
        return -inf if percept is None else percept.created_us
