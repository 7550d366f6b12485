import threading
from collections import Counter
from itertools import pairwise
from queue import Empty

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.agents.effects import HostCame, HostEvent, HostLeft, HostMessage, Reported
from dyknow.federation.transport import (
    Answered,
    Arrived,
    Asked,
    AskEnded,
    Conflated,
    HandlerFailed,
    TokenChanged,
)
from dyknow.navigation.vehicle import BatteryReport, PositionReport
from dyknow.runtime import mailbox
from dyknow.runtime.mailbox import Mailbox

STREAM, BEAT = "x/0/heli-position/0123abcd", "hb/0"


def a_mailbox() -> Mailbox:
    return Mailbox(lambda: 77)


def sample(number: int, key: str = STREAM) -> Arrived:
    return Arrived(key, number, b"%d" % number)


def emptied(box: Mailbox) -> list[object]:
    found = []
    while len(box):
        found.append(box.get(0))
    return found


def test_events_come_out_as_they_came_in() -> None:
    box, events = a_mailbox(), [sample(1), TokenChanged("@df/v1/a", 2, alive=True), sample(3), AskEnded(4, 4)]
    for event in events:
        box.post(event)
    assert emptied(box) == events


def test_an_empty_mailbox_raises_empty_when_the_wait_is_over() -> None:
    for wait_s in (0, 0.001):
        with pytest.raises(Empty):
            a_mailbox().get(wait_s)


def test_of_heartbeats_the_newest_is_kept_and_the_others_are_counted() -> None:
    box = a_mailbox()
    for number in range(5):
        box.post(sample(number, BEAT))
    assert emptied(box) == [sample(4, BEAT), Conflated(BEAT, 77, 4)]


def test_one_key_in_flood_does_not_crowd_out_another() -> None:
    box = a_mailbox()
    box.post(sample(0, "x/1/heli-position/0123abcd"))
    for number in range(10_000):
        box.post(sample(number))
    box.post(sample(1, BEAT))
    found = emptied(box)
    assert found[0] == sample(0, "x/1/heli-position/0123abcd")
    assert sample(1, BEAT) in found
    kept = [event for event in found if isinstance(event, Arrived) and event.key == STREAM]
    assert kept == [sample(number) for number in range(10_000 - 512, 10_000)], "the newest, in order"
    assert Conflated(STREAM, 77, 10_000 - 512) in found


def test_acts_of_one_sender_are_refused_beyond_64_whatever_agents_they_name() -> None:
    box = a_mailbox()
    for number in range(100):
        box.post(sample(number, f"acl/1/0/{'interface' if number % 2 else 'gateway'}"))
        box.post(sample(number, f"acl/all/u{number}/interface"))
    acts = [event for event in emptied(box) if isinstance(event, Arrived)]
    assert [event.at_us for event in acts if event.key.startswith("acl/1/0/")] == list(range(64)), "the first ones"
    assert sum(event.key.startswith("acl/all/") for event in acts) == 100, "other senders lose nothing"


def test_what_was_lost_is_told_once_and_then_counted_anew() -> None:
    box = a_mailbox()
    for _ in range(2):
        for number in range(3):
            box.post(sample(number, BEAT))
        assert emptied(box) == [sample(2, BEAT), Conflated(BEAT, 77, 2)]


def test_the_newest_change_of_a_token_is_never_lost() -> None:
    box = a_mailbox()
    for number in range(101):
        box.post(TokenChanged("@df/v1/a/0/P/uav/1", number, alive=number % 2 == 0))
    changes = [event for event in emptied(box) if isinstance(event, TokenChanged)]
    assert changes[-1] == TokenChanged("@df/v1/a/0/P/uav/1", 100, alive=True)
    assert len(changes) == 16


