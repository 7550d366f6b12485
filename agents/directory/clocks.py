"""Clock offsets between this platform and the others: measured and judged."""

from collections.abc import Callable

from agents.effects import Effect
from agents.part import NOT_MINE, ClockCompared, Followed, Part, PeerChange
from federation import keys
from federation.members.liveness import PlatformAppeared, PlatformGone
from federation.members.offsets import ClockOffsets
from federation.transport import Answered, Asked, AskEnded, DeclareQueryable


class Clocks(Part):
    """The exchange of clock readings with every peer.

    Args:
        on_peer: called when a clock was compared.
    """

    takes = {keys.ClockKey: "on_asked", Answered: "on_answered", AskEnded: "on_ask_ended"}  # noqa: RUF012

    def __init__(
        self,
        unit: str,
        offsets: ClockOffsets,
        emit: Callable[[Effect], None],
        on_peer: Callable[[PeerChange, int], None],
    ) -> None:
        self._unit, self.offsets, self._emit, self._on_peer = unit, offsets, emit, on_peer

    def start(self, _now_us: int) -> None:
        self._emit(DeclareQueryable(keys.clock(self._unit)))

    def on_asked(self, event: Asked, now_us: int) -> Followed:
        for effect in self.offsets.on_asked(event, now_us):
            self._emit(effect)
        return None

    def on_answered(self, event: Answered, now_us: int) -> Followed:
        unit = self.offsets.on_answered(event)
        if unit is None:
            return NOT_MINE
        self._on_peer(ClockCompared(unit), now_us)
        return None

    def on_ask_ended(self, event: AskEnded, _now_us: int) -> Followed:
        return () if self.offsets.on_ask_ended(event) else NOT_MINE

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        if isinstance(change, PlatformAppeared):
            self.offsets.on_appeared(change.unit, change.boot, now_us)
        elif isinstance(change, PlatformGone):
            self.offsets.on_gone(change.unit)

    @property
    def deadline_us(self) -> int | None:
        return self.offsets.deadline_us

    def on_time(self, now_us: int) -> None:
        for effect in self.offsets.on_time(now_us):
            self._emit(effect)
