"""What users ask for on the page, on its way between the threads of the server and of the member."""

from collections.abc import Mapping
from concurrent.futures import Future
from typing import Any, NamedTuple, TypeAlias

Done: TypeAlias = Mapping[str, Any]


class Wish(NamedTuple):
    """What a user has asked for, and what becomes of it."""

    given: Mapping[str, Any]
    done: "Future[Done]"
