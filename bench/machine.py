"""What the figures were taken on."""

import platform
import sys
from importlib.metadata import version
from pathlib import Path

import psutil

_PACKAGES = ("eclipse-zenoh", "msgpack", "numpy", "pymavlink", "filterpy", "mcap", "pydantic")


def machine() -> dict[str, object]:
    """Processor, cores, memory, system, versions, and how busy the machine was when asked."""
    return {
        "processor": _processor(),
        "cores": psutil.cpu_count(),
        "memory_gb": round(psutil.virtual_memory().total / 1e9, 1),
        "system": platform.platform(),
        "python": sys.version.split()[0],
        "packages": {name: version(name) for name in _PACKAGES},
        "load_average": list(psutil.getloadavg()),
    }


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text(encoding="utf-8").splitlines() if cpuinfo.exists() else []
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())
