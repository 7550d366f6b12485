"""The saliency map as a part: persons that the cameras find, and those that other platforms have found (thesis 1.1.2, 7.1.1).

A percept of detectors of persons (`person-percepts`, of the platform's own cameras or of a host) becomes an entry after
5 s; entries are the stream `saliency-entries`, which every platform imports of all others. Each makes the map for
itself, as the stream `saliency-map` and as an answer. Entries of a platform that is gone stay on the map.
"""

from collections import Counter
from collections.abc import Iterable
from typing import Final

from dyknow import US_PER_S, Sample
from dyknow.agents.actions import FEDERATION, QUERIED, Action, Offer, Role
from dyknow.agents.capabilities.cooperation.shared_map import SharedMap
from dyknow.agents.capabilities.saliency.records import (
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
from dyknow.agents.part import PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.anchoring.saliency.entries import PersonEntry
from dyknow.anchoring.saliency.map import SaliencyMap
from dyknow.anchoring.saliency.watching import PersonSearch
from dyknow.federation.members.offers import LabelAppeared, LabelGone
from dyknow.federation.messages.acts import Act
from dyknow.federation.messages.contents import SaliencyRow, SaliencyRows
from dyknow.federation.messages.descriptions import ConditionEntry

PERIOD_US: Final = US_PER_S
AGAIN: Final = 5
"""In every fifth period all entries are sent, for platforms that came later."""
ROWS_A_PAGE: Final = 24
NAMES_A_LIFE: Final = 1000


class Saliency(SharedMap):
    """Makes entries and the map. Times of both are federation time.

    Attributes:
        search: the persons seen by the platform's own cameras; None: no detector of persons has scored anything yet.
        map: of all platforms.
    """

    own, shared, shown = PERCEPTS, ENTRIES, MAP
    made = (ENTRIES, MAP)
    heeds_samples = True
    offers = (Offer(FEDERATION, (Action(SaliencyRows, "on_saliency_rows", QUERIED, Role.OBSERVER),)),)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        super().__init__(ports, parts)
        self._clock, self._origin, self._note, self._offer = ports.clock, ports.origin, ports.note, ports.offer
        self.map = SaliencyMap(ports.config.trusted)
        self.search: PersonSearch | None = None
        self._sent: dict[str, PersonEntry] = {}
        self._refused, self._refused_us = Counter[tuple[str, str]](), 0
        self._rounds = 0

    def conditions(self) -> Iterable[ConditionEntry]:
        """The refusals of other members' entries."""
        text = "; ".join(refusals(self._refused))
        return (ConditionEntry(text=f"saliency: left out: {text}"[:200], since_us=self._refused_us),) if text else ()

    # -- what is seen ------------------------------------------------------------------------------------------

    def _begin(self, now_us: int) -> None:
        self._take(self._on_look)
        if self.search is not None:
            self._open((ENTRIES, MAP), now_us)

    def _open(self, names: Iterable[str], now_us: int) -> None:
        if self._add(names):
            self._offer(now_us)

    def _on_look(self, sample: Sample) -> None:
        look = person_look(self._unit, sample)
        if look is None:
            return
        if self.search is None:
            self.search = PersonSearch(self._unit, self._first_number(NAMES_A_LIFE))
            self._due_us = 0
        self.search.on_look(look)

    # -- what others have found --------------------------------------------------------------------------------

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """A platform begins to look for persons; a platform that ends leaves its entries."""
        match change:
            case LabelAppeared(unit, label) if label.label == ENTRIES and unit != self._unit:
                if not self._agreements.disagreement(unit, ENTRIES):
                    self.partners.want(unit, {ENTRIES: PERIOD_US}, now_us)
                    self._open((MAP,), now_us)
                    self._due_us = 0 if self._due_us is None else self._due_us
            case LabelGone(unit, label) if label.label == ENTRIES:
                self.partners.want(unit, {}, now_us)

    def _on_sample(self, unit: str, _label: str, sample: Sample) -> None:
        found = person_entry(unit, sample)
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
        self._show(
            lambda: {place.name: (valid_us, place_value(place)) for place in self.map.places()},
            ended_place,
            valid_us,
            federation_us,
        )
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

    # -- questions ---------------------------------------------------------------------------------------------

    def on_saliency_rows(self, act: Act, _content: SaliencyRows, now_us: int) -> None:
        """`(saliency-rows)`: the map as it is; of a platform that shares its entries with named others nothing is handed on.

        Raises:
            Denied: the requester may see none of it.
        """
        self._agreements.check(act.sender.unit, ENTRIES)
        frame, hidden = self._origin(), self._hidden(self.map.members, act.sender.unit)
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


def refusals(refused: Counter[tuple[str, str]]) -> list[str]:
    """The refused entries, by member and reason, in words."""
    return [f"of platform {unit} {count} entries: {why}" for (unit, why), count in sorted(refused.items())]
