"""Semantic labels that another platform defines differently: each is refused between the two, and reported.

Both sides compare the definition that the other announces, and neither requests or exports such a label. Times are
the node clock.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from dyknow import Policy
from dyknow.agents.actions import Role
from dyknow.agents.admission.admission import Denied
from dyknow.agents.part import Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.members.directory import DirectoryEntry
from dyknow.federation.members.liveness import PlatformGone
from dyknow.federation.members.offers import DefinitionsChanged, LabelAppeared
from dyknow.federation.messages.descriptions import ConditionEntry
from dyknow.federation.sharing.agreement import disagreement
from dyknow.model.instants import US_PER_S
from dyknow.model.labels import Label
from dyknow.model.semantic_labels import SemanticLabel

COMMAND_CENTRE = "cc"
"""How command centres are called, with a number after it."""
NOTED = 64
"""Conflicts that are noted, each once."""
LISTED, MAX_TEXT = 4, 200
"""Conflicts that are listed as conditions, and characters of each."""
BETWEEN_US = US_PER_S
"""Least time between announcements of conditions: a platform may redefine labels without end."""


class StreamOffer(NamedTuple):
    """Cost and promised quality of a stream that is offered in a call for proposals; a period of 0 is any."""

    cost: float
    period_us: int
    delay_us: int
    certainty: float


def stream_offer(cost: float | None, policy: Policy) -> StreamOffer | None:
    """The offer of a stream by `policy` at a cost; None if there is no cost."""
    if cost is None:
        return None
    delay_us = US_PER_S if policy.max_delay_us is None else policy.max_delay_us
    return StreamOffer(cost, policy.sample_us or 0, delay_us, policy.min_certainty or 0.0)


class Restriction(NamedTuple):
    """Receivers of an export: its visibility, the only units that it goes to, if any, and the stream that is exported.

    With an `offer` it goes only to units in answer to whose call it was proposed.
    """

    visibility: str
    receivers: tuple[str, ...]
    stream: Label
    offer: StreamOffer | None = None


UNRESTRICTED = Restriction("public", (), Label("none"))


class LabelAgreements(Part):
    """Comparison of this platform's labels with those of each other platform.

    Args:
        role_of: unit -> its role.
        ontology: definitions of labels here.
        offer: announces to the others that conditions have changed, at a time.
        note: takes words for users.

    A restriction of the input streams of a stream about objects restricts it, too.
    """

    def __init__(self, ports: Ports, _parts: PartRegistry) -> None:
        self._role_of, self._restricted = ports.role_of, dict[str, Restriction]()
        self._ontology, self._directory, self._offer = ports.ontology, ports.directory, ports.offer
        self._note = ports.note
        self._conflicts: dict[tuple[str, str], ConditionEntry] = {}
        self._noted = set[str]()
        self._instance = ports.instance
        self._due_us: int | None = None
        self._told_us = -BETWEEN_US

    def disagreement(self, unit: str, label: str) -> str:
        """Why a label is not shared with a unit; empty if it can be."""
        entry = self._directory.entry(unit)
        return "" if entry is None else self._disagreement(entry, label)

    def _disagreement(self, entry: DirectoryEntry, label: str) -> str:
        offered = next((each.type_hash for each in entry.labels if each.label == label), None)
        return disagreement(self._ontology.get(label), entry.definitions.get(label), offered)

    def restrict(self, label: str, to: "Restriction | None") -> None:
        """Set the visibility of a label of this platform; None: it is not exported."""
        if to is None:
            self._restricted.pop(label, None)
        else:
            self._restricted[label] = to

    def offer_of(self, label: str) -> StreamOffer | None:
        """At what cost a label of this platform is offered; None: it is no offer."""
        return self._restricted.get(label, UNRESTRICTED).offer

    def check_stream(self, unit: str, stream: Label) -> None:
        """Raises Denied if the stream is exported, and under no label that `unit` may ask for."""
        for made_of in (stream, *self._instance().parts.objects.sources(stream)):
            reasons = [self.refusal(unit, label) for label, to in self._restricted.items() if to.stream == made_of]
            if reasons and all(reasons):
                raise next(filter(None, reasons))

    def receiving(self, units: Iterable[str], labels: Sequence[str]) -> list[str]:
        """The units that may have all of the labels; why others may not is noted. Raises Denied if there is none."""
        reasons = {unit: next(filter(None, (self.refusal(unit, label) for label in labels)), None) for unit in units}
        allowed = [unit for unit, why in reasons.items() if why is None]
        for unit, why in reasons.items():
            if why is not None and not allowed:
                raise why
            if why is not None:
                self._note_once(f"not exported to {unit}: {why}")
        return allowed

    def check(self, unit: str, label: str) -> None:
        """Raises Denied if `unit` may not ask for a label here, or means something else by it: both definitions."""
        why = self.refusal(unit, label)
        if why is not None:
            raise why

    def refusal(self, unit: str, label: str) -> Denied | None:
        """The error that `check` raises, or None."""
        here = self._directory.unit
        if unit == here:
            return None
        visibility, receivers, *_ = self._restricted.get(label, UNRESTRICTED)
        if visibility == "private":
            return Denied(f"{label} is private on {here}", "private")
        names = {unit, COMMAND_CENTRE} if unit.startswith(f"{COMMAND_CENTRE}-") else {unit}
        if receivers and names.isdisjoint(receivers):
            return Denied(f"{here} exports {label} to {', '.join(receivers)}, and to no other", "no-receiver")
        if visibility == "protected" and self._role_of(unit) < Role.DELEGATE:
            return Denied(f"{label} is protected on {here}: an observer may not ask for it", "protected")
        why = self.disagreement(unit, label)
        return Denied(f"{label} is not shared between {here} and {unit}: {why}", "label-conflict") if why else None

    def define(self, label: SemanticLabel, now_us: int) -> bool:
        """Add a label of this platform; False if it was there; raises Refused if it means something else here."""
        is_new = self._ontology.define(label)
        if is_new:
            self._offer(now_us)
            self._look_at_all(now_us)
        return is_new

    def withdraw(self, label: str, now_us: int) -> None:
        """Remove the definition of a label of this platform."""
        self._ontology.withdraw(label)
        self._offer(now_us)
        self._look_at_all(now_us)

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """Compare the definitions that a platform announces with those of this one."""
        if isinstance(change, LabelAppeared):
            self._compare(change.unit, (change.label.label,), now_us)
        elif isinstance(change, DefinitionsChanged | PlatformGone):
            self._look(change.unit, now_us)

    def _look_at_all(self, now_us: int) -> None:
        for entry in self._directory.entries():
            self._look(entry.unit, now_us)

    def _look(self, unit: str, now_us: int) -> None:
        """Compare all labels that a platform defines or offers, or about which there was a conflict."""
        entry = self._directory.entry(unit)
        labels = dict.fromkeys(label for at, label in self._conflicts if at == unit)
        if entry is not None:
            labels |= dict.fromkeys((*entry.definitions, *(each.label for each in entry.labels)))
        self._compare(unit, labels, now_us)

    def _compare(self, unit: str, labels: Iterable[str], now_us: int) -> None:
        entry = self._directory.entry(unit) if self._directory.is_present(unit) else None
        is_news = False
        for label in labels:
            why = "" if entry is None else self._disagreement(entry, label)
            known = self._conflicts.get((unit, label))
            is_news = is_news or bool(why) or known is not None
            if not why:
                self._conflicts.pop((unit, label), None)
                continue
            text = f"label {label} is not shared with {unit}: {why}"
            self._note_once(text)
            if known is None or known.text != text[:MAX_TEXT]:
                self._conflicts[unit, label] = ConditionEntry(text=text[:MAX_TEXT], since_us=now_us)
        if is_news:
            self._due_us = max(now_us, self._told_us + BETWEEN_US)

    def _note_once(self, text: str) -> None:
        if text not in self._noted and len(self._noted) < NOTED:
            self._noted.add(text)
            self._note(text)

    def conditions(self) -> Iterable[ConditionEntry]:
        return tuple(self._conflicts.values())[:LISTED]

    @property
    def deadline_us(self) -> int | None:
        return self._due_us

    def on_time(self, now_us: int) -> None:
        if self._due_us is not None and now_us >= self._due_us:
            self._due_us, self._told_us = None, now_us
            self._offer(now_us)
