"""The work of missions in processes next to the node: searches for plans, and reading of texts; results are events."""

from collections.abc import Callable, Mapping
from itertools import count
from typing import Any, Final, TypeAlias

from dyknow.agents.capabilities.missions.mission_texts import MissionTexts, texts_in
from dyknow.agents.effects import Effect, EndSearch, RunSearch, SearchOver
from dyknow.federation.messages.contents import FlyMission, Reason

READ_US: Final = 10_000_000
"""A text that takes longer to read is refused."""
LONGEST: Final = 1000
OnOver: TypeAlias = Callable[[SearchOver, int], None]
OnRead: TypeAlias = Callable[[MissionTexts | Reason, int], None]


class MissionSearches:
    """The running searches.

    Args:
        emit: takes what begins and ends them.
    """

    def __init__(self, emit: Callable[[Effect], None]) -> None:
        self._emit, self._numbers = emit, count(1)
        self._running: dict[int, tuple[object, OnOver]] = {}

    def plan(
        self, owner: object, texts: tuple[str, str], units: tuple[str, ...] | None, limit_us: int, on_over: OnOver
    ) -> None:
        """Search for a plan; `on_over` takes what that comes to."""
        self._emit(RunSearch(self._begun(owner, on_over), *texts, units, limit_us))

    def look(self, owner: object, problem: Mapping[str, Any], limit_us: int, on_over: OnOver) -> None:
        """Plan how to look again."""
        self._emit(RunSearch(self._begun(owner, on_over), "", "", None, limit_us, problem))

    def read(self, owner: object, content: FlyMission, on_read: OnRead) -> None:
        """Read a delegated mission; `on_read` takes it, or its error, with the place."""

        def on_over(event: SearchOver, at_us: int) -> None:
            on_read(_read(event), at_us)

        given = content.model_dump(mode="json")
        wanted = ("domain", "problem", "constraints", "actions", "is_whole", "platforms")
        reading = {name: given[name] for name in wanted}
        self._emit(RunSearch(self._begun(owner, on_over), "", "", None, READ_US, None, reading))

    def _begun(self, owner: object, on_over: OnOver) -> int:
        number = next(self._numbers)
        self._running[number] = owner, on_over
        return number

    def owner(self, number: int) -> object:
        """Of a search that runs; None: there is none."""
        return self._running.get(number, (None, None))[0]

    def end(self, owner: object) -> None:
        """Its searches are wanted no more."""
        for number in [number for number, (one, _) in self._running.items() if one is owner]:
            del self._running[number]
            self._emit(EndSearch(number))

    def on_over(self, event: SearchOver, now_us: int) -> None:
        """A search has ended; a search without a waiting mission is passed over."""
        _, on_over = self._running.pop(event.number, (None, None))
        if on_over is not None:
            on_over(event, now_us)


def _read(event: SearchOver) -> MissionTexts | Reason:
    if event.plan is None:
        return Reason(text=f"the texts were not read: {event.reason}"[:LONGEST], code="busy")
    if "wrong" in event.plan:
        return Reason(text=event.plan["wrong"][:LONGEST], code=event.plan["code"])
    try:
        return texts_in(event.plan)
    except ValueError as wrong:
        return Reason(text=f"the texts were not read: {wrong}"[:LONGEST], code="busy")
