"""Acts arrive once, and every conversation ends."""

from collections import Counter
from collections.abc import Sequence
from heapq import heappop, heappush
from itertools import count
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.federation import keys
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.codec import decode_act
from dyknow.federation.messages.conversations import OPEN_PER_PEER, REPLY_BY_US, RESULT_WITHIN_US, Conversations
from dyknow.federation.messages.delivery import OF_ONE, UNACKNOWLEDGED, WINDOW, SeenActs
from dyknow.federation.messages.protocols import Incoming, PeerLost, Phase, Reply, TimedOut, Undelivered
from dyknow.federation.messages.receipts import Receipt, decode_receipt, encode_receipt
from dyknow.federation.messages.sexpr import Expr
from dyknow.federation.transport import Put
from dyknow.model.errors import ContentError, DecodeError, Refused
from tests.strategies import examples

P = Performative
ASKER, DOER = AgentName("console", "a"), AgentName("interface", "b")
GOTO = Expr("goto")
WATCH = Expr("watch")
DONE = Expr("done")


def act(performative: Performative, content: Expr | None = GOTO, **more: object) -> Act:
    return Act(performative, ASKER, DOER, content, **more)  # type: ignore[arg-type]


def hear(node: Conversations, put: object, now_us: int = 0) -> list[object]:
    """What `node` makes of a put: an act or a receipt."""
    assert isinstance(put, Put)
    key = keys.parse_key(put.key)
    assert isinstance(key, keys.ActKey)
    assert key.receiver in (node.unit, keys.EVERYBODY)
    if key.agent == "receipt":
        node.on_receipt(key.sender, decode_receipt(put.payload), now_us)
        return []
    return list(node.on_act(decode_act(put.payload)[0], now_us))


def two() -> tuple[Conversations, Conversations]:
    return Conversations("a", 1), Conversations("b", 2)


def opened(
    performative: Performative = P.REQUEST, *, standing: bool = False
) -> tuple[Conversations, Conversations, Act]:
    """A conversation that b has heard of."""
    a, b = two()
    said, (put,) = a.send(act(performative), 0, standing=standing)
    assert hear(b, put) == [Incoming(said)]
    return a, b, said


def only_reply(found: list[object]) -> Reply:
    (reply,) = found
    assert isinstance(reply, Reply)
    return reply


# Delivery


def test_an_act_is_numbered_and_gets_what_an_answer_needs() -> None:
    a, _ = two()
    said, (put,) = a.send(act(P.REQUEST), 5_000_000)
    assert (said.boot, said.seq, said.created_us) == (1, 1, 5_000_000)
    assert (said.conversation_id, said.protocol, said.reply_with) == ("a-1-1.b", "fipa-request", "r1")
    assert said.reply_by_us == 5_000_000 + REPLY_BY_US
    assert isinstance(put, Put)
    assert (put.key, decode_act(put.payload)[0]) == ("acl/b/a/interface", said)
    again, _ = a.send(act(P.REQUEST), 5_000_001)
    assert (again.seq, again.conversation_id) == (2, "a-1-2.b")


def test_an_act_is_put_again_three_times_until_it_is_acknowledged() -> None:
    a, b = two()
    _, (put,) = a.send(act(P.REQUEST), 0)
    assert (a.on_time(199_999), a.deadline_us) == ([], 200_000)
    assert [a.on_time(at_us) for at_us in (200_000, 400_000, 600_000)] == [[put], [put], [put]]
    hear(b, put)
    (receipt,) = b.flush()
    assert b.flush() == []
    hear(a, receipt)
    assert a.on_time(800_000) == []


def test_acknowledgements_ride_on_acts_that_go_the_same_way() -> None:
    a, b, said = opened()
    (put,) = b.answer(said, P.AGREE, GOTO, 10)
    assert b.flush() == []
    assert isinstance(put, Put)
    assert decode_act(put.payload)[0].acks == (said.seq,)
    hear(a, put)
    assert a.on_time(200_000) == []


def test_an_act_that_arrives_twice_is_acknowledged_twice_and_said_once() -> None:
    a, b = two()
    _, (put,) = a.send(act(P.INFORM), 0)
    assert len(hear(b, put)) == 1
    assert len(b.flush()) == 1
    assert hear(b, put) == []
    assert len(b.flush()) == 1
    assert b.delivery.counts["duplicate"] == 1


