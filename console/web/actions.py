"""Users' actions on the page, on their way between the threads of the server and of the member."""

from collections.abc import Mapping
from concurrent.futures import Future
from typing import Any, NamedTuple, TypeAlias

Done: TypeAlias = Mapping[str, Any]


class PageAction(NamedTuple):
    """A user's action, and its result."""

    given: Mapping[str, Any]
    done: "Future[Done]"
