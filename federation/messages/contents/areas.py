"""Areas that are divided among platforms (thesis 9.2.3)."""

from itertools import chain
from typing import Annotated, ClassVar

from pydantic import AfterValidator, Field

from dyknow.federation.messages.contents import parts
from dyknow.federation.messages.descriptions import SemanticLabel
from dyknow.model.errors import Refused
from dyknow.navigation.areas import Area

MAX_CORNERS = 32
"""Of an area that is to be divided; a piece has a few more."""
ROUNDED_DEG = 1e-6
"""So far a corner of a piece may lie outside the whole area."""


def _corner(text: str) -> str:
    try:
        latitude, longitude = map(float, text.split())
    except ValueError:
        raise ValueError(f"a corner is a latitude and a longitude in degrees, 58.4 15.6, not {text[:40]!r}") from None
    if not (abs(latitude) <= 90 and abs(longitude) <= 180):
        raise ValueError(f"there is no place at {text[:40]}")
    return text


def _degrees(corner: str) -> tuple[float, float]:
    latitude, longitude = corner.split()
    return float(latitude), float(longitude)


def _border(corners: tuple[str, ...]) -> tuple[str, ...]:
    """Corners that an area can be made of later."""
    try:
        Area([*map(_degrees, corners)])
    except Refused as refused:
        raise ValueError(refused.reason) from None
    return corners


Corner = Annotated[str, Field(max_length=48), AfterValidator(_corner)]
ScanHeight = Annotated[float, Field(ge=5, le=500)]
Border = Annotated[tuple[Corner, ...], Field(min_length=3, max_length=MAX_CORNERS), AfterValidator(_border)]
"""Of an area that can be divided: a polygon that does not cross itself."""
Ring = Annotated[tuple[Corner, ...], Field(min_length=3, max_length=4 * MAX_CORNERS)]
"""Of a piece: the rest of an area after cuts, a sliver as well."""


class DivideArea(parts.Content):
    """Divide an area, by its corners in order, among the platforms that offer `sensor`, or among all.

    With `scan_m` each scans its piece with its cameras, flying at that height above its home.
    """

    lasting: ClassVar[bool] = True
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
    generation: parts.Generation
    rings: Annotated[tuple[AreaRing, ...], Field(max_length=MAX_CORNERS)] = ()
    area_m2: parts.SquareMetres = Field(default=0.0, alias="area_m2")
    share: parts.Share = 0.0
    middle: Corner = "0 0"
    units: parts.Units = ()

    def outside(self, whole: tuple[Corner, ...]) -> str | None:
        """A corner of the piece that does not lie where the whole area does, or None."""
        spans = [(min(each) - ROUNDED_DEG, max(each) + ROUNDED_DEG) for each in zip(*map(_degrees, whole), strict=True)]
        for corner in chain.from_iterable(ring.corners for ring in self.rings):
            if not all(least <= at <= most for at, (least, most) in zip(_degrees(corner), spans, strict=True)):
                return corner
        return None
