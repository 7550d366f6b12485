"""Domains and problems as text: printed back, and refused with place, cause and repair."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.model.errors import DyknowError, TextError, TextErrors
from dyknow.planning import Declarations, parse_domain, parse_problem, print_declarations
from dyknow.planning.domains import model
from dyknow.planning.domains.model import Application, Next, Parameter, Quantified
from dyknow.planning.domains.printing import print_expression
from dyknow.planning.domains.sorts import free_variables
from dyknow.planning.domains.texts import parse_expression
from dyknow.reasoning.formulas import tree
from tests.planning.logistics import domain, problem_text

THESIS_OPERATOR = """
#domain locatable
#domain uav : locatable
#domain carryable : locatable
#domain uavstate = {unprepared, ready-to-attach}
#constant MAX_ATTACH_DIST = 2
#feature xpos(locatable) : fp
#feature ypos(locatable) : fp
#feature attached(uav, carryable) : boolean
#feature state(uav) : uavstate
#define hasCargo(uav) := exists carryable [attached(uav, carryable)]
#define near(uav, carryable, d) := hypot(xpos(uav) - xpos(carryable), ypos(uav) - ypos(carryable)) <= d
#operator adjust-for-attach(uav, carryable, x, y)
:at start, end
:cost 500
:timeconstraint 0 <= end - start <= 5 * UNITS_PER_SECOND
:precond [start] near(uav, carryable, MAX_ATTACH_DIST)
& !hasCargo(uav)
& xpos(carryable) == x
& ypos(carryable) == y
:effects [end] state(uav) := ready-to-attach
"""
"""The operator as it is printed in 7.4.1, with the declarations it needs."""
TYPED = (
    "#control c: [t] attached(uav, carryable) -> [t + 1] attached(uav, carryable) | eventually [0, 30s] xpos(uav) == 3",
    "#monitor m: always forall uav: xpos(uav) <= 50 until [0, 5000] state(uav) == unprepared :recovery land",
    "#objects uav = {u1, u2}",
    "#init xpos(u1) := 3.5, [30s] xpos(u1) := 4, !attached(u1, u2)",
    "#goal g: forall uav: state(uav) == ready-to-attach :deadline 300s :weight 4",
)


def test_the_operator_of_the_thesis_is_read_as_it_is_printed() -> None:
    (operator,) = parse_domain(THESIS_OPERATOR).operators
    assert operator.name == "adjust-for-attach"
    assert [one.name for one in operator.parameters] == ["uav", "carryable", "x", "y"]
    (effect,) = operator.effects
    assert (effect.anchor, effect.target.name) == ("end", "state")
    assert operator.timeconstraint is not None and operator.timeconstraint.shortest == tree.Const(0)


def test_example_7_4_1_is_read_as_it_is_printed_and_quantified_universally() -> None:
    (control,) = [one for one in domain().controls if one.name.startswith("move")]
    assert isinstance(control.formula, tree.Always)
    assert print_expression(control.formula) == (
        "always (is-at(box, x, y) -> next is-at(box, x, y) | !close-enough-to-goal(box) | need-to-move-temporarily(box))"
    )
    assert [one.name for one in free_variables(control.formula, domain())] == ["box", "x", "y"]


@pytest.mark.parametrize(
    ("typed", "printed"),
    [
        ("[t] ok(uav) & [t + 1] !ok(uav) -> [t] ok(uav2)", "always (ok(uav) & next !ok(uav) -> ok(uav2))"),
        ("forall t, uav. [t] ok(uav) -> [t + 1] ok(uav)", "always forall uav: ok(uav) -> next ok(uav)"),
        ("[t] ok(uav) -> ([t + 1] ok(uav)) | !ok(uav2)", "always (ok(uav) -> next ok(uav) | !ok(uav2))"),
        ("[t] ok(uav) -> [t + 1] ok(uav) & !ok(uav2)", "always (ok(uav) -> next ok(uav) & next !ok(uav2))"),
    ],
)
def test_a_time_stamp_is_about_what_stands_right_of_it_until_the_next_one(typed: str, printed: str) -> None:
    (control,) = parse_domain(f"{BEFORE}#control c: {typed}").controls
    assert print_expression(control.formula) == printed


def test_conditions_and_effects_may_repeat_their_stamps() -> None:
    several, once = (
        parse_domain(f"{BEFORE}#operator o(uav) :precond {condition} :effects {effect}").operators
        for condition, effect in (
            ("[start] ok(uav) & [start] xpos(uav) > 0", "[start] ok(uav) & xpos(uav) > 0 -> [end] ok(uav) := false"),
            ("[start] ok(uav) & xpos(uav) > 0", "[start] (ok(uav) & xpos(uav) > 0) -> [end] !ok(uav)"),
        )
    )
    assert several == once


def test_words_of_formulas_are_refused_as_names_and_in_is_one() -> None:
    assert parse_domain("#domain box #feature in(box, box) : boolean").features[0].name == "in"
    with pytest.raises(TextError, match="`until` is a reserved word") as caught:
        parse_domain("#domain box #feature until(box) : boolean")
    assert "until_" in str(caught.value)


def test_printing_gives_the_domain_and_the_problem_back() -> None:
    assert parse_domain(print_declarations(domain())) == domain()
    asked = parse_problem(problem_text(boxes=3), domain())
    assert parse_problem(print_declarations(asked), domain()) == asked


NAMES = st.sampled_from(["a", "b2", "box", "box'", "is-at", "ready-to-fly"])
TIMES = st.integers(0, 10**6).map(lambda ms: ms * 1000)
NUMBERS = st.one_of(st.integers(0, 10**6), st.floats(0, 1e6)).map(tree.Const)


def _terms(inner: st.SearchStrategy[object]) -> st.SearchStrategy[object]:
    return st.one_of(
        st.builds(Application, NAMES, st.lists(inner, max_size=3).map(tuple)),
        st.builds(tree.Arithmetic, st.sampled_from("+-*/"), inner, inner),
        inner.filter(lambda one: not isinstance(one, tree.Const)).map(tree.Negate),
    )


TERMS = st.recursive(
    st.one_of(NUMBERS, NAMES.map(Application), TIMES.filter(bool).map(tree.Duration)), _terms, max_leaves=6
)


def _window(make: type, inner: st.SearchStrategy[object]) -> st.SearchStrategy[object]:
    return st.one_of(
        inner.map(make),
        st.tuples(inner, TIMES, st.one_of(st.none(), TIMES)).map(
            lambda one: make(one[0], one[1], None if one[2] is None else one[1] + one[2])
        ),
    )


def _formulas(inner: st.SearchStrategy[object]) -> st.SearchStrategy[object]:
    several = st.lists(inner, min_size=2, max_size=3).map(tuple)
    variables = st.lists(st.builds(Parameter, NAMES, st.one_of(st.none(), NAMES)), min_size=1, max_size=2).map(tuple)
    return st.one_of(
        inner.map(tree.Not),
        inner.map(Next),
        inner.map(model.InGoal),
        several.map(tree.And),
        several.map(tree.Or),
        st.builds(tree.Implies, inner, inner),
        st.builds(tree.Until, inner, inner),
        _window(tree.Always, inner),
        _window(tree.Eventually, inner),
        st.builds(Quantified, st.sampled_from(["forall", "exists"]), variables, inner),
    )


ATOMS = st.one_of(
    st.builds(tree.Compare, st.sampled_from(["=", "!=", "<", "<=", ">", ">="]), TERMS, TERMS),
    st.booleans().map(tree.Const),
    st.builds(Application, NAMES, st.lists(TERMS, max_size=2).map(tuple)),
)
FORMULAS = st.recursive(ATOMS, _formulas, max_leaves=8)


@given(FORMULAS)
def test_reading_what_is_printed_gives_the_formula_back(formula: object) -> None:
    assert parse_expression(print_expression(formula)) == formula


WRONG = [
    ("#operator o(uav, y) :precond [start] ok(uav)", "nothing binds y", "== y"),
    ("#operator o(uav) :precond [start] ok(uav2)", "uav2 is free", "forall uav2"),
    ("#operator o(uav) :precond [start] okay(uav)", "there is no feature okay", "ok"),
    ("#operator o(uav) :precond [start] ok(uav, uav)", "ok takes 1 argument, here are 2", "ok(uav)"),
    ("#operator o(uav) :precond [start] xpos(uav)", "a truth value is wanted", "compare"),
    ("#operator o(uav) :precond [end] ok(uav)", "another time", "[start]"),
    ("#operator o(uav) :precond [start] always ok(uav)", "cannot stand here", "#control"),
    ("#operator o(uav) :effects [end] ok(uav), [end] !ok(uav)", "two values at one time", "one of them"),
    ("#operator o(uav) :effects [end] both(uav)", "both is derived", "features"),
    ("#operator o(uav) :effects [end] xpos(uav) := ok(uav)", "xpos is a fp, this is a boolean", ""),
    ("#operator o(uav) :effects [later] ok(uav)", "later is no time point", "[end]"),
    ("#operator o(uav) :cost ok(uav)", "a number is wanted", ""),
    ("#operator o(uav) :cost 1 :cost 2", "a second :cost", ""),
    ("#operator o(place) :effects [end] ok(uav)", "no parameter of o is a unit", "o(uav"),
    ("#operator o(uav) :timeconstraint 3 <= 5", "does not bound the duration", "end - start"),
    ("#define a(uav) := b(uav) #define b(uav) := a(uav)", "defined by itself: a -> b -> a", "features"),
    ("#control c: always flies(uav)", "there is no feature flies", ""),
    ("#control c: always next next ok(uav)", "next cannot stand here", ""),
    ("#control c: always executing-o(uav)", "known while a plan is executed", ":monitor"),
    ("#control c: [t] ok(uav) -> [t + 2] ok(uav)", "only [t] and [t + 1]", ""),
    ("#domain uav", "the type uav is declared twice", ""),
    ("#domain a : b #domain b : a", "above itself", ""),
    ("#domain car : vehicle", "there is no type vehicle", ""),
    ("#feature near(uav, fp) : boolean", "of objects, not of numbers", "#define"),
    ("#feature colour(uav) : paint", "there is no type paint", ""),
    ("#objects uav = {u1, u1}", "u1 is declared twice", ""),
    ("#objects uav = u1 .. u9999999", "empty or too long", "b1 .. b20"),
    ("#objects uav = {u1} #init ok(u1), !ok(u1)", "two values at one time", ""),
    ("#init ok(u7)", "u7 is no variable, constant, object or feature", ""),
    ("#goal finished", "finished is no variable", ""),
    ("#operator o(uav :effects", "", ""),
    ("#goal ok(uav) :weight -3", "not negative", ""),
]
BEFORE = """#domain uav
#domain place
#units uav
#feature ok(uav) : boolean
#feature xpos(uav) : fp
#define both(uav) := ok(uav) & xpos(uav) > 0
"""


@pytest.mark.parametrize(("wrong", "cause", "repair"), WRONG, ids=[cause or "grammar" for _, cause, _ in WRONG])
def test_what_is_wrong_is_told_with_place_cause_and_repair(wrong: str, cause: str, repair: str) -> None:
    with pytest.raises(TextError) as caught:
        parse_domain(BEFORE + wrong)
    shown = str(caught.value)
    assert cause in shown
    assert repair in shown
    errors = getattr(caught.value, "errors", (caught.value,))
    assert all(one.line >= 7 for one in errors)


def test_all_errors_of_a_text_are_reported() -> None:
    with pytest.raises(TextError) as caught:
        parse_domain(BEFORE + "#control a: always flies(uav)\n#control b: always swims(uav)")
    assert "flies" in str(caught.value) and "swims" in str(caught.value)


@pytest.mark.parametrize("seed", [*range(3), *(pytest.param(seed, marks=pytest.mark.full) for seed in range(3, 1000))])
def test_texts_that_are_damaged_are_read_or_refused_and_nothing_else(seed: int) -> None:
    rng = random.Random(seed)
    whole = THESIS_OPERATOR + "\n".join(TYPED)
    words = whole.split(" ")
    for _ in range(100):
        kind = rng.randrange(3)
        if kind == 0:
            at = rng.randrange(len(whole))
            damaged = whole[:at] + rng.choice("()[]#:&|!->=0 xyz\n\"'é\0") + whole[at + rng.randrange(40) :]
        elif kind == 1:
            some = list(words)
            for _ in range(3):
                some[rng.randrange(len(some))] = rng.choice(words)
            damaged = " ".join(some)
        else:
            damaged = " ".join(rng.choices(words, k=rng.randrange(1, 40)))
        try:
            read = parse_domain(damaged)
        except DyknowError as refused:
            assert isinstance(refused, TextError)
        else:
            assert isinstance(read, Declarations)


def test_a_type_that_is_misspelt_is_one_error_however_often_its_feature_is_used() -> None:
    text = (
        "#domain box\n#feature xpos(boks) : fp\n#operator lift(box, x) :precond xpos(box) == x"
        " :effects xpos(box) := x + 8\n#monitor high: always forall box: xpos(box) > 3\n"
    )
    with pytest.raises(TextError) as wrong:
        parse_domain(text)
    assert str(wrong.value).count("there is no type boks") == 1
    assert "is of a boks" not in str(wrong.value)
    assert not isinstance(wrong.value, TextErrors) or len(wrong.value.errors) == 1
