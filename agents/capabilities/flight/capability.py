"""A UAV flies: estimates of its vehicle, orders to it; faults of one that is simulated."""

from dyknow.agents.capabilities.capability import Capability, Group, PartClasses, Stage, has_vehicle, is_simulated
from dyknow.agents.capabilities.flight.requests import FLIGHT


def _winch() -> PartClasses:
    from dyknow.agents.capabilities.flight.vehicle_streams import WinchStream

    return (WinchStream,)


def _flying() -> PartClasses:
    from dyknow.agents.capabilities.flight.flight import FlightAgent

    return (FlightAgent,)


def _faults() -> PartClasses:
    from dyknow.agents.capabilities.flight.flight import Faults

    return (Faults,)


CAPABILITY = Capability(
    groups=(
        Group(Stage.SENSING, has_vehicle, _winch),
        Group(Stage.FLYING, has_vehicle, _flying),
        Group(Stage.FLYING, is_simulated, _faults),
    ),
    requests=FLIGHT,
)
