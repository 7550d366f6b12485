"""Exported and imported streams: each sample once, whatever the wire does, as long as the owner holds it."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import count

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from dyknow.federation.members.clock import FederationClock
from dyknow.federation.messages.beats import MAX_TAILS
from dyknow.federation.messages.codec import StreamSample, decode_range, decode_recovered, decode_samples
from dyknow.federation.sharing.exports import LINGER_US, ContractEnded, EndReason, Exports, StreamEnded
from dyknow.federation.sharing.streams import MISSING, RETRY_MOST_US, ExportStream, ImportStream
from dyknow.federation.transport import Answer, AnswerEnd, Ask, Asked, Put
from dyknow.model.errors import Refused
from dyknow.model.sample import Sample
from dyknow.policies.policy import Policy
from tests.strategies import examples

LABEL, HASH = "heli-position", "ab12cd34"


def sample(number: int) -> Sample:
    return Sample(number, number * 100_000, (58.4, 15.5 + number))


def arrived(stream: ImportStream, put: Put, now_us: int) -> list[int]:
    boot, entries, *_ = decode_samples(put.payload)
    return [entry.seq for entry in stream.on_samples(boot, entries, now_us)]


def answered(export: ExportStream, ask: Ask) -> list[bytes]:
    return export.answer(decode_range(ask.payload).ranges)


def pair(capacity: int = 100) -> tuple[ExportStream, ImportStream]:
    return ExportStream("1", LABEL, HASH, 7, capacity), ImportStream("1", LABEL, HASH, count(1), boot=7, first=1)


def test_samples_in_order_pass_straight_through() -> None:
    export, stream = pair()
    puts = [export.on_sample(sample(number)) for number in range(5)]
    assert [arrived(stream, put, 0) for put in puts] == [[1], [2], [3], [4], [5]]
    assert (stream.deadline_us, stream.account.received, stream.missing) == (None, 5, 0)
    assert {put.key for put in puts} == {f"x/1/{LABEL}/{HASH}"}


def test_a_gap_holds_nothing_back_and_is_asked_for() -> None:
    export, stream = pair()
    puts = [export.on_sample(sample(number)) for number in range(6)]
    assert [arrived(stream, puts[at], 0) for at in (0, 3, 5)] == [[1], [4], [6]]
    assert stream.on_time(0) == [], "what is only reordered comes by itself"
    due_us = stream.deadline_us
    assert due_us is not None
    (ask,) = stream.on_time(due_us)
    assert ask.key == f"q/1/{LABEL}"
    assert decode_range(ask.payload).ranges == ((2, 3), (5, 5))
    fresh = [entry for page in answered(export, ask) for entry in stream.on_recovered(decode_recovered(page), 1)]
    assert [(entry.seq, entry.value) for entry in fresh] == [(n, sample(n - 1).value) for n in (2, 3, 5)]
    stream.on_ask_ended(ask.question, 2)
    assert (stream.deadline_us, stream.account.recovered, stream.account.lost) == (None, 3, 0)


def test_the_end_of_a_stream_is_missed_by_the_tail_that_heartbeats_carry() -> None:
    export, stream = pair()
    puts = [export.on_sample(sample(number)) for number in range(3)]
    arrived(stream, puts[0], 0)
    stream.on_tail(7, export.tail, 1_000)
    assert stream.missing == 2
    (ask,) = stream.on_time(1_000_000)
    for page in answered(export, ask):
        stream.on_recovered(decode_recovered(page), 1_000_001)
    assert (stream.missing, stream.account.received) == (0, 3)


def test_what_the_owner_holds_no_more_is_lost_and_not_asked_for_again() -> None:
    export, stream = pair(capacity=3)
    puts = [export.on_sample(sample(number)) for number in range(10)]
    arrived(stream, puts[0], 0)
    arrived(stream, puts[9], 0)
    (ask,) = stream.on_time(1_000_000)
    fresh = [entry.seq for page in answered(export, ask) for entry in stream.on_recovered(decode_recovered(page), 1)]
    stream.on_ask_ended(ask.question, 1_000_002)
    assert (fresh, stream.account.lost, stream.deadline_us) == ([8, 9], 6, None)


def test_an_owner_that_does_not_answer_is_asked_ever_more_rarely() -> None:
    export, stream = pair()
    export.on_sample(sample(0))
    arrived(stream, export.on_sample(sample(1)), 0)
    now_us, pauses = 0, []
    for _ in range(9):
        due_us = stream.deadline_us
        assert due_us is not None
        pauses.append(due_us - now_us)
        (ask,) = stream.on_time(due_us)
        assert stream.deadline_us is None, "one question at a time"
        now_us = due_us
        stream.on_ask_ended(ask.question, now_us)
    assert pauses == sorted(pauses)
    assert pauses[-1] == RETRY_MOST_US


def test_a_stream_whose_first_number_is_not_known_begins_with_what_is_heard_first() -> None:
    export = ExportStream("1", LABEL, HASH, 7)
    puts = [export.on_sample(sample(number)) for number in range(9)]
    stream = ImportStream("1", LABEL, HASH, count(1))
    assert arrived(stream, puts[6], 0) == [7]
    assert arrived(stream, puts[8], 0) == [9]
    assert arrived(stream, puts[2], 0) == [], "from before we listened"
    assert stream.missing == 1
    quiet = ImportStream("1", LABEL, HASH, count(1))
    quiet.on_tail(7, 9, 0)
    assert quiet.missing == 1, "the newest sample is wanted even if it was put before we listened"


def test_a_restarted_owner_begins_a_new_stream_and_its_old_samples_are_stale() -> None:
    export, stream = pair()
    old = [export.on_sample(sample(number)) for number in range(5)]
    arrived(stream, old[0], 0)
    arrived(stream, old[4], 0)
    reborn = ExportStream("1", LABEL, HASH, 8)
    assert arrived(stream, reborn.on_sample(sample(0)), 1) == [1]
    assert arrived(stream, old[2], 2) == []
    stream.on_tail(7, 5, 3)
    account = stream.account
    assert (account.stale, account.lost, stream.missing, stream.boot) == (1, 3, 0, 8)


def test_a_question_to_a_restarted_owner_teaches_that_it_was_restarted() -> None:
    export, stream = pair()
    puts = [export.on_sample(sample(number)) for number in range(3)]
    arrived(stream, puts[2], 0)
    (ask,) = stream.on_time(1_000_000)
    reborn = Exports("1", 8)
    answer, end = reborn.on_asked(Asked(5, ask.key, 0, ask.payload), LABEL)
    assert (isinstance(answer, Answer), end) == (True, AnswerEnd(5))
    assert isinstance(answer, Answer)
    stream.on_recovered(decode_recovered(answer.payload), 1)
    stream.on_ask_ended(ask.question, 2)
    assert (stream.boot, stream.account.lost, stream.deadline_us) == (8, 2, None)


def test_a_lying_tail_costs_no_memory() -> None:
    _, stream = pair()
    stream.on_tail(7, 10**15, 0)
    assert stream.missing == MISSING
    stream.on_samples(7, [StreamSample(2 * 10**15, 0, 1.0)], 0)
    assert stream.missing <= MISSING


@settings(max_examples=examples(200))
@given(st.integers(1, 60), st.integers(1, 40), st.data())
def test_whatever_is_lost_doubled_or_reordered_each_held_sample_is_delivered_once(
    samples: int, capacity: int, data: st.DataObject
) -> None:
    export, stream = pair(capacity)
    puts = [export.on_sample(sample(number)) for number in range(samples)]
    survivors = data.draw(st.lists(st.sampled_from(puts), max_size=2 * samples))
    got = [seq for at_us, put in enumerate(survivors) for seq in arrived(stream, put, at_us)]
    held = set(range(export.oldest, export.tail + 1))
    now_us, delivered = 1_000_000, got
    for lost_answer in [*data.draw(st.lists(st.booleans(), max_size=4)), False, False]:
        stream.on_tail(7, export.tail, now_us)
        now_us += 10_000_000
        for ask in stream.on_time(now_us):
            for page in () if lost_answer else answered(export, ask):
                delivered += [entry.seq for entry in stream.on_recovered(decode_recovered(page), now_us)]
            stream.on_ask_ended(ask.question, now_us)
    assert len(delivered) == len(set(delivered)), "once"
    assert held <= set(delivered), "all that is held"
    assert set(delivered) | set(range(1, export.oldest)) == set(range(1, samples + 1))
    assert stream.account.lost == samples - len(delivered)
    assert (stream.missing, stream.deadline_us) == (0, None)


class LossyStream(RuleBasedStateMachine):
    """An owner, a receiver and everything between them, in any order; the owner may be restarted."""

    def __init__(self) -> None:
        super().__init__()
        self.now_us, self.boot, self.made = 0, 1, 0
        self.export = ExportStream("1", LABEL, HASH, 1, 1000)
        self.stream = ImportStream("1", LABEL, HASH, count(1), boot=1, first=1)
        self.flying: list[Put] = []
        self.asks: list[Ask] = []
        self.delivered: list[tuple[int, int]] = []

    def take(self, entries: Iterable[StreamSample]) -> None:
        self.delivered += [entry.value for entry in entries]

    @rule(put=st.booleans())
    def owner_samples(self, put: bool) -> None:
        self.made += 1
        said = self.export.on_sample(Sample(0, 0, (self.boot, self.export.tail + 1)))
        if put:
            self.flying.append(said)

    @precondition(lambda self: self.flying)
    @rule(at=st.integers(0, 10**6), keep=st.booleans())
    def something_arrives(self, at: int, keep: bool) -> None:
        put = self.flying[at % len(self.flying)]
        if not keep:
            self.flying.remove(put)
        boot, entries, *_ = decode_samples(put.payload)
        self.take(self.stream.on_samples(boot, entries, self.now_us))

    @rule(later_us=st.integers(0, 3_000_000))
    def time_passes(self, later_us: int) -> None:
        self.now_us += later_us
        self.asks += self.stream.on_time(self.now_us)

    @rule()
    def heartbeat(self) -> None:
        self.stream.on_tail(self.boot, self.export.tail, self.now_us)

    @precondition(lambda self: self.asks)
    @rule(lost=st.booleans())
    def owner_answers(self, lost: bool) -> None:
        ask = self.asks.pop(0)
        if not lost:
            ranges = decode_range(ask.payload).ranges if decode_range(ask.payload).boot == self.boot else ()
            for page in self.export.answer(ranges):
                self.take(self.stream.on_recovered(decode_recovered(page), self.now_us))
        self.stream.on_ask_ended(ask.question, self.now_us)

    @rule()
    def owner_restarts(self) -> None:
        self.boot += 1
        self.export = ExportStream("1", LABEL, HASH, self.boot, 1000)

    @invariant()
    def nothing_is_delivered_twice(self) -> None:
        assert len(self.delivered) == len(set(self.delivered))

    @invariant()
    def accounts_add_up(self) -> None:
        account = self.stream.account
        assert account.received == len(self.delivered)
        assert account.recovered <= account.received

    def teardown(self) -> None:
        for _ in range(3):
            self.heartbeat()
            self.time_passes(3_000_000)
            while self.asks:
                self.owner_answers(False)
        assert (self.stream.missing, self.stream.deadline_us) == (0, None)
        if self.export.tail:
            present = sorted(seq for boot, seq in self.delivered if boot == self.boot)
            assert present == list(range(present[0], self.export.tail + 1)), "no gap from the first one on"


TestLossyStream = LossyStream.TestCase
TestLossyStream.settings = settings(max_examples=examples(60), stateful_step_count=40, deadline=None)


# Contracts

EVERY_100 = Policy.parse("sample every 100, max delay 1s")
UNTIL = Policy(to_us=5_000_000, max_delay_us=1_000_000)


@dataclass
class Ends:
    """What ended, as the agents are told."""

    contracts: list[tuple[str, EndReason]] = field(default_factory=list)
    streams: list[EndReason] = field(default_factory=list)

    @staticmethod
    def of(events: Iterable[ContractEnded | StreamEnded]) -> "Ends":
        found = Ends()
        for event in events:
            if isinstance(event, ContractEnded):
                found.contracts.append((event.contract, event.why))
            else:
                found.streams.append(event.why)
        return found


def test_contracts_for_one_label_and_policy_share_one_stream() -> None:
    exports = Exports("1", 7)
    first, is_new = exports.open("c1", LABEL, EVERY_100, ["0", "2"])
    second, is_new_again = exports.open("c2", LABEL, EVERY_100, ["3"])
    assert (first is second, is_new, is_new_again) == (True, True, False)
    assert exports.streams() == [(first, ("0", "2", "3"))]
    other, is_new = exports.open("c3", LABEL, UNTIL, ["3"])
    assert (other is first, is_new) == (False, True)
    assert Ends.of(exports.stop("c1", 0)) == Ends([("c1", EndReason.STOPPED)])
    assert Ends.of(exports.stop("c2", 0)) == Ends([("c2", EndReason.STOPPED)], [EndReason.STOPPED])
    assert exports.stop("c2", 0) == [], "ending is said once"
    assert exports.stream(LABEL, EVERY_100.content_hash()) is None


def test_of_many_streams_each_is_named_by_some_heartbeat_soon() -> None:
    exports = Exports("1", 7)
    for number in range(150):
        stream, _ = exports.open(f"c{number}", f"label-{number}", EVERY_100, ["0"])
        stream.on_sample(sample(0))
    beats = [exports.tails() for _ in range(4)]
    assert {len(tails) for tails in beats} == {MAX_TAILS}
    assert {label for tails in beats for label, _, _ in tails} == {f"label-{number}" for number in range(150)}


def test_a_stream_ends_when_the_last_late_sample_would_be_too_late() -> None:
    exports = Exports("1", 7, FederationClock(0, 2.0).wall_us)
    exports.open("c1", LABEL, UNTIL, ["0"])
    assert exports.deadline_us == 3_000_001, "6 s of federation time are 3 s of the node clock"
    assert exports.on_time(3_000_000) == []
    assert Ends.of(exports.on_time(3_000_001)) == Ends([("c1", EndReason.DURATION)], [EndReason.DURATION])
    assert exports.on_time(3_000_002) == []


def test_a_receiver_that_comes_back_in_time_keeps_its_contract_and_recovers() -> None:
    exports = Exports("1", 7)
    stream, _ = exports.open("c1", LABEL, EVERY_100, ["0"])
    exports.receiver_gone("0", 1_000_000)
    stream.on_sample(sample(0))
    assert exports.on_time(16_000_000) == []
    exports.receiver_back("0")
    assert exports.on_time(1_000_000 + LINGER_US) == []
    assert [entry.seq for page in stream.answer([(1, 1)]) for entry in decode_recovered(page).samples] == [1]


def test_the_contracts_of_a_receiver_that_went_end_when_another_life_of_it_appears() -> None:
    exports = Exports("1", 7)
    exports.open("c1", LABEL, EVERY_100, ["0"])
    exports.receiver_gone("0", 1_000_000, 5)
    assert exports.receiver_appeared("0", 5, 2_000_000) == []
    exports.receiver_gone("0", 3_000_000, 5)
    assert Ends.of(exports.receiver_appeared("0", 6, 4_000_000)) == Ends(
        [("c1", EndReason.RECEIVERS)], [EndReason.RECEIVERS]
    )
    assert exports.receiver_appeared("0", 6, 5_000_000) == []


def test_of_many_streams_each_comes_into_a_heartbeat_in_turn() -> None:
    exports = Exports("1", 7)
    names = set()
    for number in range(3 * MAX_TAILS + 5):
        policy = Policy(max_delay_us=number + 1)
        stream, _ = exports.open(f"c{number}", LABEL, policy, ["0"])
        stream.on_sample(sample(0))
        names.add((LABEL, policy.content_hash(), 1))
    beats = [exports.tails() for _ in range(5)]
    assert all(len(beat) == MAX_TAILS for beat in beats)
    assert {tail for beat in beats for tail in beat} == names


def test_a_stream_without_receivers_ends() -> None:
    exports = Exports("1", 7)
    exports.open("c1", LABEL, EVERY_100, ["0", "2"])
    exports.receiver_gone("0", 1_000_000)
    exports.receiver_gone("0", 2_000_000)
    due_us = 1_000_000 + LINGER_US
    assert exports.deadline_us == due_us
    assert exports.on_time(due_us) == [], "there is another"
    assert Ends.of(exports.receiver_restarted("2", due_us)) == Ends(
        [("c1", EndReason.RECEIVERS)], [EndReason.RECEIVERS]
    )


def test_the_ring_outlives_its_stream_and_numbers_go_on_when_it_is_opened_again() -> None:
    exports = Exports("1", 7)
    stream, _ = exports.open("c1", LABEL, EVERY_100, ["0"])
    stream.on_sample(sample(0))
    exports.stop("c1", 0)
    assert exports.tails() == [(LABEL, EVERY_100.content_hash(), 1)]
    again, is_new = exports.open("c2", LABEL, EVERY_100, ["0"])
    assert (again is stream, is_new) == (True, True)
    exports.stop("c2", 0)
    assert exports.deadline_us == LINGER_US
    assert exports.on_time(LINGER_US) == []
    assert not exports.tails()
    assert exports.deadline_us is None
    later, _ = exports.open("c3", LABEL, EVERY_100, ["0"])
    assert later.tail == 1, "a receiver that remembers takes the next sample for a new one"


def test_a_contract_needs_a_receiver_a_name_of_its_own_and_room() -> None:
    exports = Exports("1", 7, streams=2)
    with pytest.raises(Refused):
        exports.open("c1", LABEL, EVERY_100, [])
    exports.open("c1", LABEL, EVERY_100, ["0"])
    with pytest.raises(Refused):
        exports.open("c1", "heli-altitude", EVERY_100, ["0"])
    exports.open("c2", "heli-altitude", EVERY_100, ["0"])
    with pytest.raises(Refused):
        exports.open("c3", "heli-height", EVERY_100, ["0"])
    exports.stop("c2", 0)
    exports.open("c3", "heli-height", EVERY_100, ["0"])


def test_a_malformed_question_is_counted_and_ended() -> None:
    exports = Exports("1", 7)
    assert exports.on_asked(Asked(3, f"q/1/{LABEL}", 0, b"\xc1"), LABEL) == [AnswerEnd(3)]
    assert sum(exports.refused.values()) == 1
