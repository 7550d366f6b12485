"""How far each peer's clock is from ours, asked again and again (semantics: offsets between platforms).

Times are the node clock.
"""

from collections.abc import Callable, Iterator

from agents.deadlines import Deadlines
from dyknow.errors import DecodeError
from federation import keys
from federation.clock import PING_TIMEOUT_US, Offset, OffsetEstimator, Standing
from federation.codec import Ping, Pong, decode_ping, decode_pong, encode_ping, encode_pong
from federation.transport import Answer, Answered, AnswerEnd, Ask, Asked, AskEnded, WireEffect


class Clocks:
    """One estimator per peer. `on_standing` is told when what a peer's clock allows changes."""

    def __init__(
        self,
        boot: int,
        questions: Iterator[int],
        emit: Callable[[WireEffect], None],
        on_standing: Callable[[str, int], None],
    ) -> None:
        self._boot, self._questions, self._emit, self._on_standing = boot, questions, emit, on_standing
        self._estimators: dict[str, OffsetEstimator] = {}
        self._standing: dict[str, Standing] = {}
        self._asked: dict[int, str] = {}
        self._deadlines: Deadlines[str] = Deadlines()

    def meet(self, unit: str, now_us: int) -> None:
        """A platform, or a new incarnation of it, is there: estimate anew."""
        self._estimators[unit] = OffsetEstimator(now_us)
        self._standing[unit] = Standing.UNKNOWN
        self._deadlines.set(unit, now_us)
        self.on_time(now_us)

    def forget(self, unit: str) -> None:
        self._estimators.pop(unit, None)
        self._standing.pop(unit, None)
        self._deadlines.set(unit, None)

    def offset(self, unit: str) -> Offset | None:
        found = self._estimators.get(unit)
        return None if found is None else found.offset

    def offset_us(self, unit: str) -> int:
        """The peer's node clock minus ours; 0 while it is not known."""
        found = self.offset(unit)
        return 0 if found is None else found.offset_us

    def standing(self, unit: str) -> Standing:
        return self._standing.get(unit, Standing.UNKNOWN)

    def on_asked(self, asked: Asked, now_us: int) -> None:
        """A peer asks what our clock shows."""
        try:
            ping = decode_ping(asked.payload)
        except DecodeError:
            self._emit(AnswerEnd(asked.ask))
            return
        pong = Pong(self._boot, ping.sent_us, asked.at_us, now_us)
        self._emit(Answer(asked.ask, asked.key, encode_pong(pong)))
        self._emit(AnswerEnd(asked.ask))

    def on_answered(self, answered: Answered) -> bool:
        """A peer's clock; False when the answer is to somebody else's question. Raises DecodeError."""
        unit = self._asked.get(answered.question)
        if unit is None:
            return False
        estimator = self._estimators.get(unit)
        pong = decode_pong(answered.payload)
        if estimator is None:
            return True
        estimator.on_stamps(pong.boot, pong.sent_us, pong.received_us, pong.answered_us, answered.at_us)
        self._deadlines.set(unit, estimator.deadline_us)
        standing = estimator.standing
        if standing is not self._standing[unit]:
            self._standing[unit] = standing
            self._on_standing(unit, answered.at_us)
        return True

    def on_ask_ended(self, ended: AskEnded) -> bool:
        return self._asked.pop(ended.question, None) is not None

    def on_time(self, now_us: int) -> None:
        for unit in self._deadlines.pop_due(now_us):
            estimator = self._estimators[unit]
            for _ in range(estimator.due(now_us)):
                question = next(self._questions)
                self._asked[question] = unit
                self._emit(Ask(question, keys.clock(unit), encode_ping(Ping(now_us)), PING_TIMEOUT_US))
            self._deadlines.set(unit, estimator.deadline_us)

    @property
    def deadline_us(self) -> int | None:
        return self._deadlines.next_us
