"""World models from TOML. An inconsistent one, above all with contradicting thresholds, is refused when it is read."""

from collections.abc import Mapping
from math import inf, log
from typing import Final

import numpy as np

from dyknow.anchoring.belief.arrays import Floats
from dyknow.anchoring.belief.description import (
    EVENT,
    POSITION,
    READINGS,
    CategoricalAttribute,
    Confusion,
    GaussianAttribute,
    InitialInstance,
    LifeThresholds,
    ObjectTypes,
    WorldLimits,
    WorldModel,
    WorldSensor,
)
from dyknow.anchoring.belief.files.attributes import (
    LEAST_SD,
    MOST_SD,
    RESERVED,
    are_deviations,
    read_attributes,
    read_region,
    read_relations,
    read_types,
)
from dyknow.anchoring.belief.files.tables import WorldTable
from dyknow.anchoring.belief.sensing import trusted
from dyknow.documents.documents import toml_document
from dyknow.navigation import LocalFrame

HIGHEST_M: Final = 1e5
EXAMPLE: Final = "[region], [types.car], [attributes.position_m] and [sensors.camera], one table each"
_KEPT: Final = frozenset({"new", "clutter"})


def read_world_model(text: str, file: str = "") -> WorldModel:
    """The model.

    Raises:
        TextErrors: every error in it.
    """
    source = toml_document(text, file, EXAMPLE)
    root = WorldTable(source)
    gaussian, categorical = read_attributes(root, read_region(root))
    if not gaussian and not categorical:
        root.wrong("attributes", "there are no attributes", f"[attributes.{POSITION}]")
    attributes: dict[str, GaussianAttribute | CategoricalAttribute] = {each.name: each for each in gaussian}
    attributes |= {each.name: each for each in categorical}
    types = read_types(root, attributes)
    thresholds, lifetime_s = _thresholds(root), _lifetime_s(root)
    model = WorldModel(
        types,
        gaussian,
        categorical,
        read_relations(root),
        _sensors(root, attributes, types, thresholds),
        root.text("reading", EVENT, READINGS),
        thresholds,
        lifetime_s,
        _limits(root),
        _initial(root, attributes, types, thresholds),
        _frame(root),
    )
    if not model.initial and not any(each.births for each in model.sensors.values()):
        root.wrong("sensors", "nothing is believed in at first, and no sensor finds anything new", "births = 0.1")
    root.end("region", "origin", "initial", "limits", "relations", "classification")
    source.end()
    return model


def _frame(root: WorldTable) -> LocalFrame | None:
    """Of `[origin]`: where x = y = 0 is on earth."""
    if "origin" not in root:
        root.get("origin")
        return None
    origin = root.table("origin")
    latitude_deg = origin.number("latitude_deg", None, -90.0, 90.0)
    longitude_deg = origin.number("longitude_deg", None, -180.0, 180.0)
    altitude_m = origin.number("altitude_m", 0.0, -HIGHEST_M, HIGHEST_M)
    origin.end()
    return LocalFrame(latitude_deg, longitude_deg, altitude_m)


def _thresholds(root: WorldTable) -> LifeThresholds:
    table, usual = root.table("thresholds"), LifeThresholds()
    found = LifeThresholds(
        table.number("create", usual.create, 0.0, 1.0, above=True),
        table.number("confirm", usual.confirm, 0.0, 1.0, above=True),
        table.number("delete", usual.delete, 0.0, 1.0, above=True),
    )
    table.end()
    if found.delete >= found.confirm:
        message = (
            f"delete = {found.delete:g} is not below confirm = {found.confirm:g}: confirmed instances would be deleted"
        )
        table.wrong("delete" if "delete" in table else "confirm", message, "confirm = 0.9 and delete = 0.05")
    if found.delete > found.create:
        message = (
            f"create is {found.create:g}, and has to be at least delete, {found.delete:g}: instances would be born dead"
        )
        table.wrong("create" if "create" in table else "delete", message, "create = 0.1 and delete = 0.05")
    if found.confirm >= 1.0:
        table.wrong(
            "confirm", "is below 1: no existence is certain, so that nothing could be confirmed", "confirm = 0.9"
        )
    return found


def _lifetime_s(root: WorldTable) -> float:
    table = root.table("existence")
    lifetime_s = table.number("lifetime_s", inf, 0.0, above=True)
    kept = table.number("kept_per_s", 1.0, 0.0, 1.0, above=True)
    table.end()
    if "lifetime_s" in table and "kept_per_s" in table:
        message = "lifetime_s and kept_per_s say the same: kept_per_s is exp(-1 s / lifetime)"
        table.wrong("kept_per_s", message, "one of them")
    return lifetime_s if kept == 1.0 else -1.0 / log(kept)


