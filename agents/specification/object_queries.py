"""The objects that are there, in the streams of object states of one platform, for other members (thesis 8.5.1)."""

from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

from dyknow import NO_VALUE, Label, Sample
from dyknow.agents.actions import QUERIED, Action, Offer, Role
from dyknow.agents.exchange.label_agreements import LabelAgreements
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.specification.specification_part import SPECIFICATION
from dyknow.federation.messages.acts import Act
from dyknow.federation.messages.contents import ObjectEntry, ObjectEvent, ObjectEvents, ObjectList
from dyknow.federation.messages.descriptions import in_one_line
from dyknow.kpl.introspection.link_reasons import because
from dyknow.kpl.linking.branches import ways
from dyknow.kpl.linking.streams import LinkStream
from dyknow.kpl.linking.wants import Wanted
from dyknow.kpl.syntax.printing import print_formula
from dyknow.kpl.syntax.specification import RECOGNISED
from dyknow.model.errors import Refused
from dyknow.model.instants import US_PER_MS, print_span
from dyknow.model.values import without_nan
from dyknow.network.process import Process
from dyknow.objects.object_table import ObjectTable
from dyknow.reasoning.chronicles import MINUS_INFINITY

if TYPE_CHECKING:
    from dyknow.anchoring.belief.reports import LifeEvent
    from dyknow.anchoring.links.objects import LinkEvent, LinkObject

OBJECTS_A_PAGE, MOST_EVENTS = 40, 400
LONGEST_TEXT = 200
"""Characters of an attribute in an answer."""
LONGEST_REASON = 800


class LinkHistory(Protocol):
    """The history of a process of links."""

    recent: "Iterable[LinkEvent]"

    def explain(self, symbol: str) -> "tuple[LinkEvent, ...]": ...
    def find(self, symbol: str) -> "LinkObject | None": ...


class BeliefHistory(Protocol):
    """The history of a process of beliefs."""

    recent: "Iterable[LifeEvent]"

    def explain(self, name: str) -> "Iterable[LifeEvent]": ...


ObjectHistories: TypeAlias = Callable[[str | None], Iterable[tuple[Label, ObjectEvent]]]
"""Further events of one object, or of all (None), each with the label of its stream."""


class ObjectQueries(Part):
    """Lists the objects of the streams that the requester may see, with their newest states, and their events."""

    offers = (
        Offer(
            SPECIFICATION,
            (
                Action(ObjectList, "on_object_list", QUERIED, Role.OBSERVER),
                Action(ObjectEvents, "on_object_events", QUERIED, Role.OBSERVER),
            ),
        ),
    )

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self.histories: list[ObjectHistories] = []
        self._agent, self._agreements, self._instance = ports.agent, parts[LabelAgreements], ports.instance()

    def on_object_list(self, act: Act, content: ObjectList, now_us: int) -> None:
        """`(object-list)`, or `(object-list type: car)`: of one type, or of the stream of that name."""
        entries = [
            entry
            for table in self._instance.parts.objects.tables()
            if self._may_see(act.sender.unit, table.label)
            for entry in self._entries(table)
            if content.type in {None, entry.type, entry.stream}
        ]
        seen = {each.symbol for each in entries}
        entries += [
            _sought(each, sort)
            for each, sort in self._wanted(act.sender.unit)
            if each.symbol not in seen and content.type in {None, sort, each.type}
        ]
        self._agent.answer_pages(
            act, entries, OBJECTS_A_PAGE, lambda page, more: ObjectList(objects=page, more=more), now_us
        )

    def _entries(self, table: ObjectTable) -> Iterator[ObjectEntry]:
        """The objects of one stream; an object that may be on several links of the map has these as `branches`."""
        process = self._instance.network.process(table.label)
        history: LinkHistory | None = getattr(process, "linkage", None)
        for entry in _entries(table, _states(process, table)):
            one = None if history is None else history.find(entry.symbol)
            branches = "" if one is None else _branches(one)
            yield (
                entry.model_copy(update={"attributes": {**entry.attributes, "branches": branches}})
                if branches
                else entry
            )

    def on_object_events(self, act: Act, content: ObjectEvents, now_us: int) -> None:
        """`(object-events symbol: car1)`, or `(object-events since: 1700000000000000)`: the newest ones, in their order."""
        since_us = -(2**80) if content.since_us is None else content.since_us
        found = dict.fromkeys(each for each in self._events(act.sender.unit, content.symbol) if each.at_us > since_us)
        newest = sorted(found, key=lambda each: each.at_us)[-MOST_EVENTS:]
        self._agent.answer_pages(
            act, newest, OBJECTS_A_PAGE, lambda page, more: ObjectEvents(events=page, more=more), now_us
        )

    def _events(self, unit: str, symbol: str | None) -> Iterator[ObjectEvent]:
        network = self._instance.network
        for each, _ in self._wanted(unit):
            if symbol in {None, each.symbol}:
                yield ObjectEvent(at_us=each.since_us, event="wanted", target=each.symbol, because=_described(each))
        for histories in self.histories:
            yield from (event for label, event in histories(symbol) if self._may_see(unit, label))
        for label in network.labels():
            linkage: LinkHistory | None = getattr(network.process(label), "linkage", None)
            if linkage is not None and self._may_see(unit, label):
                yield from map(_event, linkage.recent if symbol is None else linkage.explain(symbol))
            beliefs: BeliefHistory | None = getattr(network.process(label), "beliefs", None)
            if beliefs is not None and self._may_see(unit, label):
                yield from map(_lived, beliefs.recent if symbol is None else beliefs.explain(symbol))
            elif label.feature == RECOGNISED:
                history = network.generator(label).history
                samples = history.get_slice(0, history.get_size() - 1) if history.get_size() else []
                recognised = (_recognised(label, each) for each in samples[-MOST_EVENTS:] if each.value is not NO_VALUE)
                yield from (each for each in recognised if symbol is None or symbol in _named(each))

    def _wanted(self, unit: str) -> Iterator[tuple[Wanted, str]]:
        """The wanted objects that the unit may see, each with the sort of its stream."""
        network = self._instance.network
        for each in self._instance.parts.wanted:
            label = Label.parse(each.type)
            if network.has(label) and self._may_see(unit, label):
                yield each, network.generator(label).sort.name

    def _may_see(self, unit: str, label: Label) -> bool:
        try:
            self._agreements.check_stream(unit, label)
        except Refused:
            return False
        return True


