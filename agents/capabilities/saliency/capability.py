"""A map of persons that several platforms find."""

from dyknow.agents.capabilities.capability import Capability, Group, PartClasses, Stage, always


def _parts() -> PartClasses:
    from dyknow.agents.capabilities.saliency.saliency import Saliency

    return (Saliency,)


CAPABILITY = Capability(
    groups=(Group(Stage.REACTING, always, _parts),),
    after=("cooperation",),
)
