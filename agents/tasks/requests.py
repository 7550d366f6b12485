"""The tasks of the platform itself that can be delegated by hand, each as the `Action` of its part; the parts need not be loaded."""

from typing import Final

from dyknow.agents.actions import CHECKED, Action, Role
from dyknow.federation.messages import contents
from dyknow.federation.messages.acts import Performative

MONITOR_PROXIMITY: Final = Action(contents.MonitorProximity, "on_monitor_proximity", typed=True)
CREATE_MONITOR: Final = Action(
    contents.CreateMonitor,
    "on_create_monitor",
    typed=True,
    inner=("coordinator", "generation", "parameters", "profile", "task"),
)
REMOVE_MONITOR: Final = Action(contents.RemoveMonitor, "on_remove_monitor", typed=True)
CHECK_FORMULA: Final = Action(contents.CheckFormula, "on_check", CHECKED, typed=True)
WHEN: Final = Action(contents.When, "on_when", frozenset({Performative.REQUEST_WHEN}))
CREATE_MULTICAST: Final = Action(contents.CreateMulticast, "on_create_multicast", typed=True)
STOP_MULTICAST: Final = Action(contents.StopMulticast, "on_stop_multicast", typed=True)
MEMBERSHIP: Final = tuple(
    Action(content, handler, role=Role.COMMAND_CENTRE, typed=True)
    for content, handler in ((contents.Leave, "on_leave"), (contents.Rejoin, "on_rejoin"))
)
RESET: Final = Action(contents.Reset, "on_reset", role=Role.COMMAND_CENTRE, typed=True)
LATER: Final = frozenset({MONITOR_PROXIMITY.head, CREATE_MONITOR.head, CREATE_MULTICAST.head})
"""Requests that a platform carries out when a condition becomes true; orders to aircraft are given in person."""
DEFAULT_TASK: Final = ("proximity", "proximity-warn")
"""Profiles of `monitor-proximity` unless one is named: the violation, and the warning that starts avoidance."""
TYPED: Final = (
    MONITOR_PROXIMITY,
    CREATE_MONITOR,
    REMOVE_MONITOR,
    CHECK_FORMULA,
    CREATE_MULTICAST,
    STOP_MULTICAST,
    RESET,
    *MEMBERSHIP,
)