def test_answers_questions_failures_and_reports_are_bounded_by_question_key_place_and_kind() -> None:
    box = a_mailbox()
    for number in range(2000):
        box.post(Answered(7, f"q/{number}/heli-position", number, b""))
        box.post(Asked(number, "q/0/heli-position", number, b""))
        box.post(HandlerFailed("sample", number, "boom"))
        box.post(Reported(number, BatteryReport(number, 0.5)))
        box.post(Reported(number, PositionReport(number, "GPS_RAW_INT", 58.4, 15.6, 20.0)))
    found = Counter(type(event) for event in emptied(box))
    assert (found[Answered], found[Asked], found[HandlerFailed], found[Reported]) == (1024, 64, 16, 2 * 256)
    assert found[Conflated] == 5


def test_when_all_is_full_only_the_end_of_a_question_gets_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mailbox, "LIMIT", 100)
    box = a_mailbox()
    for number in range(200):
        box.post(sample(number, f"x/{number}/heli-position/0123abcd"))
    box.post(AskEnded(1, 1))
    assert AskEnded(1, 1) in emptied(box)
    box.post(sample(1))
    assert emptied(box) == [sample(1)], "and it recovers"


def test_what_hosts_say_is_never_lost_since_the_door_lets_only_so_much_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mailbox, "LIMIT", 100)
    box = a_mailbox()
    for number in range(200):
        box.post(sample(number, f"x/{number}/heli-position/0123abcd"))
    said = [HostCame(1, 1), *(HostMessage(2, 1, bytes([n])) for n in range(200)), HostLeft(3, 1)]
    for event in said:
        box.post(event)
    assert [event for event in emptied(box) if isinstance(event, HostEvent)] == said


def test_hostile_keys_leave_nothing_behind() -> None:
    box = a_mailbox()
    for number in range(30_000):
        box.post(sample(number, f"x/{number}/heli-position/0123abcd"))
        box.get(0)
    assert len(box._by_key) + len(box._lanes) <= 2 * 4096


@given(st.lists(st.tuples(st.sampled_from([STREAM, BEAT, "acl/1/0/interface"]), st.booleans()), max_size=300))
def test_per_key_order_holds_and_nothing_vanishes_uncounted(moves: list[tuple[str, bool]]) -> None:
    box, found = a_mailbox(), []
    for number, (key, take) in enumerate(moves):
        box.post(sample(number, key))
        if take:
            found.append(box.get(0))
    found += emptied(box)
    arrived = [event for event in found if isinstance(event, Arrived)]
    lost = sum(event.lost for event in found if isinstance(event, Conflated))
    assert len(arrived) + lost == len(moves)
    for key in (STREAM, BEAT, "acl/1/0/interface"):
        assert all(a.at_us < b.at_us for a, b in pairwise(event for event in arrived if event.key == key))


def test_threads_that_post_at_once_lose_nothing_that_is_not_counted() -> None:
    box, posted = a_mailbox(), 20_000
    keys = [STREAM, BEAT, "acl/1/0/interface", "x/1/heli-position/0123abcd"]

    def post(key: str) -> None:
        for number in range(posted):
            box.post(sample(number, key))

    threads = [threading.Thread(target=post, args=(key,)) for key in keys]
    for thread in threads:
        thread.start()
    arrived: Counter[str] = Counter()
    lost: Counter[str] = Counter()
    while any(thread.is_alive() for thread in threads) or len(box):
        try:
            event = box.get(0.01)
        except Empty:
            continue
        if isinstance(event, Conflated):
            lost[event.key] += event.lost
        else:
            arrived[event.key] += 1
    assert {key: arrived[key] + lost[key] for key in keys} == dict.fromkeys(keys, posted)


def test_a_mailbox_that_pauses_finds_what_comes_meanwhile(monkeypatch: pytest.MonkeyPatch) -> None:
    box, pauses = a_mailbox(), []

    def pause(seconds: float) -> None:
        pauses.append(seconds)
        box.post(sample(2))

    monkeypatch.setattr(mailbox.time, "sleep", pause)
    box.pause_s = 0.005
    threading.Timer(0.01, box.post, [sample(1)]).start()
    assert box.get(10.0) == sample(1)
    assert pauses == [0.005]
    assert box.get(0) == sample(2), "and does not wait again for what is there"
    assert pauses == [0.005]
