"""The one door upward: names of `import dyknow` from the rooms above, loaded when they are first used.

No import statement leads through it, so that the rooms stay layers; `library.pyi` has the types. `dyknow.testing`
uses it, too.
"""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

_PLACES = {
    "AsyncFederationClient": "dyknow.runtime.library.async_federation",
    "FederationClient": "dyknow.runtime.library.federation",
    "Feed": "dyknow.runtime.library.feed",
    "OwnPlatform": "dyknow.runtime.library.own_platform",
    "QueryResult": "dyknow.runtime.library.results",
    "UnitSample": "dyknow.runtime.library.results",
    "connect": "dyknow.runtime.library.federation",
    "join": "dyknow.runtime.library.own_platform",
}


def loaded(name: str, places: Mapping[str, str] = _PLACES, of: str = "dyknow") -> Any:
    """Raises AttributeError for a name that does not lead through the door."""
    if name not in places:
        raise AttributeError(f"module {of!r} has no attribute {name!r}")
    return getattr(import_module(places[name]), name)
