"""How it is said of a value that it was predicted."""

from collections.abc import Mapping
from typing import Any

from dyknow.model.instants import print_span
from dyknow.model.sample import Predicted


def prediction_json(prediction: Predicted | None) -> dict[str, Any]:
    """When a predicted value was made, and its branch and weight if there are several; nothing of a measured one."""
    if prediction is None:
        return {}
    branch = {"branch": prediction.branch, "weight": prediction.weight} if prediction.branch else {}
    return {"made_us": prediction.made_us, **branch}


def prediction_text(record: Mapping[str, Any]) -> str:
    """How far ahead a sample was predicted, and in which branch; nothing of a measured one."""
    if "made_us" not in record:
        return ""
    branch = f", {record['branch']} {record['weight']:.0%}" if "branch" in record else ""
    return f"  predicted {print_span(record['valid_us'] - record['made_us'])} ahead{branch}"
