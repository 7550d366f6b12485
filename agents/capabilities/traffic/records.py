"""States of aircraft as values of the semantic label `traffic`, and back."""

from typing import Any, Final

from dyknow import NO_VALUE, Sample, Value
from dyknow.navigation.geodesy import metres_per_degree
from dyknow.navigation.heard_aircraft import HeardAircraft
from dyknow.navigation.traffic import TrafficState, identity_of

TRAFFIC: Final = "traffic"
"""The semantic label, and the feature of each local stream that feeds the picture."""
_MOST_AGE_S: Final = 60.0
_MOST_TEXT: Final = 40


def traffic_value(state: TrafficState) -> Value:
    """A state as a value of `traffic`."""
    return (
        state.identity, state.latitude_deg, state.longitude_deg, _or_none(state.altitude_m), _or_none(state.east_m_s),
        _or_none(state.north_m_s), _or_none(None if state.down_m_s is None else -state.down_m_s), state.radius_m,
        state.altitude_error_m, state.altitude_reference, state.source, state.kind, state.callsign,
        (state.valid_us - state.heard_us) / 1e6, False,
    )  # fmt: skip


def ended_value(identity: str) -> Value:
    """The last value of an aircraft that is no longer heard."""
    return identity, *(NO_VALUE,) * 8, "", "", "", "", NO_VALUE, True


def heard_of(sample: Sample, source: str = "") -> HeardAircraft | None:
    """The aircraft in a sample of `traffic`, at the time when it was heard; None: the sample has none.

    `source` names the producer where the sample does not.
    """
    if sample.value is NO_VALUE or not isinstance(sample.value, tuple) or len(sample.value) != 15:
        return None
    symbol, latitude, longitude, altitude, east, north, up, radius, error, *texts, age, is_end = sample.value
    latitude_deg, longitude_deg = _number(latitude), _number(longitude)
    if is_end is True or latitude_deg is None or longitude_deg is None or not isinstance(symbol, str) or not symbol:
        return None
    north_m_s, east_m_s, up_m_s, altitude_m = (_number(each) for each in (north, east, up, altitude))
    if north_m_s is None or east_m_s is None:
        north_m_s = east_m_s = None
    age_s = min(_MOST_AGE_S, max(0.0, _number(age) or 0.0))
    m_lat, m_lon = metres_per_degree(max(-90.0, min(90.0, latitude_deg)))
    reference, named, kind, callsign = (each[:_MOST_TEXT] if isinstance(each, str) else "" for each in texts)
    radius_m = _number(radius)
    return HeardAircraft(
        sample.valid_us - round(age_s * 1e6), named or source, identity_of("rid" if named == "remote-id" else named or source, symbol),
        latitude_deg - (north_m_s or 0.0) * age_s / m_lat, longitude_deg - (east_m_s or 0.0) * age_s / m_lon,
        None if altitude_m is None else altitude_m - (up_m_s or 0.0) * age_s, _number(error) or 0.0, reference,
        north_m_s, east_m_s, None if up_m_s is None else -up_m_s, None if radius_m is None else radius_m / 2.0, kind,
        callsign,
    )  # fmt: skip


def _or_none(value: float | None) -> Any:
    return NO_VALUE if value is None else value


def _number(value: Value) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None
