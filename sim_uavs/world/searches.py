"""Searches for plans in the simulated world: done at once, as far as a number of steps leads, and heard of a little later."""

from itertools import count
from typing import Final

from dyknow.agents.effects import RunSearch, SearchOver
from dyknow.runtime.searches.search import found_record
from dyknow.runtime.searches.workers import search_over

SEARCH_US: Final = 50_000
POLLS: Final = 2_000
"""After this many looks at the limit a search gives up: that depends on nothing but the search."""


def searched(search: RunSearch, at_us: int) -> SearchOver:
    """The result of a search."""
    polls = count()

    def stop() -> str:
        return "gave up after the steps that a search may take" if next(polls) > POLLS else ""

    return search_over(at_us, search.number, found_record(search._asdict(), stop), SEARCH_US)
