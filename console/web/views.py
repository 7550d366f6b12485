"""The viewers of pages: a picture at a time, or, of a federation, a note that there is none yet."""

import threading
from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

from dyknow.console.picture.differences import Sections

SAMPLE_SIZE, OTHER_SIZE = 300, 1000
"""About how many bytes messages have, by which a platform's share is counted."""
LOOKING = "looking for platforms"


class PageView(NamedTuple):
    """A viewer's sections at a time, federation time; `run`: a number that changes when time leaps."""

    at_us: int
    sections: Sections
    run: int = 0


class Past(NamedTuple):
    """The past for a page that opens: where platforms were, and the curves of monitors."""

    trails: dict[str, list[list[float]]]
    curves: dict[str, list[list[float]]]


class Viewer(Protocol):
    """The interface from one page to its pictures."""

    def look(self) -> PageView: ...
    def past(self) -> Past: ...
    def steer(self, action: Mapping[str, Any]) -> None: ...
    def about(self) -> dict[str, Any]: ...


class ShownPicture(Protocol):
    """A picture: `dyknow.console.picture.picture`, which is imported when there is a federation to look at."""

    now_us: int

    @property
    def base(self) -> list[float] | None: ...
    def take(self, at_us: int, schema: str, message: Mapping[str, Any]) -> None: ...
    def sections(self) -> Sections: ...
    def trails(self) -> dict[str, list[list[float]]]: ...
    def curves(self) -> dict[str, list[list[float]]]: ...


class LiveFeed:
    """The picture of now; a `Sink` that the thread of the member fills, looked at from the thread of the server.

    Attributes:
        now_us: federation time.
        trouble: why nothing is shown; empty: it is.
        more: further facts for the page, known when the member is there.
    """

    def __init__(self, federation: str, picture: ShownPicture | None = None) -> None:
        self._picture, self._federation, self._lock = picture, federation, threading.Lock()
        self._moment = PageView(0, {})
        self._is_changed = picture is not None
        self.now_us = 0
        self.trouble = "" if picture is not None else LOOKING
        self.more: Mapping[str, Any] = {}

    def begin(self, picture: ShownPicture, more: Mapping[str, Any]) -> None:
        """The member is there: show its picture from now on."""
        with self._lock:
            self._picture, self.more, self._is_changed = picture, more, True

    def add(
        self, _topic: str, schema: str, message: Mapping[str, Any], at_us: int, _valid_us: int | None = None, /
    ) -> int:
        """Take a message; about how long it is."""
        with self._lock:
            if self._picture is not None:
                self._picture.take(at_us, schema, message)
                self._is_changed = True
        return SAMPLE_SIZE if schema == "dyknow.Sample" else OTHER_SIZE

    def on_time(self) -> None:
        """Nothing waits here."""

    def look(self) -> PageView:
        """The same sections until something comes."""
        with self._lock:
            picture = self._picture
            if picture is None:
                return self._moment
            if self._is_changed:
                self._is_changed = False
                self._moment = PageView(self.now_us, picture.sections())
            return self._moment._replace(at_us=max(self.now_us, picture.now_us))

    def past(self) -> Past:
        """Of the last minutes."""
        with self._lock:
            picture = self._picture
            return Past({}, {}) if picture is None else Past(picture.trails(), picture.curves())

    def steer(self, action: Mapping[str, Any]) -> None:
        """Now is now."""

    def about(self) -> dict[str, Any]:
        """The page's facts about the whole."""
        base = None if self._picture is None else self._picture.base
        return {"federation": self._federation, "live": True, "trouble": self.trouble, "origin": base, **self.more}
