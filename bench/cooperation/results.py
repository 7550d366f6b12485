"""Where figures are kept."""

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from bench.machine import machine

RESULTS: Final = Path(__file__).parent.parent / "results"


def keep(name: str, figures: Mapping[str, object]) -> Path:
    """Write figures next to the others, with the machine and the time."""
    path = RESULTS / f"{datetime.now(UTC):%Y%m%dT%H%M%S}-{name}.json"
    path.write_text(json.dumps({"machine": machine(), **figures}, indent=1) + "\n", encoding="utf-8")
    return path
