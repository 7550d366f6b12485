"""Cameras look at requested objects, and vehicles follow them."""

from dyknow.agents.capabilities.attention.requests import ATTEND, FOLLOW, WANT
from dyknow.agents.capabilities.capability import Capability, Group, PartClasses, Stage, always, attends


def _looking() -> PartClasses:
    from dyknow.agents.capabilities.attention.camera_attention import CameraAttention

    return (CameraAttention,)


def _following() -> PartClasses:
    from dyknow.agents.capabilities.attention.following import Following

    return (Following,)


def _wanting() -> PartClasses:
    from dyknow.agents.capabilities.attention.wanting import Wanting

    return (Wanting,)


CAPABILITY = Capability(
    groups=(
        Group(Stage.SENSING, attends, _looking),
        Group(Stage.FLYING, attends, _following),
        Group(Stage.REACTING, always, _wanting),
    ),
    requests=(FOLLOW, ATTEND, WANT),
    after=("cameras", "missions"),
)
