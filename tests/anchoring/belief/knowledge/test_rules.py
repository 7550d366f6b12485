"""Rules refuse or repair and are cited; knowledge comes and goes with area and task; contradictions are refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.anchoring.belief.files.knowledge import read_knowledge
from dyknow.anchoring.belief.knowledge.ontology import ClassRule
from dyknow.anchoring.belief.knowledge.rules import of_relations
from dyknow.model.errors import TextErrors, WrongCall
from tests.anchoring.belief.knowledge.kitchens import KITCHEN, informed, kinds, kitchen, see
from tests.anchoring.belief.worlds import S

SMALL = """
[[rules]]
name = "cups-are-small"
class = "cup"
attribute = "size_cm"
low = 3.0
high = 15.0
action = "ACTION"
"""
UNIQUE = """
[[rules]]
name = "on-one-thing"
class = "vessel"
relation = "on"
at_most = 1
"""
ON_TABLES = """
[[rules]]
name = "on-tables-only"
class = "cup"
relation = "on"
other = "table"
"""


def weigh(model, t_s: float, size_cm: float):
    return see(model, t_s, -30.0, sensor="scale", size_cm=np.array([size_cm]))


def test_an_instance_that_breaks_a_rule_is_refused_and_the_rule_cited() -> None:
    model = informed(KITCHEN + SMALL.replace("ACTION", "refuse"))
    see(model, 0, -30.0, type="cup")
    assert "refused" not in [each.kind for each in weigh(model, 1, 60.0).events]  # it is something else
    model = informed(
        KITCHEN.replace("attributes.size_cm = { mean = [8.0], sd = 1.0 }", "") + SMALL.replace("ACTION", "refuse")
    )
    see(model, 0, -30.0, type="cup")
    report = weigh(model, 1, 60.0)
    assert kinds(report)[-2:] == [("refused", "i1", "size_cm"), ("deleted", "i1", "")]
    assert next(each.because for each in report.events if each.kind == "refused").startswith("cups-are-small: violated")
    assert "i1" not in model.environment.table.names


def test_a_belief_that_breaks_a_rule_is_repaired_to_what_follows_if_it_holds() -> None:
    text = KITCHEN.replace("attributes.size_cm = { mean = [8.0], sd = 1.0 }", "")
    model, lawless = informed(text + SMALL.replace("ACTION", "repair")), informed(text)
    for each in (model, lawless):
        see(each, 0, -30.0, type="cup")
        report = weigh(each, 1, 17.0)
    assert kinds(report) == [("confirmed", "i1", ""), ("attribute-created", "i1", "size_cm")] or report.events
    ours, theirs = model.environment.instance(0), lawless.environment.instance(0)
    assert theirs.gaussian["size_cm"].mean[0] == pytest.approx(17.0, abs=0.1)
    s, size = theirs.type["cup"], theirs.gaussian["size_cm"]
    samples = np.random.default_rng(0).normal(size.mean[0], np.sqrt(size.covariance[0, 0]), 2_000_000)
    obeys = (samples >= 3.0) & (samples <= 15.0)
    whole = 1.0 - s * (1.0 - obeys.mean())
    weights = np.where(obeys, 1.0, 1.0 - s)
    assert ours.type["cup"] == pytest.approx(s * obeys.mean() / whole, abs=1e-3)
    assert ours.gaussian["size_cm"].mean[0] == pytest.approx(np.average(samples, weights=weights), abs=1e-2)
    spread = np.average((samples - np.average(samples, weights=weights)) ** 2, weights=weights)
    assert ours.gaussian["size_cm"].covariance[0, 0] == pytest.approx(spread, abs=1e-2)


def test_values_that_a_rule_forbids_lose_their_share_and_their_class() -> None:
    rule = '[[rules]]\nname = "no-green-cups"\nclass = "cup"\nattribute = "colour"\nvalues = ["red", "blue"]\n'
    model, lawless = informed(KITCHEN + rule), informed(KITCHEN)
    for each in (model, lawless):
        report = see(each, 0, -30.0, colour="green", type="cup")
    ours, theirs = model.environment.instance(0), lawless.environment.instance(0)
    s, q = theirs.type["cup"], 1.0 - theirs.categorical["colour"]["green"]
    whole = 1.0 - s * (1.0 - q)
    assert ours.type["cup"] == pytest.approx(s * q / whole)
    assert ours.categorical["colour"]["green"] == pytest.approx(theirs.categorical["colour"]["green"] * (1 - s) / whole)
    assert sum(ours.categorical["colour"].values()) == pytest.approx(1.0)
    del report


def test_a_cup_is_on_one_thing_and_that_is_a_table() -> None:
    model = informed(KITCHEN + ON_TABLES + UNIQUE, model=kitchen(lifetime_s=1e9))
    cited = []
    for t_s in range(0, 12, 4):
        see(model, t_s, 20.0, type="table")
        see(model, t_s + 1, -20.0, type="plate")
        see(model, t_s + 2, 0.0, type="cup")
    names = {max(each.type, key=each.type.get): each.name for each in model.environment.query()}
    assert set(names) == {"table", "plate", "cup"}
    for t_s in range(12, 18):
        report = see(model, t_s, 0.0, type="cup", on=[names["table"], names["plate"]])
        cited += [
            (each.kind, each.what, each.because.split(":")[0]) for each in report.events if each.kind == "repaired"
        ]
    assert ("repaired", f"on {names['plate']}", "on-tables-only") in cited
    cup = next(each for each in model.environment.query() if each.name == names["cup"])
    assert set(cup.relations) == {("on", names["table"])}


@given(st.lists(st.floats(0.05, 0.95), min_size=1, max_size=6), st.integers(1, 3))
def test_at_most_is_independent_relations_given_that_no_more_hold(held: list[float], most: int) -> None:
    model = informed(KITCHEN)
    see(model, 0, 0.0, type="cup")
    rule = ClassRule("few", "cup", "repair", relation="on", at_most=most, tolerance=0.0)
    relations = {("on", "i1", f"o{number}"): p for number, p in enumerate(held)}
    found = of_relations(model.environment.table, rule, np.array([0]), None, relations)
    whole, each = 0.0, np.zeros(len(held))
    for mask in range(1 << len(held)):
        bits = np.array([mask >> number & 1 for number in range(len(held))])
        if bits.sum() <= most:
            weight = np.prod(np.where(bits == 1, held, 1.0 - np.array(held)))
            whole += weight
            each += weight * bits
    if sum(held) > most:
        assert [found[key] for key in relations] == pytest.approx(list(each / whole), abs=1e-9)
    else:
        assert found == {}


def test_knowledge_is_loaded_and_unloaded_by_area_and_task_and_types_come_and_go_with_it() -> None:
    garden = (
        'name = "garden"\ntasks = ["gardening"]\n[classes.table]\n[region]\nx_m = [100.0, 200.0]\ny_m = [0.0, 50.0]\n'
    )
    serving = KITCHEN.replace("[classes.table]\n", "").replace(
        'name = "kitchen"', 'name = "kitchen"\ntasks = ["serving"]'
    )
    model = informed(serving, garden, task="serving")
    assert list(model.knowledge.loaded) == ["kitchen"]
    see(model, 0, 0.0, type="cup")
    assert model.environment.instance(0).type["table"] == 0.0
    assert model.knowledge.known
    events = model.select((90.0, 0.0, 110.0, 10.0), "gardening")
    assert [(each.kind, each.what) for each in events] == [("loaded", "garden"), ("unloaded", "kitchen")]
    assert model.knowledge.known == []
    assert model.environment.instance(0).type == pytest.approx({"cup": 0.0, "plate": 0.0, "table": 1.0})
    assert [(each.kind, each.what) for each in model.select((0.0, 0.0, 10.0, 10.0), "gardening")] == [
        ("unloaded", "garden")
    ]
    model.select(None, "serving")
    assert sum(model.environment.instance(0).type.values()) == pytest.approx(1.0)
    assert model.environment.instance(0).type["table"] == 0.0


WRONG = [
    ("[classes.cup]", '[classes.mug]\nis_a = "pot"\n[classes.cup]', "there is no class pot"),
    ("[classes.vessel]", '[classes.vessel]\nis_a = "cup"', "would be above itself"),
    ('has = ["size_cm"]', 'has = ["weight_g"]', "there is no attribute weight_g"),
    ("colour = { red = 0.98 }", "colour = { pink = 0.98 }", "is no value of colour"),
    ("colour = { red = 0.98 }", "colour = { red = 0.98, blue = 0.5 }", "sum to 1.48"),
    ('class = "cup"', 'class = "mug"', "there is no class mug"),
    ('attribute = "size_cm"', 'attribute = "weight_g"', "no such attribute"),
    ("low = 3.0", "low = 30.0", "low is below high"),
    ('action = "repair"', 'action = "forgive"', "one of repair, refuse is expected"),
    ("high = 15.0", "high = 10.0", "cup-of-anna contradicts the rule cups-are-small"),
    ('name = "cups-are-small"', 'name = "cups-are-small"\nwhen = 3', "unknown key"),
    ('is_a = "vessel"\nlasting', 'lasting = 1\nis_a = "vessel"\nlast', "true or false is expected"),
]  # fmt: skip


@pytest.mark.parametrize(("right", "wrong", "message"), WRONG)
def test_knowledge_that_contradicts_itself_or_the_model_is_refused(right: str, wrong: str, message: str) -> None:
    text = KITCHEN + SMALL.replace("ACTION", "repair")
    read_knowledge(text, kitchen(), "kitchen.toml")
    assert right in text
    with pytest.raises(TextErrors, match=r"kitchen.toml:\d+") as refused:
        read_knowledge(text.replace(right, wrong, 1), kitchen(), "kitchen.toml")
    assert message in str(refused.value)


def test_bundles_that_contradict_each_other_are_refused() -> None:
    with pytest.raises(WrongCall, match="the class vessel is in kitchen and in other"):
        informed(KITCHEN, 'name = "other"\n[classes.vessel]\n')
    with pytest.raises(WrongCall, match="known instance cup-of-anna"):
        informed(KITCHEN, 'name = "other"\n[[known]]\nid = "cup-of-anna"\n')


RED, NOT_RED = (
    f'[[rules]]\nname = "{name}"\nclass = "{of}"\nattribute = "colour"\nvalues = {values}\n'
    for name, of, values in (("red-cups", "cup", '["red"]'), ("never-red", "vessel", '["blue"]'))
)


def test_rules_that_leave_nothing_together_are_refused_in_one_bundle_and_in_two_that_are_loaded_together() -> None:
    message = "red-cups and never-red leave a cup no colour at all"
    with pytest.raises(TextErrors, match=message):
        read_knowledge(KITCHEN + RED + NOT_RED, kitchen(), "kitchen.toml")
    other = 'name = "other"\ntasks = ["TASK"]\n' + NOT_RED.replace('"vessel"', '"cup"')
    serving = KITCHEN.replace('name = "kitchen"', 'name = "kitchen"\ntasks = ["serving"]') + RED
    with pytest.raises(WrongCall, match=message):
        informed(serving, other.replace("TASK", "serving"))
    informed(serving, other.replace("TASK", "gardening"))


def test_bounds_that_leave_nothing_together_are_refused() -> None:
    small, large = SMALL.replace("ACTION", "repair"), SMALL.replace("ACTION", "refuse")
    large = large.replace("cups-are-small", "cups-are-large").replace("low = 3.0", "low = 16.0").replace("15.0", "99.0")
    with pytest.raises(TextErrors, match="cups-are-small and cups-are-large leave a cup no size_cm at all"):
        read_knowledge(KITCHEN + small + large, kitchen(), "kitchen.toml")


def test_what_is_usual_of_a_class_and_breaks_its_rules_is_refused() -> None:
    text = KITCHEN.replace("[classes.cup]", "[classes.cup]\nattributes.colour = { blue = 1.0 }") + RED
    with pytest.raises(TextErrors, match="cup contradicts the rule red-cups"):
        read_knowledge(text, kitchen(), "kitchen.toml")


@given(seed=st.integers(0, 1000))
def test_whatever_is_seen_beliefs_under_rules_stay_beliefs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = informed(KITCHEN + SMALL.replace("ACTION", "repair") + UNIQUE + ON_TABLES)
    for t_s in range(12):
        kind = ("cup", "plate", "table")[rng.integers(3)]
        names = model.environment.table.names
        on = [names[rng.integers(len(names))]] if names else None
        see(model, t_s, float(rng.uniform(-9, 9)), type=kind, on=on, size_cm=rng.uniform(0, 40, 1))
        table = model.environment.table
        for each in table.categorical.values():
            assert each.shares.sum(axis=1) == pytest.approx(np.ones(len(table)))
            assert (each.shares >= 0.0).all()
        assert (table.gaussian["size_cm"].covariance > 0.0).all()
    assert len(kinds(model.predict_to(1000 * S))) > 0
