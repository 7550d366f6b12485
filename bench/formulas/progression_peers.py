"""Three monitors in Python that know metric time, given the formulas of thesis 7.10 in their own languages.

All step through samples, one a period. reelay and python-monitors look back: the formulas are mirrored into the past and
answer by the horizon later, 10 states for the first, 19 for the second. rtamt does that by itself (`pastify`). None has
the `always` around: a violation is an answer that is false once the horizon has passed.
"""

from collections.abc import Callable, Mapping
from importlib.util import find_spec
from typing import Any, Final

Update = Callable[[int, float], Any]
"""(number of the state, speed) -> whether the formula held a horizon ago, or its margin."""

HORIZONS: Final = {"7.10.1": 10, "7.10.2": 19}
MODULES: Final = {"reelay": "reelay", "rtamt": "rtamt", "python-monitors": "monitors"}
"""What each of them is imported as."""
_REELAY: Final = {
    "7.10.1": "once[0:10]{speed <= 30}",
    "7.10.2": "(once[19:19]{speed <= 30}) or (once[0:10](historically[0:9]{speed <= 30}))",
}
_RTAMT: Final = {
    "7.10.1": "eventually[0:10](speed <= 30)",
    "7.10.2": "(speed <= 30) or (eventually[0:10](always[0:9](speed <= 30)))",
}
_PYTHON_MONITORS: Final = {
    "7.10.1": "once[0,10](p)",
    "7.10.2": "(once[19,19](p)) or (once[0,10](always[0,9](p)))",
}


def reelay(section: str) -> tuple[Callable[[Mapping[str, float]], Any], Callable[[Any], Any]]:
    """Its own `update`, which takes a state, and how to read what that returns; changes only, which is its fastest."""
    from reelay import discrete_timed_monitor

    monitor = discrete_timed_monitor(pattern=_REELAY[section], condense=True)
    last = True

    def read(said: Any) -> bool:
        nonlocal last
        last = said.get("value", last) if said else last
        return last

    return monitor.update, read


def rtamt(section: str) -> Update:
    from rtamt import StlDiscreteTimeSpecification

    monitor = StlDiscreteTimeSpecification()
    monitor.declare_var("speed", "float")
    monitor.declare_var("out", "float")
    monitor.spec = f"out = {_RTAMT[section]}"
    monitor.parse()
    monitor.pastify()
    update = monitor.update
    return lambda number, speed: update(number, [("speed", speed)])


def python_monitors(section: str) -> Update:
    from monitors import mtl

    update = mtl.monitor(_PYTHON_MONITORS[section]).update
    return lambda _number, speed: update(p=speed <= 30)


def present() -> tuple[str, ...]:
    """Those that are installed."""
    return tuple(name for name, module in MODULES.items() if find_spec(module) is not None)
