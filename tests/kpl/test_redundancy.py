"""Redundant producers of one stream (3.2): `first of` in KPL, failover, and the report of the active producer."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow import NO_VALUE, Sample
from dyknow.kpl import parse_specification, print_specification
from dyknow.kpl.introspection.drawings import as_text
from dyknow.kpl.introspection.graph import graph_of, maker_of
from dyknow.model.errors import TextErrors
from tests.kpl.instances import Running

MS = 1000
PERIOD_MS, SILENCE_MS = 100, 300
PERIOD_US, SILENCE_US = PERIOD_MS * MS, SILENCE_MS * MS
POLICY = "with sample every 100, max delay 200"
STREAMS = f"""
source number a
source number b
source number c
strmgen x[a] = a
strmgen x[b] = b
strmgen x[c] = c
strmgen x[0] = first of x[a] {POLICY}, x[b] {POLICY}, x[c] {POLICY}
stream out = x[0]
"""


class Redundant(Running):
    """`first of` three, and which of them each sample came from."""

    def __init__(self, text=STREAMS, **more):
        self.producers, self.made_by = [], []
        super().__init__(text, **more)
        self.network.on_producer = lambda label, of: self.producers.append(
            (self.now_us, str(label), None if of is None else str(of))
        )
        self.instance.hooks.on_output = self.on_output

    def on_output(self, name, sample):
        self.outputs.append((name, sample))
        self.made_by.append(str(maker_of(self.instance, name, sample)))

    def feed(self, until_ms, **silent):
        """Each producer at 10 Hz until a time, but for those that are silent from a time to a time."""
        for at_ms in range(self.now_us // MS // PERIOD_MS * PERIOD_MS + PERIOD_MS, until_ms + 1, PERIOD_MS):
            for name in "abc":
                begins_ms, ends_ms = silent.get(name, (0, 0))
                if not begins_ms <= at_ms < ends_ms:
                    self.push(name, at_ms, at_ms * MS)


def test_the_preferred_producer_is_used_until_it_is_silent_and_again_when_it_has_been_back_for_a_while():
    run = Redundant()
    run.feed(5000, a=(1000, 2500))
    assert [each[1:] for each in run.producers] == [("x[0]", "x[b]"), ("x[0]", "x[a]")]
    assert run.producers[0][0] == 900 * MS + SILENCE_US + 1, "silent for its period and its delay"
    assert run.producers[1][0] == 2500 * MS + 3 * SILENCE_US, "back for three times as long"
    assert [sample.valid_us // MS for _, sample in run.outputs] == list(range(100, 5001, 100)), "nothing is missing"
    assert run.made_by == ["x[a]"] * 9 + ["x[b]"] * 24 + ["x[a]"] * 17


def test_a_producer_that_comes_and_goes_is_not_used_in_between():
    run = Redundant()
    run.feed(900)
    for begins_ms in range(1000, 9000, 1000):
        run.feed(begins_ms + 900, a=(begins_ms, begins_ms + 500))
    assert [each[2] for each in run.producers] == ["x[b]"]


def test_when_all_are_silent_that_is_told_and_the_first_to_be_heard_is_used():
    run = Redundant()
    run.feed(2000, a=(1000, 9000), b=(1000, 9000), c=(1000, 1800))
    assert [each[2] for each in run.producers] == [None, "x[c]"]
    assert run.made_by[-1] == "x[c]"
    run.feed(2500, a=(0, 9000))
    assert run.network.deadline_us is not None
    run.wait(3_000_000)
    assert [each[2] for each in run.producers] == [None, "x[c]", None], "told without any sample"
    run.feed(5000, a=(0, 9000), b=(0, 4000))
    assert [each[2] for each in run.producers][3:] == ["x[c]", "x[b]"], "preferred to c, and back for a while"


@pytest.mark.parametrize("value", ["nonsense", ("a", 1), NO_VALUE])
def test_what_is_no_value_of_the_sort_neither_keeps_a_stream_nor_takes_it_over(value):
    sorted_ = STREAMS.replace("source number", "source height") + "sort height in m\n"
    run = Redundant(sorted_)
    run.feed(900)
    for at_ms in range(1000, 3000, PERIOD_MS):
        run.push("b", value, at_ms * MS)
        run.push("a", at_ms, at_ms * MS)
    assert run.producers == []
    for at_ms in range(3000, 6000, PERIOD_MS):
        run.push("a", value, at_ms * MS)
        run.push("b", at_ms, at_ms * MS)
    assert [each[2] for each in run.producers] == ["x[b]"]
    assert run.values("out")[-1] == 5900


def test_a_sample_from_the_future_is_refused_and_the_old_ones_of_a_producer_are_no_sign_of_life():
    run = Redundant()
    run.feed(900)
    run.instance.push("a", Sample(950 * MS, 10_000_000, 1.0))
    for at_ms in range(1000, 2000, PERIOD_MS):
        run.instance.push("a", Sample(at_ms * MS, 500 * MS, 1.0))
        run.push("b", at_ms, at_ms * MS)
    assert [each[2] for each in run.producers] == ["x[b]"]
    assert any("ahead: refused" in said for _, said in run.faults)
    assert max(sample.valid_us for _, sample in run.outputs) == 1900 * MS


def test_who_produces_is_a_stream_and_in_the_graph():
    run = Redundant(STREAMS + "stream who = producer[x-0]\n")
    run.feed(2000, a=(1000, 9000))
    assert list(dict.fromkeys(run.values("who"))) == ["x[a]", "x[b]"]
    drawn = as_text(graph_of(run.instance))
    assert "first of number x[0]" in drawn
    assert "from x[b]; silent: x[a]" in drawn


def test_it_is_printed_as_it_is_read_and_a_change_takes_another_producer_in():
    read = parse_specification(STREAMS)
    assert parse_specification(print_specification(read)) == read
    run = Redundant()
    run.feed(900)
    run.change(STREAMS.replace(f"first of x[a] {POLICY}, ", "first of "))
    run.feed(1900)
    assert run.made_by[-1] == "x[b]"
    assert graph_of(run.instance).edges


@pytest.mark.parametrize(
    ("text", "said", "repair"),
    [
        ("strmgen y = first of x[a]", "x[a] alone is the first of nothing else", "first of x[a], "),
        ("strmgen y = first of x[a], x[a] with any order", "x[a] is named twice", "each stream once"),
        ("source car d\nstrmgen d = d\nstrmgen y = first of x[a], d", "x[a] is number; d is car", "a stream of number"),
        ("strmgen y = first of x[a], y", "a cycle: y <- y", "a stream from outside the cycle"),
        ("strmgen y = first of x[a], nothing[b]", "nothing makes nothing[b]", "strmgen nothing[b] = "),
        ("strmgen y = first of (x[a], x[b])", "`first of` names the streams", "first of gps[self]"),
        ("import heli-altitude from 1, 2 as y", "an import is from one unit", "first of alt[1], alt[2]"),
    ],
)
def test_what_cannot_be_is_told_with_its_repair(text, said, repair):
    run = Redundant()
    with pytest.raises(TextErrors) as wrong:
        run.change(STREAMS + text)
    assert said in str(wrong.value)
    assert any(repair in each.repair for each in wrong.value.errors)


silences = st.lists(st.tuples(st.integers(0, 60), st.integers(1, 30)), max_size=4)


@settings(deadline=None)
@given(silences, silences, silences)
def test_one_producer_at_a_time_none_twice_and_the_preferred_one_while_it_is_heard(a, b, c):
    run = Redundant()
    silent = {
        name: {at for begins, length in spans for at in range(begins, begins + length)}
        for name, spans in zip("abc", (a, b, c), strict=True)
    }
    spoke = {name: [at for at in range(1, 100) if at not in silent[name]] for name in "abc"}
    for at in range(1, 100):
        for name in "abc":
            if at in spoke[name]:
                run.push(name, at, at * PERIOD_MS * MS)
    valid_us = [sample.valid_us for _, sample in run.outputs]
    assert valid_us == sorted(set(valid_us)), "no valid time twice, and none that is older than what was passed on"
    for (_, sample), made_by in zip(run.outputs, run.made_by, strict=True):
        at = sample.valid_us // MS // PERIOD_MS
        assert at in spoke[made_by[2]], "what is passed on was said"
        heard_throughout = all(each in spoke["a"] for each in range(1, at + 1))
        assert not heard_throughout or made_by == "x[a]", "no other sample takes the stream over"
    for (_, _, before), (at_us, _, of) in pairwise([(0, "x[0]", "x[a]"), *run.producers]):
        assert before != of
        is_heard = before is not None and any(0 <= at_us - at * PERIOD_US <= SILENCE_US for at in spoke[before[2]])
        if of == "x[a]" and is_heard:
            heard_us = [at * PERIOD_US for at in spoke["a"] if at_us - 3 * SILENCE_US <= at * PERIOD_US <= at_us]
            gaps = [later - earlier for earlier, later in pairwise(heard_us)]
            assert len(heard_us) > 1
            assert max(gaps) <= SILENCE_US, "it is back for a while before it is used again"
