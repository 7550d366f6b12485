"""Cameras look at requested objects, and vehicles follow them."""

from agents.capabilities.attention.requests import ATTEND, FOLLOW, WANT
from agents.capabilities.capability import Capability, Group, PartClasses, Stage, always, attends


def _looking() -> PartClasses:
    from agents.capabilities.attention.camera_attention import CameraAttention
    from agents.capabilities.attention.following import Following

    return (CameraAttention, Following)


def _wanting() -> PartClasses:
    from agents.capabilities.attention.wanting import Wanting

    return (Wanting,)


CAPABILITY = Capability(
    groups=(
        Group(Stage.SENSING, attends, _looking),
        Group(Stage.REACTING, always, _wanting),
    ),
    requests=(FOLLOW, ATTEND, WANT),
    after=("cameras", "missions"),
)
