"""Real platforms and the command centre on a fake wire and clock, in this process; vehicles fly straight lines."""

from collections import deque
from collections.abc import Callable, Iterator
from heapq import heappop, heappush
from itertools import count
from queue import Empty
from typing import Any

from agents.config import PlatformConfig
from agents.effects import Halt, InjectFault, LeaveRequested, Reported
from agents.platform import Platform
from federation import keys
from federation.members.clock import FederationClock
from federation.transport import (
    Answer,
    Answered,
    AnswerEnd,
    Arrived,
    Ask,
    Asked,
    AskEnded,
    DeclareQueryable,
    DeclareToken,
    Put,
    Subscribe,
    TokenChanged,
    UndeclareToken,
    Unsubscribe,
    WatchTokens,
)
from navigation.geodesy import LocalFrame
from navigation.vehicle import BatteryReport, HomeReport, PositionReport, StatusReport, VelocityReport
from runtime.client import Surroundings

START_US = 1_800_000_000_000_000
HOP_US = 200
PERIOD_US = 100_000
FRAME = LocalFrame(55.7, 13.5, 20.0)


class Session:
    """One participant's session: what it declared."""

    def __init__(self, name: str, take: Callable[[Any], None]) -> None:
        self.name, self.take = name, take
        self.subscribed: list[str] = []
        self.answers: list[str] = []
        self.tokens: list[str] = []
        self.watches = False
        self.frozen = False
        self.closed = False


