"""Several UAVs divide an area among them, and scan it."""

from dyknow.agents.capabilities.areas.requests import DIVIDE_AREA
from dyknow.agents.capabilities.capability import Capability, Group, PartClasses, Stage, always, attends


def _division() -> PartClasses:
    from dyknow.agents.capabilities.areas.assignment import AreaAssignment
    from dyknow.agents.capabilities.areas.division import AreaDivision

    return (AreaAssignment, AreaDivision)


def _scanning() -> PartClasses:
    from dyknow.agents.capabilities.areas.scanning import Scanning

    return (Scanning,)


CAPABILITY = Capability(
    groups=(
        Group(Stage.CONVERSING, always, _division),
        Group(Stage.CONVERSING, attends, _scanning),
    ),
    requests=(DIVIDE_AREA,),
    after=("cameras", "missions"),
)
