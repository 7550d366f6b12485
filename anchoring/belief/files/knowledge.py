"""Bundles of prior knowledge from TOML. A contradiction within it, or to the model, is refused when it is read."""

from typing import Final

import numpy as np

from dyknow.anchoring.belief.arrays import Floats
from dyknow.anchoring.belief.description import CategoricalAttribute, GaussianAttribute, WorldModel
from dyknow.anchoring.belief.files.attributes import read_region
from dyknow.anchoring.belief.files.models import read_beliefs
from dyknow.anchoring.belief.files.tables import WorldTable
from dyknow.anchoring.belief.knowledge.ontology import (
    ACTIONS,
    REFUSE,
    REPAIR,
    ClassRule,
    KnowledgeBundle,
    KnownClass,
    KnownInstance,
    left_nothing,
    lineage,
)
from dyknow.anchoring.belief.observations import TYPE
from dyknow.documents.documents import toml_document

EXAMPLE: Final = "[classes.cup], [[rules]] and [[known]]"
TOLERANCE: Final = {REPAIR: 0.1, REFUSE: 0.5}
"""The greatest probability of a violation that is left alone, where a rule does not say."""


def read_knowledge(text: str, model: WorldModel, file: str = "") -> KnowledgeBundle:
    """One bundle, for a model.

    Raises:
        TextErrors: every error in it.
    """
    source = toml_document(text, file, EXAMPLE)
    root = WorldTable(source)
    area = read_region(root)
    classes = _classes(root, model)
    rules = _rules(root, model, classes)
    bundle = KnowledgeBundle(
        root.text("name", file or "knowledge"),
        None if area is None else (float(area[0][0]), float(area[0][1]), float(area[1][0]), float(area[1][1])),
        frozenset(root.texts("tasks")),
        classes,
        rules,
        _known(root, model, classes, rules),
    )
    root.end("name", "region", "tasks", "classes", "rules", "known")
    source.end()
    return bundle


def _classes(root: WorldTable, model: WorldModel) -> dict[str, KnownClass]:
    tables = root.tables("classes")
    found: dict[str, KnownClass] = {}
    for name, table in tables.items():
        above = table.text("is_a", "") if "is_a" in table else ""
        gaussian, categorical = read_beliefs(table, model.attributes, model.types)
        has = frozenset(table.texts("has"))
        for each in sorted(has - set(model.attributes)):
            table.wrong("has", f"there is no attribute {each}", "one of [attributes] of the model")
        found[name] = KnownClass(name, above, table.flag("lasting"), gaussian, categorical, has)
        table.end("is_a", "lasting", "has", "attributes")
    for name, table in tables.items():
        above = found[name].is_a
        if above and above not in found:
            table.wrong("is_a", f"there is no class {above}", f"[classes.{above}]")
        elif name in lineage({**found, name: found[name]._replace(is_a="")}, above):
            table.wrong("is_a", f"{name} would be above itself", "leave it out")
    return found


def _rules(root: WorldTable, model: WorldModel, classes: dict[str, KnownClass]) -> tuple[ClassRule, ...]:
    found: list[ClassRule] = []
    for table in root.list("rules"):
        name = table.text("name", None)
        if name in {each.name for each in found}:
            table.wrong("name", f"{name} is there twice", "another name")
        of_class = table.text("class", None)
        action = table.text("action", REPAIR, ACTIONS)
        rule = ClassRule(
            name,
            of_class,
            action,
            relation=table.text("relation", "") if "relation" in table else "",
            other=table.text("other", "") if "other" in table else "",
            at_most=table.whole("at_most", 0, 0, 100),
            tolerance=table.number("tolerance", TOLERANCE[action], 0.0, 1.0),
        )
        for key, each in (("class", rule.of_class), ("other", rule.other)):
            if each and each not in classes and each not in model.types.names:
                table.wrong(key, f"there is no class {each}", f"[classes.{each}]")
        if rule.relation:
            if rule.relation not in {each.name for each in model.relations}:
                table.wrong("relation", f"the model has no relation {rule.relation}", "one of its [relations]")
            if not rule.other and not rule.at_most:
                table.wrong("relation", "nothing is required of it", 'other = "table", or at_most = 1')
        else:
            rule = _about_attribute(table, rule, model)
        table.end("name", "class", "action", "attribute", "low", "high", "values", "relation", "other", "at_most")
        found.append(rule)
        if nothing := left_nothing(found, classes, model.types.names):
            table.wrong("name", nothing, "rules that agree")
            found.pop()
    _check_usual(root, classes, found)
    return tuple(found)


