"""One picture of the objects that several platforms see."""

from dyknow.agents.capabilities.capability import Capability, Group, PartClasses, Stage, always
from dyknow.agents.capabilities.cooperation.requests import SHARE


def _parts() -> PartClasses:
    from dyknow.agents.capabilities.cooperation.cooperation import Cooperation
    from dyknow.agents.capabilities.cooperation.handover import Handover

    return (Cooperation, Handover)


CAPABILITY = Capability(
    groups=(Group(Stage.REACTING, always, _parts),),
    requests=(SHARE,),
)
