"""Vehicles keep apart: intents, meetings, manoeuvres, and a record of each encounter."""

from agents.capabilities.capability import Capability, Group, PartClasses, Stage, always


def _parts() -> PartClasses:
    from agents.capabilities.separation.encounter_log import EncounterLog
    from agents.capabilities.separation.giving_way import GivingWay
    from agents.capabilities.separation.neighbourhood import Neighbourhood

    return (Neighbourhood, EncounterLog, GivingWay)


CAPABILITY = Capability(
    groups=(Group(Stage.REACTING, always, _parts),),
    after=("traffic",),
)
