"""The engine beyond single chronicles: hostile events, limits, what is remembered, and what is told when."""

import random
from collections import Counter
from collections.abc import Iterable
from functools import cache, reduce

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.formulas.traffic import Change, changes, overtake, turns
from dyknow import NO_VALUE, Label
from dyknow.kpl.syntax.chronicles import parse_chronicles
from dyknow.model.errors import ChronicleError
from dyknow.reasoning.chronicles import (
    ChangeEvents,
    Chronicle,
    ChronicleFile,
    ChronicleInstance,
    ChronicleVariable,
    Equal,
    Event,
    EventType,
    Inclusion,
    NamedConstraint,
    Negation,
    NoEvent,
    Parameter,
    Recogniser,
    RecognitionLimits,
    TimePoint,
    Use,
)
from tests.thesis.reasoning.test_chronicles import BEHIND_THEN_IN_FRONT, LEFT_TURN, PREDICTED

AB = "chronicle c[?x] { event(a[?x], t1) event(b[?x], t2) t2 - t1 in [0, 1000] }"


parsed = cache(parse_chronicles)


def recogniser(text: str, limits: RecognitionLimits | None = None) -> Recogniser:
    return Recogniser.of(parsed(text), limits=limits)


def test_events_out_of_order_are_counted_and_harmless() -> None:
    engine = recogniser(AB)
    engine.on_message(10, "a", ("k",))
    assert engine.on_message(9, "b", ("k",)) == []
    assert engine.on_message(10, "b", ("k",)) != []
    assert engine.ignored == {"out of order": 1}


def test_a_clock_that_goes_back_is_ignored() -> None:
    engine = recogniser(AB)
    engine.on_time(100)
    assert engine.on_time(50) == []
    assert engine.clock_ms == 100


def test_a_time_beyond_the_range_is_counted_and_does_not_move_the_clock() -> None:
    engine = recogniser(AB)
    for at_ms in (2**60, -(2**59), 2**53 + 1):
        assert engine.on_message(at_ms, "a", ("k",)) == []
    assert engine.ignored == {"beyond the clock's range": 3}
    assert engine.clock_ms is None


def test_the_same_event_twice_in_a_millisecond_is_one() -> None:
    engine = recogniser("chronicle c { event(a, t1) event(b, t2) occurs(1, 1, n, (t1, t2)) }")
    told = [
        engine.on_message(at_ms, name, ())
        for at_ms, name in ((0, "a"), (0, "a"), (1, "n"), (1, "n"), (2, "b"), (2, "b"))
    ]
    assert [len(one) for one in told] == [0, 0, 0, 0, 1, 0]


def test_a_change_to_the_same_value_is_none() -> None:
    engine = recogniser("chronicle c { event(p:(?, ?v), t1) }")
    assert engine.on_change(0, "p", (), "v", "v") == []
    assert engine.ignored == {"no change": 1}


@pytest.mark.parametrize(
    ("value", "reason"),
    [(float("nan"), "no symbol"), (float("inf"), "no symbol"), (1.5, "no symbol"), ((1, 2), "no symbol"),
     (NO_VALUE, "no value"), (None, "no value")],
)  # fmt: skip
def test_a_sample_that_is_no_symbol_is_counted_and_changes_nothing(value: object, reason: str) -> None:
    events = ChangeEvents(recogniser("chronicle c[?v] { event(p:(u, ?v), t1) }"))
    events.on_sample(Label("p"), 1000, "u")
    assert events.on_sample(Label("p"), 2000, value) == []
    assert [one.bindings for one in events.on_sample(Label("p"), 3000, True)] == [{"?v": "true"}]
    assert events.ignored == {reason: 1}


def test_a_stream_that_ended_begins_from_unknown() -> None:
    events = ChangeEvents(recogniser("chronicle c { event(p:(u, ?), t1) }"))
    events.on_sample(Label("p"), 1000, "u")
    events.forget(Label("p"))
    assert events.on_sample(Label("p"), 2000, "v") == []


