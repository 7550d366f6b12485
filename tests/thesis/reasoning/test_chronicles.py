"""Sections 8.2-8.4 and 8.7.3-8.7.5: the examples of the thesis, as text, in the engine."""

from typing import Final

import pytest

from dyknow import Label
from dyknow.kpl.syntax.chronicles import parse_chronicles
from dyknow.model.errors import ChronicleError, DyknowError
from dyknow.reasoning.chronicles import (
    MINUS_INFINITY,
    ChangeEvents,
    ChronicleInstance,
    Interval,
    Recogniser,
    symbol_set,
)

OVERTAKE: Final = """
chronicle overtake[?car1, ?car2]
{
  event(behind[?car1, ?car2]:(?, true), t1)
  event(left[?car1, ?car2]:(false, true), t2)
  event(in_front[?car1, ?car2]:(false, true), t3)
  event(road[?car1]:(?, ?road), t4)
  noevent(road[?car1]:(?road, ?), (t4, t3))
  event(road[?car2]:(?, ?road), t5)
  noevent(road[?car2]:(?road, ?), (t5, t3))
  t4 <= t1; t5 <= t1
  t1 <= t2
  t3 - t2 in [0, 60000]
}
"""


def recogniser(text: str, max_age_ms: int | None = None) -> Recogniser:
    return Recogniser.of(parse_chronicles(text), max_age_ms=max_age_ms)


def tell(engine: Recogniser, *events: tuple[object, ...]) -> list[ChronicleInstance]:
    """(time, "name[a, b]") is a message, (time, "name[a, b]", old, new) a change, (time,) the clock."""
    told: list[ChronicleInstance] = []
    for at_ms, *event in events:
        assert isinstance(at_ms, int)
        if not event:
            told += engine.on_time(at_ms)
            continue
        label = Label.parse(str(event[0]))
        if len(event) == 1:
            told += engine.on_message(at_ms, label.feature, label.objects)
        else:
            old, new = event[1], event[2]
            assert old is None or isinstance(old, str)
            told += engine.on_change(at_ms, label.feature, label.objects, old, str(new))
    return told


def times(told: list[ChronicleInstance]) -> list[tuple[dict[str, int], int]]:
    return [(dict(one.instants), one.recognised_ms) for one in told]


ON_ONE_ROAD: Final = ((0, "road[a]", None, "r1"), (10, "road[b]", "r2", "r1"))


def test_example_8_3_1_an_overtake_is_behind_left_and_in_front_on_one_road() -> None:
    told = tell(
        recogniser(OVERTAKE),
        *ON_ONE_ROAD,
        (20, "behind[a, b]", None, "true"),
        (30, "behind[a, b]", "true", "false"),
        (30, "left[a, b]", "false", "true"),
        (60_030, "in_front[a, b]", "false", "true"),
    )
    assert [(one.chronicle, dict(one.bindings)) for one in told] == [
        ("overtake", {"?car1": "a", "?car2": "b", "?road": "r1"})
    ]
    assert times(told) == [({"t1": 20, "t2": 30, "t3": 60_030, "t4": 0, "t5": 10}, 60_030)]


@pytest.mark.parametrize(
    "events",
    [
        pytest.param(((20, "behind[a, b]", None, "true"), (30, "left[a, b]", "false", "true"),
                      (60_031, "in_front[a, b]", "false", "true")), id="it takes longer than a minute"),
        pytest.param(((20, "behind[a, b]", None, "true"), (25, "road[b]", "r1", "r2"),
                      (30, "left[a, b]", "false", "true"), (40, "in_front[a, b]", "false", "true")), id="one leaves"),
        pytest.param(((20, "behind[a, b]", None, "true"), (30, "left[a, c]", "false", "true"),
                      (40, "in_front[a, b]", "false", "true")), id="left of another car"),
        pytest.param(((20, "behind[a, b]", None, "true"), (30, "left[a, b]", None, "true"),
                      (40, "in_front[a, b]", "false", "true")), id="the first value is no change from false"),
        pytest.param(((30, "left[a, b]", "false", "true"), (35, "behind[a, b]", None, "true"),
                      (40, "in_front[a, b]", "false", "true")), id="left before behind"),
    ],
)  # fmt: skip
def test_example_8_3_13_what_is_not_an_overtake_is_not_recognised(events: tuple[tuple[object, ...], ...]) -> None:
    assert tell(recogniser(OVERTAKE), *ON_ONE_ROAD, *events, (10**6,)) == []


