"""The rows of a picture, one for each object, and the events of objects and members."""

from typing import Literal, NamedTuple, TypeAlias

from dyknow.anchoring.cooperation.reports import TrackKey
from dyknow.anchoring.links.states import ObjectState

PictureEventKind: TypeAlias = Literal[
    "appeared",
    "joined",
    "split",
    "doubted",
    "renamed",
    "lost",
    "reacquired",
    "forgotten",
    "refused",
    "arrived",
    "departed",
    "recognised",
]


class PictureEvent(NamedTuple):
    """An event, with its reason.

    Attributes:
        name: the object, or the member.
        because: in words.
        by: the member that reports it, if all have seen it: the first whose track it is about; none: each for itself.
    """

    valid_us: int
    kind: PictureEventKind
    name: str
    because: str
    by: str = ""


class PictureRow(NamedTuple):
    """One object.

    Attributes:
        state: at the time of the row, predicted since it was seen.
        seen_us: when it was seen last.
        by: the members that see it now, sorted; none: it is kept and predicted.
        tracks: the members' symbols for it, of live and dormant tracks.
        others: further names that it had, or that are claimed.
    """

    name: str
    state: ObjectState
    seen_us: int
    by: tuple[str, ...]
    tracks: tuple[TrackKey, ...]
    others: tuple[str, ...] = ()