def test_a_receipt_for_an_earlier_life_says_nothing() -> None:
    a, _ = two()
    a.send(act(P.REQUEST), 0)
    a.on_receipt("b", Receipt(77, (1,)), 0)
    a.on_receipt("c", Receipt(1, (1,)), 0)
    assert len(a.on_time(200_000)) == 1


@given(st.lists(st.integers(0, 3 * WINDOW), max_size=200))
def test_each_number_of_a_life_is_new_once(seqs: list[int]) -> None:
    seen, known, greatest = SeenActs(5), set(), -1
    for seq in seqs:
        expected = seq not in known and seq > greatest - WINDOW
        assert seen.is_new(5, seq) == expected
        known.add(seq)
        greatest = max(greatest, seq)
    assert not seen.is_new(4, 10**6), "a straggler of an earlier life"
    assert seen.is_new(6, 0), "a later life"


@given(st.binary(max_size=40) | st.builds(lambda boot, seqs: encode_receipt(Receipt(boot, seqs)), st.integers(-5, 5), st.lists(st.integers(-2, 5), max_size=4)))  # fmt: skip
def test_a_receipt_is_read_strictly(payload: bytes) -> None:
    try:
        boot, seqs = decode_receipt(payload)
    except DecodeError:
        return
    assert boot >= 0
    assert all(seq >= 0 for seq in seqs)


def test_too_many_acts_that_one_does_not_acknowledge_are_given_up_from_its_oldest() -> None:
    a, _ = two()
    a.send(act(P.INFORM), 0)
    for _ in range(OF_ONE + 3):
        a.send(act(P.INFORM)._replace(receiver=AgentName("x", "silent")), 0)
    given_up = a.on_time(0)
    assert all(isinstance(each, Undelivered) for each in given_up)
    assert [each.act.seq for each in given_up] == [2, 3, 4]


def test_too_many_in_all_are_given_up_from_the_receiver_of_most() -> None:
    a, _ = two()
    for number in range(UNACKNOWLEDGED - 200):
        a.send(act(P.INFORM)._replace(receiver=AgentName("x", f"u{number % 4}")), 0)
    for number in range(201):
        a.send(act(P.INFORM)._replace(receiver=AgentName("x", f"v{number}")), 0)
    given_up = a.on_time(0)
    assert [each.act.receiver.unit[0] for each in given_up] == ["u"]


def test_an_act_that_cannot_be_encoded_is_not_sent_and_opens_nothing() -> None:
    a, _ = two()
    with pytest.raises(ContentError):
        a.send(act(P.REQUEST, Expr("goto", {"text": "x" * 70_000})), 0)
    assert (a.conversations(), a.deadline_us) == ([], None)
    assert a.send(act(P.REQUEST), 0)[0].seq == 1


# Protocols


def test_a_request_is_agreed_to_and_done() -> None:
    a, b, said = opened()
    (agree,) = b.answer(said, P.AGREE, GOTO, 10)
    assert not only_reply(hear(a, agree, 20)).closed
    assert [found.phase for found in (*a.conversations(), *b.conversations())] == [Phase.AGREED, Phase.AGREED]
    (done,) = b.answer(said, P.INFORM, DONE, 30)
    reply = only_reply(hear(a, done, 40))
    assert (reply.closed, reply.opening, reply.act.in_reply_to) == (True, said, said.reply_with)
    assert a.conversations() == b.conversations() == []


@pytest.mark.parametrize("answer", [P.REFUSE, P.FAILURE, P.NOT_UNDERSTOOD, P.INFORM])
def test_one_answer_that_is_no_agree_ends_a_request(answer: Performative) -> None:
    a, b, said = opened()
    (put,) = b.answer(said, answer, DONE, 10)
    assert only_reply(hear(a, put)).closed
    assert a.conversations() == b.conversations() == []


def test_silence_is_a_failure_at_the_reply_by() -> None:
    a, _, said = opened()
    a.on_receipt("b", Receipt(1, (said.seq,)), 0)
    assert (a.on_time(REPLY_BY_US - 1), a.deadline_us) == ([], REPLY_BY_US)
    assert a.on_time(REPLY_BY_US) == [TimedOut("a-1-1.b", said, "no answer in time")]
    assert (a.conversations(), a.deadline_us) == ([], None)


def test_who_is_asked_answers_by_the_reply_by_in_any_case() -> None:
    a, b, _ = opened()
    found = b.on_time(REPLY_BY_US)
    failure = only_reply(hear(a, found[-1], REPLY_BY_US))
    assert (failure.act.performative, failure.closed) == (P.FAILURE, True)
    assert b.conversations() == []


