"""What options may say, and what the shell completes; the lists come from where the names are defined."""

from enum import StrEnum


class Role(StrEnum):
    """What a member of a roster may do."""

    uav = "uav"
    command_centre = "command-centre"
    observer = "observer"


class Persona(StrEnum):
    """Whose MAVLink dialect a simulated autopilot speaks."""

    ardupilot = "ardupilot"
    px4 = "px4"


class Select(StrEnum):
    """Which one of several platforms' values."""

    newest = "newest"
    best = "best"


class Merge(StrEnum):
    """How one value is made of several."""

    mean = "mean"
    inverse_variance = "inverse-variance"


def scenarios() -> list[str]:
    """Completes --scenario."""
    from sim_uavs.scenarios import NAMES

    return list(NAMES)


def task_names() -> list[str]:
    """Completes the task of delegate."""
    from console.wording import TASKS

    return list(TASKS)


def fault_kinds() -> list[str]:
    """Completes the kind of a fault."""
    from sim_uavs.faults import KINDS

    return list(KINDS)
