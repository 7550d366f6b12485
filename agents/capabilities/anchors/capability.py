"""A UAV looks again when an anchor is ambiguous."""

from dyknow.agents.capabilities.capability import Capability, Group, PartClasses, Stage, attends


def _parts() -> PartClasses:
    from dyknow.agents.capabilities.anchors.recovering import RecoveringAnchors

    return (RecoveringAnchors,)


CAPABILITY = Capability(
    groups=(Group(Stage.FLYING, attends, _parts),),
    after=("attention",),
)
