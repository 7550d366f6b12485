"""The road networks that specifications name, each read once."""

from functools import lru_cache
from hashlib import sha256
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dyknow.anchoring.roads.network import RoadNetwork


@lru_cache(maxsize=4)
def roads_of(text: str, file: str) -> "RoadNetwork":
    """The road network of a text; raises RoadsError."""
    from dyknow.anchoring.roads.files.formats import survey_any

    return survey_any(text).required(file)


def digest_of(text: str) -> str:
    """A key that distinguishes a text from others."""
    return sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
