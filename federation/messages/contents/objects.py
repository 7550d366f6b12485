"""Objects that platforms see, in their streams of object states (thesis 8.5.1)."""

from typing import Annotated

from pydantic import Field

from federation.messages.contents import parts


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
