"""The saliency map as a part: persons that the cameras find, and those that other platforms have found (thesis 1.1.2, 7.1.1).

A percept of detectors of persons (`person-percepts`, of the platform's own cameras or of a host) becomes an entry after
5 s; entries are the stream `saliency-entries`, which every platform imports of all others. Each makes the map for
itself, as the stream `saliency-map` and as an answer. Entries of a platform that is gone stay on the map.
"""

from collections import Counter
from collections.abc import Iterable
from typing import Final

from agents.actions import FEDERATION, QUERIED, Action, Offer, Role
from agents.exchange.label_agreements import LabelAgreements
from agents.exchange.local_instance import LocalInstance
from agents.exchange.partners import Partners
from agents.exchange.subscription_keeper import SubscriptionKeeper
from agents.part import Part, PeerChange
from agents.ports import PartRegistry, Ports
from agents.saliency.records import (
    ENTRIES,
    MAP,
    PERCEPTS,
    attributes_of,
    ended_place,
    entry_value,
    person_entry,
    person_look,
    place_value,
)
from anchoring.saliency.entries import PersonEntry
from anchoring.saliency.map import SaliencyMap
from anchoring.saliency.watching import PersonSearch
from dyknow import US_PER_S, Label, Policy, Sample
from dyknow.network.generator import Subscription
from federation.members.offers import LabelAppeared, LabelGone
from federation.messages.acts import Act
from federation.messages.contents import SaliencyRow, SaliencyRows
from federation.messages.descriptions import ConditionEntry, LabelEntry

PERIOD_US: Final = US_PER_S
AGAIN: Final = 5
"""In every fifth period all entries are sent, for platforms that came later."""
ROWS_A_PAGE: Final = 24
_FIRST, _LIVES = 1000, 1000


