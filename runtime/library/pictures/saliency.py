"""The saliency map, as a program and as GeoJSON (RFC 7946) have it."""

from collections.abc import Iterable, Mapping
from math import sqrt
from typing import Any, NamedTuple

from dyknow.federation.messages.contents import SaliencyRow, SaliencyRows
from dyknow.runtime.client import Client, Job
from dyknow.runtime.library.jobs import lists, platforms

_NOTHING = float("nan")


class FoundPerson(NamedTuple):
    """A person whom platforms have found. Times are microseconds of federation time.

    Attributes:
        name: `PLATFORM:SYMBOL` of the entry that was there first.
        x_m, y_m: metres east and north of the federation's origin.
        latitude_deg, longitude_deg: WGS-84; None: no platform that answered knows the origin.
        covariance: (xx, xy, yy) of x_m and y_m, m^2.
        since_us, seen_us: when it was seen first, and last.
        observed_s: how long it was observed by the platform that did so longest.
        thermal, colour: scores of the two channels, from 0 to 1.
        thermal_image, colour_image: `PLATFORM/CHANNEL/TIME@U,V`, the images in which it looked most like a person.
        by: the platforms that have found it.
        entries: `PLATFORM:SYMBOL`, what they call it.
    """

    name: str
    x_m: float
    y_m: float
    latitude_deg: float | None
    longitude_deg: float | None
    covariance: tuple[float, float, float]
    since_us: int
    seen_us: int
    observed_s: float
    thermal: float
    colour: float
    thermal_image: str
    colour_image: str
    by: tuple[str, ...]
    entries: tuple[str, ...]

    @property
    def sd_m(self) -> float:
        """The standard deviation of the place, the mean of both axes."""
        return sqrt(max(0.0, self.covariance[0] + self.covariance[2]) / 2.0)

    def as_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            **self._asdict(),
            "covariance": list(self.covariance),
            "by": list(self.by),
            "entries": list(self.entries),
        }


class SaliencyPicture(NamedTuple):
    """The persons, by name; the platforms that have entries; the entries that platforms left out."""

    persons: tuple[FoundPerson, ...]
    members: tuple[str, ...]
    refused: tuple[str, ...]


def saliency_map(client: Client, unit: str | None = None) -> Job[SaliencyPicture]:
    """Ask one platform, or all: then of each person the row of the platform that knows most of it."""
    yield from platforms(client)
    found = yield from lists(client, client.pick(unit), SaliencyRows(), SaliencyRows)
    members: set[str] = set()
    refused: dict[str, None] = {}
    rows: list[FoundPerson] = []
    for by, said in found:
        members.update(said.members or ())
        refused |= dict.fromkeys(f"{each} (by {by})" for each in said.refused)
        rows += [person_of(row) for row in said.rows or ()]
    persons = sorted(_once(rows), key=lambda each: each.name)
    return SaliencyPicture(tuple(persons), tuple(sorted(members)), tuple(refused))


def _once(rows: Iterable[FoundPerson]) -> list[FoundPerson]:
    """Each person once: rows that have an entry in common are of one; the one of most entries, then the newest, is taken."""
    taken: list[FoundPerson] = []
    seen: set[str] = set()
    for row in sorted(rows, key=lambda each: (-len(each.entries), -each.seen_us, each.name)):
        if seen.isdisjoint(row.entries):
            taken.append(row)
        seen.update(row.entries)
    return taken


def person_of(row: SaliencyRow) -> FoundPerson:
    """A row of the map."""
    found: Mapping[str, Any] = row.attributes
    numbers = {name: float(value) for name, value in found.items() if isinstance(value, int | float)}

    def number(name: str) -> float:
        return numbers.get(name, _NOTHING)

    return FoundPerson(
        name=row.symbol,
        x_m=number("x_m"),
        y_m=number("y_m"),
        latitude_deg=numbers.get("latitude_deg"),
        longitude_deg=numbers.get("longitude_deg"),
        covariance=(number("xx_m2"), number("xy_m2"), number("yy_m2")),
        since_us=int(numbers.get("since_us", 0)),
        seen_us=int(numbers.get("seen_us", 0)),
        observed_s=number("observed_s"),
        thermal=number("thermal"),
        colour=number("colour"),
        thermal_image=str(found.get("thermal_image") or ""),
        colour_image=str(found.get("colour_image") or ""),
        by=row.by,
        entries=row.entries,
    )


def geojson(picture: SaliencyPicture) -> dict[str, Any]:
    """A FeatureCollection with a point for each person of known latitude and longitude; the rest are properties."""
    features = [
        {
            "type": "Feature",
            "id": each.name,
            "geometry": {"type": "Point", "coordinates": [each.longitude_deg, each.latitude_deg]},
            "properties": {
                name: value
                for name, value in (each.as_json() | {"sd_m": round(each.sd_m, 3)}).items()
                if name not in {"latitude_deg", "longitude_deg"}
            },
        }
        for each in picture.persons
        if each.latitude_deg is not None and each.longitude_deg is not None
    ]
    return {"type": "FeatureCollection", "features": features}
