"""Problems of looking: hypotheses about one world that stands still, places, and the outcome of each look.

An e-state of such a problem is where the observer is, and which hypotheses remain: moving changes the one, looking the other.
Hypotheses that no look tells apart are merged; if their answers differ, no plan can exist.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from heapq import heappop, heappush
from math import lcm
from typing import Final, Literal, NamedTuple, TypeAlias

MOST_HYPOTHESES: Final = 4096
Distance: TypeAlias = tuple[int, int]
"""Cost and number of moves."""
RecoveryTask: TypeAlias = Literal["identify", "search"]


class RecoveryHypothesis(NamedTuple):
    """One way the world may be.

    Attributes:
        possibility: above 0; the greatest of all hypotheses is 1.
        answer: which object, or in a search which place, it is; `f` for none.
        visible_from: for each object the places from which a look at it shows what is wanted.
    """

    possibility: float
    answer: str
    visible_from: Mapping[str, frozenset[str]]


class PossibleLook(NamedTuple):
    """A look from a place at an object, with its outcomes: for each value the hypotheses that show it, a bit each."""

    place: str
    target: str
    feature: str
    outcomes: tuple[tuple[str, int], ...]


class ActionCosts(NamedTuple):
    """Whole numbers above 0; each way has a length by which that of a move is multiplied."""

    move: int = 1
    look: int = 1
    anchor: int = 1


class LookErrors(NamedTuple):
    """Looks that may err.

    Attributes:
        unseen: how probable it is that what is visible is not seen.
        false: how probable it is that something is seen though nothing is visible.
        sure: how probable an answer has to be.
        looks: of one branch at most.
    """

    unseen: float
    false: float
    sure: float = 0.95
    looks: int = 6


@dataclass(frozen=True, slots=True)
class SensingProblem:
    """The hypotheses to decide between, and the means to do so.

    Attributes:
        task: `identify` ends by an action that anchors the symbol, `search` as soon as the place is known.
        ways: for each place the places to which one can move from it, with a length, a whole number above 0.
        symbol: of the wanted object.
    """

    task: RecoveryTask
    ways: Mapping[str, Mapping[str, int]]
    start: str
    hypotheses: tuple[RecoveryHypothesis, ...]
    looks: tuple[PossibleLook, ...]
    symbol: str = "b1"
    costs: ActionCosts = ActionCosts()  # noqa: RUF009 (a NamedTuple cannot change)


def visibility_looks(hypotheses: Sequence[RecoveryHypothesis], feature: str) -> tuple[PossibleLook, ...]:
    """The looks that could show something: `t` at an object from a place from which that is visible, else `f`."""
    masks: dict[tuple[str, str], int] = {}
    for number, hypothesis in enumerate(hypotheses):
        for target, places in hypothesis.visible_from.items():
            for place in places:
                masks[place, target] = masks.get((place, target), 0) | 1 << number
    every = (1 << len(hypotheses)) - 1
    return tuple(
        PossibleLook(place, target, feature, (("t", mask), ("f", every & ~mask)))
        for (place, target), mask in sorted(masks.items())
    )


def sensing_problem(
    task: RecoveryTask,
    ways: Mapping[str, Iterable[str]],
    start: str,
    hypotheses: Sequence[RecoveryHypothesis],
    symbol: str = "b1",
) -> SensingProblem:
    """A problem in which each move, look and anchor costs 1."""
    lengths = {place: dict.fromkeys(sorted(set(others) - {place}), 1) for place, others in ways.items()}
    looks = visibility_looks(hypotheses, "mark" if task == "identify" else "visible")
    return SensingProblem(task, lengths, start, tuple(hypotheses), looks, symbol)


class MergedHypotheses(NamedTuple):
    """Hypotheses that no look tells apart, and that have one answer.

    Attributes:
        weight: the sum of their possibilities, as a whole number; all weights have one unit.
    """

    answer: str
    possibility: float
    weight: int


class MacroLook(NamedTuple):
    """A look that can be reached: its outcomes over merged hypotheses."""

    look: PossibleLook
    masks: tuple[int, ...]


class CompiledSensing:
    """A problem with its distances computed and its hypotheses merged.

    Attributes:
        classes, heads: merged hypotheses, and the number of the first of each.
        looks: the informative looks, by place.
        conflicts: sets of hypotheses, by number, that no look tells apart though their answers differ.
        unreachable: places of looks to which no way leads from the start.
    """

    def __init__(self, problem: SensingProblem, least_possibility: float = 0.0) -> None:
        self.problem = problem
        self._distances: dict[str, Mapping[str, Distance]] = {}
        self._distances_to: dict[str, Mapping[str, Distance]] = {}
        self._back: dict[str, dict[str, int]] = {}
        for place, others in problem.ways.items():
            for other, length in others.items():
                self._back.setdefault(other, {})[place] = length
        lengths = {length for others in problem.ways.values() for length in others.values()}
        self._length = lengths.pop() if len(lengths) == 1 else None
        reachable = self.distances(problem.start)
        self.unreachable = sorted({look.place for look in problem.looks} - set(reachable))
        looks = [look for look in problem.looks if look.place in reachable]
        counted = 0
        for number, each in enumerate(problem.hypotheses):
            if each.possibility > least_possibility:
                counted |= 1 << number
        self.counted = counted
        blocks = _blocks(counted, looks)
        self.conflicts = [block for block in blocks if len({problem.hypotheses[n].answer for n in _bits(block)}) > 1]
        self._merge([part for block in blocks for part in self._by_answer(block)], looks)

    def _by_answer(self, block: int) -> list[int]:
        """A set of hypotheses in parts that have one answer each."""
        parts: dict[str, int] = {}
        for number in _bits(block):
            answer = self.problem.hypotheses[number].answer
            parts[answer] = parts.get(answer, 0) | 1 << number
        return list(parts.values())

    def _merge(self, blocks: Sequence[int], looks: Sequence[PossibleLook]) -> None:
        exact = [Fraction(str(each.possibility)) for each in self.problem.hypotheses]
        unit = lcm(*(each.denominator for each in exact))
        self.classes: list[MergedHypotheses] = []
        for block in blocks:
            members = [self.problem.hypotheses[number] for number in _bits(block)]
            weight = sum(int(exact[number] * unit) for number in _bits(block))
            self.classes.append(MergedHypotheses(members[0].answer, max(each.possibility for each in members), weight))
        self.heads = [(block & -block).bit_length() - 1 for block in blocks]
        numbers = {head: number for number, head in enumerate(self.heads)}
        heads = sum(1 << head for head in self.heads)
        self.looks: dict[str, list[MacroLook]] = {}
        known: set[tuple[str, tuple[int, ...]]] = set()
        for look in looks:
            masks = [sum(1 << numbers[head] for head in _bits(mask & heads)) for _, mask in look.outcomes[:-1]]
            masks.append((1 << len(blocks)) - 1 - sum(masks))
            parts = tuple(sorted(filter(None, masks)))
            if len(parts) > 1 and (look.place, parts) not in known:
                known.add((look.place, parts))
                self.looks.setdefault(look.place, []).append(MacroLook(look, tuple(masks)))

    def distances(self, place: str) -> Mapping[str, Distance]:
        """To every place that can be reached from this one; computed once."""
        if place not in self._distances:
            self._distances[place] = _distances(self.problem.ways, place, self.problem.costs.move, self._length)
        return self._distances[place]

    def first_moves(self, place: str, target: str) -> list[str]:
        """The places to which a shortest way from a place to another one begins by moving."""
        if target not in self._distances_to:
            self._distances_to[target] = _distances(self._back, target, self.problem.costs.move, self._length)
        far, move = self._distances_to[target], self.problem.costs.move
        return [
            nearer
            for nearer, length in sorted(self.problem.ways.get(place, {}).items())
            if nearer in far and (far[nearer][0] + length * move, far[nearer][1] + 1) == far[place]
        ]


def bits_of(mask: int) -> list[int]:
    """The numbers of the bits that are set."""
    return list(_bits(mask))


def _bits(mask: int) -> Iterator[int]:
    while mask:
        low = mask & -mask
        yield low.bit_length() - 1
        mask ^= low


def _blocks(every: int, looks: Iterable[PossibleLook]) -> list[int]:
    """The hypotheses in sets that no look splits, ordered by their first."""
    blocks, single = [every] if every & (every - 1) else [], [] if every & (every - 1) else [every]
    for look in looks:
        split = list[int]()
        for block in blocks:
            for _, mask in look.outcomes:
                if part := block & mask:
                    (split if part & (part - 1) else single).append(part)
        blocks = split
        if not blocks:
            break
    return sorted((each for each in (*blocks, *single) if each), key=lambda block: block & -block)


def _distances(ways: Mapping[str, Mapping[str, int]], start: str, move: int, every: int | None) -> dict[str, Distance]:
    """Of the cheapest way to each place that can be reached, of those the one with fewest moves.

    `every` is the length of every way, where all have one.
    """
    if every is not None:
        return _layers(ways, start, move * every)
    found: dict[str, Distance] = {}
    waiting = [((0, 0), start)]
    while waiting:
        reached, place = heappop(waiting)
        if place in found:
            continue
        found[place] = reached
        for other, length in ways.get(place, {}).items():
            if other not in found:
                heappush(waiting, ((reached[0] + length * move, reached[1] + 1), other))
    return found


def _layers(ways: Mapping[str, Mapping[str, int]], start: str, cost: int) -> dict[str, Distance]:
    """The same where every move costs as much."""
    found, layer, number = {start: (0, 0)}, [start], 0
    while layer:
        number += 1
        after = list[str]()
        for place in layer:
            for other in ways.get(place, ()):
                if other not in found:
                    found[other] = number * cost, number
                    after.append(other)
        layer = after
    return found
