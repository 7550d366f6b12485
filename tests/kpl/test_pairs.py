"""What is declared for each pair of objects that a stream names, thesis 8.7.5: CarPairs and what is computed of them."""

import pytest

from dyknow import NO_VALUE
from dyknow.kpl import parse_specification, print_specification
from dyknow.model.errors import SortError, TextErrors
from dyknow.model.members import MAX_MEMBERS, tuples_of
from tests.kpl.instances import Running

NUMBERS = """
source pairs pairs
source number one
source number two
strmgen car_pairs = pairs
strmgen x[a] = one
strmgen x[b] = two
compunit number Add(number, number)
"""


def test_there_is_a_stream_for_each_pair_while_it_is_named():
    running = Running(
        f"{NUMBERS}for p, q in car_pairs strmgen sum[p, q] = Add(x[p], x[q])\n"
        "for p, q in car_pairs stream total = sum[p, q]\n"
    )
    running.push("pairs", (("a", "b"), ("b", "a")))
    running.push("one", 1)
    running.push("two", 10)
    assert set(running.instance.streams) == {"total-a-b", "total-b-a"}
    running.push("pairs", (("b", "a"),))
    running.push("one", 2)
    assert running.values("total-a-b") == [11]
    assert running.values("total-b-a") == [11, 12]
    running.push("pairs", NO_VALUE)
    assert running.instance.streams == {}
    assert [str(label) for label in running.network.labels()] == ["car_pairs", "x[a]", "x[b]"]


def test_a_monitor_of_each_pair_is_called_by_both():
    running = Running(f"{NUMBERS}for p, q in car_pairs monitor less = always x[p] < x[q] with close after 1\n")
    running.push("pairs", (("a", "b"),), 0)
    for k in range(10):
        running.push("one", 5, k * 100_000)
        running.push("two", 1 if k > 4 else 9, k * 100_000)
    running.wait(3_000_000)
    assert [(each.monitor, each.event, each.valid_us) for each in running.alarms][:1] == [
        ("less-a-b", "opened", 500_000)
    ]


def test_three_objects_are_named_together_as_well_and_what_is_wrong_changes_nothing():
    running = Running(f"{NUMBERS}for l, x, m in car_pairs strmgen left[l, x, m] = one\n")
    running.push("pairs", (("l1", "x", "l2"),))
    assert "left[l1, x, l2]" in map(str, running.network.labels())
    for wrong in ((("l1", "l2"),), "l1", ((1.5, "x", "l2"),), (("l1", "x", "a b"),)):
        running.push("pairs", wrong)
        assert "left[l1, x, l2]" in map(str, running.network.labels())
    assert len(running.faults) == 4


def test_it_is_printed_as_it_was_read():
    text = "for a, b in car_pairs strmgen pair[a, b] = state(car[a], car[b]) with sample every 100, max delay 200"
    (declaration,) = parse_specification(text)
    assert parse_specification(print_specification((declaration,))) == (declaration,)
    assert print_specification((declaration,)).strip().startswith("for a, b in car_pairs strmgen pair[a, b] = state(")


@pytest.mark.parametrize(
    ("text", "message", "repair"),
    [
        ("for p, q in car_pairs strmgen y[p] = x[p]", "every member of the stream would make", "y[q, p]"),
        ("for p, q in car_pairs stream y = x[p]", "q is not in it", "pos[q]"),
        ("for p, q in car_pairs monitor y = always x[q] > 0", "p is not in it", "pos[p]"),
        ("for p, p in car_pairs stream y = x[p]", "a name of its own", "for a, b in ..."),
    ],
)
def test_each_object_of_a_pair_has_to_be_used(text, message, repair):
    if "stream" in text or "monitor" in text:
        whole = f"{NUMBERS}{text}\n"
    else:
        whole = f"{NUMBERS}{text.replace('x[p]', 'Add(x[p], x[q])')}\n"
    with pytest.raises(TextErrors) as caught:
        Running(whole)
    (error,) = caught.value.errors
    assert message in error.message
    assert repair in error.repair


def test_tuples_are_named_once_and_are_limited():
    assert tuples_of((("a", 1), ("a", "1"), ("b", "a")), 2) == (("a", "1"), ("b", "a"))
    assert tuples_of(frozenset({("a", "b")}), 2) == (("a", "b"),)
    assert tuples_of("a", 1) == (("a",),)
    assert tuples_of(NO_VALUE, 2) == ()
    with pytest.raises(SortError, match="at most"):
        tuples_of(tuple(("a", f"c{k}") for k in range(MAX_MEMBERS + 1)), 2)
