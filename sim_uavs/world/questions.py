"""Questions on the wire in a box: to every queryable that matches, with answers until all ended or the time is over."""

from collections.abc import Callable
from typing import TypeAlias

from dyknow.federation.transport import Answer, Answered, AnswerEnd, Ask, Asked, AskEnded
from dyknow.sim_uavs.world.agenda import Agenda
from dyknow.sim_uavs.world.routes import DeclaredRoutes
from dyknow.sim_uavs.world.sessions import Direction, Session, Transport

UNANSWERED_US = 100
"""How long it takes to notice that there is no recipient."""


class WorldQuestion:
    """One question of one session; `open` are the asks of it that have not ended."""

    __slots__ = ("number", "open", "requester")

    def __init__(self, requester: Session, number: int) -> None:
        self.requester, self.number = requester, number
        self.open: dict[int, AskOf] = {}


class AskOf:
    """A question at one of its recipients; `last_us` is when its last answer arrives."""

    __slots__ = ("ask", "back", "last_us", "question", "transport")

    def __init__(self, ask: int, question: WorldQuestion, transport: Transport, back: Direction) -> None:
        self.ask, self.question, self.transport, self.back = ask, question, transport, back
        self.last_us = 0


Send: TypeAlias = Callable[..., int]
"""(direction, not before, action, its arguments): puts a message on its way; when it arrives, or 0 if it is lost."""


class Questions:
    """All open questions and their possible recipients."""

    def __init__(self, agenda: Agenda, send: Send) -> None:
        self._agenda, self._send = agenda, send
        self._queryables = DeclaredRoutes()
        self._recipients: dict[str, tuple[Session, ...]] = {}  # by key, until a queryable comes or goes
        self._asks = 0
        self._asked: dict[int, AskOf] = {}
        self._open: dict[tuple[int, int], WorldQuestion] = {}

    def __len__(self) -> int:
        return len(self._open)

    def of(self, requester: Session) -> list[WorldQuestion]:
        return [question for question in self._open.values() if question.requester is requester]

    def ask(self, requester: Session, effect: Ask) -> None:
        """Ask every session whose queryable matches; those out of reach keep the requester waiting."""
        question = self._open[requester.number, effect.question] = WorldQuestion(requester, effect.question)
        recipients = self._recipients.get(effect.key)
        if recipients is None:
            recipients = self._recipients[effect.key] = tuple(self._queryables.matching(effect.key))
        for session in recipients:
            transport = requester.transports.get(session.number)
            if transport is not None and transport.up:
                self._asks += 1
                direction = transport.direction(requester)
                asked = AskOf(self._asks, question, transport, transport.direction(session))
                self._asked[asked.ask] = question.open[asked.ask] = asked
                if direction.passes:
                    self._send(direction, 0, direction.to.take, Asked, effect.payload, asked.ask, effect.key)
        wait_us = effect.timeout_us if question.open else UNANSWERED_US
        self._agenda.at(self._agenda.now_us + wait_us, self.end, question)

    def declare(self, session: Session, key_expr: str) -> None:
        """From now on `session` gets questions that match."""
        session.queryables.setdefault(key_expr)
        self._queryables.add(session, key_expr)
        self._recipients.clear()

    def open(self, session: Session) -> None:
        """A session is there that has declared already what the one before it did."""
        for key_expr in session.queryables:
            self._queryables.add(session, key_expr)
        self._recipients.clear()

    def answer(self, by: Session, effect: Answer) -> None:
        asked = self._asked.get(effect.ask)
        if asked is not None and asked.back.by is by and asked.back.passes:
            at_us = self._send(asked.back, 0, self._answered, asked, effect.key, effect.payload)
            asked.last_us = max(asked.last_us, at_us)

    def answer_end(self, by: Session, effect: AnswerEnd) -> None:
        asked = self._asked.get(effect.ask)
        if asked is not None and asked.back.by is by and asked.back.passes:
            self._send(asked.back, asked.last_us, self._ended, asked)

    def _answered(self, asked: AskOf, key: str, payload: bytes) -> None:
        question = asked.question
        if asked.ask in question.open:
            question.requester.take(Answered, payload, question.number, key)

    def _ended(self, asked: AskOf) -> None:
        question = asked.question
        self._asked.pop(asked.ask, None)
        if question.open.pop(asked.ask, None) is not None and not question.open:
            self.end(question)

    def end(self, question: WorldQuestion) -> None:
        """No more answers: all ended, the time is over, or the session closes."""
        if self._open.pop((question.requester.number, question.number), None) is None:
            return
        for ask in question.open:
            self._asked.pop(ask, None)
        question.open.clear()
        requester = question.requester
        if requester.alive:
            requester.post(AskEnded(question.number, requester.now_us()))

    def down(self, transport: Transport) -> None:
        """End the questions over a transport that is down."""
        for asked in [asked for asked in self._asked.values() if asked.transport is transport]:
            self._ended(asked)

    def forget(self, requester: Session) -> None:
        """Forget a closed session as requester and as recipient."""
        for key_expr in requester.queryables:
            self._queryables.discard(requester, key_expr)
        self._recipients.clear()
        for question in self.of(requester):
            for ask in question.open:
                self._asked.pop(ask, None)
            del self._open[requester.number, question.number]
