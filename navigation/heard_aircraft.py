"""An aircraft that is no member, as a receiver of ADS-B or Remote ID tells of it."""

from typing import NamedTuple


class HeardAircraft(NamedTuple):
    """An aircraft by its own broadcast (ADS-B, Remote ID), or by a sensor; None, or empty: not known.

    `altitude_m` is above mean sea level within `altitude_error_m` (95 %); `altitude_reference` says what was measured: `barometric`
    (corrected for the pressure of the day), `pressure` (not corrected), `geometric` (above the ellipsoid).
    """

    valid_us: int
    source: str
    identity: str
    latitude_deg: float
    longitude_deg: float
    altitude_m: float | None = None
    altitude_error_m: float = 0.0
    altitude_reference: str = ""
    north_m_s: float | None = None
    east_m_s: float | None = None
    down_m_s: float | None = None
    horizontal_sd_m: float | None = None
    kind: str = ""
    callsign: str = ""
    on_ground: bool = False