def test_a_reply_by_counts_from_when_it_was_said_not_by_the_receivers_clock() -> None:
    _, b = two()
    skewed = act(P.REQUEST, conversation_id="a-1-1.b", created_us=10**15, reply_by_us=10**15 + 300_000, boot=1, seq=1)
    b.on_act(skewed, 5)
    assert [found.due_us for found in b.conversations()] == [300_005]
    eternal = act(P.REQUEST, conversation_id="a-1-2.b", created_us=0, reply_by_us=2**62, boot=1, seq=2)
    b.on_act(eternal, 5)
    assert b.conversations()[1].due_us == 600_000_005


def test_an_agreed_result_that_does_not_come_is_a_failure_unless_it_may_take_for_ever() -> None:
    for within_us in (RESULT_WITHIN_US, None):
        a, b = two()
        said, (put,) = a.send(act(P.REQUEST), 0, result_within_us=within_us)
        hear(b, put)
        (agree,) = b.answer(said, P.AGREE, GOTO, 0)
        hear(a, agree, 1_000)
        late = a.on_time(1_000 + RESULT_WITHIN_US)
        assert late == ([] if within_us is None else [TimedOut("a-1-1.b", said, "no result in time")])


def test_what_cannot_be_delivered_fails_at_once() -> None:
    a, _ = two()
    said, _ = a.send(act(P.QUERY_REF), 0)
    for at_us in (200_000, 400_000, 600_000):
        assert len(a.on_time(at_us)) == 1
    assert a.on_time(800_000) == [TimedOut("a-1-1.b", said, "not delivered")]
    assert a.on_time(10**9) == []
    assert a.conversations() == []
    assert a.deadline_us is None


def test_an_answer_is_worth_more_patience_than_a_question() -> None:
    _, b, said = opened()
    (put,) = b.answer(said, P.INFORM, DONE, 0)
    found, now_us = [], 0
    while (due_us := b.deadline_us) is not None:
        now_us = due_us
        found += b.on_time(now_us)
    assert found[:-1] == [put] * 13
    assert isinstance(found[-1], Undelivered)
    assert now_us < 15_000_000


def test_a_subscription_lives_until_it_is_cancelled() -> None:
    a, b, said = opened(P.SUBSCRIBE)
    hear(a, b.answer(said, P.AGREE, GOTO, 0)[0])
    for number in range(3):
        assert not only_reply(hear(a, b.answer(said, P.INFORM, Expr("alarm"), number)[0])).closed
    assert a.on_time(10**9) == b.on_time(0) == []
    (cancel,) = a.cancel("a-1-1.b", "b", 10**9)
    assert a.cancel("a-1-1.b", "b", 10**9) == []
    ((incoming),) = hear(b, cancel)
    assert isinstance(incoming, Incoming)
    assert incoming.act.performative is P.CANCEL
    assert not only_reply(hear(a, b.answer(said, P.INFORM, Expr("alarm"), 5)[0])).closed, "one was under way"
    assert only_reply(hear(a, b.answer(incoming.act, P.INFORM, DONE, 6)[0])).closed
    assert a.conversations() == b.conversations() == []


def test_a_standing_request_lives_beyond_its_result() -> None:
    a, b, said = opened(standing=True)
    hear(a, b.answer(said, P.AGREE, GOTO, 0, standing=True)[0])
    assert not only_reply(hear(a, b.answer(said, P.INFORM, DONE, 1)[0])).closed
    assert [found.phase for found in (*a.conversations(), *b.conversations())] == [Phase.STANDING, Phase.STANDING]
    assert only_reply(hear(a, b.answer(said, P.FAILURE, DONE, 2)[0])).closed
    assert a.conversations() == b.conversations() == []


def test_a_cancel_that_is_not_answered_is_a_failure() -> None:
    a, b, said = opened(P.SUBSCRIBE)
    hear(a, b.answer(said, P.AGREE, GOTO, 0)[0])
    a.on_receipt("b", Receipt(1, (1,)), 0)
    a.cancel("a-1-1.b", "b", 1_000_000)
    a.on_receipt("b", Receipt(1, (2,)), 0)
    assert a.on_time(1_000_000 + REPLY_BY_US) == [TimedOut("a-1-1.b", said, "no answer to cancel in time")]


