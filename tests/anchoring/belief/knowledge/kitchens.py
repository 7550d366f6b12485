"""A kitchen: cups and tables, a camera that sees colours and places, a scale that weighs sizes."""

from typing import Any

import numpy as np

from dyknow.anchoring.belief.description import (
    Confusion,
    GaussianAttribute,
    LifeThresholds,
    ObjectTypes,
    RelationKind,
    WorldModel,
    WorldSensor,
    uniform,
)
from dyknow.anchoring.belief.environment import EnvironmentModel
from dyknow.anchoring.belief.files.knowledge import read_knowledge
from dyknow.anchoring.belief.knowledge.informed import InformedModel
from dyknow.anchoring.belief.knowledge.memory import PriorKnowledge
from dyknow.anchoring.belief.observations import ReportedRelation, WorldObservation
from tests.anchoring.belief.worlds import S, position

TYPES = ("cup", "plate", "table")
COLOURS = ("red", "blue", "green")

KITCHEN = """
name = "kitchen"
[classes.vessel]
has = ["size_cm"]
[classes.cup]
is_a = "vessel"
lasting = true
attributes.size_cm = { mean = [8.0], sd = 1.0 }
[classes.plate]
is_a = "vessel"
[classes.table]
[[known]]
id = "cup-of-anna"
type = { cup = 1.0 }
attributes.colour = { red = 0.98 }
attributes.size_cm = { mean = [11.0], sd = 0.1 }
attributes.position_m = { mean = [5.0, 5.0], sd = 1.0 }
"""


def kitchen(**about: Any) -> WorldModel:
    right = 0.9 * np.eye(3) + 0.05 * (1 - np.eye(3))
    sees = {"colour": Confusion(COLOURS, right), "type": Confusion(TYPES, right)}
    camera = WorldSensor("camera", 0.5, 0.01, 0.2, 0.1, {"position_m": 0.25 * np.eye(2)}, sees)
    scale = WorldSensor("scale", 0.5, 0.01, 0.2, 0.1, {"size_cm": np.eye(1), "position_m": np.eye(2)})
    size = GaussianAttribute("size_cm", mean=np.array([20.0]), sd=np.array([20.0]), create_sd=5.0, drop_sd=15.0)
    usual = {
        "relations": (RelationKind("on"),),
        "sensors": {"camera": camera, "scale": scale},
        "thresholds": LifeThresholds(0.2, 0.8, 0.05),
        "lifetime_s": 20.0,
    }
    return WorldModel(
        ObjectTypes(uniform("type", TYPES)), [position(1, 0.01), size], [uniform("colour", COLOURS)], **{**usual, **about}
    )  # fmt: skip


def informed(*texts: str, model: WorldModel | None = None, task: str = "") -> InformedModel:
    model = model or kitchen()
    knowledge = PriorKnowledge(model.types.names, [read_knowledge(each, model, f"{n}") for n, each in enumerate(texts)])
    made = InformedModel(EnvironmentModel(model), knowledge)
    made.select(None, task)
    return made


def see(model: InformedModel, t_s: float, x_m: float, y_m: float = 0.0, sensor: str = "camera", **values: Any) -> Any:
    on = values.pop("on", None)
    relations = () if on is None else tuple(ReportedRelation("on", each) for each in on)
    seen = {"position_m": np.array([x_m, y_m]), **values}
    return model.on_look(round(t_s * S), sensor, [WorldObservation(round(t_s * S), sensor, seen, None, relations)])


def kinds(report: Any) -> list[tuple[str, str, str]]:
    return [(each.kind, each.instance, each.what) for each in report.events]