def _limits(root: WorldTable) -> WorldLimits:
    table, usual = root.table("limits"), WorldLimits()
    found = WorldLimits(
        table.whole("instances", usual.instances, 1, 100_000),
        table.whole("scan", usual.scan, 1, 100_000),
        table.whole("pairs", usual.pairs, 1, 10_000_000),
    )
    table.end()
    return found


def _sensors(
    root: WorldTable,
    attributes: Mapping[str, GaussianAttribute | CategoricalAttribute],
    types: ObjectTypes,
    thresholds: LifeThresholds,
) -> dict[str, WorldSensor]:
    tables = root.tables("sensors")
    if not tables:
        root.wrong("sensors", "there are no sensors", "[sensors.camera] with detects = 0.9")
    found = {}
    for name, table in tables.items():
        usual = WorldSensor(name)
        sensor = WorldSensor(
            name,
            table.number("detects", usual.detects, 0.0, 1.0, above=True),
            table.number("false_alarm", usual.false_alarm, 0.0, 1.0),
            table.number("births", usual.births, 0.0, 1e6),
            table.number("clutter", usual.clutter, 0.0, 1e6),
            _noise(table, attributes),
            _confusion(table, attributes, types),
            _view(table),
            table.flag("frame"),
            table.number("trust", usual.trust, 0.0, 1.0),
        )
        table.end()
        _check_sensor(table, sensor, thresholds)
        found[name] = sensor
    return found


def _check_sensor(table: WorldTable, sensor: WorldSensor, thresholds: LifeThresholds) -> None:
    if sensor.false_alarm >= sensor.detects:
        message = (
            f"{sensor.false_alarm:g} is not below detects, {sensor.detects:g}: to be seen would speak against existence"
        )
        table.wrong(
            "false_alarm" if "false_alarm" in table else "detects", message, "detects = 0.9, false_alarm = 0.01"
        )
    if sensor.births > 0.0 and sensor.trust > 0.0:
        known = trusted(sensor, sensor.trust)
        most = known.births / (known.births + known.clutter)
        if most <= thresholds.create:
            so_far = "" if sensor.trust == 1.0 else " as far as it is trusted"
            message = (
                f"what it observes is new with a probability of at most {most:.4g}, births / (births + clutter){so_far}, which is "
                f"not above the threshold create, {thresholds.create:g}: no instance could ever be created"
            )
            table.wrong("births" if "births" in table else "", message, f"create and delete below {most:.4g}")


def _noise(sensor: WorldTable, attributes: Mapping[str, GaussianAttribute | CategoricalAttribute]) -> dict[str, Floats]:
    """Standard deviations, squared: of each axis, or one for all."""
    table = sensor.table("noise_sd")
    found: dict[str, Floats] = {}
    for name in table.entries:
        attribute = attributes.get(name)
        sd = table.numbers(name)
        if not isinstance(attribute, GaussianAttribute):
            table.wrong(name, "is no continuous attribute", "one of [attributes] without values")
        elif sd is not None and (len(sd) not in {1, attribute.axes} or not are_deviations(sd)):
            message = f"is a standard deviation from {LEAST_SD:g} to {MOST_SD:g}, or one for each axis"
            table.wrong(name, message, f"{name} = 0.5")
        elif sd is not None:
            found[name] = np.diag(np.broadcast_to(sd, attribute.axes) ** 2)
    return found


def _confusion(
    sensor: WorldTable,
    attributes: Mapping[str, GaussianAttribute | CategoricalAttribute],
    types: ObjectTypes,
) -> dict[str, Confusion]:
    found: dict[str, Confusion] = {}
    for name, table in sensor.tables("confusion").items():
        attribute = types.belief if name == "type" else attributes.get(name)
        if not isinstance(attribute, CategoricalAttribute):
            table.wrong("", f"{name} is no discrete attribute", "one of [attributes] that has values, or type")
            continue
        symbols = tuple(
            dict.fromkeys(symbol for row in table.entries.values() if isinstance(row, dict) for symbol in row)
        )
        rows = []
        for value in attribute.values:
            row = table.shares(value, symbols, "symbol")
            if value not in table:
                message = f"the value {value} is missing"
                table.wrong("", message, f"{value} = {{ {value} = 0.9, ... }}, probabilities of what is reported")
            rows.append(np.zeros(len(symbols)) if row is None else row)
            table.get(value)
        table.end(*attribute.values)
        found[name] = Confusion(symbols, np.array(rows))
    return found