@pytest.mark.parametrize("conversation", ["a-1-1.b", "c-9-4"])
def test_a_cancel_of_what_was_lost_or_another_member_opened_is_answered_or_fails(conversation: str) -> None:
    for is_answered in (True, False):
        a, b, _ = opened(standing=True)
        a.peer_gone("b")
        said, (put,) = a.send(act(P.CANCEL, GOTO, conversation_id=conversation), 0)
        incoming = hear(b, put)[-1]
        assert isinstance(incoming, Incoming)
        if is_answered:
            assert only_reply(hear(a, b.answer(incoming.act, P.INFORM, DONE, 1)[0])).closed
        else:
            a.on_receipt("b", Receipt(1, (1, 2)), 0)
            assert a.on_time(REPLY_BY_US) == [TimedOut(conversation, said, "no answer to cancel in time")]
        assert a.conversations() == []


def test_a_standing_request_that_failed_in_silence_is_cancelled_too() -> None:
    a, b, said = opened(standing=True)
    a.on_receipt("b", Receipt(1, (1,)), 0)
    timed_out, cancel = a.on_time(REPLY_BY_US)
    assert timed_out == TimedOut("a-1-1.b", said, "no answer in time")
    (incoming,) = hear(b, cancel)
    assert isinstance(incoming, Incoming)
    assert incoming.act.performative is P.CANCEL
    b.answer(incoming.act, P.INFORM, DONE, REPLY_BY_US)
    assert b.conversations() == []


def test_who_agrees_too_late_is_told_to_stop() -> None:
    a, b, said = opened()
    agree = b.answer(said, P.AGREE, GOTO, 0)[0]
    a.on_receipt("b", Receipt(1, (1,)), 0)
    a.on_time(REPLY_BY_US)
    (cancel,) = hear(a, agree, REPLY_BY_US + 1)
    (incoming,) = hear(b, cancel)
    assert isinstance(incoming, Incoming)
    assert (incoming.act.performative, incoming.act.conversation_id) == (P.CANCEL, "a-1-1.b")
    late_inform = b.answer(said, P.INFORM, DONE, 0)[0]
    assert hear(a, late_inform) == []
    assert a.delivery.counts["late"] == 2


def test_a_proposal_is_accepted_or_rejected() -> None:
    for answer in (P.ACCEPT_PROPOSAL, P.REJECT_PROPOSAL):
        a, b, said = opened(P.PROPOSE)
        assert only_reply(hear(a, b.answer(said, answer, Expr("avoid"), 0)[0])).closed
        assert a.conversations() == b.conversations() == []


def test_a_question_to_everybody_collects_answers_until_its_reply_by() -> None:
    a, b, c = Conversations("a", 1), Conversations("b", 2), Conversations("c", 3)
    everybody = Act(P.QUERY_REF, ASKER, AgentName("interface", "all"), Expr("tasks"))
    said, (put,) = a.send(everybody, 0)
    for node in (b, c):
        (incoming,) = hear(node, put)
        assert isinstance(incoming, Incoming)
        assert node.flush() == [], "nobody acknowledges what is said to everybody"
        (answer,) = node.answer(incoming.act, P.INFORM, DONE, 5)
        assert only_reply(hear(a, answer)).act.sender == AgentName("interface", node.unit)
    a.flush()
    assert a.on_time(REPLY_BY_US) == [TimedOut("a-1-1.all", said, "no answer in time")]
    assert a.conversations() == b.conversations() == []


def test_an_inform_out_of_the_blue_is_for_the_agents() -> None:
    a, b = two()
    said, (put,) = a.send(act(P.INFORM, Expr("stream")), 0)
    assert hear(b, put) == [Incoming(said)]
    assert a.conversations() == b.conversations() == []


def test_the_loss_of_a_platform_ends_everything_with_it_and_nothing_else() -> None:
    a, b, said = opened(P.SUBSCRIBE)
    hear(a, b.answer(said, P.AGREE, GOTO, 0)[0])
    other, _ = a.send(Act(P.REQUEST, ASKER, AgentName("interface", "c"), GOTO), 0)
    assert a.peer_gone("b") == [PeerLost("a-1-1.b", said, "b", ours=True)]
    assert b.peer_gone("a") == [PeerLost("a-1-1.b", said, "a", ours=False)]
    assert [found.opening for found in a.conversations()] == [other]
    assert [put for put in a.on_time(200_000) if isinstance(put, Put) and put.key.startswith("acl/b")] == []


