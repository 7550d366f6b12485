"""The texts of thesis 8.3, typed: what is written there is read as it is meant there."""

import pytest

from dyknow.kpl import parse_chronicles, print_chronicles
from dyknow.model.errors import TextError
from dyknow.reasoning.chronicles import (
    Attribute,
    Chronicle,
    ChronicleVariable,
    Combination,
    Complement,
    ComplexConstraint,
    ConstraintUse,
    Distance,
    DomainDefinition,
    Event,
    EventType,
    Instants,
    Interval,
    MemberOf,
    Message,
    NamedDomain,
    NoEvent,
    Occurs,
    Recogniser,
    Symbols,
    TimeOrder,
    TimePoint,
    Variables,
    symbol_set,
)
from dyknow.reasoning.chronicles.definition.domains import RESERVED

CAR = ChronicleVariable("car")


def declared(text):
    """The declarations of a text, which also print and read back."""
    found = parse_chronicles(text)
    assert parse_chronicles(print_chronicles(found)) == found
    return found.declarations


def statements(text, before="event(a, t1) event(a, t2) event(a, t3) event(a, t4) event(a, t5)"):
    """What stands in a chronicle, without the events that make it one."""
    count = before.count("event(")
    chronicle = declared(f"chronicle c {{ {before} {text} }}")[-1]
    return chronicle.statements[count:]


def between(text):
    """The interval that an expression is."""
    (found,) = statements(f"t2 - t1 in {text}")
    assert (found.to, found.from_) == ("t2", "t1")
    return found.interval


def points(*names):
    return tuple(TimePoint(name) for name in names)


def test_8_3_1_symbols_are_letters_digits_and_underscores_and_keywords_name_nothing() -> None:
    assert [one.name for one in declared("message overtake message car2 message _9")] == ["overtake", "car2", "_9"]
    with pytest.raises(TextError):
        parse_chronicles("message 2car")
    for word in sorted(RESERVED - {"oo"}):
        with pytest.raises(TextError) as told:
            parse_chronicles(f"message {word}")
        assert "reserved word" in str(told.value)


def test_example_8_3_2_time_constants_and_intervals() -> None:
    assert statements("t1 = 123456") == (Distance("t1", None, Interval(123456, 123456)),)
    assert between("[10, 122]") == Interval(10, 122)
    assert between("]-oo, oo[") == Interval()
    assert between("[10, oo[") == Interval(10, None)
    assert between("]-oo, 10]") == Interval(None, 10)


def test_example_8_3_3_temporal_expressions() -> None:
    assert between("[-12, 100] + 22") == between("[10, 122]")
    assert between("[1300, oo[ & [0, 10000]") == between("[1300, 10000]")
    assert between("[10, 122] | [50, 100]") == between("[10, 122]")
    assert between("[10, 122] - 10") == Interval(0, 112)


def test_times_have_suffixes_and_chronicles_tick_in_milliseconds() -> None:
    assert between("[1.5s, 1min]") == Interval(1500, 60_000)
    assert statements("t2 <= t1 + 2h") == (
        TimeOrder((TimePoint("t2"), TimePoint("t1", Interval(7_200_000, 7_200_000))), ("<=",)),
    )
    with pytest.raises(TextError, match="tick in milliseconds"):
        statements("t2 <= t1 + 500us")


def test_example_8_3_4_domains() -> None:
    color, car, everything = declared(
        "domain Color = {red, blue, green}  domain Car = {car3} | {car2} | {car1}  domain All = ~{}"
    )
    assert color == DomainDefinition("Color", Symbols(("red", "blue", "green")))
    assert symbol_set(car.domain, {}) == symbol_set(Symbols(("car1", "car2", "car3")), {})
    assert everything == DomainDefinition("All", Complement(Symbols()))
    assert "anything" in symbol_set(everything.domain, {})


def test_both_spellings_of_the_operators_of_domains_are_read() -> None:
    """C7: the grammar writes | and \\, the text + and -."""
    (of_the_grammar,) = declared("domain D = ({a} | {b}) \\ {b} & ~{c}")
    (of_the_text,) = declared("domain D = ({a} + {b}) - {b} & ~{c}")
    assert of_the_grammar == of_the_text
    assert of_the_text.domain == Combination(
        "-",
        Combination("|", Symbols(("a",)), Symbols(("b",))),
        Combination("&", Symbols(("b",)), Complement(Symbols(("c",)))),
    )
    assert declared("domain D = {a} domain E = {a} domain F = D-E")[-1].domain == Combination(
        "-", NamedDomain("D"), NamedDomain("E")
    )