def _view(table: WorldTable) -> Floats | None:
    corners = table.matrix("view_m", 2)
    if corners is not None and len(corners) < 3:
        table.wrong(
            "view_m", "a field of view has at least three corners", "view_m = [[0.0, 0.0], [50.0, 0.0], [0.0, 50.0]]"
        )
        return None
    return corners


def _initial(
    root: WorldTable,
    attributes: Mapping[str, GaussianAttribute | CategoricalAttribute],
    types: ObjectTypes,
    thresholds: LifeThresholds,
) -> list[InitialInstance]:
    found: list[InitialInstance] = []
    names = set(_KEPT)
    for table in root.list("initial"):
        name = table.text("id", None)
        if name in names:
            why = "is kept for associations" if name in _KEPT else "is there twice"
            table.wrong("id", f"{name} {why}", 'id = "i1"')
        names.add(name)
        existence = table.number("existence", None, 0.0, 1.0)
        if existence < thresholds.delete:
            message = f"{existence:g} is below the threshold delete, {thresholds.delete:g}: it would be deleted at once"
            table.wrong("existence", message, "existence = 0.9")
        gaussian, categorical = read_beliefs(table, attributes, types)
        table.end("attributes", "type")
        found.append(InitialInstance(name, existence, gaussian, categorical))
    return found


def read_beliefs(
    table: WorldTable,
    attributes: Mapping[str, GaussianAttribute | CategoricalAttribute],
    types: ObjectTypes,
) -> tuple[dict[str, tuple[Floats, Floats]], dict[str, Floats]]:
    """The beliefs about one instance: its `type` and its `attributes`."""
    gaussian: dict[str, tuple[Floats, Floats]] = {}
    categorical: dict[str, Floats] = {}
    if (shares := table.shares("type", types.names, "type", rest=True)) is not None:
        categorical["type"] = shares
    known = table.table("attributes")
    for name in known.entries:
        attribute = attributes.get(name)
        if attribute is None or name in RESERVED:
            known.get(name)
            known.wrong(name, "there is no such attribute", "one of [attributes]")
        elif isinstance(attribute, CategoricalAttribute):
            if (shares := known.shares(name, attribute.values, f"value of {name}", rest=True)) is not None:
                categorical[name] = shares
        else:
            gaussian[name] = _gaussian_belief(known.table(name), attribute)
    return gaussian, categorical


def _gaussian_belief(table: WorldTable, attribute: GaussianAttribute) -> tuple[Floats, Floats]:
    """Mean (d,) and covariance (d, d); of rates that are not given the prior."""
    mean, covariance = attribute.prior_mean.copy(), attribute.prior_covariance.copy()
    given = table.numbers("mean")
    if given is None or len(given) not in {attribute.axes, len(mean)}:
        table.wrong(
            "mean" if "mean" in table else "", f"mean has {attribute.axes} or {len(mean)} numbers", "mean = [1.0]"
        )
        return mean, covariance
    size = len(given)
    mean[:size] = given
    sd, matrix = table.numbers("sd"), table.matrix("covariance", size)
    table.end()
    if matrix is not None:
        if len(matrix) != size or not is_covariance(matrix):
            table.wrong("covariance", f"is a symmetric, positive definite {size} x {size} matrix", "sd = 1.0")
        else:
            covariance[:size, :size] = matrix
    elif sd is None or len(sd) not in {1, size} or not are_deviations(sd):
        message = f"sd is from {LEAST_SD:g} to {MOST_SD:g}, one number or one for each of mean"
        table.wrong("sd" if "sd" in table else "", message, "sd = 1.0")
    else:
        covariance[:size, :size] = np.diag(np.broadcast_to(sd, size) ** 2)
    return mean, covariance


def is_covariance(matrix: Floats) -> bool:
    """Whether it is symmetric, positive definite and not so extreme that arithmetic would fail."""
    if not np.isfinite(matrix).all() or np.abs(matrix - matrix.T).max() > 1e-6 * np.abs(matrix).max():
        return False
    spread = np.linalg.eigvalsh(matrix)
    return bool(spread[0] >= LEAST_SD**2 and spread[-1] <= MOST_SD**2 and spread[-1] < 1e12 * spread[0])