def test_who_leaves_the_road_at_the_instant_of_overtaking_has_overtaken() -> None:
    told = tell(
        recogniser(OVERTAKE),
        *ON_ONE_ROAD,
        (20, "behind[a, b]", None, "true"),
        (30, "left[a, b]", "false", "true"),
        (40, "road[a]", "r1", "r3"),
        (40, "in_front[a, b]", "false", "true"),
    )
    assert [one.recognised_ms for one in told] == [40]


def test_examples_8_3_2_and_8_3_3_intervals_and_expressions_over_them() -> None:
    assert Interval(-12, 100).shifted(22) == Interval(10, 122)
    assert Interval(1300) & Interval(0, 10_000) == Interval(1300, 10_000)
    assert Interval(10, 122) | Interval(50, 100) == Interval(10, 122)
    assert 10 in Interval(10, 122)
    assert 123 not in Interval(10, 122)
    assert -(10**9) in Interval()
    with pytest.raises(ChronicleError, match="gap"):
        _ = Interval(0, 1) | Interval(3, 4)
    assert Interval(0, 1) | Interval(2, 4) == Interval(0, 4)


def test_example_8_3_4_domains() -> None:
    domains = parse_chronicles(
        "domain Color = {red, blue, green}\n domain Car = {car3} | {car2} | {car1}\n domain All = ~{}\n"
        "domain Bright = Color - {blue}\n domain Rest = ~Bright & Color\n domain Same = Color \\ {red} + {red}"
    ).domains
    found = {name: symbol_set(domain, domains) for name, domain in domains.items()}
    assert found["Car"].symbols == {"car1", "car2", "car3"}
    assert "whatever" in found["All"]
    assert found["Bright"].symbols == {"red", "green"}
    assert found["Rest"].symbols == {"blue"}
    assert found["Same"] == found["Color"]


DECLARED: Final = """
domain Car = {car1, car2}
domain Crossing = {x1}
message in_crossing[?car, ?crossing] { ?car in Car  ?crossing in Crossing }
attribute on_road[?car] { ?value in {true, false}  ?car in Car }
chronicle enters[?c, ?x] { event(in_crossing[?c, ?x], t1) }
chronicle leaves[?c, ?v] { event(on_road[?c]:(?, ?v), t1) }
"""


def test_examples_8_3_5_and_8_3_6_events_are_of_their_domains() -> None:
    engine = recogniser(DECLARED)
    told = tell(
        engine,
        (1, "in_crossing[car1, x1]"),
        (2, "in_crossing[car9, x1]"),
        (3, "in_crossing[car1, x9]"),
        (4, "on_road[car2]", None, "true"),
        (5, "on_road[car2]", "true", "perhaps"),
        (6, "on_road[car2]", "perhaps", "false"),
        (7, "on_road[car9]", None, "true"),
    )
    assert [(one.chronicle, one.recognised_ms) for one in told] == [("enters", 1), ("leaves", 4)]


@pytest.mark.parametrize(
    ("constraint", "right", "wrong"),
    [
        ("t1 < t2 <= t3 = t4", (1, 2, 2, 2), (1, 2, 3, 4)),
        ("t3 - t2 in [0, 250]", (0, 0, 250, 300), (0, 0, 251, 300)),
        ("t4 - t1 < 100", (0, 0, 0, 99), (0, 0, 0, 100)),
        ("t4 - t1 in ]-oo, 100[", (0, 0, 0, 99), (0, 0, 0, 100)),
        ("10 <= t4 - t1 <= 30", (0, 0, 0, 30), (0, 0, 0, 31)),
        ("10 <= t4 - t1 <= 30", (0, 0, 0, 10), (0, 0, 0, 9)),
    ],
)
def test_example_8_3_7_atomic_constraints(constraint: str, right: tuple[int, ...], wrong: tuple[int, ...]) -> None:
    body = " ".join(f"event(e{number}, t{number})" for number in range(1, 5))
    for instants, expected in ((right, 1), (wrong, 0)):
        engine = recogniser(f"chronicle c {{ {body} {constraint} }}")
        events = sorted((at_ms, f"e{number}") for number, at_ms in enumerate(instants, 1))
        assert len(tell(engine, *events)) == expected


