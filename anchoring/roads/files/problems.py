"""Problems in the text of a road network: the feature, the cause and the remedy."""

from collections.abc import Callable, Iterable, Sequence
from typing import Final, NamedTuple, TypeVar

from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.model.errors import RoadsError

ERROR, WARNING = "error", "warning"
MOST_BYTES: Final = 512 * 2**20
"""The most that is read of a text."""
MOST_PROBLEMS: Final = 1000
"""The most that are listed of one severity; the others are counted."""


class RoadProblem(NamedTuple):
    """One problem.

    Attributes:
        severity: `error`: the text is not taken; `warning`: it is, and perhaps not as it is meant.
        feature: index of the feature, from 0; None: it is the text as a whole.
        id: of the feature, if it has one.
        noun: the text's word for a feature: feature, way, edge.
    """

    severity: str
    feature: int | None
    id: str | None
    message: str
    remedy: str
    noun: str = "feature"

    @property
    def drawn(self) -> str:
        """One line: the feature, what is wrong with it, what to do."""
        named = "" if self.id is None else f" ({self.id!r})"
        place = "" if self.feature is None else f"{self.noun} {self.feature}{named}: "
        return f"{place}{self.message}; {self.remedy}"


class RoadSurvey(NamedTuple):
    """A text that was read: its network, unless there are errors, and its problems in the order of the text.

    Attributes:
        left_out: how many further problems are not listed.
    """

    network: RoadNetwork | None
    problems: tuple[RoadProblem, ...]
    left_out: int = 0

    def required(self, file: str = "") -> RoadNetwork:
        """The network.

        Raises:
            RoadsError: there are errors.
        """
        if self.network is not None:
            return self.network
        errors = [each for each in self.problems if each.severity == ERROR]
        raise RoadsError(tuple(each.drawn for each in errors), file, self.left_out)


class Problems:
    """Collects problems while a text is read; its features are called `noun`."""

    def __init__(self, noun: str = "feature") -> None:
        self.noun = noun
        self._listed: list[RoadProblem] = []
        self._counts = {ERROR: 0, WARNING: 0}

    @property
    def has_errors(self) -> bool:
        return bool(self._counts[ERROR])

    def error(self, feature: int | None, name: str | None, message: str, remedy: str) -> None:
        self._add(RoadProblem(ERROR, feature, name, message, remedy, self.noun))

    def errors(self, feature: int | None, name: str | None, wrong: Iterable["FeatureError"]) -> None:
        for each in wrong:
            self.error(feature, name, each.message, each.remedy)

    def warning(self, feature: int | None, name: str | None, message: str, remedy: str) -> None:
        self._add(RoadProblem(WARNING, feature, name, message, remedy, self.noun))

    def _add(self, problem: RoadProblem) -> None:
        self._counts[problem.severity] += 1
        if self._counts[problem.severity] <= MOST_PROBLEMS:
            self._listed.append(problem)

    def survey(self, network: RoadNetwork | None) -> RoadSurvey:
        """The survey; without a network if there are errors."""
        listed: Sequence[RoadProblem] = sorted(
            self._listed, key=lambda each: -1 if each.feature is None else each.feature
        )
        left_out = sum(self._counts.values()) - len(listed)
        return RoadSurvey(None if self.has_errors else network, tuple(listed), left_out)


class FeatureError(ValueError):
    """An error of the feature that is being read."""

    def __init__(self, message: str, remedy: str) -> None:
        self.message, self.remedy = message, remedy
        super().__init__(message)


_Made = TypeVar("_Made")


class Tries:
    """Reads the parts of a feature one by one; an error in one part does not hide an error in another.

    Attributes:
        wrong: the errors until now.
    """

    def __init__(self) -> None:
        self.wrong: list[FeatureError] = []

    def __call__(self, make: Callable[..., _Made], *arguments: object) -> _Made | None:
        """The result of `make`; None if it raises FeatureError, which is kept."""
        try:
            return make(*arguments)
        except FeatureError as wrong:
            self.wrong.append(wrong)
            return None

    def add(self, message: str, remedy: str) -> None:
        self.wrong.append(FeatureError(message, remedy))
