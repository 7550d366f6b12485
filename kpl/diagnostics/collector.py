"""Collects the errors of one text, so that all of them are reported and not the first."""

from collections.abc import Callable, Iterable
from difflib import get_close_matches
from typing import TypeVar

from dyknow.model.errors import TextError
from dyknow.reasoning.formulas.tree import Place

Made = TypeVar("Made")


class ErrorCollector:
    """The errors of one text, each with its place; readers and checkers are one, or hold one.

    Attributes:
        errors: in the order in which they were met.
        limit: how many are kept.
    """

    limit = 100

    def __init__(self, text: str) -> None:
        self.errors: list[TextError] = []
        self.text = text

    @property
    def is_full(self) -> bool:
        """Whether no more errors are kept."""
        return len(self.errors) >= self.limit

    def error(self, message: str, place: Place, repair: str = "") -> None:
        """Keep an error at its place; `repair` is what could be written instead."""
        if not self.is_full:
            self.errors.append(TextError.at(place, message, text=self.text, repair=repair))

    def attempt(self, make: Callable[[], Made], place: Place, otherwise: Made, repair: str = "") -> Made:
        """The result of `make`; if it raises TextError, its message becomes an error here, and the result `otherwise`."""
        try:
            return make()
        except TextError as error:
            self.error(error.message, place, repair)
            return otherwise


def nearest(name: str, names: Iterable[object], otherwise: str = "", cutoff: float = 0.6) -> str:
    """The known name that is most like `name`, or `otherwise` if none is like it."""
    return next(iter(get_close_matches(name, list(map(str, names)), n=1, cutoff=cutoff)), otherwise)
