"""A UAV with cameras looks: images become percepts on the ground."""

from dyknow.agents.capabilities.capability import Capability, Group, PartClasses, Stage, has_cameras


def _parts() -> PartClasses:
    from dyknow.agents.capabilities.cameras.cameras import Cameras

    return (Cameras,)


CAPABILITY = Capability(
    groups=(Group(Stage.SENSING, has_cameras, _parts),),
    after=("flight",),
)
