"""Tables of attributes, relations and types in a world model."""

from collections.abc import Mapping
from math import inf
from typing import Final

import numpy as np

from dyknow.anchoring.belief.arrays import Floats
from dyknow.anchoring.belief.description import (
    POSITION,
    CategoricalAttribute,
    GaussianAttribute,
    ObjectTypes,
    RelationKind,
    uniform,
)
from dyknow.anchoring.belief.files.tables import WorldTable

ORDERS: Final = {"place": 1, "velocity": 2, "acceleration": 3}
RESERVED: Final = frozenset(
    {"t_ms", "sensor", "type", "relations", "covariance_m2", "nothing", "new", "clutter", "attributes", "existence"}
)
_FARTHEST: Final = 1e7
LEAST_SD, MOST_SD = 1e-6, 1e9
"""Bounds of all standard deviations, and of the widths of regions: arithmetic would fail beyond."""


def are_deviations(values: Floats | None) -> bool:
    """Whether these can be standard deviations."""
    return values is not None and bool(((values >= LEAST_SD) & (values <= MOST_SD)).all())


def read_region(root: WorldTable) -> tuple[Floats, Floats] | None:
    """Low and high (2,) of the positions; None where there is no region, or a wrong one."""
    if "region" not in root:
        root.get("region")
        return None
    region = root.table("region")
    spans = [region.numbers(key, 2) for key in ("x_m", "y_m")]
    region.end()
    for key, span in zip(("x_m", "y_m"), spans, strict=True):
        if span is None and key not in region:
            region.wrong("", f"has no {key}", f"{key} = [-100.0, 100.0]")
        elif span is not None and not (-_FARTHEST <= span[0] < span[1] <= _FARTHEST and span[1] - span[0] >= LEAST_SD):
            region.wrong(
                key, f"goes from a lower to a higher number, within {_FARTHEST:g} m", f"{key} = [-100.0, 100.0]"
            )
            return None
    x_m, y_m = spans
    return None if x_m is None or y_m is None else (np.array([x_m[0], y_m[0]]), np.array([x_m[1], y_m[1]]))


def read_attributes(
    root: WorldTable, region: tuple[Floats, Floats] | None
) -> tuple[list[GaussianAttribute], list[CategoricalAttribute]]:
    """All of `[attributes]`."""
    gaussian: list[GaussianAttribute] = []
    categorical: list[CategoricalAttribute] = []
    for name, table in root.tables("attributes").items():
        if name in RESERVED:
            table.wrong("", f"an attribute cannot be called {name}", "another name")
        if "values" in table:
            categorical.append(_categorical(name, table))
        else:
            gaussian.append(_gaussian(name, table, region))
        table.end("values", "prior", "ageing_s", "create", "drop", "mean", "sd", "low", "high", "motion", "noise")
    if POSITION in {each.name for each in categorical}:
        root.wrong("attributes", f"{POSITION} is continuous", f"[attributes.{POSITION}] without values")
    return gaussian, categorical


def _gaussian(name: str, table: WorldTable, region: tuple[Floats, Floats] | None) -> GaussianAttribute:
    order = ORDERS[table.text("motion", "place", tuple(ORDERS))]
    low, high, mean = table.numbers("low"), table.numbers("high"), table.numbers("mean")
    if name == POSITION:
        if region is None:
            table.wrong("", "positions need a region", "[region] with x_m = [-100.0, 100.0] and y_m = [-100.0, 100.0]")
        low, high = region or (np.zeros(2), np.ones(2))
    axes = len(next((each for each in (low, mean) if each is not None), np.zeros(1)))
    sd = table.numbers("sd", axes)
    if low is not None and (high is None or len(high) != len(low) or not are_deviations(high - low)):
        table.wrong(
            "high" if "high" in table else "", "low and high are bounds of every axis", "low = [0.0], high = [1.0]"
        )
        low = None
    if low is None and (mean is None or sd is None or not are_deviations(sd)):
        if mean is None or sd is not None or "sd" not in table:
            message = f"has neither values, nor low and high, nor mean and sd from {LEAST_SD:g} to {MOST_SD:g}"
            table.wrong("", message, "mean = 5.0 and sd = 2.0")
        mean, sd = np.zeros(axes), np.ones(axes)
    rates = table.numbers("rate_sd", order - 1) if order > 1 else None
    if order > 1 and not are_deviations(rates):
        if rates is not None or "rate_sd" not in table:
            message = f"needs rate_sd from {LEAST_SD:g} to {MOST_SD:g}"
            table.wrong("rate_sd" if "rate_sd" in table else "", message, "rate_sd = [10.0]")
        rates = np.ones(order - 1)
    is_angle = table.flag("angle")
    if is_angle and axes != 1:
        table.wrong("angle", "an angle has one axis", "angle = false")
        is_angle = False
    empty = np.zeros(0)
    found = GaussianAttribute(
        name,
        axes,
        order,
        table.number("noise", 0.0, 0.0, 1e9),
        low=empty if low is None else low,
        high=empty if low is None or high is None else high,
        mean=empty if low is not None or mean is None else mean,
        sd=empty if low is not None or sd is None else sd,
        rate_sd=() if rates is None else tuple(rates.tolist()),
        is_angle=is_angle,
        create_sd=table.number("create_sd", inf, 0.0, above=True),
        drop_sd=table.number("drop_sd", inf, 0.0, above=True),
    )
    _check_presence(found, table)
    return found


