"""`python -m runtime.node --config FILE`: the process of one platform, or of several whose vehicles share an endpoint.

What a platform flies is a kind of vehicle of `runtime.vehicles`, or of a module that is named with `--vehicles`.
"""

import argparse
import contextlib
import os
import sys
from functools import partial
from pathlib import Path

from pydantic import ValidationError

from runtime.configuration.config import NodeConfig
from runtime.process import serve
from runtime.vehicles import SharedPorts, build_vehicle


def main() -> int:
    """Read the configuration and run."""
    parser = argparse.ArgumentParser(prog="python -m runtime.node", description=__doc__)
    parser.add_argument(
        "--config", action="append", type=Path, required=True, help="JSON file with the configuration of a platform"
    )
    parser.add_argument("--vehicles", action="append", default=[], help="module that registers kinds of vehicles")
    parser.add_argument("--records", type=Path, help="file for what happens, bounded; without it: standard output")
    chosen = parser.parse_args()
    configs = []
    for path in chosen.config:
        try:
            configs.append(NodeConfig.model_validate_json(path.read_bytes()))
        except (OSError, ValidationError) as wrong:
            parser.error(f"{path}: {wrong}")
    return serve(configs, partial(build_vehicle, modules=chosen.vehicles, shared=SharedPorts()), chosen.records)


if __name__ == "__main__":
    code = main()
    with contextlib.suppress(OSError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code)  # threads of Zenoh may still be closing links: an interpreter that ended under them would abort
