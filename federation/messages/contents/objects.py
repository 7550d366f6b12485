"""Objects that platforms see, in their streams of object states (thesis 8.5.1)."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from dyknow.federation.messages.contents import parts


class ObjectEntry(parts.ContentPart):
    """One object: its newest state in a stream of the platform. `type` is the sort of its states, or their field `type`."""

    symbol: parts.Word
    type: parts.Word
    stream: parts.Line
    valid_us: parts.Instant
    attributes: parts.Values = Field(default_factory=dict)


class ObjectList(parts.Content):
    """The objects that are there, of one type or of all: the query is without `objects`, the answer with them."""

    type: parts.Word | None = None
    objects: Annotated[tuple[ObjectEntry, ...], Field(max_length=parts.MAX_LIST)] | None = None
    more: bool = False


class PictureEntry(parts.ContentPart):
    """One object as several platforms see it together.

    Attributes:
        by: the platforms that see it now; none: it is predicted since `seen_us`.
        tracks: `PLATFORM:SYMBOL`, what platforms call it.
        others: further names.
    """

    symbol: parts.Word
    by: parts.Units = ()
    tracks: Annotated[tuple[parts.Line, ...], Field(max_length=parts.MAX_LIST)] = ()
    others: Annotated[tuple[parts.Word, ...], Field(max_length=parts.MAX_LIST)] = ()
    seen_us: parts.Instant
    attributes: parts.Values = Field(default_factory=dict)


class ObjectPicture(parts.Content):
    """The picture that a platform has of all objects: the query is without `objects`, the answer with them.

    Attributes:
        members: the platforms that take part and are there; none: the platform has no picture, since it exports no
            `object-tracks`.
    """

    members: parts.Units | None = None
    objects: Annotated[tuple[PictureEntry, ...], Field(max_length=parts.MAX_LIST)] | None = None
    more: bool = False


class SaliencyRow(parts.ContentPart):
    """A person whom platforms have found.

    Attributes:
        by: the platforms that have.
        entries: `PLATFORM:SYMBOL`, what they call it.
        attributes: its place, times, scores and images.
    """

    symbol: parts.Word
    by: parts.Units = ()
    entries: Annotated[tuple[parts.Line, ...], Field(max_length=parts.MAX_LIST)] = ()
    attributes: parts.Values = Field(default_factory=dict)


class SaliencyRows(parts.Content):
    """The map of persons that a platform has: the query is without `rows`, the answer with them.

    Attributes:
        members: the platforms that have found persons.
        refused: entries that the platform has refused, by member and reason.
    """

    members: parts.Units | None = None
    rows: Annotated[tuple[SaliencyRow, ...], Field(max_length=parts.MAX_LIST)] | None = None
    refused: Annotated[tuple[parts.Line, ...], Field(max_length=parts.MAX_LIST)] = ()
    more: bool = False


class Share(parts.Content):
    """What to share with one platform, or with all: a level for good or `auto`, and within which bandwidth; 0 is without a limit."""

    level: Literal["auto", "none", "events", "relations", "states", "percepts"] | None = None
    unit: parts.Unit | None = None
    kbit_s: Annotated[float, Field(ge=0, le=1e9)] | None = Field(default=None, alias="kbit_s")


class ObjectEvent(parts.ContentPart):
    """An event of a link of two objects, of an object, or a chronicle recognised of objects (thesis 8.5, 8.7).

    Attributes:
        event: `established`, `reestablished`, `unlinked`, `reclassified`, `forgotten`, `recognised`; of a `wanted`
            object also `find`, `track`, `reacquire`, `lost`.
        source, target: the objects of the link; of a recognised chronicle `target` is the chronicle and its arguments.
    """

    at_us: parts.Instant
    event: parts.Word
    target: parts.Line
    source: parts.Line = ""
    because: parts.Line = ""


class ObjectEvents(parts.Content):
    """Events of one object, or all later than a time; the query is without `events`, the answer with them."""

    symbol: parts.Word | None = None
    since_us: parts.Instant | None = None
    events: Annotated[tuple[ObjectEvent, ...], Field(max_length=parts.MAX_LIST)] | None = None
    more: bool = False


class WantObject(parts.Content):
    """Look for an object: of a stream of linked objects the first for which the formula over `symbol` holds is given it.

    Attributes:
        recover: while it is open which object it is, the vehicle looks again from elsewhere, `standoff_m` from those that it may
            be, or searches for it `within_m` around; `cautious`: also where one is as described, and others may be.
    """

    head: ClassVar[str] = "want"
    lasting: ClassVar[bool] = True
    symbol: parts.Word
    type: parts.Line
    description: Annotated[str, Field(min_length=1, max_length=1000), parts.TO_PARSE]
    recover: Literal["no", "yes", "cautious"] = "no"
    within_m: Annotated[float, Field(gt=0, le=500)] = Field(default=60.0, alias="within_m")
    standoff_m: Annotated[float, Field(ge=1, le=200)] = Field(default=25.0, alias="standoff_m")