def _check_presence(attribute: GaussianAttribute, table: WorldTable) -> None:
    if not attribute.is_optional:
        return
    prior_sd = float(np.sqrt(np.diag(attribute.prior_covariance)[: attribute.axes].max()))
    if attribute.create_sd >= attribute.drop_sd:
        message = (
            f"create_sd is {attribute.create_sd:g}, and has to be below drop_sd, {attribute.drop_sd:g}: without a gap "
        )
        table.wrong("create_sd", message + "between them it would come and go", "create_sd = 1.0 and drop_sd = 3.0")
    elif prior_sd < attribute.create_sd:
        message = f"the prior deviates by {prior_sd:g} only: it would be created before anything is observed"
        table.wrong("create_sd", message, f"create_sd = {prior_sd / 2.0:g}")


def _categorical(name: str, table: WorldTable) -> CategoricalAttribute:
    values = table.texts("values")
    if len(values) < 2:
        table.wrong("values", "has at least two values", 'values = ["red", "blue"]')
        values = ("one", "other")
    prior = table.shares("prior", values, f"value of {name}")
    known = uniform(name, values)
    found = CategoricalAttribute(
        name,
        values,
        known.prior if prior is None else prior,
        table.number("ageing_s", inf, 0.0, above=True),
        table.number("create", 0.0, 0.0, 1.0),
        table.number("drop", 0.0, 0.0, 1.0),
    )
    if found.is_optional or found.drop > 0.0:
        _check_thresholds(table, found.create, found.drop, float(found.prior.max()), 1.0 / len(values), found.ageing_s)
    return found


def _check_thresholds(
    table: WorldTable, create: float, drop: float, prior: float, oldest: float, ageing_s: float
) -> None:
    """A created attribute must neither be dropped at once, nor exist from the beginning, nor stay for ever."""
    if drop >= create:
        message = (
            f"drop is {drop:g}, and has to be below create, {create:g}: without a gap between them it would come and go"
        )
        table.wrong("drop", message, "create = 0.8 and drop = 0.6")
    elif create <= prior:
        message = f"the prior is {prior:g} already: it would be created before anything is observed"
        table.wrong("create", message, f"create = {(1.0 + prior) / 2.0:g}")
    elif ageing_s < inf and drop <= oldest:
        message = f"age alone leads to {oldest:g}, and drop, {drop:g}, has to be above that: it would never be dropped"
        table.wrong("drop", message, f"drop = {(create + oldest) / 2.0:g}, or no ageing_s")


def read_relations(root: WorldTable) -> list[RelationKind]:
    """All of `[relations]`."""
    found = []
    for name, table in root.tables("relations").items():
        usual = RelationKind(name)
        kind = RelationKind(
            name,
            table.number("prior", usual.prior, 0.0, 1.0),
            table.number("ageing_s", usual.ageing_s, 0.0, above=True),
            table.number("right", usual.right, 0.0, 1.0),
            table.number("wrong", usual.wrong, 0.0, 1.0),
            table.number("create", usual.create, 0.0, 1.0),
            table.number("drop", usual.drop, 0.0, 1.0),
        )
        table.end()
        _check_thresholds(table, kind.create, kind.drop, kind.prior, 0.5, kind.ageing_s)
        if kind.wrong >= kind.right:
            message = f"reported where it holds: {kind.right:g}, where it does not: {kind.wrong:g}; a report would be no evidence"
            table.wrong("right", message, "right = 0.9 and wrong = 0.1")
        found.append(kind)
    return found


def read_types(root: WorldTable, attributes: Mapping[str, object]) -> ObjectTypes:
    """All of `[types]`, and `[classification]`."""
    about = root.table("classification")
    ageing_s, least = about.number("ageing_s", inf, 0.0, above=True), about.number("floor", 1e-6, 0.0, 1.0)
    about.end()
    tables = root.tables("types")
    if not tables:
        root.wrong("types", "there are no types", "[types.car] with prior = 1.0")
        return ObjectTypes(uniform("type", ("thing",)))
    names = tuple(tables)
    priors = np.array([table.number("prior", 1.0 / len(names), 0.0, 1.0) for table in tables.values()])
    if abs(priors.sum() - 1.0) > 1e-6:
        root.wrong("types", f"priors of types sum to {priors.sum():g}, not to 1", "priors that sum to 1")
        priors = np.full(len(names), 1.0 / len(names))
    observed: dict[frozenset[str], Floats] = {}
    for index, table in enumerate(tables.values()):
        total = 0.0
        for entry in table.list("observed"):
            key = frozenset(entry.texts("attributes"))
            for each in sorted(key - set(attributes)):
                entry.wrong("attributes", f"there is no attribute {each}", "one of [attributes]")
            shares = observed.setdefault(key, np.zeros(len(names)))
            shares[index] = entry.number("probability", None, 0.0, 1.0)
            total += float(shares[index])
            entry.end()
        if total > 1.0 + 1e-6:
            table.wrong("observed", f"probabilities sum to {total:g}, more than 1", "probabilities that sum to 1")
        table.end("prior", "observed")
    if observed:
        for name, table in tables.items():
            if not table.entries.get("observed"):
                message = f"other types say which attributes are observed, {name} does not"
                table.wrong("", message, 'observed = [{attributes = ["position_m"], probability = 1.0}]')
    belief = CategoricalAttribute("type", names, priors / priors.sum(), ageing_s)
    return ObjectTypes(belief, observed, least)
