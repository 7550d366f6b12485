import sys

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dyknow.kpl import check, parse_formula, print_formula
from dyknow.kpl.checking.formulas import Vocabulary
from dyknow.kpl.diagnostics.languages import language
from dyknow.model.errors import SourceText, TextError, TextErrors
from dyknow.reasoning import make_progression
from dyknow.reasoning.formulas.tree import (
    Always,
    And,
    Arithmetic,
    Compare,
    Const,
    Domain,
    Duration,
    Eventually,
    Feature,
    Forall,
    Implies,
    Negate,
    Not,
    Now,
    Or,
    Until,
    Variable,
)
from tests.kpl.strategies import formulas
from tests.strategies import examples

FORMULAS = language("formulas")
P, Q, R = Feature("p"), Feature("q"), Feature("r")
MODERATE = settings(max_examples=examples(200), deadline=None, suppress_health_check=[HealthCheck.too_slow])


def error_of(text):
    with pytest.raises(TextError) as caught:
        parse_formula(text)
    return caught.value


@given(formulas())
@MODERATE
def test_what_is_printed_reads_back_as_the_same_formula(formula):
    text = print_formula(formula)
    assert parse_formula(text) == formula
    assert print_formula(parse_formula(text)) == text


@pytest.mark.parametrize(
    ("text", "formula"),
    [
        ("p -> q -> r", Implies(P, Implies(Q, R))),
        ("p or q and r", Or((P, And((Q, R))))),
        ("p and q until r", And((P, Until(Q, R)))),
        ("p until q until r", Until(P, Until(Q, R))),
        ("not p and q", And((Not(P), Q))),
        ("always p until q", None),
        ("(always p) until q", Until(Always(P), Q)),
        ("always (p until q)", Always(Until(P, Q))),
        ("forall u in d: p -> q", Forall("u", Domain("d"), Implies(P, Q))),
        ("p and forall u in d: q or r", And((P, Forall("u", Domain("d"), Or((Q, R)))))),
        ("always[0, 5s] p", Always(P, 0, 5_000_000)),
        ("eventually[100, oo] p", Eventually(P, 100_000, None)),
        ("p until[1min, 2h] q", Until(P, Q, 60_000_000, 7_200_000_000)),
        ("always[0, T] p", Always(P, 0, Feature("T"))),
        (
            "x - y - 1 < 2",
            Compare("<", Arithmetic("-", Arithmetic("-", Feature("x"), Feature("y")), Const(1)), Const(2)),
        ),
        ("x-y < 2", Compare("<", Feature("x-y"), Const(2))),
        ("-x * 2 = -3", Compare("=", Arithmetic("*", Negate(Feature("x")), Const(2)), Const(-3))),
        ("cpa_time[0, 1] <= 10s", Compare("<=", Feature("cpa_time", ("0", "1")), Duration(10_000_000))),
        ("cars.link[car1] = l1", Compare("=", Feature("cars", ("car1",), "link"), Feature("l1"))),
        ('mode[from] != "AUTO"', Compare("!=", Feature("mode", ("from",)), Const("AUTO", quoted=True))),
        ("now > 5s", Compare(">", Now(), Duration(5_000_000))),
        ("state and link and growing", And((Feature("state"), Feature("link"), Feature("growing")))),
        ("p # and so on\n and q", And((P, Q))),
    ],
)
def test_precedence_and_names_are_as_the_language_says(text, formula):
    if formula is None:
        error_of(text)
    else:
        assert parse_formula(text) == formula


def test_a_quantifier_binds_its_variable_in_its_body_only():
    formula = parse_formula("(forall u in d - {u}: s[u] and u = v) and s[u]")
    inner = And((Feature("s", (Variable("u"),)), Compare("=", Variable("u"), Feature("v"))))
    assert formula == And((Forall("u", Domain("d", (("u",),)), inner), Feature("s", ("u",))))


def test_an_inner_quantifier_of_one_name_hides_the_outer():
    text = "forall u in d: forall u in {u, w} - {a}: s[u]"
    assert print_formula(parse_formula(text)) == text


