"""The piece of a divided area that this platform is to watch, as a stream under `assigned-area` (thesis 9.2.3).

An assignment carries the act that delegated the division, and is taken from the platform that leads it by that act:
`dyknow.agents.tasks.authority`. A platform that has no part in a division knows of it, too: it may have to lead it.

Times are the node clock, but for valid times.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

from dyknow import US_PER_S, Sample
from dyknow.agents.actions import COORDINATION, INFORMED, Action, Offer
from dyknow.agents.part import Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.tasks.authority import Authority, TaskEvidence
from dyknow.federation.members.liveness import PlatformAppeared, PlatformGone
from dyknow.federation.messages.acts import Act
from dyknow.federation.messages.contents import AssignArea, DivideArea
from dyknow.federation.messages.descriptions import ConditionEntry, LabelEntry
from dyknow.model.errors import Refused

LABEL: Final = "assigned-area"
PERIOD_US: Final = US_PER_S
MAX_BORDER: Final = 1000
"""Characters of a border in the stream; a longer one ends with dots."""

MOST, MOST_OF_ONE, MOST_FOR_ONE = 16, 8, 4
"""Pieces that are kept: in all, of one leader, and for one delegator that is no command centre."""


@dataclass(slots=True)
class AssignedPiece:
    """The newest assignment of one task, by the leader's incarnation; `gone_us`: since when the leader is gone."""

    leader: str
    boot: int
    content: AssignArea
    evidence: TaskEvidence
    gone_us: int | None = None


