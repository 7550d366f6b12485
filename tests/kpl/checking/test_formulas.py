import pytest

from dyknow import kpl
from dyknow.kpl import FeatureType, Vocabulary, check, parse_formula, print_formula, read_formula
from dyknow.model.errors import TextError, TextErrors
from dyknow.reasoning.formulas.tree import Always, Compare, Const, Duration, Eventually, Feature

KNOWN = Vocabulary(
    features={
        "speed": FeatureType(1, "number"),
        "winch": FeatureType(1, "number"),
        "cpa_time": FeatureType(2, "duration"),
        "attached": FeatureType(2, "boolean"),
        "EXEC": FeatureType(0, "boolean"),
        "cars.link": FeatureType(1, "object"),
        "mode": FeatureType(1, "object"),
        "anything": FeatureType(),
    },
    objects=("uav1", "uav2", "box1", "l1"),
    domains=("uavs", "carryable"),
    constants={"self": "uav1", "M": 30, "T": Duration(5_000_000), "S": 250, "FLAG": True, "OTHER": "uav2"},
)


def wrong(text):
    with pytest.raises(TextErrors) as caught:
        read_formula(text, KNOWN)
    return caught.value


@pytest.mark.parametrize(
    ("text", "resolved"),
    [
        ("speed[self] < M", "speed[uav1] < 30"),
        ("always[0, T] EXEC", "always[0, 5s] EXEC"),
        ("eventually[S, oo] FLAG", "eventually[250ms, oo] true"),
        ("always[T / 5, 2 * T + S] EXEC", "always[1s, 10250ms] EXEC"),
        ("EXEC until[T - 1s, T * 1.5 - (S + 2)] FLAG", "EXEC until[4s, 7248ms] true"),
        ("cars.link[self] = l1", "cars.link[uav1] = l1"),
        ("cpa_time[uav1, uav2] <= 10", "cpa_time[uav1, uav2] <= 10ms"),
        ("cpa_time[uav1, uav2] <= 10s", "cpa_time[uav1, uav2] <= 10s"),
        ("now - since(speed[uav1]) > 5000 + 1s", "now - since(speed[uav1]) > 5s + 1s"),
        ("cpa_time[uav1, uav2] / 2 < cpa_time[uav2, uav1] * 3", None),
        ("cpa_time[uav1, uav2] / 2s < 3", None),
        ("(EXEC and FLAG) = true", "(EXEC and true) = true"),
        ("anything[uav1] < 3 or anything[uav1, uav2] = l1 or anything", None),
        (
            "forall u in uavs - {self, OTHER}: speed[u] < 3 or u = OTHER",
            "forall u in uavs - {uav1, uav2}: speed[u] < 3 or u = uav2",
        ),
        ("abs(speed[uav1] - speed[uav2]) < 0.5", None),
        ('mode[uav1] = "AUTO"', None),
        ("occurred(landed[self])", "occurred(landed[uav1])"),
    ],
)
def test_names_resolve_to_constants_objects_and_features(text, resolved):
    formula = read_formula(text, KNOWN)
    assert print_formula(formula) == (resolved or text)


def test_a_variable_hides_constants_and_features_of_its_name():
    assert print_formula(read_formula("forall M in uavs: speed[M] < 3", KNOWN)) == "forall M in uavs: speed[M] < 3"


