"""Real sessions of one process: what an edge performs, another one hears."""

import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import TypeVar

import pytest

from dyknow.federation import keys
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
    HandlerFailed,
    Put,
    Reopen,
    Subscribe,
    TokenChanged,
    UndeclareToken,
    Unsubscribe,
    Urgency,
    WatchTokens,
    WireEvent,
)
from dyknow.model.errors import SessionFailed
from dyknow.proxies.zenoh import edge as zenoh_edge
from dyknow.proxies.zenoh.configuration import ZenohOptions
from dyknow.proxies.zenoh.edge import ZenohEdge
from dyknow.runtime.clock import NodeClock

pytestmark = pytest.mark.live
PATIENCE_S = 15.0
STREAM = keys.stream("0", "heli-position", "0123abcd")
SECOND_US = 1_000_000
E = TypeVar("E", bound=WireEvent)


@dataclass
class Peer:
    """An edge and what it heard so far."""

    edge: ZenohEdge
    arriving: SimpleQueue[WireEvent]
    heard: list[WireEvent] = field(default_factory=list)

    def until(self, enough: Callable[[list[WireEvent]], bool], wait_s: float = PATIENCE_S) -> list[WireEvent]:
        """Everything heard, as soon as it is enough."""
        end = time.monotonic() + wait_s
        while not enough(self.heard):
            try:
                self.heard.append(self.arriving.get(timeout=max(0.001, end - time.monotonic())))
            except Empty:
                if time.monotonic() >= end:
                    raise AssertionError(f"not in {wait_s} s; heard {self.heard}") from None
        return self.heard

    def hears(self, event: type[E], **fields: object) -> E:
        """The first event of that kind and with those fields; waits for it, and forgets those of its kind before it.

        Samples, questions and tokens come on threads of their own, so that only those of one kind have an order.
        """

        def wanted(found: WireEvent) -> bool:
            return isinstance(found, event) and all(getattr(found, name) == value for name, value in fields.items())

        self.until(lambda heard: any(map(wanted, heard)))
        at = next(number for number, found in enumerate(self.heard) if wanted(found))
        found = self.heard[at]
        assert isinstance(found, event)
        self.heard[: at + 1] = [before for before in self.heard[:at] if not isinstance(before, event)]
        return found

    def perform(self, *effects: object) -> None:
        for effect in effects:
            self.edge.perform(effect)

    def took(self) -> bool:
        """Take what has arrived by now, without waiting."""
        while not self.arriving.empty():
            self.heard.append(self.arriving.get())
        return True

    def put_until(self, key: str, payload: bytes, arrived: Callable[[], bool]) -> None:
        """Put again until it is there: where the sending thread finds no processor in time, Zenoh drops a sample."""
        end, pause = time.monotonic() + PATIENCE_S, threading.Event()
        while not arrived():
            assert time.monotonic() < end, f"{len(payload)} bytes not in {PATIENCE_S} s"
            self.perform(Put(key, payload, Urgency.STREAM))
            pause.wait(0.05)

    def exchanged(self) -> None:
        """Beat, as a node does, until the new session is there."""
        end, pause = time.monotonic() + PATIENCE_S, threading.Event()
        while not self.edge.is_open:
            assert time.monotonic() < end
            pause.wait(0.02)
            self.perform(Put(keys.heartbeat("1"), b"", Urgency.CONTROL))

    def token(self, unit: str) -> str:
        return keys.token_platform(self.edge.zid, unit, "uav", 1)


class Peers:
    def __init__(self) -> None:
        self.clock, self.edges = NodeClock(), list[ZenohEdge]()
        self.name = f"edge-{secrets.token_hex(4)}"

    def made(self, **options: object) -> Peer:
        arriving: SimpleQueue[WireEvent] = SimpleQueue()
        edge = ZenohEdge(ZenohOptions(**{"federation": self.name, **options}), arriving.put, self.clock.now_us)
        self.edges.append(edge)
        return Peer(edge, arriving)

    def opened(self, **options: object) -> Peer:
        peer = self.made(**options)
        peer.edge.open()
        return peer

    def met(self, *more: object, **options: object) -> tuple[Peer, Peer]:
        """Two peers; the second has performed `more` before the first saw its token."""
        first, second = self.opened(**options), self.opened(**options)
        first.perform(WatchTokens(keys.TOKENS))
        second.perform(*more, DeclareToken(second.token("1")))
        first.hears(TokenChanged, key=second.token("1"), alive=True)
        return first, second


