"""The rest of a problem while its plan is executed: hypotheses, looks and ways."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace

from dyknow.planning.contingent.sensing_problems import PossibleLook, SensingProblem, bits_of


class RemainingProblem:
    """A problem whose hypotheses are eliminated by observations; looks and ways that failed are dropped."""

    def __init__(self, problem: SensingProblem) -> None:
        self.problem = problem
        self._with_look: SensingProblem | None = None

    def problem_from(self, place: str) -> SensingProblem:
        """The problem for an observer at a place."""
        return replace(self.problem, start=place)

    def observe(self, target: str, place: str, value: str) -> None:
        """Keep the hypotheses under which a look shows this; all of them, if it shows this under none."""
        for look in self.problem.looks:
            if (look.target, look.place) == (target, place):
                mask = dict(look.outcomes).get(value, 0)
                if mask:
                    self._keep(mask)

    def drop_answers(self, answers: Collection[str]) -> None:
        """Eliminate the hypotheses of these answers."""
        self._keep(sum(1 << n for n, each in enumerate(self.problem.hypotheses) if each.answer not in answers))

    def drop_look(self, target: str, place: str) -> None:
        """Plan without a look; `take_back` has it again, if there is no plan without it."""
        self._with_look = self.problem
        kept = tuple(look for look in self.problem.looks if (look.target, look.place) != (target, place))
        self.problem = replace(self.problem, looks=kept)

    def take_back(self) -> bool:
        """Have the look again that was dropped last; whether there is one."""
        before, self._with_look = self._with_look, None
        self.problem = before or self.problem
        return before is not None

    def drop_way(self, place: str, to: str) -> None:
        """Plan without a way."""
        ways = {each: dict(others) for each, others in self.problem.ways.items()}
        ways.get(place, {}).pop(to, None)
        self.problem = replace(self.problem, ways=ways)

    def add_ways(self, ways: Mapping[str, Iterable[str]]) -> None:
        """Plan with these ways as well, each as long as one move."""
        added = {
            place: dict.fromkeys(others, 1) | dict(self.problem.ways.get(place, {})) for place, others in ways.items()
        }
        self.problem = replace(self.problem, ways={**self.problem.ways, **added})

    def _keep(self, mask: int) -> None:
        self._with_look = None
        numbers = bits_of(mask & ((1 << len(self.problem.hypotheses)) - 1))
        hypotheses = tuple(self.problem.hypotheses[number] for number in numbers)
        self.problem = replace(
            self.problem,
            hypotheses=hypotheses,
            looks=tuple(_narrowed(look, numbers) for look in self.problem.looks),
        )


def _narrowed(look: PossibleLook, numbers: list[int]) -> PossibleLook:
    outcomes = tuple(
        (value, sum(1 << at for at, number in enumerate(numbers) if mask >> number & 1))
        for value, mask in look.outcomes
    )
    return look._replace(outcomes=outcomes)