class World:
    """Everything happens in `run_until`; events of one instant in the order in which they were caused."""

    def __init__(self, clock: FederationClock | None = None) -> None:
        self.now_us, self.clock = START_US, clock or FederationClock()
        self.sessions: list[Session] = []
        self.platforms: dict[str, tuple[Platform, Session]] = {}
        self.injected: list[InjectFault] = []
        self.lacking: set[type] = set()
        """Kinds of reports that vehicles do not send any more."""
        self.delay_us = 0
        """How long a report is under way from its vehicle."""
        self._queue: list[tuple[int, int, Callable[[], None]]] = []
        self._numbers = count()
        self._asks: dict[int, tuple[Session, Ask]] = {}

    # Who takes part

    def add(self, unit: str, north_m: float, east_m: float, north_m_s: float = 0.0, **config: Any) -> Platform:
        """A platform whose vehicle flies north at a constant speed, 40 m above home."""
        found = PlatformConfig(
            unit, self.now_us // 1000, zid=f"{1000 + len(self.sessions):x}", clock=self.clock, simulated=True, **config
        )
        platform = Platform(found, self.now_us)
        session = Session(unit, lambda event: self._step(unit, lambda: platform.on_event(event, self.now_us)))
        self.sessions.append(session)
        self.platforms[unit] = (platform, session)
        self._perform(session, platform.start(self.now_us))
        self._report(unit, 0, north_m, east_m, north_m_s)
        return platform

    def freeze(self, unit: str) -> None:
        self.platforms[unit][1].frozen = True

    def leave(self, unit: str) -> None:
        """It says good-bye and ends."""
        self._step(unit, lambda: self.platforms[unit][0].on_event(LeaveRequested(self.now_us), self.now_us))
        self.kill(unit)

    def kill(self, unit: str) -> None:
        _, session = self.platforms.pop(unit)
        self._close(session)

    def surroundings(self) -> Surroundings:
        """For a client: its waiting makes the world go on."""
        inbox: deque[Any] = deque()
        world = self

        class Waiting:
            def put(self, item: Any, /) -> None:
                inbox.append(item)

            def get(self, block: bool = True, timeout: float | None = None) -> Any:
                until_us = world.now_us + round((timeout or 0.0) * 1e6)
                while not inbox:
                    if not world.next_before(until_us):
                        raise Empty
                return inbox.popleft()

        class Wire:
            def __init__(self, post: Callable[[Any], None]) -> None:
                self.session = Session("cc", post)
                self.zid = f"{1000 + len(world.sessions):x}"
                world.sessions.append(self.session)

            def perform(self, effect: Any) -> None:
                world._perform(self.session, [effect])

            def close(self) -> None:
                world._close(self.session)

        return Surroundings(Waiting(), lambda: self.now_us, lambda post, _now_us: Wire(post))

    # Time

    def run(self, seconds: float) -> None:
        until_us = self.now_us + round(seconds * 1e6)
        while self.next_before(until_us):
            pass

    def next_before(self, until_us: int) -> bool:
        """Do the next thing that is due by `until_us`; False, and that time, if there is none."""
        due = [(p.deadline_us, unit) for unit, (p, session) in self.platforms.items() if not session.frozen]
        timer_us, unit = min(due, default=(until_us + 1, ""))
        if self._queue and self._queue[0][0] <= min(timer_us, until_us):
            at_us, _, happen = heappop(self._queue)
            self.now_us = max(self.now_us, at_us)
            happen()
            return True
        if timer_us <= until_us:
            self.now_us = max(self.now_us, timer_us)
            platform = self.platforms[unit][0]
            self._step(unit, lambda: platform.on_time(self.now_us))
            return True
        self.now_us = until_us
        return False

    def _step(self, unit: str, step: Callable[[], Any]) -> None:
        entry = self.platforms.get(unit)
        if entry is not None and not entry[1].frozen:
            self._perform(entry[1], step())

    def _report(self, unit: str, number: int, north_m: float, east_m: float, north_m_s: float) -> None:
        if unit not in self.platforms:
            return
        now_us = self.now_us
        valid_us = self.clock.federation_us(now_us)
        place = FRAME.from_ned(north_m + north_m_s * number * PERIOD_US / 1e6, east_m, -40.0)
        home = FRAME.from_ned(north_m, east_m, 0.0)
        for report in (
            HomeReport(valid_us, *home),
            StatusReport(valid_us, True, True, True, "GUIDED"),
            BatteryReport(valid_us, 0.8),
            PositionReport(valid_us, "global", *place, 0.3, 0.3, 40.0),
            VelocityReport(valid_us, "global", north_m_s, 0.0, 0.0, 0.1),
        ):
            event = Reported(now_us, report)
            if type(report) not in self.lacking:
                self._reach(unit, event)
        self._later(PERIOD_US, lambda: self._report(unit, number + 1, north_m, east_m, north_m_s))

    def _reach(self, unit: str, event: Reported) -> None:
        """A report arrives, at once or after `delay_us`."""

        def arrive() -> None:
            self._step(unit, lambda: self.platforms[unit][0].on_event(event._replace(at_us=self.now_us), self.now_us))

        if self.delay_us:
            self._later(self.delay_us, arrive)
        else:
            arrive()

    # The wire

    def _later(self, after_us: int, happen: Callable[[], None]) -> None:
        heappush(self._queue, (self.now_us + after_us, next(self._numbers), happen))

    def _deliver(self, session: Session, event: Any) -> None:
        def arrive() -> None:
            if not session.closed and not session.frozen:
                session.take(event._replace(at_us=self.now_us))

        self._later(HOP_US, arrive)

    def _others(self, session: Session) -> Iterator[Session]:
        return (other for other in self.sessions if other is not session and not other.closed)

    def _perform(self, session: Session, effects: Any) -> None:
        for effect in effects:
            match effect:
                case Put(key, payload):
                    for other in self._others(session):
                        if any(keys.matches(expr, key) for expr in other.subscribed):
                            self._deliver(other, Arrived(key, 0, payload))
                case Subscribe(expr):
                    session.subscribed.append(expr)
                case Unsubscribe(expr):
                    session.subscribed.remove(expr)
                case DeclareQueryable(expr):
                    session.answers.append(expr)
                case DeclareToken(key):
                    session.tokens.append(key)
                    self._tell_token(session, key, alive=True)
                case UndeclareToken(key):
                    if key in session.tokens:
                        session.tokens.remove(key)
                        self._tell_token(session, key, alive=False)
                case WatchTokens():
                    session.watches = True
                    for other in self._others(session):
                        for key in other.tokens:
                            self._deliver(session, TokenChanged(key, 0, alive=True))
                case Ask():
                    self._ask(session, effect)
                case Answer(ask, key, payload):
                    asker, asked = self._asks[ask]
                    self._deliver(asker, Answered(asked.question, key, 0, payload))
                case AnswerEnd(ask):
                    asker, asked = self._asks.pop(ask)
                    self._deliver(asker, AskEnded(asked.question, 0))
                case InjectFault():
                    self.injected.append(effect)
                case Halt(reason):
                    raise AssertionError(f"{session.name} halts: {reason}")

    def _ask(self, session: Session, ask: Ask) -> None:
        able = [o for o in self._others(session) if any(keys.matches(expr, ask.key) for expr in o.answers)]
        if not able:
            self._deliver(session, AskEnded(ask.question, 0))
        for other in able:
            number = next(self._numbers)
            self._asks[number] = (session, ask)
            self._deliver(other, Asked(number, ask.key, 0, ask.payload))

    def _tell_token(self, session: Session, key: str, *, alive: bool) -> None:
        for other in self._others(session):
            if other.watches:
                self._deliver(other, TokenChanged(key, 0, alive))

    def _close(self, session: Session) -> None:
        session.closed = True
        for key in session.tokens:
            self._tell_token(session, key, alive=False)