@pytest.fixture
def peers() -> Iterator[Peers]:
    found = Peers()
    yield found
    for edge in found.edges:
        edge.close()


def free_endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def test_what_is_put_arrives_at_those_who_subscribed_with_the_time_of_the_node(peers: Peers) -> None:
    before_us = peers.clock.now_us()
    one, two = peers.met(Subscribe(keys.inbox("1")), Subscribe(keys.stream_expr("heli-position", "0123abcd")))
    key = keys.act("1", "0", "interface")
    for urgency in Urgency:
        one.perform(Put(key, urgency.value.encode(), urgency))
    one.perform(Put(STREAM, b"sample", Urgency.STREAM), Put(keys.act("2", "0", "interface"), b"", Urgency.ACT))
    found = two.hears(Arrived, key=STREAM)
    assert found.payload == b"sample"
    assert before_us < found.at_us <= peers.clock.now_us()
    two.perform(Subscribe(keys.HEARTBEATS))
    one.perform(Put(key, b"last", Urgency.ACT))
    two.hears(Arrived, key=key, payload=b"last")
    assert not any(isinstance(event, Arrived) and event.key.startswith("acl/2/") for event in two.heard)


def test_acts_of_one_sender_keep_their_order(peers: Peers) -> None:
    one, two = peers.met(Subscribe(keys.inbox("1")))
    key = keys.act("1", "0", "interface")
    one.perform(*(Put(key, b"%d" % number, Urgency.ACT) for number in range(100)))
    heard = two.until(lambda heard: sum(isinstance(event, Arrived) for event in heard) == 100)
    assert [int(event.payload) for event in heard if isinstance(event, Arrived)] == list(range(100))


def test_federations_of_different_names_hear_nothing_of_each_other(peers: Peers) -> None:
    one, two = peers.met(Subscribe("x/**"))
    stranger = peers.opened(federation=f"{peers.name}-b")
    stranger.perform(DeclareToken(stranger.token("9")), Put(STREAM, b"strange", Urgency.STREAM))
    one.perform(Put(STREAM, b"own", Urgency.STREAM))
    assert two.hears(Arrived).payload == b"own"
    assert stranger.edge.peers() == ()
    assert not any(isinstance(event, TokenChanged) and "/9/" in event.key for event in one.heard)


def test_subscribing_twice_is_subscribing_once_and_ends_with_one_unsubscribe(peers: Peers) -> None:
    expr = keys.stream_expr("heli-position", "0123abcd")
    one, two = peers.met(Subscribe(expr), Subscribe(expr), Subscribe(keys.HEARTBEATS))
    one.perform(Put(STREAM, b"1", Urgency.STREAM), Put("hb/0", b"1", Urgency.STREAM))
    two.hears(Arrived, key="hb/0")
    two.until(lambda heard: True)
    two.perform(Unsubscribe(expr), Unsubscribe(expr))
    one.perform(Put(STREAM, b"2", Urgency.STREAM), Put("hb/0", b"2", Urgency.STREAM))
    two.hears(Arrived, key="hb/0", payload=b"2")
    streamed = [event.payload for event in two.heard if isinstance(event, Arrived) and event.key == STREAM]
    assert b"2" not in streamed
    assert len(streamed) <= 1


def test_tokens_appear_to_those_who_come_later_and_end_with_their_session(peers: Peers) -> None:
    one, two = peers.met()
    late = peers.opened()
    late.perform(WatchTokens(keys.TOKENS))
    late.hears(TokenChanged, key=two.token("1"), alive=True)
    two.edge.close()
    for other in (one, late):
        other.hears(TokenChanged, key=two.token("1"), alive=False)
    two.edge.close()


def test_a_platform_leaves_before_its_services_do(peers: Peers) -> None:
    one = peers.opened()
    one.perform(WatchTokens(keys.TOKENS))
    two = peers.opened()
    service = keys.token_service(two.edge.zid, "1", "alarms", 1)
    two.perform(DeclareToken(service), DeclareToken(two.token("1")))
    one.until(lambda heard: len(heard) == 2)
    two.edge.close()
    gone = [event.key for event in one.until(lambda heard: len(heard) == 4)[2:] if isinstance(event, TokenChanged)]
    assert gone == [two.token("1"), service]


def test_a_token_can_be_taken_back(peers: Peers) -> None:
    one, two = peers.met()
    two.perform(UndeclareToken(two.token("1")), UndeclareToken(two.token("1")))
    one.hears(TokenChanged, key=two.token("1"), alive=False)