def on_one(name: str, event: str) -> Chronicle:
    return Chronicle(name, (), (), (Event(EventType(event), TimePoint("t1")),))


def test_chronicles_in_a_circle_are_refused() -> None:
    with pytest.raises(ChronicleError, match="circle"):
        Recogniser.of(ChronicleFile((on_one("c", "d"), on_one("d", "c"))))


def test_a_chronicle_without_any_event_is_refused() -> None:
    absence = Chronicle("c", (), (), (NoEvent(EventType("a"), TimePoint("t1"), TimePoint("t2")),))
    with pytest.raises(ChronicleError, match="asks for no event"):
        Recogniser.of(ChronicleFile((absence,)))


def test_a_chronicle_that_is_not_there_is_told_with_those_that_are() -> None:
    with pytest.raises(ChronicleError, match="declared: c"):
        Recogniser.of(parse_chronicles(AB), ["d"])


def test_a_maximum_age_ends_what_the_times_leave_open() -> None:
    text = "chronicle c { event(a, t1) event(b, t2) t1 <= t2 }"
    engine = Recogniser.of(parse_chronicles(text), max_age_ms=100)
    engine.on_message(0, "a", ())
    assert [one.dies_ms for one in engine.partial_instances()] == [101]
    assert engine.on_message(100, "b", ()) != []
    assert engine.on_message(101, "b", ()) == []


def test_without_a_bound_the_engine_says_what_it_would_remember_for_ever() -> None:
    text = "chronicle c { event(a, t1) event(b, t2) t1 <= t2 }"
    (matcher,) = Recogniser.of(parse_chronicles(text)).chronicles
    assert matcher.unbounded == ("event(a, t1)",)
    (bounded,) = Recogniser.of(parse_chronicles(text), max_age_ms=5).chronicles
    assert bounded.unbounded == ()


@pytest.mark.parametrize(
    ("limits", "reason"),
    [
        (RecognitionLimits(events_of_one_binding=50), "events of one binding"),
        (RecognitionLimits(found_at_once=10), "instances found by one event"),
    ],
)
def test_what_a_limit_cuts_off_is_told_as_incomplete(limits: RecognitionLimits, reason: str) -> None:
    engine = recogniser("chronicle c { event(a, t1) event(b, t2) t1 <= t2 }", limits)
    for at_ms in range(200):
        engine.on_message(at_ms, "a", ())
    told = engine.on_message(200, "b", ())
    assert 0 < len(told) <= 100
    assert engine.incomplete["c"][reason] > 0


def test_what_waits_is_bounded() -> None:
    engine = recogniser(
        "chronicle c { event(a, t1) noevent(b, (t1, t2)) t2 - t1 in [1000, 1000] }", RecognitionLimits(waiting=10)
    )
    for at_ms in range(100):
        engine.on_message(at_ms, "a", ())
    assert engine.live <= 40
    assert len(engine.on_time(5000)) == 10
    assert engine.incomplete["c"]["instances that wait"] == 90


def test_all_that_is_remembered_is_bounded() -> None:
    text = "chronicle c[?x] { event(a[?x], t1) event(b[?x], t2) t1 <= t2 }"
    engine = recogniser(text, RecognitionLimits(events=1000))
    for at_ms in range(30_000):
        engine.on_message(at_ms, "a", (f"k{at_ms}",))
    assert engine.live <= 1000 + 8192 + 1
    assert engine.incomplete["c"]["events"] > 0


def feed(engine: Recogniser, events: Iterable[Change], every: int = 500) -> tuple[list[ChronicleInstance], list[int]]:
    told: list[ChronicleInstance] = []
    live = []
    for number, event in enumerate(events):
        told += engine.on_change(*event)
        if not number % every:
            live.append(engine.live_of_one_binding)
    return told, live


