"""Cursor on Target events (version 2.0): XML with a type, a place, and the time until which it holds.

Names come from other members: XML escapes markup, and what XML cannot hold at all is left out. Heights are above the
ellipsoid there and above mean sea level here; without the undulation of the geoid the difference is part of the error.
"""

import math
from datetime import UTC, datetime, timedelta
from typing import Final, NamedTuple
from xml.etree.ElementTree import Element, SubElement, tostring

UNKNOWN_M: Final = 9_999_999.0
"""An error that is not known (Cursor on Target, event schema 2.0)."""
GEOID_M: Final = 107.0
"""How far mean sea level lies from the ellipsoid at most."""
UAV, UNKNOWN_AIR, UNKNOWN_GROUND, ALARM = "a-f-A-M-H-Q", "a-u-A", "a-u-G", "b-a-o"
"""Types: a friendly rotary-wing drone; an aircraft of unknown allegiance; a thing on the ground of unknown allegiance; an alarm of another kind."""
LONGEST_NAME: Final = 64
_LONGEST_REMARK: Final = 256
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


class CotPoint(NamedTuple):
    """A place: WGS-84, metres above mean sea level, and the errors of both, one standard deviation; None: not known."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float | None = None
    horizontal_sd_m: float | None = None
    vertical_sd_m: float | None = None


class CotMotion(NamedTuple):
    """Where it moves to, clockwise from north, and how fast over ground."""

    course_deg: float
    speed_m_s: float


def cot_event(
    uid: str,
    kind: str,
    callsign: str,
    point: CotPoint,
    *,
    time_us: int,
    now_us: int,
    stale_us: int,
    motion: CotMotion | None = None,
    text: str = "",
    undulation_m: float | None = None,
) -> bytes:
    """One event.

    Args:
        uid: the same for all events about one thing.
        kind: the type, such as `UAV`.
        callsign: the name that receivers show.
        point: where it is.
        time_us: when it was there.
        now_us: when the event is made.
        stale_us: from when on it does not hold.
        motion: how it moves.
        text: for readers.
        undulation_m: how far mean sea level lies above the ellipsoid there; None: not known.
    """
    event = Element("event")
    attributes = {
        "version": "2.0",
        "uid": plain(uid, 4 * LONGEST_NAME),
        "type": kind,
        "how": "m-g" if kind == UAV else "m-f",
        "time": _instant(now_us),
        "start": _instant(time_us),
        "stale": _instant(stale_us),
    }
    for name, value in attributes.items():
        event.set(name, value)
    place = SubElement(event, "point")
    for name, number in _point(point, undulation_m).items():
        place.set(name, number)
    detail = SubElement(event, "detail")
    SubElement(detail, "contact", callsign=plain(callsign, LONGEST_NAME))
    if motion is not None:
        SubElement(detail, "track", course=f"{motion.course_deg % 360:.1f}", speed=f"{motion.speed_m_s:.2f}")
    if text:
        SubElement(detail, "remarks").text = plain(text, _LONGEST_REMARK)
    data: bytes = tostring(event, encoding="utf-8", xml_declaration=True)
    return data


def plain(text: str, longest: int) -> str:
    """The first characters that are visible and that XML can hold; never empty."""
    kept = "".join(each for each in text[:longest] if each.isprintable())
    return kept.strip() or "?"


def _point(point: CotPoint, undulation_m: float | None) -> dict[str, str]:
    height_m, le_m = 0.0, UNKNOWN_M
    if point.altitude_m is not None:
        height_m = point.altitude_m + (undulation_m or 0.0)
        if point.vertical_sd_m is not None:
            le_m = point.vertical_sd_m + (GEOID_M if undulation_m is None else 0.0)
    sd_m = point.horizontal_sd_m
    return {
        "lat": f"{point.latitude_deg:.7f}",
        "lon": f"{point.longitude_deg:.7f}",
        "hae": f"{height_m:.2f}",
        "ce": f"{min(UNKNOWN_M, sd_m if sd_m is not None and math.isfinite(sd_m) else UNKNOWN_M):.1f}",
        "le": f"{min(UNKNOWN_M, le_m):.1f}",
    }


def _instant(at_us: int) -> str:
    return (_EPOCH + timedelta(microseconds=at_us)).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z"
