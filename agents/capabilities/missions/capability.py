"""A UAV pursues goals: it leads, performs, proposes and takes over missions; one without a vehicle relays them."""

from dyknow.agents.capabilities.capability import Capability, Group, PartClasses, Stage, has_no_vehicle, has_vehicle


def _with_vehicle() -> PartClasses:
    from dyknow.agents.capabilities.missions.leading import MissionLeading
    from dyknow.agents.capabilities.missions.mission_succession import MissionSuccession
    from dyknow.agents.capabilities.missions.performing import Performing
    from dyknow.agents.capabilities.missions.proposing import MissionProposals

    return (Performing, MissionLeading, MissionProposals, MissionSuccession)


def _relaying() -> PartClasses:
    from dyknow.agents.capabilities.missions.relaying import MissionRelay

    return (MissionRelay,)


CAPABILITY = Capability(
    groups=(
        Group(Stage.FLYING, has_vehicle, _with_vehicle),
        Group(Stage.FLYING, has_no_vehicle, _relaying),
    ),
    after=("flight",),
)
