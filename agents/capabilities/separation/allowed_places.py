"""Where a vehicle may fly to in order to give way, within all that bounds its orders."""

from agents.capabilities.flight.pilot import Pilot
from navigation.intents.path import FlatOrigin, FlatPlace


def may_fly_to(pilot: Pilot, origin: FlatOrigin, place: FlatPlace, before: FlatPlace | None = None) -> bool:
    """Whether it may be sent to a place, straight from the one before it; None: from where it is."""
    order = pilot.stop(place.altitude_m, origin.degrees(place.north_m, place.east_m))
    if before is None or pilot.fix is None:
        return pilot.refusal(order) is None
    latitude_deg, longitude_deg = origin.degrees(before.north_m, before.east_m)
    start = pilot.fix._replace(
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        altitude_m=before.altitude_m,
        north_m_s=0.0,
        east_m_s=0.0,
    )
    return pilot.refusal(order, start=start) is None
