"""Orders to a vehicle, and faults of simulated ones."""

from typing import Annotated

from pydantic import Field

from federation.messages.contents.parts import Content, Line, Number, Period, Unit, Units, Word


class Goto(Content):
    """Fly to a point: WGS-84, metres above mean sea level."""

    latitude_deg: Annotated[float, Field(ge=-90, le=90)] = Field(alias="latitude_deg")
    longitude_deg: Annotated[float, Field(ge=-180, le=180)] = Field(alias="longitude_deg")
    altitude_m: Annotated[float, Field(ge=-1000, le=100_000)] = Field(alias="altitude_m")


class Hold(Content):
    """Stay where you are."""


class Follow(Content):
    """Fly after an object that you see, `standoff_m` away from it, at the altitude that you have."""

    object: Word
    standoff_m: Annotated[float, Field(ge=0, le=500)] = Field(default=20.0, alias="standoff_m")


class Attend(Content):
    """Turn the camera to what is to be learnt: objects that are lost, new, wanted or undecided."""


class Land(Content):
    """Land where you are."""


class ReturnHome(Content):
    """Fly home and land."""


class Resume(Content):
    """Fly on along the route."""


class Avoid(Content):
    """Propose a manoeuvre: due to `alarm`, `climber` climbs by `climb_m` and the other of `units` holds.

    `level` is what the sender does for another already: climb, hold or descend.
    With `because` the sender does not avoid the other, for that reason, and asks it to do all of it.
    """

    alarm: Line
    climber: Unit
    climb_m: Annotated[float, Field(ge=0, le=1000)] = Field(alias="climb_m")
    units: Units
    because: Line | None = None
    level: Word | None = None


class Fault(Content):
    """Make a simulated vehicle fail: `kind` e.g. `gps-loss`; `value` where the kind needs one; for `duration_s`."""

    kind: Word
    value: bool | int | Number | Line | None = None
    duration_s: Period | None = None