def test_8_3_3_start_and_end_bound_all_instants() -> None:
    text = "chronicle c { event(a, t1) event(b, t2) end - start <= 10 }"
    assert len(tell(recogniser(text), (0, "b"), (10, "a"))) == 1
    assert tell(recogniser(text), (0, "b"), (11, "a")) == []


def test_example_8_3_8_a_complex_constraint_is_what_it_stands_for() -> None:
    text = """
    constraint mySequence(t1, t2, t3) { t1 <= t2 <= t3  t3 - t1 <= 5 }
    chronicle c { instant begin, middle, finish  mySequence(begin, middle, finish)
                  event(a, begin) event(b, middle) event(c, finish) }
    """
    text = text.replace("event(c, finish)", "event(d, finish)")
    assert len(tell(recogniser(text), (0, "a"), (3, "b"), (5, "d"))) == 1
    assert tell(recogniser(text), (0, "a"), (3, "b"), (6, "d")) == []
    assert tell(recogniser(text), (0, "b"), (3, "a"), (5, "d")) == []


def test_example_8_3_10_local_variables_have_domains() -> None:
    text = "domain Car = {a, b} chronicle c { variable ?y, *z variable ?c in Car event(m[?c, ?y, *z], t1) }"
    told = tell(recogniser(text), (1, "m[a, u, v]"), (2, "m[x, u, v]"))
    assert [dict(one.bindings) for one in told] == [{"?c": "a", "?y": "u"}]


def test_example_8_3_11_so_many_events_as_the_predicate_says() -> None:
    once = "chronicle c { event(go, t1) event(stop, t2) occurs(1, 1, in_crossing[car1, ?c], (t1, t2)) }"
    assert len(tell(recogniser(once), (0, "go"), (1, "in_crossing[car1, x]"), (2, "stop"))) == 1
    twice = ((0, "go"), (1, "in_crossing[car1, x]"), (2, "in_crossing[car1, x]"), (3, "stop"))
    assert tell(recogniser(once), *twice) == []
    at_the_end = ((0, "go"), (2, "stop"), (2, "in_crossing[car1, x]"))
    assert tell(recogniser(once), *at_the_end) == []
    at_the_begin = ((0, "go"), (0, "in_crossing[car1, x]"), (2, "stop"))
    assert len(tell(recogniser(once), *at_the_begin)) == 1


def test_example_8_3_11_at_least_once_is_settled_by_the_first_and_at_most_by_the_end() -> None:
    at_least = "chronicle c { event(go, t5) occurs(1, oo, on_road[?car1]:(?, false), (t5, t6)) t6 - t5 = 10 }"
    at_least = at_least.replace("t6 - t5 = 10", "t6 - t5 in [10, 10]")
    told = tell(recogniser(at_least), (0, "go"), (3, "on_road[a]", "true", "false"), (20,))
    assert [one.recognised_ms for one in told] == [3]
    at_most = at_least.replace("occurs(1, oo,", "occurs(1, 5,")
    told = tell(recogniser(at_most), (0, "go"), (3, "on_road[a]", "true", "false"), (20,))
    assert [one.recognised_ms for one in told] == [10]


THREE: Final = "chronicle c { event(go, t1) event(stop, t2) occurs(3, 3, in_crossing[CAR, ?c], (t1, t2)) t1 < t2 }"


def test_example_8_3_12_one_car_three_times_or_any_three() -> None:
    mixed = ((0, "go"), (1, "in_crossing[a, x]"), (2, "in_crossing[b, x]"), (3, "in_crossing[a, x]"), (4, "stop"))
    assert tell(recogniser(THREE.replace("CAR", "?car")), *mixed) == []
    assert len(tell(recogniser(THREE.replace("CAR", "*car")), *mixed)) == 1
    same = tuple((at_ms, name.replace("b", "a")) for at_ms, name in mixed)
    assert len(tell(recogniser(THREE.replace("CAR", "?car")), *same)) == 1


def test_different_cars_in_one_millisecond_are_counted_each_and_one_car_once() -> None:
    text = THREE.replace("CAR", "*car")
    events = ((0, "go"), (1, "in_crossing[a, x]"), (1, "in_crossing[b, x]"), (1, "in_crossing[a, x]"))
    assert tell(recogniser(text), *events, (2, "stop")) == []
    assert len(tell(recogniser(text), *events, (1, "in_crossing[d, x]"), (2, "stop"))) == 1