def _check_usual(root: WorldTable, classes: dict[str, KnownClass], rules: list[ClassRule]) -> None:
    """The usual attributes of a class must obey its rules."""
    for name, table in root.tables("classes").items():
        usual = KnownInstance(name, classes[name].gaussian, classes[name].categorical)
        for rule in rules:
            if rule.of_class in lineage(classes, name) and _disobeys(usual, rule):
                table.wrong(
                    "attributes", f"{name} contradicts the rule {rule.name}", "another rule, or other attributes"
                )


def _about_attribute(table: WorldTable, rule: ClassRule, model: WorldModel) -> ClassRule:
    attribute = model.attributes.get(table.text("attribute", None))
    if attribute is None:
        table.wrong(
            "attribute" if "attribute" in table else "", "the model has no such attribute", 'attribute = "colour"'
        )
        return rule
    if isinstance(attribute, CategoricalAttribute):
        values = table.texts("values")
        for each in sorted(set(values) - set(attribute.values)):
            table.wrong("values", f"{each} is no value of {attribute.name}", "its values")
        if not values:
            table.wrong("values" if "values" in table else "", "which values are allowed?", 'values = ["red", "blue"]')
        allowed = np.array([float(each in values) for each in attribute.values])
        return rule._replace(attribute=attribute.name, values=allowed)
    return _with_bounds(table, rule, attribute)


def _with_bounds(table: WorldTable, rule: ClassRule, attribute: GaussianAttribute) -> ClassRule:
    given = [table.numbers(key, attribute.axes) for key in ("low", "high")]
    low = np.full(attribute.axes, -np.inf) if given[0] is None else given[0]
    high = np.full(attribute.axes, np.inf) if given[1] is None else given[1]
    if not ("low" in table or "high" in table):
        table.wrong("", "which values are allowed?", "low = [3.0] and high = [20.0]")
    elif not (low < high).all():
        table.wrong(
            "low" if "low" in table else "high", "low is below high on every axis", "low = [3.0] and high = [20.0]"
        )
    return rule._replace(attribute=attribute.name, low=low, high=high)


def _known(
    root: WorldTable, model: WorldModel, classes: dict[str, KnownClass], rules: tuple[ClassRule, ...]
) -> tuple[KnownInstance, ...]:
    found: list[KnownInstance] = []
    for table in root.list("known"):
        name = table.text("id", None)
        if name in {each.name for each in found}:
            table.wrong("id", f"{name} is there twice", "another name")
        gaussian, categorical = read_beliefs(table, model.attributes, model.types)
        table.end("id", "type", "attributes")
        known = KnownInstance(name, gaussian, categorical)
        for rule in rules:
            if broken(known, rule, model, classes):
                table.wrong("id", f"{name} contradicts the rule {rule.name}", "another rule, or other attributes")
        found.append(known)
    return tuple(found)


def broken(known: KnownInstance, rule: ClassRule, model: WorldModel, classes: dict[str, KnownClass]) -> bool:
    """Whether a known instance is certainly of the class of a rule and probably does not obey it."""
    types = known.categorical.get(TYPE, model.types.belief.prior)
    of_class = [rule.of_class in lineage(classes, each) for each in model.types.names]
    if float(types @ np.array(of_class, dtype=np.float64)) < 0.5:
        return False
    return _disobeys(known, rule)


def _disobeys(known: KnownInstance, rule: ClassRule) -> bool:
    if rule.values is not None and rule.attribute in known.categorical:
        return float(known.categorical[rule.attribute] @ rule.values) < 0.5
    if rule.low is not None and rule.high is not None and rule.attribute in known.gaussian:
        mean: Floats = known.gaussian[rule.attribute][0][: len(rule.low)]
        return bool(((mean < rule.low) | (mean > rule.high)).any())
    return False


def print_known(known: KnownInstance, model: WorldModel) -> str:
    """Learnt knowledge, as `read_knowledge` reads it."""
    lines = ["[[known]]", f'id = "{known.name}"']
    for name, shares in known.categorical.items():
        values = model.types.names if name == TYPE else model.attributes[name].values  # type: ignore[union-attr]
        total = float(np.round(shares, 9).sum())
        listed = ", ".join(f'"{value}" = {share / total:.12g}' for value, share in zip(values, shares, strict=True))
        lines.append(f"{'' if name == TYPE else 'attributes.'}{name} = {{ {listed} }}")
    for name, (mean, covariance) in known.gaussian.items():
        rows = ", ".join(str([float(f"{each:.9g}") for each in row]) for row in covariance.tolist())
        places = [float(f"{each:.9g}") for each in mean.tolist()]
        lines.append(f"attributes.{name} = {{ mean = {places}, covariance = [{rows}] }}")
    return "\n".join((*lines, ""))