def test_examples_8_3_5_and_8_3_6_messages_and_attributes() -> None:
    domains = "domain Car = {car1, car2} domain Crossing = {x1} "
    message = declared(domains + "message in_crossing[?car, ?crossing] { ?car in Car ?crossing in Crossing }")[-1]
    inside = (MemberOf(CAR, NamedDomain("Car")), MemberOf(ChronicleVariable("crossing"), NamedDomain("Crossing")))
    assert message == Message("in_crossing", (CAR, ChronicleVariable("crossing")), inside)
    attribute = declared(domains + "attribute on_road[?car] { ?value in {true, false} ?car in Car }")[-1]
    values = MemberOf(ChronicleVariable("value"), Symbols(("true", "false")))
    assert attribute == Attribute("on_road", (CAR,), (values, MemberOf(CAR, NamedDomain("Car"))))


def test_example_8_3_7_atomic_constraints() -> None:
    assert statements("t1 < t2 <= t3 = t4") == (TimeOrder(points("t1", "t2", "t3", "t4"), ("<", "<=", "=")),)
    assert statements("t3 - t2 in [0, 250]") == (Distance("t3", "t2", Interval(0, 250)),)
    assert (
        statements("t4 - t1 < 100")
        == statements("t4 - t1 in ]-oo, 100[")
        == (Distance("t4", "t1", Interval(None, 99)),)
    )
    assert statements("10 <= t5 - t1 <= 30") == (Distance("t5", "t1", Interval(10, 30)),)
    assert statements("end - start <= 10") == (Distance("end", "start", Interval(None, 10)),)
    assert statements("t3-t2 in [-1000, 1000]") == (Distance("t3", "t2", Interval(-1000, 1000)),)


def test_example_8_3_8_complex_constraints() -> None:
    text = """
    constraint mySequence(t1, t2, t3) {
        t1 <= t2 <= t3
        t3 - t1 <= 5
    }
    chronicle c {
        instant begin, middle, finish
        event(a, begin)
        mySequence(begin, middle, finish)
    }
    """
    sequence, chronicle = declared(text)
    assert sequence == ComplexConstraint(
        "mySequence",
        ("t1", "t2", "t3"),
        (TimeOrder(points("t1", "t2", "t3"), ("<=", "<=")), Distance("t3", "t1", Interval(None, 5))),
    )
    assert chronicle.statements[0] == Instants(("begin", "middle", "finish"))
    assert chronicle.statements[2] == ConstraintUse("mySequence", points("begin", "middle", "finish"))
    (bare, used) = declared("time constraint rising { t1 < t2 } chronicle c { event(a, t1) event(b, t2) rising() }")
    assert bare == ComplexConstraint("rising", (), (TimeOrder(points("t1", "t2"), ("<",)),))
    assert used.statements[2] == ConstraintUse("rising", ())
    as_in_the_grammar = declared(text.replace("constraint my", "time constraint my"))
    assert as_in_the_grammar == (sequence, chronicle)


def test_example_8_3_10_local_variables() -> None:
    assert statements("variable ?y, *z event(b[?y, *z], t1)")[0] == Variables(
        (ChronicleVariable("y"), ChronicleVariable("z", star=True))
    )
    chronicle = declared("domain Car = {car1} chronicle c { variable ?c in Car event(a[?c], t1) }")[-1]
    assert chronicle.statements[0] == Variables((ChronicleVariable("c"),), NamedDomain("Car"))


@pytest.mark.parametrize(
    ("text", "least", "most", "type_", "begin", "end"),
    [
        ("occurs(1, 1, in_crossing[car1, ?c], (t1, t2))", 1, 1, EventType("in_crossing", ("car1", ChronicleVariable("c"))), "t1", "t2"),
        ("occurs(1, 5, in_crossing[?car, ?], (t3, t4))", 1, 5, EventType("in_crossing", (CAR, ChronicleVariable())), "t3", "t4"),
        ("occurs(1, oo, on_road[?car] : (?, false), (t5, t6))", 1, None, EventType("on_road", (CAR,), (ChronicleVariable(), "false")), "t5", "t6"),
        ("occurs(3, 3, in_crossing[?car, ?c], (t1, t2))", 3, 3, EventType("in_crossing", (CAR, ChronicleVariable("c"))), "t1", "t2"),
        ("occurs(3, 3, in_crossing[*car, ?c], (t1, t2))", 3, 3, EventType("in_crossing", (ChronicleVariable("car", star=True), ChronicleVariable("c"))), "t1", "t2"),
    ],
)  # fmt: skip
def test_examples_8_3_11_and_8_3_12_occurs(text, least, most, type_, begin, end) -> None:
    assert statements(text) == (Occurs(least, most, type_, TimePoint(begin), TimePoint(end)),)


