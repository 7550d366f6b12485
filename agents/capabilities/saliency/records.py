"""Looks, entries and places of the saliency map as values of their semantic labels, and as an answer shows them."""

from typing import Any, Final

from dyknow import NO_VALUE, US_PER_S, Sample, Value
from dyknow.anchoring.saliency.entries import PersonEntry
from dyknow.anchoring.saliency.map import SalientPlace
from dyknow.anchoring.saliency.watching import PersonLook
from dyknow.navigation.geodesy import LocalFrame

PERCEPTS: Final = "person-percepts"
ENTRIES: Final = "saliency-entries"
MAP: Final = "saliency-map"
"""Semantic labels."""
_NOTHING: Final = float("nan")


def person_look(unit: str, sample: Sample) -> PersonLook | None:
    """The look of a sample of `person-percepts` of this platform; None: none."""
    if sample.value is NO_VALUE:
        return None
    _, x_m, y_m, xx, xy, yy, thermal, colour, *images, is_end = sample.value
    if is_end is True:
        return None
    heat, likeness = (None if each is NO_VALUE else _number(each) for each in (thermal, colour))
    hot, seen = (f"{unit}/{each}" if isinstance(each, str) else "" for each in images)
    spread = _number(xx), _number(xy), _number(yy)
    return PersonLook(sample.valid_us, _number(x_m), _number(y_m), spread, heat, likeness, hot, seen)


def entry_value(entry: PersonEntry) -> Value:
    """An entry as a value of `saliency-entries`."""
    return (
        entry.symbol, entry.x_m, entry.y_m, *entry.covariance, entry.since_us / US_PER_S, entry.seen_us / US_PER_S,
        entry.observed_s, entry.thermal, entry.colour, entry.thermal_image, entry.colour_image, False,
    )  # fmt: skip


def person_entry(unit: str, sample: Sample) -> tuple[PersonEntry, bool] | None:
    """The entry of a sample of `saliency-entries`, and whether it is withdrawn; None: it has no value."""
    if sample.value is NO_VALUE:
        return None
    symbol, x_m, y_m, xx, xy, yy, since_s, seen_s, *rest, is_end = sample.value
    observed_s, thermal, colour, *images = rest
    entry = PersonEntry(
        unit, str(symbol), _number(x_m), _number(y_m), (_number(xx), _number(xy), _number(yy)),
        _instant_us(since_s), _instant_us(seen_s), _number(observed_s), _number(thermal), _number(colour),
        *(each if isinstance(each, str) else "" for each in images),
    )  # fmt: skip
    return entry, is_end is True


def place_value(place: SalientPlace) -> Value:
    """A place as a value of `saliency-map`."""
    best = place.best
    return (
        place.name, place.x_m, place.y_m, *place.covariance, place.since_us / US_PER_S, place.seen_us / US_PER_S,
        best.observed_s, best.thermal, best.colour, best.thermal_image, best.colour_image, " ".join(place.by), False,
    )  # fmt: skip


def ended_place(name: str) -> Value:
    """The last value of a place of `saliency-map` that is another one now."""
    return name, *(NO_VALUE,) * 10, "", "", "", True


def attributes_of(place: SalientPlace, frame: LocalFrame | None) -> dict[str, Any]:
    """The attributes of a place in an answer; latitude and longitude where the platform knows the origin."""
    xx, xy, yy = place.covariance
    best = place.best
    found: dict[str, Any] = {
        "x_m": round(place.x_m, 3), "y_m": round(place.y_m, 3),
        "xx_m2": round(xx, 4), "xy_m2": round(xy, 4), "yy_m2": round(yy, 4),
        "since_us": place.since_us, "seen_us": place.seen_us, "observed_s": round(best.observed_s, 2),
        "thermal": round(best.thermal, 3), "colour": round(best.colour, 3),
        "thermal_image": best.thermal_image, "colour_image": best.colour_image,
    }  # fmt: skip
    if frame is not None:
        latitude_deg, longitude_deg, _ = frame.from_ned(place.y_m, place.x_m, 0.0)
        found |= {"latitude_deg": round(latitude_deg, 8), "longitude_deg": round(longitude_deg, 8)}
    return found


def _instant_us(seconds: Value) -> int:
    return -1 if seconds is NO_VALUE else round(seconds * US_PER_S)


def _number(value: Value) -> float:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else _NOTHING
