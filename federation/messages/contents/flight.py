"""Orders to a vehicle, and faults of simulated ones."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from dyknow.federation.messages.contents.areas import Corner
from dyknow.federation.messages.contents.parts import (
    AltitudeM,
    Content,
    ContentPart,
    Integer,
    LatitudeDeg,
    Line,
    LongitudeDeg,
    Metres,
    Number,
    Timeout,
    Units,
    Word,
)

MOST_PLACES, MOST_FENCES = 64, 16
_Places = Annotated[tuple[Corner, ...], Field(max_length=MOST_PLACES)]


class Goto(Content):
    """Fly to a point: WGS-84, metres above mean sea level; with `until` it is done when the vehicle is there."""

    latitude_deg: LatitudeDeg = Field(alias="latitude_deg")
    longitude_deg: LongitudeDeg = Field(alias="longitude_deg")
    altitude_m: AltitudeM = Field(alias="altitude_m")
    until: Literal["arrival"] | None = None


class Hold(Content):
    """Stay where you are."""


class Follow(Content):
    """Fly after an object that you see, `standoff_m` away from it, at the altitude that you have."""

    lasting: ClassVar[bool] = True
    object: Word
    standoff_m: Annotated[float, Field(ge=0, le=500)] = Field(default=20.0, alias="standoff_m")


class Attend(Content):
    """Turn the camera to the objects with the greatest need: lost, new, wanted or undecided ones."""

    lasting: ClassVar[bool] = True


class Land(Content):
    """Land where you are."""


class ReturnHome(Content):
    """Fly home and land."""


class Resume(Content):
    """Fly on along the route."""


class Avoid(Content):
    """Propose a manoeuvre to another vehicle that one meets; `units` are the two.

    `legs` is where the sender flies to keep apart, as the label `intent` writes it, `speed_m_s` how fast, if it is slower than usual.
    With `because` the sender does not avoid the other, for that reason, flies on along the legs, and asks it to do all of it.
    """

    units: Units
    legs: Line = ""
    because: Line | None = None
    speed_m_s: Annotated[float, Field(gt=0, le=60)] | None = Field(default=None, alias="speed_m_s")


class Fault(Content):
    """Make a simulated vehicle fail: `kind` e.g. `gps-loss`; `value` where the kind needs one; for `duration_s`."""

    kind: Word
    value: bool | Integer | Number | Line | None = None
    duration_s: Timeout | None = None


class Fence(ContentPart):
    """An area that a vehicle does not leave, or enter if excluded: around a place, or within corners; above its home."""

    name: Line
    centre: Corner | None = None
    radius_m: Metres | None = Field(default=None, alias="radius_m")
    lowest_m: Metres | None = Field(default=None, alias="lowest_m")
    highest_m: Metres | None = Field(default=None, alias="highest_m")
    corners: _Places = ()


class FlightOutlook(Content):
    """Where will your vehicle fly, on whose behalf, and within what? The query is empty, the answer is not.

    Attributes:
        commander: who has the vehicle, as `dyknow.agents.capabilities.flight.arbiter` names it.
        doing: its flight, in words.
        ahead: the places that it flies to next, in their order; `again`: over and over.
        altitude_m: of the first of them, above mean sea level.
        origin: the origin of metres in the streams of its objects.
    """

    commander: Word | None = None
    doing: Line = ""
    ahead: _Places = ()
    again: bool = False
    altitude_m: Metres | None = Field(default=None, alias="altitude_m")
    fences: Annotated[tuple[Fence, ...], Field(max_length=MOST_FENCES)] = ()
    origin: Corner | None = None
