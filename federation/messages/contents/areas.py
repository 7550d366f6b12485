"""Areas that are divided among platforms (thesis 9.2.3)."""

from typing import Annotated

from pydantic import AfterValidator, Field

from dyknow.model.errors import Refused
from federation.messages.contents import parts
from federation.messages.descriptions import Count, SemanticLabel
from navigation.areas import Area

MAX_CORNERS = 32
"""Of an area that is to be divided; a piece has a few more."""


def _corner(text: str) -> str:
    try:
        latitude, longitude = map(float, text.split())
    except ValueError:
        raise ValueError(f"a corner is a latitude and a longitude in degrees, 58.4 15.6, not {text[:40]!r}") from None
    if not (abs(latitude) <= 90 and abs(longitude) <= 180):
        raise ValueError(f"there is no place at {text[:40]}")
    return text


def _border(corners: tuple[str, ...]) -> tuple[str, ...]:
    """Corners that an area can be made of, whoever does so later."""
    try:
        Area([(float(latitude), float(longitude)) for latitude, longitude in map(str.split, corners)])
    except Refused as refused:
        raise ValueError(refused.reason) from None
    return corners


Corner = Annotated[str, Field(max_length=48), AfterValidator(_corner)]
ScanHeight = Annotated[float, Field(ge=5, le=500)]
Border = Annotated[tuple[Corner, ...], Field(min_length=3, max_length=MAX_CORNERS), AfterValidator(_border)]
"""Of an area that can be divided: a polygon that does not cross itself."""
Ring = Annotated[tuple[Corner, ...], Field(min_length=3, max_length=4 * MAX_CORNERS)]


class DivideArea(parts.Content):
    """Divide an area, by its corners in order, among the platforms that offer `sensor`, or among all.

    With `scan_m` each scans its piece with its cameras, flying at that height above its home.
    """

    area: Border
    sensor: SemanticLabel | None = None
    scan_m: ScanHeight | None = Field(default=None, alias="scan_m")


class AreaRing(parts.ContentPart):
    """One border of a piece, by its corners in order."""

    corners: Ring


class AssignArea(parts.Content):
    """The piece of the receiver in a division: its borders, none if it has no part in it (any longer).

    `generation` counts the divisions of one task; the latest holds. `units`: the platforms that have a piece. The whole area,
    its sensor, the height of scanning and whose task it is are in the evidence that the act carries.
    """

    task: parts.Conversation
    generation: Count
    rings: Annotated[tuple[AreaRing, ...], Field(max_length=MAX_CORNERS)] = ()
    area_m2: Annotated[float, Field(ge=0)] = Field(default=0.0, alias="area_m2")
    share: Annotated[float, Field(ge=0, le=1)] = 0.0
    middle: Corner = "0 0"
    units: parts.Units = ()
