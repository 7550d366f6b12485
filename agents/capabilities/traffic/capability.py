"""Aircraft that are no members."""

from dyknow.agents.capabilities.capability import Capability, Group, PartClasses, Stage, always


def _parts() -> PartClasses:
    from dyknow.agents.capabilities.traffic.traffic import Traffic

    return (Traffic,)


CAPABILITY = Capability(
    groups=(Group(Stage.SENSING, always, _parts),),
    after=("flight",),
)