def test_looking_again_says_what_was_missed_and_nothing_else(peers: Peers) -> None:
    one, two = peers.met()
    watch = one.edge._watches[WatchTokens(keys.TOKENS)]
    one.perform(WatchTokens(keys.TOKENS))
    watch._alive = {"@df/v1/0/0/P/uav/1"}  # as if both changes had gone unnoticed
    one.perform(WatchTokens(keys.TOKENS))
    one.hears(TokenChanged, key=two.token("1"), alive=True)
    one.hears(TokenChanged, key="@df/v1/0/0/P/uav/1", alive=False)
    assert watch._alive == {two.token("1")}


def test_everybody_asked_answers_as_often_as_they_like(peers: Peers) -> None:
    one, two = peers.met(DeclareQueryable(keys.history_expr("1")))
    one.perform(DeclareQueryable(keys.history_expr("0")))
    one.perform(Ask(7, "q/*/heli-position", b"between", SECOND_US))
    for peer, unit in ((one, "0"), (two, "1")):
        asked = peer.hears(Asked)
        assert (asked.key, asked.payload) == ("q/*/heli-position", b"between")
        own = keys.history(unit, "heli-position")
        peer.perform(Answer(asked.ask, own, b"1"), Answer(asked.ask, own, b"2"), AnswerEnd(asked.ask))
        peer.perform(AnswerEnd(asked.ask), Answer(asked.ask, own, b"late"))
    heard = one.until(lambda heard: any(isinstance(event, AskEnded) for event in heard))
    answers = [event for event in heard if isinstance(event, Answered)]
    assert sorted((event.question, event.key, event.payload) for event in answers) == sorted(
        (7, keys.history(unit, "heli-position"), payload) for unit in "01" for payload in (b"1", b"2")
    )


def test_a_question_to_all_is_to_each_one_about_itself(peers: Peers) -> None:
    one, two = peers.met(DeclareQueryable(keys.describe("1")))
    one.perform(Ask(6, "*/df", b"", SECOND_US))
    asked = two.hears(Asked)
    assert asked.key == keys.describe("1")
    two.perform(Answer(asked.ask, asked.key, b"me"), AnswerEnd(asked.ask))
    answered = one.hears(Answered, question=6)
    assert (answered.key, answered.payload) == (keys.describe("1"), b"me")


def test_a_silent_platform_does_not_hold_back_the_answers_of_others(peers: Peers) -> None:
    one, two = peers.met(DeclareQueryable(keys.history_expr("1")))
    one.perform(DeclareQueryable(keys.history_expr("0")), Ask(8, "q/*/heli-position", b"", SECOND_US))
    asked, silent = one.hears(Asked), two.hears(Asked)
    one.perform(Answer(asked.ask, keys.history("0", "heli-position"), b"here"), AnswerEnd(asked.ask))
    answered = one.hears(Answered)
    ended = one.hears(AskEnded, question=8)
    assert answered.at_us - asked.at_us < SECOND_US // 2
    assert ended.at_us - asked.at_us > SECOND_US // 2, "the silent one is waited for until the time is over"
    assert two.edge._asks.get(silent.ask) is not None


def test_asking_where_nobody_answers_ends_at_once(peers: Peers) -> None:
    one = peers.opened()
    before_us = peers.clock.now_us()
    one.perform(Ask(9, keys.describe("5"), b"", 10 * SECOND_US))
    assert one.hears(AskEnded, question=9).at_us - before_us < SECOND_US


def test_a_reopened_session_has_a_new_identity_and_all_that_was_declared(peers: Peers) -> None:
    one, two = peers.met(Subscribe(keys.inbox("1")), DeclareQueryable(keys.history_expr("1")))
    old, token = two.edge.zid, two.token("1")
    two.perform(WatchTokens(keys.TOKENS), Put(STREAM, b"", Urgency.STREAM), Reopen("deaf to 0"))
    two.perform(Subscribe("x/**"), Ask(7, "q/0/battery", b"", SECOND_US), Put(STREAM, b"lost", Urgency.STREAM))
    assert two.hears(AskEnded).question == 7, "what is asked between two sessions is answered by nobody"
    one.hears(TokenChanged, key=token, alive=False)
    two.exchanged()
    again = one.hears(TokenChanged, alive=True)
    assert (found := keys.parse_key(again.key)) is not None
    assert isinstance(found, keys.PlatformToken)
    assert found.unit == "1"
    assert found.zid != old
    assert found.zid in one.edge.peers()
    assert two.edge.zid == old, "keys of tokens go on carrying what the node knows"
    one.perform(Put(keys.act("1", "0", "interface"), b"hello", Urgency.ACT), Ask(1, "q/1/battery", b"", SECOND_US))
    assert two.hears(Arrived).payload == b"hello"
    assert two.hears(Asked).key == "q/1/battery"
    one.perform(Put(STREAM, b"declared meanwhile", Urgency.STREAM))
    assert two.hears(Arrived).payload == b"declared meanwhile"
    two.perform(UndeclareToken(token))
    one.hears(TokenChanged, key=again.key, alive=False)