def relations(events: Iterable[Change]) -> Iterable[Change]:
    for at_ms, name, arguments, old, new in events:
        yield at_ms, name if name == "road" else f"car_relations.{name}", arguments, old, new


@pytest.mark.parametrize("chronicle", ["8.3.13", "8.7.5", "8.7.4"])
def test_what_is_remembered_of_one_binding_does_not_grow(chronicle: str) -> None:
    file, events = {
        "8.3.13": (overtake(), changes(10, 20_000)),
        "8.7.5": (parse_chronicles(BEHIND_THEN_IN_FRONT), relations(changes(10, 20_000))),
        "8.7.4": (parse_chronicles(LEFT_TURN + PREDICTED), turns(10, 20_000)),
    }[chronicle]
    engine = Recogniser.of(file)
    told, live = feed(engine, events)
    assert len(told) > 50
    assert max(live) <= 40
    assert not engine.incomplete
    assert engine.live < 3 * 8192


def test_forgetting_loses_nothing() -> None:
    """The same events, with everything forgotten that can be after each, tell the same."""
    file, events = overtake(), list(changes(4, 1_200, seed=3, roads=2))
    lazy, _ = feed(Recogniser.of(file), events)
    eager = Recogniser.of(file)
    told: list[ChronicleInstance] = []
    for number, event in enumerate(events):
        told += eager.on_change(*event)
        if not number % 5:
            eager.tidy()
    assert told == lazy
    assert len(told) > 5


def test_the_order_of_events_in_a_millisecond_does_not_matter() -> None:
    text = "chronicle c[?x, ?y] { event(a[?x], t1) event(b[?x, ?y], t2) noevent(n[?x], (t1, t2)) occurs(1, 2, m[?y], (t0, t2)) t0 = t1 t1 <= t2 t2 - t1 in [0, 3] }"
    rng = random.Random(5)
    found = 0
    for _ in range(60):
        events = [
            (rng.randrange(8), name, tuple(rng.choice("kl") for _ in range(2 if name == "b" else 1)))
            for name in rng.choices("aabbmmn", k=12)
        ]
        first = sorted(events, key=lambda one: one[0])
        second = sorted(rng.sample(events, len(events)), key=lambda one: one[0])
        told = []
        for order in (first, second):
            engine = recogniser(text)
            told.append(Counter(str(one) for event in order for one in engine.on_message(*event)))
        assert told[0] == told[1]
        found += len(told[0])
    assert found > 10


def test_a_long_chain_of_chronicles_is_told_at_one_clock() -> None:
    chain = ChronicleFile(tuple(on_one(f"c{number}", f"c{number - 1}") for number in range(1, 400)))
    told = Recogniser.of(chain).on_message(7, "c0", ())
    assert [(one.chronicle, one.recognised_ms) for one in told] == [(f"c{number}", 7) for number in range(1, 400)]


def test_a_deadline_says_when_something_is_told_without_an_event() -> None:
    engine = recogniser("chronicle c { event(a, t1) noevent(b, (t1, t2)) t2 - t1 in [1000, 2000] }")
    assert engine.deadline_ms is None
    engine.on_message(5, "a", ())
    assert engine.deadline_ms == 1005
    assert engine.on_time(1004) == []
    assert [one.recognised_ms for one in engine.on_time(1500)] == [1005]
    assert engine.deadline_ms is None


def test_what_waits_is_a_partial_instance_that_says_for_what() -> None:
    engine = recogniser("chronicle c { event(a, t1) occurs(2, oo, b, (t1, t2)) t2 - t1 in [0, 100] }")
    engine.on_message(5, "a", ())
    engine.on_message(6, "b", ())
    (partial,) = engine.partial_instances()
    assert partial.missing == ("occurs(2, oo, b, (t1, t2))",)
    assert partial.dies_ms == 105
    engine.on_time(105)
    assert list(engine.partial_instances()) == []


