"""Where edges leave events for the node thread: many threads post, one takes, and a poster is never blocked.

Bounded by conflation. Every event belongs to a lane, and a lane has a limit; when it is full, either its oldest event
gives way (the newest counts, or numbers recover what is lost) or the new one is refused (its sender was to wait). A
lost event is counted and reported to the node as `Conflated`.

A stream key keeps 512 samples, a heartbeat key its newest, a sender 64 acts, a token its last 16 changes, a question
1024 answers, a queryable 64 questions, a kind of vehicle report its newest 256. When `LIMIT` events wait in all,
everything new is refused but the end of a question.

The queue holds what to take (the lane's `popleft`) instead of events, so that giving way needs no search. A lane never
holds fewer events than the queue holds for it: a poster adds first, then takes the oldest away or says that there is
more to take. So the usual way through needs no lock; a lane that is full or new does.
"""

import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Hashable
from functools import partial
from queue import SimpleQueue
from typing import Any, NamedTuple

from dyknow.agents.effects import Computed, HostEvent, Reported, SearchOver
from dyknow.federation.transport import Answered, Arrived, Asked, AskEnded, Conflated, HandlerFailed, TokenChanged

LIMIT = 50_000
_FEW_LANES = 4096


class Rule(NamedTuple):
    """How many events a lane holds, and whether its oldest gives way to a new one."""

    bound: int
    gives_way: bool


SAMPLES = Rule(512, gives_way=True)
NEWEST = Rule(1, gives_way=True)
ACTS = Rule(64, gives_way=False)
CHANGES = Rule(16, gives_way=True)
ANSWERS = Rule(1024, gives_way=False)
QUESTIONS = Rule(64, gives_way=False)
FAILURES = Rule(16, gives_way=False)
REPORTS = Rule(256, gives_way=True)
ENDS = Rule(sys.maxsize, gives_way=False)

_ARRIVALS = {"x": SAMPLES, "hb": NEWEST}


class _Lane:
    __slots__ = ("bound", "dropped", "gives_way", "name", "take", "tell", "waiting")

    def __init__(self, name: str, rule: Rule, told: Callable[["_Lane"], Conflated]) -> None:
        self.name, (self.bound, self.gives_way) = name, rule
        self.waiting: deque[Any] = deque()
        self.take = self.waiting.popleft
        self.tell = partial(told, self)
        self.dropped = 0


class Mailbox:
    """Any thread may `post`; the node thread alone calls `get`.

    Args:
        now_us: the node clock, for the stamps of `Conflated`.

    Attributes:
        waited_us: how long `get` has waited, all in all.
        pause_s: how long `get`, when it had to wait, waits on after the first event, for the others that come with it.
    """

    def __init__(self, now_us: Callable[[], int]) -> None:
        self._now_us = now_us
        self._lock = threading.Lock()
        self._queue: SimpleQueue[Callable[[], Any]] = SimpleQueue()
        self._by_key: dict[str, _Lane] = {}
        self._lanes: dict[Hashable, _Lane] = {}
        self._many = _FEW_LANES
        self.waited_us = 0
        self.pause_s = 0.0

    def __len__(self) -> int:
        return self._queue.qsize()

    def post(self, event: Any) -> None:
        """Leave `event` for the node thread. Returns at once, whatever happens to it."""
        lane = (self._by_key.get(event.key) if type(event) is Arrived else None) or self._lane_of(event)
        if len(lane.waiting) < lane.bound and self._queue.qsize() < LIMIT:
            lane.waiting.append(event)
            self._queue.put(lane.take)
        else:
            self._conflate(lane, event)

    def get(self, timeout: float | None = None) -> Any:
        """The next event; a timeout of 0 does not wait.

        Raises:
            queue.Empty: none came within `timeout` seconds.
        """
        if timeout == 0 or self._queue.qsize():
            return self._queue.get(timeout != 0, timeout)()
        began_us = self._now_us()
        try:
            take = self._queue.get(timeout=timeout)
            if self.pause_s:
                time.sleep(self.pause_s)
        finally:
            self.waited_us += self._now_us() - began_us
        return take()

    def _conflate(self, lane: _Lane, event: Any) -> None:
        with self._lock:
            if lane.bound == ENDS.bound:
                lane.waiting.append(event)
                self._queue.put(lane.take)
                return
            if lane.gives_way and lane.waiting:
                lane.waiting.append(event)
                lane.waiting.popleft()
            lane.dropped += 1
            if lane.dropped == 1:
                self._queue.put(lane.tell)

    def _told(self, lane: _Lane) -> Conflated:
        with self._lock:
            count, lane.dropped = lane.dropped, 0
        return Conflated(lane.name, self._now_us(), count)

    def _lane_of(self, event: Any) -> _Lane:
        address, name, rule = _place(event)
        with self._lock:
            lane = self._lanes.get(address)
            if lane is None:
                self._forget_empty_lanes()
                lane = self._lanes[address] = _Lane(name, rule, self._told)
            if type(event) is Arrived:
                self._by_key[event.key] = lane
        return lane

    def _forget_empty_lanes(self) -> None:
        if len(self._by_key) + len(self._lanes) < self._many:
            return
        self._by_key = {key: lane for key, lane in self._by_key.items() if lane.waiting}
        self._lanes = {address: lane for address, lane in self._lanes.items() if lane.waiting}
        self._many = max(_FEW_LANES, 2 * (len(self._by_key) + len(self._lanes)))


def _place(event: Any) -> tuple[Hashable, str, Rule]:
    """Which lane an event belongs to, what it is called in reports, and its rule."""
    match event:
        case Arrived(key=key):
            purpose, *rest = key.split("/")
            if purpose == "acl" and len(rest) > 1:
                return (Arrived, "acl", rest[1]), key, ACTS
            return (Arrived, key), key, _ARRIVALS.get(purpose, ACTS)
        case TokenChanged(key=key):
            return (TokenChanged, key), key, CHANGES
        case Asked(key=key):
            return (Asked, key), key, QUESTIONS
        case Answered(question=question, key=key):
            return (Answered, question), key, ANSWERS
        case AskEnded():
            return AskEnded, AskEnded.__name__, ENDS
        case Reported(report=report):
            return (Reported, type(report)), type(report).__name__, REPORTS
        case Computed():  # each unit is called once at a time
            return Computed, Computed.__name__, ENDS
        case SearchOver():
            return SearchOver, SearchOver.__name__, ENDS
        case _ if isinstance(event, HostEvent):  # the door lets so many of each host in
            return HostEvent, "hosts", ENDS
        case HandlerFailed(where=where):
            return (HandlerFailed, where), where, FAILURES
        case _:
            kind: type[Any] = type(event)
            return (kind,), kind.__name__, REPORTS
