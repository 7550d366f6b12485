"""What a row of the benchmark is: two sides measured in turn, and the bars that relate them."""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Protocol

Figures = dict[str, float]
"""What one round measured: metric -> value. Names carry units."""

Side = Callable[[], Figures]
"""Runs one round."""


@dataclass(frozen=True, slots=True)
class Ratio:
    """ours / peer, medians over the rounds."""

    metric: str
    bar: float
    ours: str = "ours"
    peer: str = "raw"
    at_least: bool = False  # of a rate more is better


@dataclass(frozen=True, slots=True)
class Above:
    """ours - peer, medians over the rounds: at most `bar`."""

    metric: str
    bar: float
    ours: str = "ours"
    peer: str = "raw"


@dataclass(frozen=True, slots=True)
class Limit:
    """A median of ours by itself: at most `bar`."""

    metric: str
    bar: float
    ours: str = "ours"


Bar = Ratio | Above | Limit


TRIAL = 0.1
"""An effort below this one is a trial, which shows that a row runs, and nothing else."""


@dataclass(frozen=True, slots=True)
class Options:
    """How much to measure: `rounds` of every side, each `effort` times as long as it has to be."""

    rounds: int = 15
    effort: float = 1.0
    sides: frozenset[str] = field(default_factory=frozenset)

    def wants(self, side: str) -> bool:
        return not self.sides or side in self.sides

    @property
    def is_trial(self) -> bool:
        return self.effort < TRIAL

    def size(self, usual: int, trial: int) -> int:
        """What no effort shortens, since the figures are about it: how many processes, vehicles or streams there are."""
        return trial if self.is_trial else usual


class Row(Protocol):
    """A module of this package named after its row."""

    TITLE: str
    BARS: tuple[Bar, ...]
    QUIET: tuple[str, ...]
    """Sides that are kept but not printed; a module need not have it."""
    COMPARED: tuple[str, ...]
    """What two trees are compared by, where the bars' own figures are slopes or counts; need not be there either."""
    EXTRA: Mapping[str, str]
    """Sides that are there only where a module is installed, and that module; need not be there either."""

    @staticmethod
    def sides(options: Options) -> AbstractContextManager[Mapping[str, Side]]:
        """Everything is started before the first round and ended after the last."""
        ...
