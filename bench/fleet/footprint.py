"""How much memory a process takes, and the least that what it imports takes."""

import importlib
import os
import subprocess
import sys
import time
from pathlib import Path

import psutil

PLATFORM = ("zenoh", "pymavlink.dialects.v20.ardupilotmega", "numpy")


class Imports:
    """The raw peer of a platform process: its imports, and nothing done with them (see `workers`)."""

    def __init__(self, modules: list[str] | None = None) -> None:
        began = time.perf_counter()
        for module in modules or PLATFORM:
            importlib.import_module(module)
        self._import_s = time.perf_counter() - began

    def footprint(self) -> dict[str, float]:
        return {**footprint(os.getpid()), "import_s": self._import_s}


def footprint(pid: int) -> dict[str, float]:
    """Megabytes resident, and those shared with nobody."""
    found = psutil.Process(pid).memory_full_info()
    return {"rss_mb": found.rss / 1e6, "uss_mb": found.uss / 1e6}


def help_seconds() -> float:
    """How long `dyknow --help` takes, from start to end."""
    began = time.perf_counter()
    subprocess.run([str(Path(sys.executable).with_name("dyknow")), "--help"], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - began


def imported_by_help() -> set[str]:
    """The top-level packages that `dyknow --help` imports."""
    code = (
        "import sys\nfrom dyknow.console.main import main\nsys.argv = ['dyknow', '--help']\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "sys.stderr.write(' '.join({name.partition('.')[0] for name in sys.modules}))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stderr.split())
