import pytest
from hypothesis import given

from dyknow import Label, reasoning
from dyknow.kpl import parse_formula, print_formula
from dyknow.model.errors import TextError, UnknownLabel
from dyknow.reasoning import domain_members, instantiate, label_text, required_labels, split_growing
from dyknow.reasoning.formulas.tree import Domain, Forall, is_temporal, walk
from tests.reasoning.oracle import put
from tests.reasoning.strategies import bodies


def test_the_api_names_what_is_there_once():
    assert len(set(reasoning.__all__)) == len(reasoning.__all__)
    assert all(hasattr(reasoning, name) for name in reasoning.__all__)


def test_labels_of_features_are_the_labels_of_streams():
    assert label_text("xy_dist", ("0", "1")) == str(Label("xy_dist", ("0", "1")))
    assert label_text("cars.link", ("car1",)) == str(Label.parse("cars.link[car1]"))


@given(bodies)
def test_instances_have_the_member_wherever_the_variable_was_free(body):
    assert instantiate(body, "v", "m") == put(body, "v", "m")


def test_a_quantifier_of_the_same_name_keeps_its_variable():
    formula = parse_formula("forall v in d - {w}: s[v] and (forall v in e: t[v])")
    assert isinstance(formula, Forall)
    assert print_formula(instantiate(formula.body, "v", "m")) == "s[m] and forall v in e: t[v]"


def test_growing_formulas_split_into_one_formula_per_member():
    formula = parse_formula("always forall other in units - {self} growing: xy_dist[self, other] >= 15.0 or p")
    variable, domain, body = split_growing(formula)
    assert (variable, domain) == ("other", Domain("units", (("self",),)))
    assert print_formula(instantiate(body, variable, "7")) == "always (xy_dist[self, 7] >= 15.0 or p)"


@pytest.mark.parametrize(
    "text",
    [
        "always forall u in d: p",
        "always exists u in d growing: p",
        "forall u in d growing: always p",
        "always[0, 5] forall u in d growing: p",
        "always (q and forall u in d growing: p)",
    ],
)
def test_other_forms_do_not_split(text):
    assert split_growing(parse_formula(text)) is None


def test_domains_are_sets_without_sets_in_the_order_given():
    domains = {"units": ("2", "0", "1", "0"), "gone": ("1",)}
    assert domain_members(Domain("units", (("2",), "gone")), domains) == ("0",)
    assert domain_members(Domain(("a", "b", "a")), {}) == ("a", "b")
    with pytest.raises(UnknownLabel):
        domain_members(Domain("uavs"), domains)


def test_required_labels_expand_quantifiers_and_leave_events_out():
    inner = parse_formula("(forall u in d: s[u] -> since(t[u]) > 1s) and occurred(e) and cars.link[a] < 3")
    assert required_labels(inner, {"d": ("x", "y")}) == ("cars.link[a]", "s[x]", "s[y]", "t[x]", "t[y]")


def test_labels_over_other_members_leave_the_member_itself_out():
    formula = parse_formula("forall u in d: forall v in d - {u}: near[u, v]")
    assert required_labels(formula, {"d": ("x", "y")}) == ("near[x, y]", "near[y, x]")


def test_a_formula_that_explodes_over_its_domains_is_refused_before_it_does():
    formula = parse_formula("".join(f"forall v{n} in d: " for n in range(150)) + "p")
    with pytest.raises(TextError, match="expands"):
        required_labels(formula, {"d": tuple(map(str, range(50)))})
    wide = parse_formula("forall v in d: " + " and ".join(["s[v]"] * 4_000))
    with pytest.raises(TextError, match="expands"):
        required_labels(wide, {"d": tuple(map(str, range(100_000)))})


def test_temporal_formulas_are_told_from_formulas_about_one_state():
    assert is_temporal(parse_formula("p and not (q until r)"))
    assert not is_temporal(parse_formula("forall u in d: s[u] < 3"))
    assert sum(1 for _ in walk(parse_formula("p and not q"))) == 4
