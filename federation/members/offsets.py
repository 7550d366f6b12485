"""Asks every peer what its clock says, and answers the same question of others."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from dyknow.federation import keys
from dyknow.federation.members.clock import PING_TIMEOUT_US, TOGETHER_US, Offset, OffsetEstimator, Standing
from dyknow.federation.members.deadlines import Deadlines
from dyknow.federation.messages.codec import Ping, Pong, decode_ping, decode_pong, encode_ping, encode_pong
from dyknow.federation.transport import Answer, Answered, AnswerEnd, Ask, Asked, AskEnded
from dyknow.model.errors import DecodeError

ABSENT = 512
SETTLE_US, SETTLE_PER_PEER_US = 100_000, 20_000
"""How long a peer is met before its clock is asked for: the rush of meeting would spoil what is measured."""
_ANSWERED = ("", 0)


class Compared(NamedTuple):
    """The clock of `unit` was compared with ours; `is_news`: it stands otherwise than before."""

    unit: str
    is_news: bool


class ClockOffsets:
    """The clock offset of each peer that is there. Times are the node clock; stamps are those of arrival.

    `questions` numbers the questions of the whole node.
    """

    def __init__(self, boot: int, questions: Iterator[int]) -> None:
        self.boot = boot
        self.refused = 0
        self._questions = questions
        self._estimators: dict[str, OffsetEstimator] = {}
        self._absent: dict[str, OffsetEstimator] = {}
        self._asked: dict[int, tuple[str, int]] = {}
        self._due: Deadlines[str] = Deadlines()

    def of(self, unit: str) -> Offset | None:
        """How far the clock of `unit` is ahead of ours, or None before that is known."""
        estimator = self._estimators.get(unit)
        return None if estimator is None else estimator.offset

    def last(self, unit: str) -> Offset | None:
        """The same, or, of one that is gone, what was learned last: streams of a platform that left may continue (thesis 9.3.4)."""
        estimator = self._estimators.get(unit) or self._absent.get(unit)
        return None if estimator is None else estimator.offset

    def standing(self, unit: str) -> Standing:
        estimator = self._estimators.get(unit)
        return Standing.UNKNOWN if estimator is None else estimator.standing

    def all(self) -> Mapping[str, Offset | None]:
        """By unit, for display."""
        return {unit: estimator.offset for unit, estimator in self._estimators.items()}

    def on_appeared(self, unit: str, boot: int, now_us: int) -> None:
        """A peer is met: exchanges soon, later among many, which have more to learn of each other first. The same incarnation,
        seen again, keeps what was learned of it.
        """
        estimator = self._estimators.get(unit) or self._absent.pop(unit, None)
        if estimator is None or estimator.boot not in (None, boot):
            estimator = OffsetEstimator(now_us)
        estimator.hurry(now_us + SETTLE_US + SETTLE_PER_PEER_US * len(self._estimators))
        self._estimators[unit] = estimator
        self._due.set(unit, estimator.deadline_us)

    def on_gone(self, unit: str) -> None:
        """A peer is gone: it gets no questions; its offset is kept for its return."""
        estimator = self._estimators.pop(unit, None)
        if estimator is not None:
            self._due.set(unit, None)
            self._absent[unit] = estimator
            if len(self._absent) > ABSENT:
                del self._absent[next(iter(self._absent))]
        for question in [question for question, (asked, _) in self._asked.items() if asked == unit]:
            del self._asked[question]

    def on_asked(self, asked: Asked, now_us: int) -> list[Answer | AnswerEnd]:
        """Tell a peer when its question arrived, and when it was answered."""
        try:
            ping = decode_ping(asked.payload)
        except DecodeError:
            self.refused += 1
            return [AnswerEnd(asked.ask)]
        pong = Pong(self.boot, ping.sent_us, asked.at_us, max(asked.at_us, now_us))
        return [Answer(asked.ask, asked.key, encode_pong(pong)), AnswerEnd(asked.ask)]

    def on_answered(self, answered: Answered) -> Compared | None:
        """Take an answer, once; returns the comparison, or None if the question is none of ours."""
        unit, sent_us = self._asked.get(answered.question, _ANSWERED)
        estimator = self._estimators.get(unit)
        if estimator is None:
            return None
        self._asked[answered.question] = _ANSWERED
        try:
            pong = decode_pong(answered.payload)
        except DecodeError:
            self.refused += 1
            return Compared(unit, is_news=False)
        if pong.sent_us != sent_us:
            self.refused += 1
            return Compared(unit, is_news=False)
        before = estimator.standing
        estimator.on_stamps(pong.boot, sent_us, pong.received_us, pong.answered_us, answered.at_us)
        self._due.set(unit, estimator.deadline_us)
        return Compared(unit, estimator.standing is not before)

    def on_ask_ended(self, ended: AskEnded) -> bool:
        """No answer will come from now on; False if the question is none of ours."""
        return self._asked.pop(ended.question, None) is not None

    @property
    def deadline_us(self) -> int | None:
        return self._due.next_us

    def on_time(self, now_us: int) -> list[Ask]:
        """Ask the peers that are due, and with them those that are due soon: one step asks many."""
        due_us = self._due.next_us
        if due_us is None or now_us < due_us:
            return []
        asks = []
        for unit in self._due.pop_due(now_us + TOGETHER_US):
            estimator = self._estimators[unit]
            for _ in range(estimator.due(now_us)):
                question = next(self._questions)
                self._asked[question] = (unit, now_us)
                asks.append(Ask(question, keys.clock(unit), encode_ping(Ping(now_us)), PING_TIMEOUT_US))
            self._due.set(unit, estimator.deadline_us)
        return asks