def test_who_was_thought_gone_is_told_what_was_dropped_meanwhile() -> None:
    a, b, said = opened(P.SUBSCRIBE)
    hear(a, b.answer(said, P.AGREE, GOTO, 0)[0])
    for receipt in a.flush():
        hear(b, receipt)
    b.peer_gone("a")  # a stood still and noticed nothing
    (failure,) = b.peer_appeared("a", 1, 5)
    reply = only_reply(hear(a, failure))
    assert (reply.closed, reply.act.performative) == (True, P.FAILURE)
    assert a.conversations() == []
    assert b.peer_appeared("a", 1, 6) == []


def test_a_delegator_that_lost_sight_cancels_what_it_had_standing() -> None:
    a, b, said = opened(standing=True)
    hear(a, b.answer(said, P.AGREE, GOTO, 0, standing=True)[0])
    a.peer_gone("b")
    (cancel,) = a.peer_appeared("b", 2, 5)
    (incoming,) = hear(b, cancel)
    assert isinstance(incoming, Incoming)
    assert incoming.act.performative is P.CANCEL
    a.peer_gone("b")
    assert a.peer_appeared("b", 3, 6) == [], "a new incarnation knows nothing of it"


def test_a_restarted_peer_whose_clock_was_set_back_is_heard_again() -> None:
    _, b = two()
    b.on_act(act(P.INFORM, boot=100, seq=9), 0)
    assert b.on_act(act(P.INFORM, boot=50, seq=1), 1) == []
    b.peer_appeared("a", 50, 2)
    assert len(b.on_act(act(P.INFORM, boot=50, seq=2), 3)) == 1


def test_nobody_opens_more_conversations_than_the_quota() -> None:
    a, b = two()
    for _ in range(OPEN_PER_PEER):
        _, (put,) = a.send(act(P.REQUEST), 0)
        hear(b, put)
    with pytest.raises(Refused):
        a.send(act(P.REQUEST), 0)
    (refusal,) = b.on_act(act(P.REQUEST, conversation_id="a-1-hostile", boot=1, seq=999), 0)
    assert isinstance(refusal, Put)
    assert decode_act(refusal.payload)[0].performative is P.REFUSE
    assert len(b.conversations()) == OPEN_PER_PEER
    assert b.on_act(act(P.CANCEL, conversation_id="a-1-1.b", boot=1, seq=1000), 0), "a cancel of what is open passes"


def test_a_stream_that_ran_out_closes_its_conversation_without_words() -> None:
    a, b, said = opened(standing=True)
    hear(a, b.answer(said, P.AGREE, GOTO, 0, standing=True)[0])
    a.close("a-1-1.b", "b")
    b.close("a-1-1.b", "a")
    assert a.conversations() == b.conversations() == []


# Two platforms that talk over a bad wire


