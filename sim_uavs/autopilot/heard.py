"""Messages of a vehicle's receivers about other aircraft: ADSB_VEHICLE, and those of Open Drone ID."""

from math import atan2, degrees
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from dyknow.navigation.geodesy import LocalFrame
from dyknow.sim_uavs.autopilot.link import Message
from dyknow.sim_uavs.dynamics.aircraft import PassingAircraft

_ICAO: Final = 0x4CA123
_UAS_ID: Final = tuple(b"1SIM5FLYBY".ljust(20, b"\0"))
_MAC: Final = (2, 0, 0, 0, 0, 1, *(0,) * 14)
_VALID: Final = (
    mavlink.ADSB_FLAGS_VALID_COORDS | mavlink.ADSB_FLAGS_VALID_ALTITUDE | mavlink.ADSB_FLAGS_VALID_HEADING
    | mavlink.ADSB_FLAGS_VALID_VELOCITY | mavlink.ADSB_FLAGS_VALID_CALLSIGN | mavlink.ADSB_FLAGS_VERTICAL_VELOCITY_VALID
)  # fmt: skip


def broadcasts(frame: LocalFrame, one: PassingAircraft) -> list[Message]:
    """The messages of one aircraft."""
    latitude_deg, longitude_deg, altitude_m = frame.from_ned(*one.position)
    velocity = one.velocity
    course_cdeg = round(degrees(atan2(velocity.east, velocity.north)) % 360.0 * 100.0) % 36_000
    place = round(latitude_deg * 1e7), round(longitude_deg * 1e7)
    speed_cm_s, climb_cm_s = round(velocity.horizontal * 100), round(-velocity.down * 100)
    if one.kind == "helicopter":
        return [
            mavlink.MAVLink_adsb_vehicle_message(
                _ICAO, *place, mavlink.ADSB_ALTITUDE_TYPE_PRESSURE_QNH, round(altitude_m * 1000), course_cdeg, speed_cm_s,
                climb_cm_s, b"SIMHELI", mavlink.ADSB_EMITTER_TYPE_ROTOCRAFT, 0, _VALID, 0,
            )
        ]  # fmt: skip
    return [
        mavlink.MAVLink_open_drone_id_basic_id_message(
            0, 0, _MAC, mavlink.MAV_ODID_ID_TYPE_SERIAL_NUMBER, mavlink.MAV_ODID_UA_TYPE_HELICOPTER_OR_MULTIROTOR, _UAS_ID
        ),
        mavlink.MAVLink_open_drone_id_location_message(
            0, 0, _MAC, mavlink.MAV_ODID_STATUS_AIRBORNE, course_cdeg, speed_cm_s, climb_cm_s, *place, -1000.0, altitude_m,
            mavlink.MAV_ODID_HEIGHT_REF_OVER_TAKEOFF, -1000.0, 10, 4, 0, 0, 0.0, 0,
        ),
    ]  # fmt: skip
