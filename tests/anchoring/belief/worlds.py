"""Small world models for tests."""

from math import inf, log
from typing import Any

import numpy as np

from dyknow.anchoring.belief.description import (
    CategoricalAttribute,
    Confusion,
    GaussianAttribute,
    LifeThresholds,
    ObjectTypes,
    RelationKind,
    WorldModel,
    WorldSensor,
    uniform,
)
from dyknow.anchoring.belief.observations import WorldObservation

S = 1_000_000
COLOURS = ("red", "blue", "white")


def position(order: int = 1, noise: float = 0.0, side_m: float = 100.0, **about: Any) -> GaussianAttribute:
    half = np.full(2, side_m / 2.0)
    return GaussianAttribute("position_m", 2, order, noise, low=-half, high=half, rate_sd=(5.0, 2.0), **about)


def sensor(name: str = "camera", **about: Any) -> WorldSensor:
    right = 0.9 * np.eye(3) + 0.05 * (1 - np.eye(3))
    return WorldSensor(
        name,
        noise={"position_m": 0.25 * np.eye(2)},
        confusion={"colour": Confusion(COLOURS, right)},
        **about,
    )


def world(
    *sensors: WorldSensor,
    colour: CategoricalAttribute | None = None,
    place: GaussianAttribute | None = None,
    types: ObjectTypes | None = None,
    kept_per_s: float = 1.0,
    relations: tuple[RelationKind, ...] = (),
    thresholds: LifeThresholds | None = None,
    **about: Any,
) -> WorldModel:
    return WorldModel(
        types or ObjectTypes(uniform("type", ("car", "pedestrian"))),
        [place or position()],
        [colour or uniform("colour", COLOURS)],
        relations,
        {each.name: each for each in sensors or (sensor(),)},
        lifetime_s=inf if kept_per_s == 1.0 else -1.0 / log(kept_per_s),
        thresholds=thresholds or LifeThresholds(),
        **about,
    )


def seen(t_s: float, x_m: float | None = None, y_m: float = 0.0, **values: Any) -> WorldObservation:
    place = {} if x_m is None else {"position_m": np.array([x_m, y_m])}
    relations = values.pop("relations", ())
    return WorldObservation(round(t_s * S), values.pop("sensor", "camera"), {**place, **values}, None, relations)
