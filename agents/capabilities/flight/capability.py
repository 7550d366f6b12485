"""A UAV flies: estimates of its vehicle, orders to it; faults of one that is simulated."""

from dyknow.agents.capabilities.capability import Capability, Group, PartClasses, Stage, has_vehicle, is_simulated
from dyknow.agents.capabilities.flight.requests import FLIGHT


def _vehicle() -> PartClasses:
    from dyknow.agents.capabilities.flight.flight import FlightAgent
    from dyknow.agents.capabilities.flight.vehicle_streams import WinchStream

    return (WinchStream, FlightAgent)


def _faults() -> PartClasses:
    from dyknow.agents.capabilities.flight.flight import Faults

    return (Faults,)


CAPABILITY = Capability(
    groups=(
        Group(Stage.SENSING, has_vehicle, _vehicle),
        Group(Stage.SENSING, is_simulated, _faults),
    ),
    requests=FLIGHT,
)
