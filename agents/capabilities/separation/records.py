"""Intents as values of the semantic label `intent`, and as words of acts; and back, with everything checked."""

from math import isfinite
from typing import Final, TypeVar

from dyknow import NO_VALUE, Sample, Value
from dyknow.navigation.intents.intent import (
    MOST_LEGS,
    Contingency,
    IntendedPlace,
    Intent,
    IntentEnding,
    IntentSource,
    RightOfWay,
)

INTENT: Final = "intent"
FIELDS: Final = 16
MOST_SPEED_M_S, MOST_RADIUS_M, MOST_ALTITUDE_M, MOST_DELAY_S = 60.0, 100.0, 12_000.0, 3600.0
W = TypeVar("W", IntentSource, IntentEnding)


def intent_value(intent: Intent) -> Value:
    """An intent as a value of `intent`; its time is that of the sample."""
    return (
        intent.source.value, intent.rank.name.lower(), *intent[1:7], intent.speed_m_s, intent.climb_m_s,
        intent.descent_m_s, intent.radius_m, intent.half_height_m, legs_text(intent.legs), intent.ending.value,
        failsafe_text(intent.contingency),
    )  # fmt: skip


def intent_of(sample: Sample) -> Intent | None:
    """The intent that a sample of `intent` has; None: none, or one that no vehicle has."""
    value = sample.value
    if value is NO_VALUE or not isinstance(value, tuple) or len(value) != FIELDS:
        return None
    source, rank, *numbers, legs, ending, failsafe = value
    kind, follows = _word(IntentSource, source), _word(IntentEnding, ending)
    way = _rank(rank)
    if kind is None or follows is None or way is None or not all(map(_is_number, numbers)):
        return None
    latitude_deg, longitude_deg, altitude_m, north, east, down, speed, climb, descent, radius_m, half_m = map(
        float, numbers
    )
    fast = max(map(abs, (north, east, down, speed, climb, descent)))
    is_one = abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 180.0 and abs(altitude_m) <= MOST_ALTITUDE_M
    is_one &= fast <= MOST_SPEED_M_S and 0.0 <= radius_m <= MOST_RADIUS_M and 0.0 <= half_m <= MOST_RADIUS_M
    is_one &= min(speed, climb, descent) > 0.0
    places = legs_of(legs)
    if not is_one or places is None:
        return None
    contingency = failsafe_of(failsafe)
    if contingency is None and failsafe != "":
        return None
    return Intent(
        sample.valid_us, latitude_deg, longitude_deg, altitude_m, north, east, down, kind, way, places, follows, speed, climb,
        descent, radius_m, half_m, contingency,
    )  # fmt: skip


def failsafe_text(contingency: Contingency | None) -> str:
    """A contingency as `SECONDS ENDING LEGS`; empty: there is none."""
    return (
        ""
        if contingency is None
        else f"{contingency.after_s:.1f} {contingency.ending.value} {legs_text(contingency.legs)}"
    )


def failsafe_of(text: Value) -> Contingency | None:
    """The contingency in a text of `failsafe_text`; None: there is none, or the text is invalid."""
    words = text.split(" ", 2) if isinstance(text, str) else []
    if len(words) != 3:
        return None
    legs, ending = legs_of(words[2]), _word(IntentEnding, words[1])
    try:
        after_s = float(words[0])
    except ValueError:
        return None
    if legs is None or ending is None or not 0.0 <= after_s <= MOST_DELAY_S:
        return None
    return Contingency(after_s, legs, ending)


def legs_text(legs: tuple[IntendedPlace, ...]) -> str:
    """The legs as `latitude,longitude,altitude;...`, no more than are read."""
    return ";".join(f"{lat:.7f},{lon:.7f},{alt:.1f}" for lat, lon, alt in legs[:MOST_LEGS])


def legs_of(text: Value) -> tuple[IntendedPlace, ...] | None:
    """The legs in a text of `legs_text`; None: the text is invalid."""
    if not isinstance(text, str):
        return None
    if not text:
        return ()
    legs: list[IntendedPlace] = []
    for leg in text.split(";", MOST_LEGS):
        try:
            latitude_deg, longitude_deg, altitude_m = map(float, leg.split(",", 3))
        except ValueError:
            return None
        place = IntendedPlace(latitude_deg, longitude_deg, altitude_m)
        if not all(map(isfinite, place)) or abs(latitude_deg) > 90.0 or abs(longitude_deg) > 180.0:
            return None
        if abs(altitude_m) > MOST_ALTITUDE_M:
            return None
        legs.append(place)
    return tuple(legs) if len(legs) <= MOST_LEGS else None


def _word(kind: type[W], word: Value) -> W | None:
    return next((each for each in kind if each.value == word), None)


def _rank(word: Value) -> RightOfWay | None:
    return next((each for each in RightOfWay if each.name.lower() == word), None)


def _is_number(value: Value) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