class Talk:
    """Platforms whose agents answer as they like, on a wire that loses, doubles, delays and is cut."""

    def __init__(self, seed: int, loss: float) -> None:
        self.random, self.loss, self.cut = Random(seed), loss, False
        self.nodes = {unit: Conversations(unit, boot) for boot, unit in enumerate(("a", "b", "c"), 1)}
        self.now_us = 0
        self.queue: list[tuple[int, int, str, Put]] = []
        self.numbers = count()
        self.incoming: Counter[tuple[str, int, str]] = Counter()
        self.ended: Counter[str] = Counter()
        self.openings: set[str] = set()
        self.blind: set[tuple[str, str]] = set()

    def say(self) -> None:
        unit, peer = self.random.sample(sorted(self.nodes), 2)
        performative = self.random.choice([P.REQUEST, P.QUERY_REF, P.SUBSCRIBE, P.PROPOSE, P.INFORM])
        standing = performative is P.REQUEST and self.random.random() < 0.4
        said, outcome = self.nodes[unit].send(
            Act(performative, AgentName("x", unit), AgentName("interface", peer), WATCH if standing else GOTO),
            self.now_us,
            standing=standing,
        )
        if performative is not P.INFORM:
            assert said.conversation_id is not None
            self.openings.add(said.conversation_id)
        self.take(unit, outcome)

    def take(self, unit: str, outcome: Sequence[object]) -> None:
        for found in outcome:
            match found:
                case Put(key):
                    for _ in range(self.random.choice([1, 1, 1, 2])):
                        if not self.cut and self.random.random() >= self.loss:
                            at_us = self.now_us + self.random.randrange(1, 150_000)
                            heappush(self.queue, (at_us, next(self.numbers), key.split("/")[1], found))
                case Incoming(said):
                    self.incoming[said.sender.unit, said.seq, unit] += 1
                    self.agent(unit, said)
                case Reply(conversation, said, opening, closed):
                    self.incoming[said.sender.unit, said.seq, unit] += 1
                    self.ended[conversation] += closed
                    if not closed and self.random.random() < 0.3:
                        self.take(unit, self.nodes[unit].cancel(conversation, opening.receiver.unit, self.now_us))
                case TimedOut(conversation):
                    self.ended[conversation] += 1
                case PeerLost(conversation, _, _, ours):
                    self.ended[conversation] += ours

    def lose_sight(self, unit: str, peer: str) -> None:
        """`unit` thinks that `peer` is gone, which may be so or not; or sees it again."""
        if (unit, peer) in self.blind:
            self.see_again(unit, peer)
        else:
            self.blind.add((unit, peer))
            self.take(unit, self.nodes[unit].peer_gone(peer))

    def see_again(self, unit: str, peer: str) -> None:
        self.blind.discard((unit, peer))
        self.take(unit, self.nodes[unit].peer_appeared(peer, self.nodes[peer].boot, self.now_us))

    def agent(self, unit: str, said: Act) -> None:
        node = self.nodes[unit]
        if said.performative is P.INFORM or self.random.random() < 0.1:
            return
        if said.performative is P.CANCEL:
            self.take(unit, node.answer(said, P.INFORM, DONE, self.now_us))
            return
        standing = said.content == WATCH
        if self.random.random() < 0.7:
            self.take(unit, node.answer(said, P.AGREE, GOTO, self.now_us, standing=standing))
        if self.random.random() < 0.8:
            answer = self.random.choice([P.INFORM, P.INFORM, P.FAILURE, P.REFUSE, P.NOT_UNDERSTOOD])
            self.take(unit, node.answer(said, answer, DONE, self.now_us, standing=standing))

    def run(self, seconds: float) -> None:
        until_us = self.now_us + round(seconds * 1e6)
        while True:
            due = [(node.deadline_us, unit) for unit, node in self.nodes.items() if node.deadline_us is not None]
            next_us, unit = min(due, default=(until_us + 1, ""))
            if self.queue and self.queue[0][0] <= min(next_us, until_us):
                self.now_us, _, unit, put = heappop(self.queue)
                self.take(unit, hear(self.nodes[unit], put, self.now_us))
            elif next_us <= until_us:
                self.now_us = max(self.now_us, next_us)
                self.take(unit, self.nodes[unit].on_time(self.now_us))
            else:
                break
            self.take(unit, self.nodes[unit].flush())
        self.now_us = until_us


@settings(max_examples=examples(80), deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([0.0, 0.1, 0.4]), st.booleans())
def test_on_any_wire_acts_are_heard_once_and_conversations_end_once_on_both_sides(
    seed: int, loss: float, losing_sight: bool
) -> None:
    talk = Talk(seed, loss)
    for _ in range(30):
        talk.say()
        talk.cut = talk.random.random() < 0.2
        if losing_sight and talk.random.random() < 0.2:
            talk.lose_sight(*talk.random.sample(sorted(talk.nodes), 2))
        talk.run(talk.random.random() * 0.8)
    talk.cut, talk.loss = False, 0.0
    for unit, peer in sorted(talk.blind):
        talk.see_again(unit, peer)
    talk.run(30)
    assert set(talk.incoming.values()) <= {1}, "no act is taken twice"
    assert set(talk.ended.values()) <= {0, 1}, "no conversation ends twice"
    ours: set[tuple[str, str]] = set()
    theirs: set[tuple[str, str]] = set()
    for node in talk.nodes.values():
        for found in node.conversations():
            name = found.opening.conversation_id
            assert name is not None
            assert found.due_us is None, "nobody owes an answer"
            if found.ours:
                assert found.phase is Phase.STANDING
                ours.add((name, found.peer))
            elif found.phase is Phase.STANDING:
                theirs.add((name, node.unit))
    assert ours == theirs, "what one side believes to stand, the other does too"
    assert {name for name, _ in ours} | {name for name, times in talk.ended.items() if times} == talk.openings
    assert all(node.delivery.waiting(unit) == 0 for node in talk.nodes.values() for unit in talk.nodes)