def test_a_key_that_zenoh_refuses_becomes_an_event_and_the_edge_lives_on(peers: Peers) -> None:
    one, two = peers.met(Subscribe("x/**"))
    one.perform(Put("x//a", b"", Urgency.STREAM), Subscribe("x/#"), DeclareToken("/"))
    assert [one.hears(HandlerFailed).where for _ in range(3)] == ["Put", "Subscribe", "DeclareToken"]
    one.perform(Put(STREAM, b"fine", Urgency.STREAM))
    assert two.hears(Arrived).payload == b"fine"


def test_a_handler_that_raises_becomes_an_event(peers: Peers) -> None:
    one, two = peers.met(Subscribe("x/**"))
    post = two.arriving.put

    def refuse(event: WireEvent) -> None:
        if isinstance(event, Arrived) and event.payload == b"bad":
            raise ValueError("no room")
        post(event)

    two.edge._post = refuse
    one.perform(Put(STREAM, b"bad", Urgency.STREAM), Put(STREAM, b"good", Urgency.STREAM))
    failed = two.hears(HandlerFailed)
    assert (failed.where, failed.error) == ("sample", "ValueError('no room')")
    assert two.hears(Arrived).payload == b"good"


def test_what_is_larger_than_a_message_may_be_does_not_arrive(peers: Peers) -> None:
    one, two = peers.met(Subscribe("x/**"))

    def arrived(size: int) -> bool:
        return any(isinstance(event, Arrived) and len(event.payload) == size for event in two.heard)

    one.put_until(STREAM, bytes(65_536), lambda: two.took() and arrived(65_536))
    one.perform(*(Put(STREAM, bytes(size), Urgency.STREAM) for size in (65_537, 2_000_000)))
    one.put_until(STREAM, bytes(3), lambda: two.took() and arrived(3))
    assert {len(event.payload) for event in two.heard if isinstance(event, Arrived)} == {65_536, 3}


def test_publishers_are_bounded(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zenoh_edge, "_MAX_PUBLISHERS", 8)
    one, two = peers.met(Subscribe("x/**"))
    for number in range(50):
        one.perform(Put(keys.stream(str(number), "battery", "0123abcd"), b"", Urgency.STREAM))
    assert len(one.edge._publishers) == 8
    two.until(lambda heard: sum(isinstance(event, Arrived) for event in heard) == 50)


def test_who_dials_keeps_trying_until_the_other_is_there(peers: Peers) -> None:
    endpoint = free_endpoint()
    two = peers.opened(connect=(endpoint,))
    two.perform(DeclareToken(two.token("1")))
    one = peers.opened(listen=(endpoint,), discover="none")
    one.perform(WatchTokens(keys.TOKENS))
    one.hears(TokenChanged, key=two.token("1"), alive=True)


def test_with_one_meeting_point_the_others_find_each_other(peers: Peers) -> None:
    endpoint = free_endpoint()
    middle = peers.opened(listen=(endpoint,), discover="none")
    first, second = peers.opened(connect=(endpoint,)), peers.opened(connect=(endpoint,))
    first.perform(WatchTokens(keys.TOKENS))
    second.perform(DeclareToken(second.token("1")))
    first.hears(TokenChanged, key=second.token("1"), alive=True)
    middle.edge.close()
    second.perform(DeclareToken(second.token("2")))
    first.hears(TokenChanged, key=second.token("2"), alive=True)


def test_a_session_that_cannot_listen_does_not_open(peers: Peers) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(SessionFailed, match="does not open"):
            peers.opened(listen=(f"tcp/127.0.0.1:{taken.getsockname()[1]}",))


def test_an_interface_that_is_not_there_is_named_with_those_that_are(peers: Peers) -> None:
    with pytest.raises(SessionFailed, match=r"'nosuch0'; this machine has .*lo"):
        peers.made(interface="nosuch0")
    with pytest.raises(SessionFailed, match="open it first"):
        peers.made().edge.peers()