def test_a_partial_instance_keeps_to_the_constraints_on_variables() -> None:
    engine = recogniser("chronicle c { event(a[?x], t1) event(b[?y], t2) event(d, t3) ?x != ?y t1 < t2 < t3 }")
    for at_ms, name, symbol in ((1, "a", "k"), (2, "b", "k"), (2, "b", "l")):
        engine.on_message(at_ms, name, (symbol,))
    pairs = [one.bindings for one in engine.partial_instances() if len(one.instants) == 2]
    assert pairs == [{"?x": "k", "?y": "l"}]


def test_what_a_chronicle_listens_to_can_be_asked() -> None:
    engine = Recogniser.of(overtake())
    assert engine.attributes == {("behind", 2), ("left", 2), ("in_front", 2), ("road", 1)}
    assert recogniser(AB).messages == {("a", 1), ("b", 1)}


X: tuple[Parameter, ...] = (ChronicleVariable("x"),)
DOUBLING = ChronicleFile(
    (
        NamedConstraint("k0", X, (Equal(ChronicleVariable("x"), "a"),)),
        *(NamedConstraint(f"k{n}", X, (Use(f"k{n - 1}", X),) * 2) for n in range(1, 60)),
        Chronicle("c", (), (), (Event(EventType("e", X), TimePoint("t")), Use("k59", X))),
    )
)
DEEP = ChronicleFile(
    (
        Chronicle(
            "c",
            (),
            (),
            (
                Event(EventType("e", X), TimePoint("t")),
                reduce(lambda c, _: Negation(c), range(10_000), Equal(ChronicleVariable("x"), "a")),
            ),
        ),
    )
)
INCLUDED = ChronicleFile(
    (
        Chronicle("c0", (), (), (Event(EventType("e"), TimePoint("t")),)),
        *(Chronicle(f"c{n}", (), (), (Inclusion(f"c{n - 1}"),) * 2) for n in range(1, 60)),
    )
)
ITSELF = ChronicleFile((Chronicle("c", (), (), (Inclusion("c"),)),))


@pytest.mark.parametrize("file", [DOUBLING, DEEP, INCLUDED, ITSELF], ids=["doubling", "deep", "included", "itself"])
def test_what_would_come_to_too_much_is_refused(file: ChronicleFile) -> None:
    with pytest.raises(ChronicleError):
        Recogniser.of(file)


def test_many_choices_of_free_instants_end_in_bounded_work() -> None:
    """Which eight of 200 events go where is soon decided, or given up and told."""
    body = " ".join(f"occurs(2, 3, x[*v{n}], (a{n}, b{n}))" for n in range(8))
    order = " ".join(f"b{n} < a{n + 1}" for n in range(7))
    engine = recogniser(f"chronicle c {{ event(go, g) {body} {order} b7 - a0 < 30 }}")
    for at_ms in range(0, 2000, 10):
        engine.on_message(at_ms, "x", ("v",))
    assert engine.on_message(2000, "go", ()) == []
    assert engine.live < 1000


EVENT_TEXTS = st.tuples(
    st.integers(-(2**60), 2**60) | st.integers(0, 50),
    st.sampled_from("abn") | st.text(max_size=3),
    st.lists(st.text(max_size=2) | st.just("k"), max_size=2).map(tuple),
)


@given(st.lists(EVENT_TEXTS, max_size=30))
def test_any_events_are_taken_or_counted(events: list[tuple[int, str, tuple[str, ...]]]) -> None:
    engine = recogniser(
        "chronicle c[?x] { event(a[?x], t1) occurs(1, 2, b[*y], (t1, t2)) noevent(n, (t1, t2)) t2 - t1 <= 20 }"
    )
    for event in events:
        for one in engine.on_message(*event):
            assert one.recognised_ms == engine.clock_ms or one.recognised_ms <= event[0]
    assert engine.events + engine.ignored.total() == len(events)