@pytest.mark.parametrize(
    ("text", "message", "repair"),
    [
        ("speed[u] < 3", "u is free", "forall u in DOMAIN: ..."),
        ("speed[uav3] < 3", "uav3 is free", "uav"),
        ("sped[uav1] < 3", "there is no feature sped", "speed"),
        ("zzz", "zzz is no variable", "forall zzz in DOMAIN: ..."),
        ("EXEK", "EXEK is no variable", "EXEC"),
        ("speed < 3", "speed takes one object, here are 0", "speed[object1]"),
        ("attached[uav1]", "attached takes 2 objects, here are 1", "attached[object1, object2]"),
        ("EXEC[uav1]", "EXEC takes no object, here are 1", "EXEC"),
        ("speed[uav1]", "a truth value is wanted, this is a number", "compare it"),
        ("speed[uav1] < cpa_time[uav1, uav2]", "a number meets a duration", "suffix"),
        ("cpa_time[uav1, uav2] * 2s < 3s", "cannot be multiplied", ""),
        ("speed[uav1] < EXEC", "a number meets a truth value", ""),
        ("cars.link[uav1] < l1", "an object has no order", "= or !="),
        ("EXEC > true", "a truth value has no order", "= or !="),
        ("mode[uav1] + 1 < 3", "a number is wanted, this is an object", ""),
        ("abs(EXEC) < 3", "a number is wanted, this is a truth value", ""),
        ("(always EXEC) = true", "several states", ""),
        ("speed[uav1] + (eventually EXEC) < 3", "several states", ""),
        ("forall u in uvas: EXEC", "there is no domain uvas", "uavs"),
        ("forall u in cars: EXEC", "there is no domain cars", "list members"),
        ("always[0, U] EXEC", "U is no time", "[0, 5s]"),
        ("always[0, inf] EXEC", "inf is no time", "oo"),
        ("always[T, 3] EXEC", "ends before it begins", "from <= to"),
        ("always[0, FLAG] EXEC", "FLAG is no time", ""),
        ("always[now, 100] EXEC", "now is no time", "[0, 5s]"),
        ("always[0, T * T] EXEC", "no product of times", "2 * 5s"),
        ("always[0, S / T] EXEC", "nothing divided by a time", "2 * 5s"),
        ("always[0, T / (S - S)] EXEC", "divided by a time or by 0", "2 * 5s"),
        ("always[S - T, T] EXEC", "begins before the state", "[0, 5s]"),
        ("always[S + T, T] EXEC", "ends before it begins", "from <= to"),
        ("always[0, S / 7] EXEC", "finer than a microsecond", "[0, 5s]"),
        ("speed[M] < 3", "the constant M is no object", ""),
        ("occurred(landed[u])", "u is free", ""),
        ("since(sped[uav1]) > 1s", "there is no feature sped", "speed"),
    ],
)
def test_each_error_says_what_and_how_to_mend_it(text, message, repair):
    error = wrong(text)
    assert message in error.message
    assert repair in error.repair


def test_every_error_of_a_formula_is_reported_with_its_caret():
    text = "always (sped[uav1] < 3 and\n        speed[u] < cpa_time[self])"
    error = wrong(text)
    found = [(one.line, one.column, one.width) for one in error.errors]
    assert found == [(1, 9, 10), (2, 9, 8), (2, 9, 25), (2, 20, 14)]
    assert str(error).count("^^^") >= 3


def test_errors_of_reading_and_of_checking_are_reported_together():
    error = wrong("always EXEC -> sped[uav1] < 3 and always[5, 3] FLAG")
    assert [one.column for one in error.errors] == [1, 16, 41]


def test_a_number_beside_a_numbered_object_is_that_object():
    known = Vocabulary(domains=("units",), constants={"self": "0"})
    formula = read_formula("exists u in units: u != 0 and d[self, u] < 3", known)
    assert print_formula(formula) == "exists u in units: u != 0 and d[0, u] < 3"
    inner = formula.body.parts[0]
    assert inner.right == Const("0")


def test_an_open_vocabulary_takes_names_as_they_come():
    formula = read_formula("always (speed[u] > M -> eventually[0, 5s] q)")
    assert isinstance(formula, Always)
    with pytest.raises(TextError, match="T is no time"):
        read_formula("always[0, T] p")


def test_terms_of_bounds_are_printed_as_they_are_read():
    for text in ("always[0, 2 * T + 100ms] p", "p until[T / 2, oo] q", "eventually[T, T * (S + 1)] p"):
        assert print_formula(parse_formula(text)) == text


def test_checking_again_changes_nothing():
    formula = read_formula("forall u in uavs - {self}: cpa_time[self, u] <= 10 or speed[u] < M", KNOWN)
    assert check(formula, KNOWN) == formula


def test_a_constant_of_the_wrong_size_is_no_bound():
    with pytest.raises(TextError, match="finer"):
        check(Eventually(Feature("p"), Feature("T"), None), Vocabulary(constants={"T": 0.00001}))


def test_durations_may_be_negative_beside_times():
    formula = read_formula("cpa_time[uav1, uav2] - 2s > -500", KNOWN)
    assert isinstance(formula, Compare)
    assert formula.right == Duration(-500_000)


def test_the_api_names_what_is_there_once():
    assert len(set(kpl.__all__)) == len(kpl.__all__)
    assert all(hasattr(kpl, name) for name in kpl.__all__)


def test_places_survive_for_messages_and_do_not_count_in_comparisons():
    formula = parse_formula("p and\n  q")
    assert (formula.parts[1].place.line, formula.parts[1].place.column) == (2, 3)
    assert formula == parse_formula("p   and q")