class Saliency(Part):
    """Makes entries and the map. Times of both are federation time.

    Attributes:
        search: the persons seen by the platform's own cameras; None: no detector of persons has scored anything yet.
        map: of all platforms.
    """

    heeds_samples = True
    offers = (Offer(FEDERATION, (Action(SaliencyRows, "on_saliency_rows", QUERIED, Role.OBSERVER),)),)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._boot, self._agent = ports.config.unit, ports.config.boot, ports.agent
        self._clock, self._network = ports.clock, ports.network
        self._translation, self._directory = ports.translation, ports.directory
        self._agreements, self._origin = parts[LabelAgreements], ports.origin
        self._note, self._offer = ports.note, ports.offer
        self.map = SaliencyMap(ports.config.trusted)
        self.search: PersonSearch | None = None
        self._partners = Partners(ports.network, parts[LocalInstance], parts[SubscriptionKeeper], self._on_sample)
        self._labels = {
            name: ports.translation.local_label(name, ports.config.unit) for name in (PERCEPTS, ENTRIES, MAP)
        }
        self._taken: Subscription | None = None
        self._sent: dict[str, PersonEntry] = {}
        self._shown = set[str]()
        self._refused, self._refused_us = Counter[tuple[str, str]](), 0
        self._rounds = 0
        self._due_us: int | None = None
        ports.network.meet(self._on_label)

    def labels(self) -> Iterable[LabelEntry]:
        """The entries of this platform once its detectors look for persons, and the map while there is one."""
        ontology = self._translation.ontology
        return [
            LabelEntry(label=name, sort=ontology[name].sort.name, type_hash=ontology[name].type_hash, period_us=0)
            for name in (ENTRIES, MAP)
            if self._network.has(self._labels[name])
        ]

    def conditions(self) -> Iterable[ConditionEntry]:
        """The refusals of other members' entries."""
        text = "; ".join(refusals(self._refused))
        return (ConditionEntry(text=f"saliency: left out: {text}"[:200], since_us=self._refused_us),) if text else ()

    # -- what is seen ------------------------------------------------------------------------------------------

    def _on_label(self, label: Label) -> None:
        """A detector of persons is there."""
        if label == self._labels[PERCEPTS] and self._taken is None:
            self._due_us = 0

    def _begin(self, now_us: int) -> None:
        if self._taken is None and self._network.has(self._labels[PERCEPTS]):
            self._taken = self._network.subscribe(self._labels[PERCEPTS], Policy(), self._on_look, self._on_end)
        if self.search is not None:
            self._open((ENTRIES, MAP), now_us)

    def _open(self, names: Iterable[str], now_us: int) -> None:
        """Have these streams."""
        new = [name for name in names if not self._network.has(self._labels[name])]
        for name in new:
            self._network.add_source(self._labels[name], self._translation.local_sort(name))
        if new:
            self._offer(now_us)

    def _on_end(self) -> None:
        self._taken = None

    def _on_look(self, sample: Sample) -> None:
        look = person_look(self._unit, self._translation.to_semantic(PERCEPTS).sample(sample))
        if look is None:
            return
        if self.search is None:
            self.search = PersonSearch(self._unit, self._boot // 1000 % _LIVES * _FIRST + 1)
            self._due_us = 0
        self.search.on_look(look)

    # -- what others have found --------------------------------------------------------------------------------

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """A platform begins to look for persons; a platform that ends leaves its entries."""
        match change:
            case LabelAppeared(unit, label) if label.label == ENTRIES and unit != self._unit:
                if not self._agreements.disagreement(unit, ENTRIES):
                    self._partners.want(unit, {ENTRIES: PERIOD_US}, now_us)
                    self._open((MAP,), now_us)
                    self._due_us = 0 if self._due_us is None else self._due_us
            case LabelGone(unit, label) if label.label == ENTRIES:
                self._partners.want(unit, {}, now_us)

    def _on_sample(self, unit: str, _label: str, sample: Sample) -> None:
        found = person_entry(unit, self._translation.to_semantic(ENTRIES).sample(sample))
        if found is None:
            return
        entry, is_withdrawn = found
        if is_withdrawn:
            self.map.withdraw(unit, entry.symbol)
        else:
            self.map.take(entry, max(self._network.now_us, sample.available_us))

    # -- time --------------------------------------------------------------------------------------------------

    @property
    def deadline_us(self) -> int | None:
        return self._due_us

    def on_time(self, now_us: int) -> None:
        """Send new and changed entries, once a second, and report refusals."""
        if self._due_us is None or now_us < self._due_us:
            return
        self._begin(now_us)
        if self.search is None and not self._network.has(self._labels[MAP]):
            self._due_us = None
            return
        federation_us = self._clock.federation_us(now_us)
        valid_us = federation_us // PERIOD_US * PERIOD_US
        self._due_us = self._clock.wall_us(valid_us + PERIOD_US)
        self._send(valid_us, federation_us)
        self._show(valid_us, federation_us)
        if self.map.gate.refused.keys() - self._refused.keys():
            new = Counter({key: n for key, n in self.map.gate.refused.items() if key not in self._refused})
            self._note(f"saliency: left out: {'; '.join(refusals(new))}")
            self._refused, self._refused_us = Counter(self.map.gate.refused), now_us
            self._offer(now_us)

    def _send(self, valid_us: int, federation_us: int) -> None:
        if self.search is None:
            return
        self._rounds += 1
        with self._network.instant.whole():
            for entry in self.search.entries():
                is_new = self._sent.get(entry.symbol) != entry
                if is_new:
                    self._note_found(entry)
                    self.map.take(entry, federation_us)
                    self._sent[entry.symbol] = entry
                if is_new or self._rounds % AGAIN == 0:
                    self._push(ENTRIES, valid_us, entry_value(entry), federation_us)

    def _note_found(self, entry: PersonEntry) -> None:
        if entry.symbol not in self._sent:
            self._note(f"saliency: {entry.name} is a person at ({entry.x_m:.1f}, {entry.y_m:.1f}) m")

    def _show(self, valid_us: int, federation_us: int) -> None:
        """The map as a stream, while it has subscribers."""
        label = self._labels[MAP]
        if not self._network.has(label) or not self._network.generator(label).subscriptions:
            return
        places = {place.name: place for place in self.map.places()}
        with self._network.instant.whole():
            for place in places.values():
                self._push(MAP, valid_us, place_value(place), federation_us)
            for name in self._shown - places.keys():
                self._push(MAP, valid_us, ended_place(name), federation_us)
        self._shown = set(places)

    def _push(self, name: str, valid_us: int, value: object, now_us: int) -> None:
        self._network.push(self._labels[name], valid_us, self._translation.to_local(name)(value), now_us)

    # -- questions ---------------------------------------------------------------------------------------------

    def on_saliency_rows(self, act: Act, _content: SaliencyRows, now_us: int) -> None:
        """`(saliency-rows)`: the map as it is; of a platform that shares its entries with named others nothing is handed on.

        Raises:
            Denied: the requester may see none of it.
        """
        self._agreements.check(act.sender.unit, ENTRIES)
        requester, frame = act.sender.unit, self._origin()
        hidden = {unit for unit in self.map.members if not self._may_hand_on(unit, requester)}
        rows = [
            SaliencyRow(
                symbol=place.name,
                by=place.by,
                entries=tuple(each.name for each in place.entries),
                attributes=attributes_of(place, frame),
            )
            for place in self.map.places()
            if hidden.isdisjoint(place.by)
        ]
        members, refused = self.map.members, tuple(refusals(self.map.gate.refused))
        self._agent.answer_pages(
            act,
            rows,
            ROWS_A_PAGE,
            lambda page, more: SaliencyRows(members=members, rows=page, refused=refused, more=more),
            now_us,
        )

    def _may_hand_on(self, unit: str, requester: str) -> bool:
        """Whether a platform shares its entries with the requester, too."""
        entry = self._directory.entry(unit)
        named = next((each.receivers for each in (entry.labels if entry else ()) if each.label == ENTRIES), ())
        return not named or requester in named


def refusals(refused: Counter[tuple[str, str]]) -> list[str]:
    """The refused entries, by member and reason, in words."""
    return [f"of platform {unit} {count} entries: {why}" for (unit, why), count in sorted(refused.items())]
