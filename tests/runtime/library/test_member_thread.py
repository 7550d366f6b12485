"""A member stepped by a thread of its own: jobs, their errors and their end; no wire is needed for that."""

import threading
from collections.abc import Callable
from queue import SimpleQueue

import pytest

from dyknow import FederationFailed, NothingFound, SessionFailed
from dyknow.federation.members.command_centre import CommandCentre
from dyknow.federation.transport import WireEffect, WireEvent
from dyknow.runtime.client import ClientPorts
from dyknow.runtime.clock import NodeClock
from dyknow.runtime.library import jobs
from dyknow.runtime.library.alarm_news import follow_alarms
from dyknow.runtime.library.feed import Feed
from dyknow.runtime.library.member_thread import Job, MemberThread, Wait
from dyknow.runtime.library.questions import Which


class Quiet:
    """A wire on which nobody else is."""

    zid = "1"

    def peers(self) -> tuple[str, ...]:
        return ()

    def __init__(self) -> None:
        self.performed: list[WireEffect] = []
        self.is_closed = False

    def perform(self, effect: WireEffect) -> None:
        assert not self.is_closed
        self.performed.append(effect)

    def close(self) -> None:
        self.is_closed = True


def connected() -> tuple[MemberThread, Quiet]:
    wire = Quiet()

    def opened(_post: Callable[[WireEvent], None], _now_us: Callable[[], int]) -> Quiet:
        return wire

    around = ClientPorts(SimpleQueue(), NodeClock().now_us, opened)
    return MemberThread(around, lambda zid, now_us: CommandCentre("cc-1", now_us, zid=zid), "test"), wire


def counted(upto: int, error: Exception | None = None) -> Job[int]:
    for _ in range(upto):
        assert (yield Wait(lambda: True, 60.0))
    assert not (yield Wait(lambda: False, 0.001))
    if error is not None:
        raise error
    return upto


def test_jobs_take_turns_and_their_results_and_errors_come_back() -> None:
    thread, _ = connected()
    results = [thread.post(counted(number)) for number in range(5)]
    failed = thread.post(counted(1, FederationFailed("no")))
    assert [result.result(5) for result in results] == list(range(5))
    with pytest.raises(FederationFailed, match="no"):
        failed.result(5)
    thread.close()


def test_a_job_that_is_given_up_before_it_begins_ends_no_other() -> None:
    thread, _ = connected()
    gate, begun = threading.Event(), list[str]()

    def job(name: str) -> Job[str]:
        gate.wait(5)
        begun.append(name)
        yield Wait(lambda: True, 60.0)
        return name

    first, given_up, last = (thread.post(job(name)) for name in ("first", "given up", "last"))
    assert given_up.cancel()
    gate.set()
    assert (first.result(5), last.result(5)) == ("first", "last")
    assert begun == ["first", "last"]
    thread.close()


def test_what_waits_when_the_connection_closes_learns_of_it() -> None:
    thread, wire = connected()

    def forever() -> Job[None]:
        while True:
            yield Wait(lambda: False, 60.0)

    waiting = thread.post(forever())
    feed: Feed[object] = Feed()
    alarms = thread.post(follow_alarms(thread.client, feed))  # type: ignore[arg-type]
    thread.post(counted(1)).result(5)
    thread.close()
    for result in (waiting, alarms):
        with pytest.raises(SessionFailed, match="closed"):
            result.result(5)
    assert (feed.is_closed, wire.is_closed) == (True, True)
    with pytest.raises(SessionFailed, match="open another"):
        thread.post(counted(1))


def test_where_no_platform_is_the_answer_says_so() -> None:
    thread, _ = connected()
    with pytest.raises(NothingFound, match="no platform of federation test is there"):
        thread.post(jobs.query(thread.client, "heli-position", None, Which(), "1s")).result(5)
    assert thread.post(jobs.platforms(thread.client)).result(5) == []
    thread.close()
