"""The piece of a divided area that this platform is to watch, as a stream under `assigned-area` (thesis 9.2.3).

The leader of a division is the platform that it was delegated to, which is in the name of its task, and while that is gone
a successor: the first of the platforms with a piece, by unit. A successor that is not known yet is followed if the leader
is not there; of two the one that sorts first is, and the platform that the task was delegated to always.

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
from federation.members.directory import DirectoryFacilitator, unit_order
from federation.members.liveness import PlatformAppeared, PlatformGone
from federation.messages.acts import Act
from federation.messages.contents import AssignArea
from federation.messages.descriptions import ConditionEntry, LabelEntry
from federation.sharing.translation import Translation

LABEL: Final = "assigned-area"
PERIOD_US: Final = US_PER_S
MAX_BORDER: Final = 1000
"""Characters of a border in the stream; a longer one ends with dots."""

MOST, MOST_OF_ONE = 16, 8
"""Pieces that are kept, in all and of one leader."""


@dataclass(slots=True)
class AssignedPiece:
    """The newest assignment of one task, by which life of its leader; `gone_us`: since when the leader is gone.

    `delegate_boot` is the life of the platform that the task was delegated to.
    """

    leader: str
    boot: int
    content: AssignArea
    delegate_boot: int
    gone_us: int | None = None


class AreaAssignment(Part):
    """See the module. Of the pieces of several tasks the one that was assigned last is in the stream.

    Attributes:
        pieces: by task.
        refused: assignments that were not taken, by reason.
        on_led: takes a task that another platform leads from now on.
        on_piece: called when the pieces have changed.
    """

    offers = (Offer(COORDINATION, (Action(AssignArea, "on_assign", INFORMED),)),)

    def __init__(
        self,
        unit: str,
        boot: int,
        clock: FederationClock,
        directory: DirectoryFacilitator,
        network: Network,
        translation: Translation,
        offer: Callable[[int], None],
        note: Callable[[str], None],
    ) -> None:
        self._unit, self._boot, self._clock, self._network, self._offer, self._note = (
            unit,
            boot,
            clock,
            network,
            offer,
            note,
        )
        self._directory, self._translation, self._local = directory, translation, translation.local_label(LABEL, unit)
        self.on_led: Callable[[str], None] = lambda _task: None
        self.on_piece: Callable[[], None] = lambda: None
        self.pieces: dict[str, AssignedPiece] = {}
        self.refused: Counter[str] = Counter()
        self._generations: dict[tuple[str, str], int] = {}
        self._due_us: int | None = None

    def labels(self) -> Iterable[LabelEntry]:
        """Offered while there is a piece."""
        if not self.pieces:
            return ()
        known = self._translation.ontology[LABEL]
        return (LabelEntry(label=LABEL, sort=known.sort.name, type_hash=known.type_hash, period_us=PERIOD_US),)

    def conditions(self) -> Iterable[ConditionEntry]:
        """The leader of a division is gone, and no other has taken over yet."""
        return tuple(
            ConditionEntry(text=f"area of {task}: its leader {piece.leader} is gone"[:200], since_us=piece.gone_us)
            for task, piece in self.pieces.items()
            if piece.gone_us is not None
        )[:2]

    def on_assign(self, act: Act, content: AssignArea, now_us: int) -> None:
        """`(assign-area ...)`: of the leader of the task.

        Raises:
            Refused: another sends it, the task is of another delegator, or there are too many pieces already.
        """
        sender = act.sender.unit
        if content.delegator is not None and not content.task.startswith(f"{content.delegator}-"):
            self.refused["not its delegator"] += 1
            raise Refused(
                f"{content.task} was not asked for by {content.delegator}: its name says by whom", "delegator"
            )
        of_sender = [task for task, piece in self.pieces.items() if piece.leader == sender and task != content.task]
        if content.rings and (len(of_sender) >= MOST_OF_ONE or len({*self.pieces, content.task}) > MOST):
            self.refused["too many pieces"] += 1
            raise Refused(f"there are {len(self.pieces)} pieces here, {len(of_sender)} of {sender}", "too-many-pieces")
        if not self._may_lead(sender, content):
            self.refused["not its task"] += 1
            raise Refused(f"{sender} does not lead {content.task}", "not-its-task")
        self.on_led(content.task)
        self.assign(sender, act.boot, content, now_us)

    def _may_lead(self, sender: str, content: AssignArea) -> bool:
        delegate = content.task.rpartition(".")[2]
        if sender == delegate:
            return True
        piece = self.pieces.get(content.task)
        if piece is None or piece.gone_us is not None:
            return not self._is_there(delegate, content.delegate_boot if piece is None else piece.delegate_boot)
        is_before = piece.leader != delegate and unit_order(sender) < unit_order(piece.leader)
        return sender == piece.leader or is_before

    def _is_there(self, delegate: str, boot: int) -> bool:
        """Whether the life of a platform to which a task was delegated leads it."""
        if delegate == self._unit:
            return boot == self._boot
        entry = self._directory.entry(delegate)
        return self._directory.is_present(delegate) and entry is not None and entry.boot == boot

    def assign(self, leader: str, boot: int, content: AssignArea, now_us: int) -> None:
        """Take what the leader of a task assigns, unless a later division by it is known."""
        task, has_been = content.task, bool(self.pieces)
        if content.generation < self._generations.get((task, leader), 0):
            self.refused["superseded"] += 1
            return
        self._generations[task, leader] = content.generation
        while len(self._generations) > 256:
            del self._generations[next(iter(self._generations))]
        had = self.pieces.pop(task, None)
        if content.rings:
            self.pieces[task] = AssignedPiece(leader, boot, content, content.delegate_boot)
            self._note(
                f"area: {content.area_m2:.0f} m2 around {content.middle}, {content.share:.0%} of the whole, by {leader}"
            )
        elif had is not None:
            self._note(f"area: none any longer, by {leader}")
        self._changed(has_been, now_us)

    def drop(self, task: str, now_us: int) -> None:
        """No platform leads the task any longer."""
        if self.pieces.pop(task, None) is not None:
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
            for piece in self.pieces.values():
                if piece.leader == change.unit:
                    is_gone = isinstance(change, PlatformGone) or change.boot != piece.boot
                    piece.gone_us = now_us if is_gone else None
                    self._offer(now_us)

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
