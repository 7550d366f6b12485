"""A long formula of another platform is parsed by a worker, next to the thread of the node; the short ones are read at once."""

from collections.abc import Callable
from typing import Final

from dyknow.model.errors import TextError
from dyknow.network.process import CallsApart, Outcome
from kpl import parse_formula
from reasoning import Formula

LONG: Final = 500
"""Characters that take about 4 ms to parse."""


class FormulaReading:
    """One formula that is parsed; `on_parsed` is called, once, when it is (federation time).

    Attributes:
        parsed: what it is; None: it is parsed where it is used, as when a journal is replayed.
    """

    def __init__(self, text: str, on_parsed: Callable[["FormulaReading", int], None]) -> None:
        self.text, self._on_parsed = text, on_parsed
        self.parsed: Formula | TextError | None = None

    def begin(self, calls: CallsApart) -> bool:
        """Whether it was given to a worker."""
        if len(self.text) <= LONG or calls.workers is None:
            return False
        calls.start(self, self._parse)
        return True

    @property
    def formula(self) -> Formula | None:
        """What the worker made of it; raises the TextError that it met."""
        if isinstance(self.parsed, TextError):
            raise self.parsed
        return self.parsed

    def _parse(self) -> Outcome:
        try:
            self.parsed = parse_formula(self.text)
        except TextError as wrong:
            self.parsed = wrong
        return Outcome()

    def on_computed(self, _outcome: Outcome, _took_us: int, now_us: int) -> None:
        self._on_parsed(self, now_us)
