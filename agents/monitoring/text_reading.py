"""A long text of another platform is parsed by a worker, next to the thread of the node; the short ones are read at once."""

from collections.abc import Callable
from typing import Final, Generic, TypeVar

from dyknow.model.errors import DyknowError
from dyknow.network.process import CallsApart, Outcome

LONG: Final = 500
"""Characters that take about 4 ms to parse."""
T = TypeVar("T")


class TextReading(Generic[T]):
    """One text that is parsed; `on_parsed` is called, once, when it is (federation time).

    Attributes:
        parsed: the result or the error of the worker; None: there is no worker, as in a replayed journal, and the user of the text parses it.
    """

    def __init__(
        self, text: str, parse: Callable[[str], T], on_parsed: Callable[["TextReading[T]", int], None]
    ) -> None:
        self.text, self._read, self._on_parsed = text, parse, on_parsed
        self.parsed: T | DyknowError | None = None

    def begin(self, calls: CallsApart) -> bool:
        """Whether it was given to a worker."""
        if len(self.text) <= LONG or calls.workers is None:
            return False
        calls.start(self, self._parse)
        return True

    @property
    def result(self) -> T | None:
        """The parsed text; raises the worker's error."""
        if isinstance(self.parsed, DyknowError):
            raise self.parsed
        return self.parsed

    def _parse(self) -> Outcome:
        try:
            self.parsed = self._read(self.text)
        except DyknowError as wrong:
            self.parsed = wrong
        return Outcome()

    def on_computed(self, _outcome: Outcome, _took_us: int, now_us: int) -> None:
        self._on_parsed(self, now_us)
