"""Streams by call for proposals: which platform produces one, at what cost."""

from dyknow.agents.capabilities.capability import Capability, Group, PartClasses, Stage, always


def _parts() -> PartClasses:
    from dyknow.agents.capabilities.calls.bids import Bids
    from dyknow.agents.capabilities.calls.calls import Calls

    return (Bids, Calls)


CAPABILITY = Capability(
    groups=(Group(Stage.CONVERSING, always, _parts),),
)