class AreaAssignment(Part):
    """See the module. Of the pieces of several tasks the one that was assigned last is in the stream.

    Attributes:
        pieces: by task.
        refused: assignments that were not taken, by the code of the refusal.
        on_led: takes a task that another platform leads from now on.
        on_piece: called when the pieces have changed.
    """

    offers = (Offer(COORDINATION, (Action(AssignArea, "on_assign", INFORMED),)),)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._clock, self._network, self._offer, self._note = ports.clock, ports.network, ports.offer, ports.note
        self._authority, self._translation = parts[Authority], ports.translation
        self._local = ports.translation.local_label(LABEL, ports.unit)
        parts[Authority].on_over.append(self.drop)
        parts[Authority].held.append(lambda: [piece.evidence for piece in self.known.values()])
        self.on_led: Callable[[str], None] = lambda _task: None
        self.on_piece: Callable[[], None] = lambda: None
        self.pieces: dict[str, AssignedPiece] = {}
        self._without: dict[str, AssignedPiece] = {}
        self.refused: Counter[str] = Counter()
        self._generations: dict[tuple[str, str], int] = {}
        self._due_us: int | None = None

    def labels(self) -> Iterable[LabelEntry]:
        """Offered while there is a piece."""
        return [self._translation.ontology.entry(LABEL, PERIOD_US)] if self.pieces else ()

    def conditions(self) -> Iterable[ConditionEntry]:
        """The leader of a division is gone, and no other has taken over yet."""
        return tuple(
            ConditionEntry(text=f"area of {task}: its leader {piece.leader} is gone"[:200], since_us=piece.gone_us)
            for task, piece in self.pieces.items()
            if piece.gone_us is not None
        )[:2]

    def on_assign(self, act: Act, content: AssignArea, now_us: int) -> None:
        """`(assign-area ...)`: of the leader of the task, with the act that delegated it.

        Raises:
            Refused: another sends it, there is no evidence for it, or there are too many pieces already.
        """
        sender = act.sender.unit
        try:
            evidence = self._authority.proven(act, content.task, (DivideArea,), now_us)
            self._authority.check_leads(evidence, sender, act.boot, now_us)
            self._check_room(sender, evidence)
            self._check_place(content, evidence)
        except Refused as refused:
            self.refused[refused.code] += 1
            raise
        self.on_led(content.task)
        self.assign(sender, act.boot, content, evidence, now_us)

    def _check_room(self, sender: str, evidence: TaskEvidence) -> None:
        others = [each for task, each in self.known.items() if task != evidence.task]
        owner = self._authority.owner
        of_sender = sum(owner(each.leader) == owner(sender) for each in others)
        for_one = sum(owner(each.evidence.delegator) == owner(evidence.delegator) for each in others)
        is_share = for_one < MOST_FOR_ONE or self._authority.is_centre(evidence.delegator)
        if of_sender >= MOST_OF_ONE or len(others) >= MOST or not is_share:
            text = f"there are {len(others)} pieces here, {of_sender} of {sender}, {for_one} for {evidence.delegator}"
            raise Refused(text, "too-many-pieces")

    def _check_place(self, content: AssignArea, evidence: TaskEvidence) -> None:
        corner = content.outside(evidence.content.area) if isinstance(evidence.content, DivideArea) else None
        if corner is not None:
            raise Refused(f"the piece has a place outside the area that is divided: {corner}", "outside")

    def assign(self, leader: str, boot: int, content: AssignArea, evidence: TaskEvidence, now_us: int) -> None:
        """Take what the leader of a task assigns, unless a later division by it is known."""
        task, has_been = content.task, bool(self.pieces)
        if content.generation < self._generations.get((task, leader), 0):
            self.refused["superseded"] += 1
            return
        self._generations[task, leader] = content.generation
        while len(self._generations) > 256:
            del self._generations[next(iter(self._generations))]
        had = self.pieces.pop(task, None)
        self._without.pop(task, None)
        piece = AssignedPiece(leader, boot, content, evidence)
        if content.rings:
            self.pieces[task] = piece
            self._note(
                f"area: {content.area_m2:.0f} m2 around {content.middle}, {content.share:.0%} of the whole, by {leader}, "
                f"delegated by {evidence.delegator}"
            )
        else:
            self._without[task] = piece
            if had is not None:
                self._note(f"area: none any longer, by {leader}")
        self._changed(has_been, now_us)

    def drop(self, task: str, now_us: int) -> None:
        """The task is over."""
        self._without.pop(task, None)
        had = self.pieces.pop(task, None)
        if had is not None:
            self._note(f"area: none any longer, by {had.leader}: the task is over")
            self._changed(True, now_us)

    def _changed(self, has_been: bool, now_us: int) -> None:
        if self.pieces and not self._network.has(self._local):
            self._network.add_source(self._local, self._translation.local_sort(LABEL))
        self._due_us = now_us if self.pieces else None
        self.on_piece()
        if has_been is not bool(self.pieces):
            self._offer(now_us)

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """A leader that is gone cannot renew its division, and one that was restarted knows nothing of it."""
        if isinstance(change, PlatformGone | PlatformAppeared):
            for piece in self.known.values():
                if piece.leader == change.unit:
                    is_gone = isinstance(change, PlatformGone) or change.boot != piece.boot
                    piece.gone_us = now_us if is_gone else None
                    self._offer(now_us)

    @property
    def known(self) -> dict[str, AssignedPiece]:
        """With the divisions in which this platform has no piece."""
        return {**self._without, **self.pieces}

    @property
    def deadline_us(self) -> int | None:
        return self._due_us

    def on_time(self, now_us: int) -> None:
        """Push the piece that was assigned last, on the grid of the stream."""
        if self._due_us is None or now_us < self._due_us or not self.pieces:
            return
        content = next(reversed(self.pieces.values())).content
        federation_us = self._clock.federation_us(now_us)
        valid_us = federation_us // PERIOD_US * PERIOD_US
        self._due_us = self._clock.wall_us(valid_us + PERIOD_US)
        latitude_deg, longitude_deg = map(float, content.middle.split())
        border = "; ".join(", ".join(ring.corners) for ring in content.rings)
        border = border if len(border) <= MAX_BORDER else f"{border[:MAX_BORDER]}..."
        value = (latitude_deg, longitude_deg, content.area_m2, content.share, border)
        conversion = self._translation.to_local(LABEL)
        self._network.push(self._local, conversion.sample(Sample(federation_us, valid_us, value)))
