"""What the wire in a box does for sessions, and that it keeps nothing of those that are gone."""

from random import Random

import pytest

from dyknow.federation.transport import (
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
    Reopen,
    Subscribe,
    TokenChanged,
    UndeclareToken,
    Urgency,
    WatchTokens,
)
from dyknow.sim_uavs.world.agenda import Agenda
from dyknow.sim_uavs.world.sessions import SessionLink
from dyknow.sim_uavs.world.wire import Wire
from tests.sim_uavs.worlds import kept_by

S = 1_000_000
TOKEN = "@df/v1/a1/{}/P/uav/1"


class Room:
    """Sessions that note what they are told."""

    def __init__(self, *units, seed=1, **options):
        self.agenda = Agenda(0)
        self.wire = Wire(self.agenda, Random(seed), **options)
        self.told = {}
        for unit in units:
            self.open(unit)
        self.run(1)

    def open(self, unit):
        told = self.told[unit] = []
        self.wire.open(unit, "a1", told.append, lambda: self.agenda.now_us)
        self.do(unit, WatchTokens("@df/v1/**"), DeclareToken(TOKEN.format(unit)))

    def do(self, unit, *effects):
        for effect in effects:
            self.wire.perform(unit, effect)

    def run(self, seconds):
        self.agenda.run_until(self.agenda.now_us + round(seconds * S))

    def take(self, unit, kind):
        found = [event for event in self.told[unit] if type(event) is kind]
        self.told[unit][:] = [event for event in self.told[unit] if type(event) is not kind]
        return found

    def tokens(self, unit):
        return [(event.key.split("/")[3], event.alive) for event in self.take(unit, TokenChanged)]


def put(key, payload=b"x"):
    return Put(key, payload, Urgency.STREAM)


def test_puts_reach_those_who_subscribe_in_order_and_nobody_else():
    room = Room("a", "b", "c")
    room.do("b", Subscribe("x/*/pos/0a1b2c3d"))
    room.do("a", *(put("x/a/pos/0a1b2c3d", bytes([n])) for n in range(100)), put("x/a/alt/0a1b2c3d"))
    room.run(0.1)
    assert [event.payload[0] for event in room.take("b", Arrived)] == list(range(100))
    assert not room.take("c", Arrived)


def test_a_link_loses_duplicates_and_reorders_its_shares():
    room = Room("a", "b")
    room.do("b", Subscribe("x/**"))
    room.wire.set_link("a", "b", SessionLink(loss=0.2, duplication=0.1, reordering=0.1))
    for number in range(2000):
        room.do("a", put("x/a/pos/0a1b2c3d", number.to_bytes(2, "big")))
        room.run(0.001)
    room.run(1)
    found = [int.from_bytes(event.payload, "big") for event in room.take("b", Arrived)]
    assert 0.75 < len(set(found)) / 2000 < 0.85
    assert 1.06 < len(found) / len(set(found)) < 1.14
    assert found != sorted(found)


def test_a_kill_takes_tokens_away_within_milliseconds():
    room = Room("a", "b")
    assert room.tokens("b") == [("a", True)]
    room.wire.kill("a")
    room.run(0.02)
    assert room.tokens("b") == [("a", False)]
    assert kept_by(room.wire) == {"sessions": 1, "transports": 0, "told": 0, "questions": 0}


def test_behind_a_cut_tokens_last_for_the_lease_and_come_back_after_it():
    room = Room("a", "b", lease_us=2 * S)
    room.tokens("b")
    room.wire.cut("a", "b")
    room.wire.cut("b", "a")
    room.run(1.9)
    assert room.tokens("b") == []
    room.run(0.2)
    assert room.tokens("b") == [("a", False)]
    room.wire.mend("a", "b")
    room.run(2)
    assert room.tokens("b") == []
    room.wire.mend("b", "a")
    room.run(2)
    assert room.tokens("b") == [("a", True)]


def test_a_host_that_is_lost_is_noticed_with_the_lease_and_leaves_nothing():
    room = Room("a", "b", lease_us=2 * S)
    room.tokens("b")
    room.wire.cut("a", "b")
    room.wire.kill("a")
    room.run(1.5)
    assert room.tokens("b") == []
    room.run(1)
    assert room.tokens("b") == [("a", False)]
    assert kept_by(room.wire)["transports"] == 0


def test_a_deaf_direction_loses_puts_but_not_tokens_until_somebody_reopens():
    room = Room("a", "b")
    room.do("b", Subscribe("hb/*"))
    room.tokens("b")
    room.wire.deafen("a", "b")
    room.do("a", put("hb/a"))
    room.run(5)
    assert (room.take("b", Arrived), room.tokens("b")) == ([], [])
    room.do("b", Reopen("deaf"))
    room.run(2)
    room.do("a", put("hb/a"))
    room.run(0.1)
    assert len(room.take("b", Arrived)) == 1
    assert room.tokens("b")[-1] == ("a", True)
    assert [alive for _, alive in room.tokens("a")] == [True, False, True]


def test_a_process_that_stands_still_loses_its_links_with_the_lease_and_finds_them_again():
    room = Room("a", "b", lease_us=S)
    room.tokens("b")
    room.wire.freeze("a")
    room.run(1.1)
    assert room.tokens("b") == [("a", False)]
    room.wire.thaw("a")
    room.run(1.5)
    assert room.tokens("b") == [("a", True)]


def test_a_withdrawn_token_goes():
    room = Room("a", "b")
    room.do("a", UndeclareToken(TOKEN.format("a")))
    room.run(0.1)
    assert room.tokens("b") == [("a", True), ("a", False)]


def test_a_question_ends_when_all_have_answered_and_at_once_when_nobody_can():
    room = Room("a", "b", "c")
    for unit in ("b", "c"):
        room.do(unit, DeclareQueryable("q/**"))
    room.do("a", Ask(7, "q/b/pos", b"?", S))
    room.run(0.01)
    for unit in ("b", "c"):
        (asked,) = room.take(unit, Asked)
        room.do(unit, Answer(asked.ask, asked.key, unit.encode()), AnswerEnd(asked.ask))
    room.run(0.01)
    assert sorted(answer.payload for answer in room.take("a", Answered)) == [b"b", b"c"]
    assert [ended.question for ended in room.take("a", AskEnded)] == [7]
    room.do("a", Ask(8, "time/b", b"", S))
    room.run(0.01)
    assert [ended.question for ended in room.take("a", AskEnded)] == [8]
    assert kept_by(room.wire)["questions"] == 0


@pytest.mark.parametrize("how", ["silent", "killed", "frozen"])
def test_who_does_not_answer_delays_the_end_but_not_the_answers_of_others(how):
    room = Room("a", "b", "c")
    for unit in ("b", "c"):
        room.do(unit, DeclareQueryable("q/**"))
    if how == "frozen":
        room.wire.freeze("c")
    room.do("a", Ask(7, "q/b/pos", b"?", S))
    room.run(0.01)
    (asked,) = room.take("b", Asked)
    room.do("b", Answer(asked.ask, asked.key, b"b"), AnswerEnd(asked.ask))
    room.run(0.01)
    assert [answer.payload for answer in room.take("a", Answered)] == [b"b"]
    assert not room.take("a", AskEnded)
    if how == "killed":
        room.wire.kill("c")
    room.run(0.1 if how == "killed" else 1)
    assert [ended.question for ended in room.take("a", AskEnded)] == [7]
    assert kept_by(room.wire)["questions"] == 0
