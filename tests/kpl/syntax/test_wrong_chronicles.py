"""What is wrong with chronicles is told all at once, each at its place, with what was meant."""

import pytest

from dyknow.kpl import parse_chronicles
from dyknow.model.errors import SourceText, TextErrors

WRONG = """\
domain A = {a, b}
domain A = {c}
domain L = L | {a}
domain M = Nope
attribute road[?car] { ?value in {r1, r2} ?car in A }
message hit[?car, ?by] { ?card in A }
constraint soon(t1, t2) { t1 < t3 }
constraint differ[?a, ?b] { ?a != ?c }
chronicle a[?x, ?y] {
    event(road[?x]:(r1, r3), t1)
    event(rood[?x]:(r1, r2), t1)
    event(road[c]:(r1, r2), t1)
    event(hit[?x, a]:(true, false), t2)
    event(hit[?x], t2)
    event(road[?x], t2)
    t1 <= t22
    son(t1, t2)
    soon(t1)
    ?z != ?x
    ?x in {a} & {b}
    ?x in A; ?x in {z}
    occurs(5, 3, hit[?x, ?q], (t1, t2))
    chronicle a[?x](t1, foo = t2)
    differ[?x]
    diffe[?x, ?q]
    t4 - t3 < t2 - t1
    t2 - t1 in [5, 3]
    t2 - t1 in [0, 3] | [5, 7]
    t2 - t1 in [oo, 5]
    t2 - t1 >= 500us
    t2 <= t1
    - 5 <= t2
    event(hit[?value, ?x], 5)
}
chronicle b { t1 < t2 }
chronicle c { event(b, t1) }
chronicle d { event(d, t1) }
chronicle heli-pos { event(d, t1) }
"""

TOLD = [
    (2, 8, "A is declared already, as a domain in line 1", "another name, or one of them"),
    (3, 8, "the domain L is declared by itself; write its symbols", "domain D = {a, b}"),
    (4, 12, "there is no domain Nope", "declare it: domain Nope = {...}"),
    (6, 26, "?card is not in the brackets of hit", "?car"),
    (7, 32, "t3 is not an instant of the constraint", ""),
    (8, 35, "?c is not in the brackets of differ", ""),
    (9, 17, "?y is not bound: it stands in no event and in no part", "event(...[?y], t1)"),
    (10, 11, "r3 is outside the domain of ?value: r1, r2", ""),
    (11, 11, "there is no attribute rood", "road"),
    (12, 11, "c is outside the domain of ?car: a, b", ""),
    (13, 11, "hit is a message, which has no value", "hit[?x, a]"),
    (14, 11, "the message hit takes 2, here are 1", "hit[?car, ?by]"),
    (15, 11, "road is an attribute, whose events are changes", "road[?x]:(?, true)"),
    (16, 11, "nothing happens at t22: it is only compared", "t2"),
    (17, 5, "there is no constraint on instants son", "soon"),
    (18, 5, "the constraint on instants soon takes 2, here are 1", "soon(t1, t2)"),
    (19, 5, "?z is not bound: it stands in no event and in no part", "event(...[?z], t1)"),
    (20, 5, "?x can have no value: {a} & {b} holds nothing", ""),
    (22, 15, "at least 5 and at most 3 cannot be", "the lower number first"),
    (23, 5, "the chronicle a takes 2, here are 1", "a[?x, ?y]"),
    (23, 5, "chronicle a gives 0 instants by place, here are 1", "name them: chronicle a[...](start = t1, end = t2)"),
    (23, 5, "chronicle a gives no instant foo", "start, end, or chronicle a[...](foo) { ... }"),
    (23, 5, "a stands on a: nothing can stand on itself", "leave it out"),
    (24, 5, "the constraint differ takes 2, here are 1", "differ[?a, ?b]"),
    (25, 5, "there is no constraint diffe", "differ"),
    (26, 5, "a time constraint compares two instants, or the distance of two with a time", "t3 - t2 in [0, 60000]"),
    (26, 5, "nothing happens at t4: it is only compared", "instant t4"),
    (26, 10, "nothing happens at t3: it is only compared", "instant t3"),
    (27, 16, "[5, 3] holds no instant; write the lower bound first", ""),
    (28, 16, "[0, 3] | [5, 7] has a gap; a constraint takes one interval", ""),
    (29, 16, "an interval goes from the earlier to the later", "[0, oo[   or   ]-oo, 5]"),
    (30, 16, "chronicles tick in milliseconds, 500us is finer", "whole milliseconds, or oo where there is no bound"),
    (
        32,
        5,
        "this line continues what is before it, since it begins with `-`",
        "end the line before with `-`, or with `;` if this is another statement",
    ),
    (
        33,
        28,
        "this is no instant: an instant is named, and may be shifted",
        "event(on_road[?car]:(?, true), t1 + 500ms)",
    ),
    (35, 11, "chronicle b asks for no event, so that nothing could be recognised", "event(...) or occurs(1, oo, ...)"),
    (35, 15, "nothing happens at t1: it is only compared", "instant t1"),
    (35, 20, "nothing happens at t2: it is only compared", "instant t2"),
    (37, 21, "d stands on d: nothing can stand on itself", "leave it out"),
    (38, 11, "the name of a chronicle is a symbol: letters, digits and _", "heli_pos"),
]
BROKEN = """\
domain A = {a; b}
domain B = {c}
chronicle a[?x] {
    event(a[?x]:true, t1)
    t1 <
    event(b(?x),
       t2)
    noevent(c, t1)
    t1 == t2
}
message m(?x)
chronicle b {
    event(a, t1.5)
    t1 <= t2 or t3 <= t4
    not t1
"""