def _lived(event: "LifeEvent") -> ObjectEvent:
    """An event of a believed instance, or of the trust in a source."""
    about = [event.what] if event.instance else []
    why = ", ".join(filter(None, (*about, event.because or f"existence {event.existence:.3f}")))
    target = (event.instance or event.what)[:LONGEST_TEXT]
    return ObjectEvent(at_us=event.valid_us, event=event.kind, target=target, because=in_one_line(why)[:LONGEST_REASON])


def _event(event: "LinkEvent") -> ObjectEvent:
    return ObjectEvent(
        at_us=event.valid_us,
        event=event.kind,
        source=event.source[:LONGEST_TEXT],
        target=event.target[:LONGEST_TEXT],
        because=in_one_line(because(event.reason))[:LONGEST_REASON],
    )


def _described(wanted: Wanted) -> str:
    return in_one_line(print_formula(wanted.description))[:LONGEST_REASON]


def _sought(wanted: Wanted, sort: str) -> ObjectEntry:
    """A wanted object that is in no state yet, or was forgotten."""
    attributes: dict[str, Any] = {"wanted": _described(wanted)[:LONGEST_TEXT]}
    return ObjectEntry(
        symbol=wanted.symbol, type=sort[:64], stream=wanted.type, valid_us=wanted.since_us, attributes=attributes
    )


def _recognised(label: Label, sample: Sample) -> ObjectEvent:
    """An instance of a chronicle: its arguments, and how long before it the instants were that it names itself."""
    arguments, _, instants = sample.value
    known = [(name, sample.valid_us - time_ms * US_PER_MS) for name, time_ms in instants if time_ms != MINUS_INFINITY]
    times = ", ".join(f"{name} {print_span(ago_us)} before" for name, ago_us in known if ago_us > 0 and "." not in name)
    name = f"{label.objects[0]}[{', '.join(map(str, arguments))}]"
    return ObjectEvent(
        at_us=sample.valid_us, event="recognised", target=name[:LONGEST_TEXT], because=times[:LONGEST_REASON]
    )


def _named(event: ObjectEvent) -> tuple[str, ...]:
    """The objects that a recognised chronicle is about."""
    return tuple(event.target.partition("[")[2].removesuffix("]").split(", "))


def _branches(one: "LinkObject") -> str:
    """Where an object that is not seen may be: the links of the map with their weights, the most probable first."""
    found = ways(one.whereabouts)
    if len(found) < 2:
        return ""
    return ", ".join(f"{way.link} {way.weight:.2f}" for way in found)[:LONGEST_TEXT]


def _states(process: Process | None, table: ObjectTable) -> list[tuple[str, Sample]]:
    """States of a stream's objects; linked objects have states also while only a derived stream has a subscriber."""
    return process.there() if isinstance(process, LinkStream) and not process.running else table.read()


def _entries(table: ObjectTable, states: Iterable[tuple[str, Sample]]) -> Iterator[ObjectEntry]:
    names = [each.name for each in table.sort.fields]
    for symbol, state in states:
        attributes = dict(zip(names, without_nan(state.value), strict=True))
        del attributes[names[0]]
        type_ = str(attributes.pop("type", table.sort.name))[:64] or table.sort.name
        shown = {name: one[:LONGEST_TEXT] if isinstance(one, str) else one for name, one in attributes.items()}
        yield ObjectEntry(
            symbol=symbol[:64], type=type_, stream=str(table.label), valid_us=state.valid_us, attributes=shown
        )