def test_8_3_4_event_and_noevent_are_occurs() -> None:
    short = "chronicle c { event(a, t1) event(b, t2) noevent(n, (t1, t2)) t1 < t2 }"
    long = "chronicle c { occurs(1, oo, a, (t1, t1 + 1)) occurs(1, oo, b, (t2, t2 + 1)) occurs(0, 0, n, (t1, t2)) t1 < t2 }"
    events = ((0, "a"), (1, "b"), (2, "n"), (3, "a"), (3, "b"), (4, "b"), (4, "a"), (5, "n"), (5, "b"))
    assert times(tell(recogniser(short), *events)) == times(tell(recogniser(long), *events))


def test_8_3_4_a_context_holds_while_nothing_ends_it() -> None:
    text = "chronicle c { event(p:(?, v), t0) noevent(p:(v, ?), (t0 + 1, t2)) t0 <= t1 event(a, t1) event(b, t2) }"
    told = tell(recogniser(text), (0, "p", "u", "v"), (5, "a"), (9, "b"), (9, "p", "v", "u"), (10, "b"))
    assert times(told) == [({"t0": 0, "t1": 5, "t2": 9}, 9)]


def test_8_3_5_an_included_chronicle_is_a_part_with_names_of_its_own() -> None:
    text = """
    chronicle pair[?x](first, last) { event(a[?x], first) event(b[?x, ?y], last) first <= last }
    chronicle two[?u, ?w] { chronicle pair[?u](t1, t2) chronicle pair[?w](first = t3, last = t4) t2 < t3 }
    """
    told = [
        one
        for one in tell(recogniser(text), (1, "a[k]"), (2, "b[k, p]"), (3, "a[l]"), (4, "b[l, q]"))
        if one.chronicle == "two"
    ]
    assert [sorted(one.bindings.values()) for one in told] == [["k", "l", "p", "q"]]
    assert times(told) == [({"t1": 1, "t2": 2, "t3": 3, "t4": 4}, 4)]


def test_8_2_a_recognised_chronicle_is_an_event_of_others_when_it_is_recognised() -> None:
    text = """
    chronicle calm[?x] { event(rest[?x], t1) noevent(move[?x], (t1, t2)) t2 - t1 in [100, 100] }
    chronicle asleep[?x] { event(calm[?x], t1) event(dark, t2) t1 - t2 in [0, 1000] }
    """
    told = tell(recogniser(text), (0, "dark"), (50, "rest[a]"), (60, "rest[b]"), (70, "move[b]"), (500,))
    assert [(one.chronicle, dict(one.instants), one.recognised_ms) for one in told] == [
        ("calm", {"t1": 50}, 150),
        ("asleep", {"t1": 150, "t2": 0}, 150),
    ]


ABC: Final = "chronicle abc { event(a, tA) event(b, tB) event(c, tC) tC - tB <= 5 }"


def partials(engine: Recogniser) -> set[tuple[tuple[int, str], ...]]:
    """Matched events as the thesis lists them: (4, A)."""
    return {
        tuple(sorted((at_ms, name[1:]) for name, at_ms in one.instants.items())) for one in engine.partial_instances()
    }


def test_8_4_the_worked_example_step_by_step() -> None:
    """The uninstantiated instance [] is the chronicle itself, and is not listed."""
    engine = recogniser(ABC)
    assert partials(engine) == set()
    assert tell(engine, (4, "a")) == []
    assert partials(engine) == {((4, "A"),)}
    assert tell(engine, (5, "b")) == []
    assert partials(engine) == {((4, "A"),), ((5, "B"),), ((4, "A"), (5, "B"))}
    assert tell(engine, (8, "b")) == []
    assert partials(engine) == {
        ((4, "A"),), ((5, "B"),), ((8, "B"),), ((4, "A"), (5, "B")), ((4, "A"), (8, "B")),
    }  # fmt: skip
    assert tell(engine, (11,)) == []
    assert partials(engine) == {((4, "A"),), ((8, "B"),), ((4, "A"), (8, "B"))}
    told = tell(engine, (12, "c"))
    assert times(told) == [({"tA": 4, "tB": 8, "tC": 12}, 12)]
    assert partials(engine) == {
        ((4, "A"),), ((8, "B"),), ((12, "C"),), ((4, "A"), (12, "C")), ((8, "B"), (12, "C")), ((4, "A"), (8, "B")),
    }  # fmt: skip


