"""Streams by call for proposals: which platform produces one, at what cost."""

from agents.capabilities.capability import Capability, Group, PartClasses, Stage, always


def _parts() -> PartClasses:
    from agents.capabilities.calls.bids import Bids
    from agents.capabilities.calls.calls import Calls

    return (Bids, Calls)


CAPABILITY = Capability(
    groups=(Group(Stage.CONVERSING, always, _parts),),
)