@pytest.mark.parametrize(
    ("text", "column", "readings"),
    [
        ("always p -> q", 1, ("(always p) -> q", "always (p -> q)")),
        ("eventually[0, 5] p or q", 1, ("(eventually[0, 5] p) or q", "eventually[0, 5] (p or q)")),
        ("r -> always p and q", 6, ("(always p) and q", "always (p and q)")),
        ("eventually p until q", 1, ("(eventually p) until q", "eventually (p until q)")),
        ("p and always q and r", 7, ("(always q) and r", "always (q and r)")),
    ],
)
def test_always_and_eventually_on_the_left_must_choose_their_reading(text, column, readings):
    error = error_of(text)
    assert error.column == column
    assert "two ways" in error.message
    for reading in readings:
        assert reading in error.repair
        parse_formula(reading)


@pytest.mark.parametrize(
    ("text", "reading"),
    [
        ("p -> always q", "p -> (always q)"),
        ("p and eventually q", "p and (eventually q)"),
        ("not p until always q", "(not p) until (always q)"),
        ("(always p) -> q", "(always (p)) -> (q)"),
    ],
)
def test_always_and_eventually_on_the_right_need_no_parentheses(text, reading):
    assert parse_formula(text) == parse_formula(reading)


def test_every_error_of_a_formula_is_reported_in_its_order():
    text = "always p -> always[5, 3] q and\n  s[1.5] or eventually[0.0001us, oo] q"
    error = error_of(text)
    assert isinstance(error, TextErrors)
    assert [(one.line, one.column) for one in error.errors] == [(1, 1), (1, 13), (1, 19), (2, 5), (2, 24)]
    assert str(error).count("^") >= 5


@pytest.mark.parametrize(
    ("mistake", "sample"), [(mistake, sample) for mistake in FORMULAS.mistakes for sample in mistake.samples]
)
def test_each_sample_mistake_teaches_its_message(mistake, sample):
    error = error_of(sample)
    assert error.message == mistake.message
    assert error.repair == mistake.repair


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("always (altitude(uav1) > 3)", "objects stand in brackets"),
        ("p or not forall u in uavs - {a}. s[u]", "the domain and the body of a quantifier are separated by a colon"),
        ("p -> 3 < x + 1 <= 5", "comparisons do not chain"),
        ("p and q until[5s, 10s) r", "an interval is closed on both sides"),
        ("not always(0, 5s) p", "an interval stands in brackets, directly after always, eventually or until"),
    ],
)
def test_a_mistake_is_recognised_in_other_words(text, message):
    assert error_of(text).message == message


@pytest.mark.parametrize("spelling", sorted(FORMULAS.operators))
def test_operators_of_other_languages_are_answered_with_ours(spelling):
    text = (
        f"{spelling} p"
        if FORMULAS.operators[spelling].startswith(("not", "always", "event", "forall", "exists"))
        else f"p {spelling} q"
    )
    error = error_of(f"always[0, {spelling}] p" if spelling == "∞" else text)
    assert error.repair == FORMULAS.operators[spelling]


@pytest.mark.parametrize("word", ["p implies q", "p AND q", "ALWAYS p", "p UNTIL q", "NOT p"])
def test_words_of_other_languages_are_answered_with_ours(word):
    assert error_of(word).repair in {*FORMULAS.words.values(), "and", "always", "until", "not"}


@pytest.mark.parametrize(
    ("text", "message", "line", "column"),
    [
        ("", "no formula", 1, 1),
        ("   \n ", "no formula", 1, 1),
        ("p and", "the text ends", 1, 6),
        ("(p and\n (q or r)", "never closed", 1, 1),
        ("p)", "`)` closes nothing", 1, 2),
        ("p q", "found `q`", 1, 3),
        ("sample > 3", "reserved word", 1, 1),
        ('p = "abc', "string is never closed", 1, 5),
        ("p and\n  q $ r", "`$` has no meaning", 2, 5),
        ("1e99 < x", "too large", 1, 1),
        ("99999999999999999999999999h < x", "", 1, 1),
    ],
)
def test_errors_name_the_place_and_the_cause(text, message, line, column):
    error = error_of(text)
    assert message in str(error)
    assert (error.line, error.column) == (line, column)