def test_8_4_a_partial_instance_says_what_is_missing_and_when_it_is_given_up() -> None:
    engine = recogniser(ABC)
    tell(engine, (4, "a"), (8, "b"))
    deaths = {tuple(one.instants.values()): (one.missing, one.dies_ms) for one in engine.partial_instances()}
    assert deaths[4, 8] == (("event(c, tC)",), 14)
    assert deaths[(4,)] == (("event(b, tB)", "event(c, tC)"), None)


def test_8_4_contradictory_times_are_an_error_that_names_them() -> None:
    text = (
        "chronicle c { event(a, t1) event(b, t2) event(d, t3) t1 < t2 t2 - t3 in [5, oo[ t3 - t1 in [0, 10] t1 > t3 }"
    )
    with pytest.raises(DyknowError) as raised:
        recogniser(text)
    assert "t3 - t1 in [0, 10]" in str(raised.value)
    assert "t1 > t3" in str(raised.value)
    assert "contradict each other: t1 < t2" not in str(raised.value)


def test_8_4_initial_values_are_changes_since_ever() -> None:
    engine = recogniser("chronicle c { event(p:(?, v), t1) event(a, t2) t1 < t2 noevent(p:(v, ?), (t1 + 1, t2)) }", 100)
    events = ChangeEvents(engine, initially=True)
    assert events.on_sample(Label("p"), 5_000_000, "v") == []
    told = tell(engine, (10**6, "a"))
    assert times(told) == [({"t1": MINUS_INFINITY, "t2": 10**6}, 10**6)]


def test_8_7_3_a_sample_is_an_event_if_its_value_changes() -> None:
    engine = recogniser("chronicle c[?v] { event(link[c1]:(?, ?v), t1) }")
    events = ChangeEvents(engine)
    label = Label("link", ("c1",))
    samples = [(1_000_999, "l1"), (2_000_000, "l1"), (3_000_000, "l2"), (2_500_000, "l3"), (4_000_000, "l1")]
    told = [one for valid_us, value in samples for one in events.on_sample(label, valid_us, value)]
    assert [(one.bindings["?v"], one.recognised_ms) for one in told] == [("l1", 1000), ("l2", 3000), ("l1", 4000)]
    assert events.ignored == {"out of order": 1}


LEFT_TURN: Final = """
chronicle turn_left_in_crossing[?c, ?l1, ?x, ?l2]
{
  occurs(1, 1, cars.link[?c]:(?l1, no_link), (t2, t3))
  occurs(1, 1, cars.crossing[?c]:(no_crossing, ?x), (t2, t3))
  event(cars.crossing[?c]:(?x, no_crossing), t4)
  event(cars.link[?c]:(no_link, ?l2), t5)
  noevent(cars.link[?c]:(?l1, no_link), (t3 + 1, t5 - 1))
  noevent(cars.crossing[?c]:(no_crossing, ?x), (t3 + 1, t5 - 1))
  noevent(cars.crossing[?c]:(?x, no_crossing), (t2, t4 - 1))
  noevent(cars.link[?c]:(no_link, ?l2), (t2, t4 - 1))
  event(links.left[?l1, ?x, ?l2]:(?, true), t1)
  noevent(links.left[?l1, ?x, ?l2]:(?, true), (t1 + 1, t5 - 1))
  noevent(links.left[?l1, ?x, ?l2]:(true, false), (t1 + 1, t5 - 1))
  t1 < t2
  t3 - t2 in [-1000, 1000]
  t4 - t3 in [0, 10000]
  t5 - t4 in [-1000, 1000]
}
"""
PREDICTED: Final = """
chronicle turn_left_in_crossing_predicted[?c, ?l1, ?x, ?l2]
{
  event(cars.link[?c]:(?, ?l1), t2)
  event(cars.link[?c]:(?l1, ?l2), t3)
  noevent(cars.link[?c]:(?l1, ?), (t2 + 1, t3 - 1))
  event(links.left[?l1, ?x, ?l2]:(?, true), t1)
  noevent(links.left[?l1, ?x, ?l2]:(?, true), (t1 + 1, t3 - 1))
  noevent(links.left[?l1, ?x, ?l2]:(true, false), (t1 + 1, t3 - 1))
  t1 < t2
  t2 < t3
}
"""
MAP: Final = ((0, "links.left[l1, x1, l2]", None, "true"), (0, "links.left[l2, x5, l84]", None, "true"))


