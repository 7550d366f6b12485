"""`python -m runtime.node --config FILE`: one platform process.

What it flies is a kind of vehicle of `runtime.vehicles`, or of a module that is named with `--vehicles`.
"""

import argparse
from functools import partial
from pathlib import Path

from pydantic import ValidationError

from runtime.configuration.config import NodeConfig
from runtime.process import serve
from runtime.vehicles import build_vehicle


def main() -> int:
    """Read the configuration and run."""
    parser = argparse.ArgumentParser(prog="python -m runtime.node", description=__doc__)
    parser.add_argument("--config", type=Path, required=True, help="JSON file with the configuration of the platform")
    parser.add_argument("--vehicles", action="append", default=[], help="module that registers kinds of vehicles")
    chosen = parser.parse_args()
    try:
        config = NodeConfig.model_validate_json(chosen.config.read_bytes())
    except (OSError, ValidationError) as wrong:
        parser.error(f"{chosen.config}: {wrong}")
    if config.vehicle.kind != "none":
        import filterpy.kalman  # noqa: F401  half a second: before the session opens, not while others wait for us
    return serve(config, partial(build_vehicle, modules=chosen.vehicles))


if __name__ == "__main__":
    raise SystemExit(main())
