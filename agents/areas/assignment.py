"""The piece of a divided area that this platform is to watch, as a stream under `assigned-area` (thesis 9.2.3).

Times are the node clock, but for valid times.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

from agents.actions import COORDINATION, INFORMED, Action, Offer
from agents.part import Part, PeerChange
from dyknow import US_PER_S, Network
from dyknow.model.errors import Refused
from federation.members.clock import FederationClock
from federation.members.liveness import Departure, PlatformAppeared, PlatformGone
from federation.messages.acts import Act
from federation.messages.contents import AssignArea
from federation.messages.descriptions import ConditionEntry, LabelEntry
from federation.sharing.translation import Translation

LABEL: Final = "assigned-area"
PERIOD_US: Final = US_PER_S
MAX_BORDER: Final = 1000
"""Characters of a border in the stream; a longer one ends with dots."""


@dataclass(slots=True)
class AssignedPiece:
    """The newest assignment of one task, by which life of its leader; `gone_us`: since when the leader is gone."""

    leader: str
    boot: int
    content: AssignArea
    gone_us: int | None = None


class AreaAssignment(Part):
    """See the module. Of the pieces of several tasks the one that was assigned last is in the stream.

    Attributes:
        pieces: by task.
        refused: assignments that were not taken, by reason.
    """

    offers = (Offer(COORDINATION, (Action(AssignArea, "on_assign", INFORMED),)),)

    def __init__(
        self,
        unit: str,
        clock: FederationClock,
        network: Network,
        translation: Translation,
        offer: Callable[[int], None],
        note: Callable[[str], None],
    ) -> None:
        self._unit, self._clock, self._network, self._offer, self._note = unit, clock, network, offer, note
        self._translation, self._local = translation, translation.local_label(LABEL, unit)
        self.pieces: dict[str, AssignedPiece] = {}
        self.refused: Counter[str] = Counter()
        self._generations: dict[str, int] = {}
        self._due_us: int | None = None

    def labels(self) -> Iterable[LabelEntry]:
        """Offered while there is a piece."""
        if not self.pieces:
            return ()
        known = self._translation.ontology[LABEL]
        return (LabelEntry(label=LABEL, sort=known.sort.name, type_hash=known.type_hash, period_us=PERIOD_US),)

    def conditions(self) -> Iterable[ConditionEntry]:
        """The leader of a division is gone: it would not be renewed."""
        return tuple(
            ConditionEntry(text=f"area of {task}: its leader {piece.leader} is gone"[:200], since_us=piece.gone_us)
            for task, piece in self.pieces.items()
            if piece.gone_us is not None
        )[:2]

    def on_assign(self, act: Act, content: AssignArea, now_us: int) -> None:
        """`(assign-area ...)`: of the platform that the task was delegated to, which is in the task's name.

        Raises:
            Refused: another sends it.
        """
        sender = act.sender.unit
        if not content.task.endswith(f".{sender}"):
            self.refused["not its task"] += 1
            raise Refused(f"{sender} does not lead {content.task}", "not-its-task")
        self.assign(sender, act.boot, content, now_us)

    def assign(self, leader: str, boot: int, content: AssignArea, now_us: int) -> None:
        """Take what the leader of a task assigns, unless a later division is known."""
        task, has_been = content.task, bool(self.pieces)
        if content.generation < self._generations.get(task, 0):
            self.refused["superseded"] += 1
            return
        self._generations[task] = content.generation
        while len(self._generations) > 256:
            del self._generations[next(iter(self._generations))]
        had = self.pieces.pop(task, None)
        if content.rings:
            self.pieces[task] = AssignedPiece(leader, boot, content)
            self._note(
                f"area: {content.area_m2:.0f} m2 around {content.middle}, {content.share:.0%} of the whole, by {leader}"
            )
        elif had is not None:
            self._note(f"area: none any longer, by {leader}")
        self._changed(has_been, now_us)

    def _changed(self, has_been: bool, now_us: int) -> None:
        if self.pieces and not self._network.has(self._local):
            self._network.add_source(self._local, self._translation.local_sort(LABEL))
        self._due_us = now_us if self.pieces else None
        if has_been is not bool(self.pieces):
            self._offer(now_us)

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """A leader that is gone cannot renew its division, and one that was restarted knows nothing of it."""
        if isinstance(change, PlatformGone | PlatformAppeared):
            has_been = bool(self.pieces)
            for task, piece in list(self.pieces.items()):
                if piece.leader != change.unit:
                    continue
                piece.gone_us = now_us if isinstance(change, PlatformGone) else None
                if change.why is Departure.LEFT if isinstance(change, PlatformGone) else change.boot != piece.boot:
                    del self.pieces[task]
                self._offer(now_us)
            self._changed(has_been, now_us)

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
        self._network.push(self._local, valid_us, conversion(value), federation_us)