def test_an_error_draws_the_line_and_a_caret_under_the_place():
    assert str(error_of("p and\n  speed(u) > 3")) == (
        "2:8: objects stand in brackets\n      speed(u) > 3\n           ^\n    write: speed[u]"
    )


def test_a_file_is_named_in_the_error():
    with pytest.raises(TextError, match=r"mission\.kpl:1:3"):
        parse_formula(SourceText("p q", "mission.kpl"))


BOMBS = [
    "(" * 60_000,
    "(" * 30_000 + "p" + ")" * 30_000,
    "not " * 16_000 + "p",
    "- " * 30_000 + "1 < 2",
    "always " * 9_000 + "p",
    "p -> " * 13_000 + "p",
    "p until " * 8_000 + "p",
    "1 + " * 16_000 + "1 < 2",
    "2 * " * 16_000 + "1 < 2",
    "forall u in d: " * 4_000 + "p",
    "[" * 65_000,
    "{" * 65_000,
    "s[" * 30_000,
    "p and " * 20_000 + "p",
    "(not " * 150 + "p" + ")" * 150,
    "9" * 65_000 + " < x",
    "x < 1e" + "9" * 60_000,
    '"' * 65_000,
    "#" * 65_000,
    "always[0, " * 6_000,
    "\x00" * 65_000,
    "é" * 65_000,
    "abs(" * 16_000,
]


@pytest.mark.parametrize("bomb", BOMBS, ids=range(len(BOMBS)))
def test_a_bomb_is_refused_with_a_text_error(bomb):
    with pytest.raises(TextError):
        parse_formula(bomb)


@pytest.mark.parametrize(
    "text",
    [
        "not " * 190 + "p",
        "(" * 95 + "p" + ")" * 95,
        "p -> " * 190 + "p",
        "1 + " * 190 + "1 < 2",
        "p and " * 9_000 + "p",
    ],
)
def test_what_passes_the_limits_can_be_checked_printed_and_progressed(text):
    formula = check(parse_formula(text), Vocabulary(), text)
    assert parse_formula(print_formula(formula)) == formula
    assert hash(formula)
    progression = make_progression(formula)
    progression.progress(0, {"p": True})
    assert progression.verdict != "undecided"


TOKENS = st.sampled_from(
    [
        "p",
        "q",
        "s[u]",
        "s",
        "u",
        "(",
        ")",
        "[",
        "]",
        "{",
        "}",
        ",",
        ":",
        ".",
        "-",
        "+",
        "*",
        "/",
        "->",
        "=",
        "!=",
        "<=",
        "<",
        "not",
        "and",
        "or",
        "until",
        "always",
        "eventually",
        "forall",
        "exists",
        "in",
        "growing",
        "true",
        "false",
        "abs",
        "since",
        "occurred",
        "now",
        "0",
        "5s",
        "100",
        "1.5",
        "oo",
        "T",
        '"',
        '"a"',
        "#",
        "\n",
        "\t",
        "$",
        "\\",
        "\x00",
        "é",
        "sample",
        "with",
        "from",
        "to",
    ]
)


@given(st.lists(TOKENS, max_size=40).map(" ".join) | st.text(max_size=80))
@MODERATE
def test_any_text_is_a_formula_or_a_text_error(text):
    try:
        formula = parse_formula(text)
    except TextError as error:
        assert 1 <= error.line <= text.count("\n") + 2
        assert error.column >= 1
        assert str(error)
    else:
        assert parse_formula(print_formula(formula)) == formula


def test_the_stack_is_left_alone_however_deep_the_caller_stands():
    def deep(left):
        return deep(left - 1) if left else parse_formula("not " * 150 + "p")

    assert deep(sys.getrecursionlimit() // 2) == parse_formula("not " * 150 + "p")