def test_example_8_3_12_a_star_counts_what_a_question_mark_keeps_apart() -> None:
    crossings = [(1, "car1"), (2, "car2"), (3, "car1"), (4, "car1")]

    def told(car):
        text = f"chronicle c {{ occurs(3, 3, in_crossing[{car}, ?c], (t1, t2)) t1 = 0 t2 = 10 }}"
        recogniser = Recogniser.of(parse_chronicles(text))
        for at_ms, name in crossings:
            assert recogniser.on_message(at_ms, "in_crossing", (name, "x")) == []
        return [dict(one.bindings) for one in recogniser.on_time(10)]

    assert told("?car") == [{"?car": "car1", "?c": "x"}]
    assert told("*car") == []
    crossings.pop()
    assert told("*car") == [{"?c": "x"}]


def test_a_context_assertion_is_an_event_a_noevent_and_a_time_constraint() -> None:
    """8.3.4: the attribute p has the value v over ]t1, t2[."""
    held = statements("event(p:(?, v), t0) noevent(p:(v, ?), (t0 + 1, t2)) t0 <= t1")
    after = TimePoint("t0", Interval(1, 1))
    assert held == (
        Event(EventType("p", (), (ChronicleVariable(), "v")), TimePoint("t0")),
        NoEvent(EventType("p", (), ("v", ChronicleVariable())), after, TimePoint("t2")),
        TimeOrder(points("t0", "t1"), ("<=",)),
    )


def test_examples_8_3_1_8_3_9_and_8_3_13_an_overtake() -> None:
    text = """
    chronicle overtake[?car1,?car2]
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
    (chronicle,) = declared(text)
    assert isinstance(chronicle, Chronicle)
    assert [str(one) for one in chronicle.statements] == [
        "event(behind[?car1, ?car2]:(?, true), t1)",
        "event(left[?car1, ?car2]:(false, true), t2)",
        "event(in_front[?car1, ?car2]:(false, true), t3)",
        "event(road[?car1]:(?, ?road), t4)",
        "noevent(road[?car1]:(?road, ?), (t4, t3))",
        "event(road[?car2]:(?, ?road), t5)",
        "noevent(road[?car2]:(?road, ?), (t5, t3))",
        "t4 <= t1",
        "t5 <= t1",
        "t1 <= t2",
        "t3 - t2 in [0, 60000]",
    ]


def test_the_grammar_of_8_3_5_reads_parts_conditions_and_points_in_intervals() -> None:
    text = """
    time constraint soon(a, b) { b = a + [0, 100] }
    constraint differ[?x, ?y] { ?x != ?y }
    chronicle inner[?x](begin, finish) { event(a[?x], begin) event(b[?x], finish) begin < finish }
    chronicle outer[?x, ?y] {
        chronicle inner[?x](t1, t2)
        chronicle inner[?y](end = t4)
        event(c[?x, ?y], t3 - 5)
        event(d, t2 + [0, 10])
        differ[?x, ?y]
        if ?x == p then ?y != q else ?y in {q, r}
        ?x == p => ?y not in {s}
        ?x == q <=> ?y == r or ?y == s and not ?x == s
        soon(t3, t4 + 1)
        t1 >= t0 - 5 > start
        instant t0
    }
    """
    outer = declared(text)[-1]
    assert [str(one) for one in outer.statements] == [
        "chronicle inner[?x](t1, t2)",
        "chronicle inner[?y](end = t4)",
        "event(c[?x, ?y], t3 - 5)",
        "event(d, t2 + [0, 10])",
        "differ[?x, ?y]",
        "if ?x == p then ?y != q else ?y in {q, r}",
        "?x == p => ?y not in {s}",
        "?x == q <=> (?y == r or (?y == s and not ?x == s))",
        "soon(t3, t4 + 1)",
        "t1 >= t0 - 5 > start",
        "instant t0",
    ]