def through(
    begin_ms: int, old: str, crossing: str, new: str, entered_ms: int = 200, left_ms: int = 5000
) -> list[tuple[object, ...]]:
    """A car leaves a link, is in a crossing, leaves it and is on another link 100 ms later."""
    return [
        (begin_ms, "cars.link[c]", old, "no_link"),
        (begin_ms + entered_ms, "cars.crossing[c]", "no_crossing", crossing),
        (begin_ms + left_ms, "cars.crossing[c]", crossing, "no_crossing"),
        (begin_ms + left_ms + 100, "cars.link[c]", "no_link", new),
    ]


def test_8_7_4_two_left_turns_are_recognised_when_the_car_is_on_the_next_link() -> None:
    engine = recogniser(LEFT_TURN)
    told = tell(engine, *MAP, (10, "cars.link[c]", None, "l1"), (10, "cars.crossing[c]", None, "no_crossing"),
                *through(1000, "l1", "x1", "l2"), *through(60_000, "l2", "x5", "l84"))  # fmt: skip
    assert [(one.bindings["?x"], one.instants["t4"], one.recognised_ms) for one in told] == [
        ("x1", 6000, 6100),
        ("x5", 65_000, 65_100),
    ]


@pytest.mark.parametrize(
    "events",
    [
        pytest.param(through(1000, "l1", "x1", "l3"), id="no left turn in the map"),
        pytest.param(through(1000, "l1", "x1", "l2", entered_ms=1001), id="seen in the crossing too late"),
        pytest.param(through(1000, "l1", "x1", "l2", left_ms=11_201), id="longer than ten seconds in the crossing"),
    ],
)
def test_8_7_4_what_is_no_left_turn_is_not_recognised(events: list[tuple[object, ...]]) -> None:
    assert tell(recogniser(LEFT_TURN), *MAP, *events, (10**6,)) == []


def test_figure_8_8_who_seems_to_enter_a_crossing_twice_is_told_by_the_unfiltered_chronicle_not_at_all() -> None:
    noisy = [
        *through(1000, "l1", "x1", "l2")[:2],
        (1300, "cars.crossing[c]", "x1", "no_crossing"),
        (1400, "cars.crossing[c]", "no_crossing", "x1"),
        *through(1000, "l1", "x1", "l2")[2:],
    ]
    assert tell(recogniser(LEFT_TURN), *MAP, *noisy, (10**6,)) == []


def test_8_7_4_a_turn_is_predicted_from_one_link_to_another() -> None:
    told = tell(
        recogniser(PREDICTED),
        *MAP,
        (10, "cars.link[c]", None, "l1"),
        (9000, "cars.link[c]", "l1", "l2"),
        (20_000, "cars.link[c]", "l2", "l9"),
    )
    assert [(dict(one.bindings), one.recognised_ms) for one in told] == [
        ({"?c": "c", "?l1": "l1", "?l2": "l2", "?x": "x1"}, 9000)
    ]


BEHIND_THEN_IN_FRONT: Final = """
chronicle overtake[?car1, ?car2]
{
  event(car_relations.behind[?car1, ?car2]:(?, true), t1)
  event(car_relations.behind[?car1, ?car2]:(true, false), t2)
  event(car_relations.in_front[?car1, ?car2]:(false, true), t3)
  noevent(car_relations.behind[?car1, ?car2]:(true, false), (t1, t2 - 1))
  noevent(car_relations.behind[?car1, ?car2]:(false, true), (t2 + 1, t3 - 1))
  noevent(car_relations.in_front[?car1, ?car2]:(false, true), (t1, t3 - 1))
  t1 < t3
  t1 < t2
}
"""


def test_8_7_5_behind_and_then_in_front_is_an_overtake_each_time() -> None:
    behind, in_front = "car_relations.behind[a, b]", "car_relations.in_front[a, b]"
    told = tell(
        recogniser(BEHIND_THEN_IN_FRONT),
        (0, behind, None, "true"), (0, in_front, None, "false"),
        (100, behind, "true", "false"), (200, behind, "false", "true"), (300, behind, "true", "false"),
        (400, in_front, "false", "true"), (500, in_front, "true", "false"), (600, behind, "false", "true"),
        (700, behind, "true", "false"), (700, in_front, "false", "true"),
    )  # fmt: skip
    assert times(told) == [({"t1": 200, "t2": 300, "t3": 400}, 400), ({"t1": 600, "t2": 700, "t3": 700}, 700)]
