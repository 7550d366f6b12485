"""Vehicles keep apart: intents, meetings, manoeuvres, and a record of each encounter."""

from dyknow.agents.capabilities.capability import Capability, Group, PartClasses, Stage, always


def _parts() -> PartClasses:
    from dyknow.agents.capabilities.separation.encounter_log import EncounterLog
    from dyknow.agents.capabilities.separation.giving_way import GivingWay
    from dyknow.agents.capabilities.separation.neighbourhood import Neighbourhood

    return (Neighbourhood, EncounterLog, GivingWay)


CAPABILITY = Capability(
    groups=(Group(Stage.REACTING, always, _parts),),
    after=("traffic",),
)
