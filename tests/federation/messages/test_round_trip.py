"""What a slow peer has not acknowledged yet is not said again and again."""

from collections import deque

from hypothesis import given
from hypothesis import strategies as st

from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.conversations import Conversations
from dyknow.federation.messages.delivery import REPEATS, REPEATS_PER_S, RETRANSMISSIONS, SLOW_US
from dyknow.federation.messages.receipts import Receipt
from dyknow.federation.messages.round_trip import LEAST_US, MOST_US, RoundTrip
from dyknow.federation.messages.sexpr import Expr
from dyknow.federation.transport import Put

SAID = Act(Performative.INFORM, AgentName("x", "a"), AgentName("interface", "b"), Expr("done"))
EVERY_US = 100_000


def puts_of(acts: int, answers_us: int) -> list[int]:
    """How often each act is put, one every 100 ms, by who gets its acknowledgement `answers_us` after the first put."""
    node, receipts = Conversations("a", 1), deque[tuple[int, int]]()
    puts = [0] * (acts + 1)
    now_us = 0
    while now_us <= acts * EVERY_US + 20_000_000:
        while receipts and receipts[0][0] <= now_us:
            node.on_receipt("b", Receipt(1, (receipts.popleft()[1],)), now_us)
        if now_us % EVERY_US == 0 and now_us < acts * EVERY_US:
            said, _ = node.send(SAID, now_us)
            puts[said.seq] = 1
            receipts.append((now_us + answers_us, said.seq))
        before = dict(node.delivery._pending)
        again = {id(put) for put in node.on_time(now_us) if isinstance(put, Put)}
        for (_, seq), pending in before.items():
            puts[seq] += id(pending.put) in again
        now_us += 20_000
    return puts[1:]


def test_a_slow_peer_soon_gets_each_act_once() -> None:
    puts = puts_of(200, 2_500_000)
    assert max(puts) <= 1 + RETRANSMISSIONS + 2, "before it is known"
    assert set(puts[100:]) == {1}


def test_a_quick_peer_never_gets_an_act_twice() -> None:
    assert set(puts_of(50, 150_000)) == {1}


def test_what_a_quick_peer_lost_is_put_again_as_soon_as_ever() -> None:
    node = Conversations("a", 1)
    node.send(SAID, 0)
    node.on_receipt("b", Receipt(1, (1,)), 10_000)
    node.send(SAID, 1_000_000)
    due = [at_us for at_us in range(1_000_000, 3_000_000, 10_000) if node.on_time(at_us)]
    assert due == [1_200_000, 1_400_000, 1_600_000, 1_800_000, 1_800_000 + SLOW_US]


def test_a_question_is_put_again_while_it_is_of_use_and_no_longer() -> None:
    node = Conversations("a", 1)
    for seq in range(1, 6):
        node.send(SAID, 0)
        node.on_receipt("b", Receipt(1, (seq,)), 3_000_000)
    asked = SAID._replace(performative=Performative.REQUEST, reply_by_us=12_000_000)
    node.send(asked, 10_000_000)
    puts = [at_us for at_us in range(10_000_000, 20_000_000, 100_000) if any(isinstance(each, Put) for each in node.on_time(at_us))]  # fmt: skip
    assert puts == [11_000_000]


def test_what_is_put_again_is_bounded_by_time_and_by_what_is_acknowledged() -> None:
    node = Conversations("a", 1)
    for _ in range(1_000):
        node.send(SAID, 0)
    again = sum(isinstance(each, Put) for at_us in range(0, 1_000_000, 20_000) for each in node.on_time(at_us))
    assert REPEATS <= again <= REPEATS + REPEATS_PER_S
    node.on_receipt("b", Receipt(1, tuple(range(1, 41))), 1_000_000)
    more = sum(isinstance(each, Put) for at_us in range(1_000_000, 10_000_000, 20_000) for each in node.on_time(at_us))
    assert 40 <= more <= 40 + 10 * REPEATS_PER_S
    while node.deadline_us is not None:
        assert node.deadline_us < 300_000_000
        node.on_time(node.deadline_us)
    assert node.delivery.unacknowledged == 0, "and it is given up as early as ever"


@given(st.lists(st.one_of(st.none(), st.integers(0, 30_000_000))))
def test_the_pause_is_bounded_and_comes_back(measured: list[int | None]) -> None:
    peer = RoundTrip()
    for at, took_us in enumerate(measured):
        peer.on_late(at * MOST_US) if took_us is None else peer.on_measured(took_us)
        assert LEAST_US <= peer.pause_us <= MOST_US
    for _ in range(100):
        peer.on_measured(5_000)
    assert peer.pause_us == LEAST_US