TOLD_OF_BROKEN = [
    (1, 14, "a domain is a set of values or its name; sets are put together by |, &, - and ~"),
    (
        4,
        17,
        "an event is a message, event(in_crossing[?car], t1), or a change of an attribute from one value to another",
    ),
    (6, 5, "expected a name, a number, `-`, `+`; found `event`"),
    (
        8,
        16,
        "what happens at one instant is an event; noevent and occurs speak of the time between two, the second left out",
    ),
    (9, 8, "instants are compared with <, <=, =, >= and >; variables with == and !="),
    (11, 10, "an attribute or a message has its objects in brackets, and their domains in braces"),
    (12, 13, "this `{` is never closed"),
    (13, 16, "expected `)`, `-`, `+`; found `.`"),
    (14, 14, "of events and times there are no alternatives, and nothing denies them"),
]


def told(text):
    with pytest.raises(TextErrors) as found:
        parse_chronicles(SourceText(text, "wrong.chr"))
    return found.value.errors


def test_every_name_value_and_time_that_is_wrong_is_told_with_its_repair():
    assert [(one.line, one.column, one.message, one.repair) for one in told(WRONG)] == TOLD


def test_one_place_that_leaves_the_grammar_hides_no_other():
    assert [(one.line, one.column, one.message) for one in told(BROKEN)] == TOLD_OF_BROKEN


@pytest.mark.parametrize(
    ("body", "line", "message"),
    [
        (
            "event(a[?x], t1)\nevent(a[?x], t2)\nt1 < t2\nt2 - t1 in ]-oo, 0]",
            5,
            "these times contradict each other: t1 < t2; t2 - t1 in ]-oo, 0]; take one of them out or widen it",
        ),
        ("occurs(1, oo, a[?x], (t1, t2))\nt2 <= t1", 3, "these times contradict each other: "),
        ("event(a[?x], t1)\nend - start < 3\nt1 - start > 5", 4, "these times contradict each other: "),
        ("event(a[*x], t1)\nevent(b[*y], t2)\n*x != *y", 4, "*x != *y: *x, *y stands in no one event"),
    ],
)
def test_what_cannot_be_recognised_is_told_at_its_statement(body, line, message):
    (one,) = told(f"chronicle c {{\n{body}\n}}")
    assert one.line == line
    assert message in one.message
