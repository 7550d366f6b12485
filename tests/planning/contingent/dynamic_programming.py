"""Exact dynamic programming over e-states, apart from the product: one action at a time, every place, every set of hypotheses.

A problem is what a file of `dyknow recover` holds. The best of equal plans has fewer leaves, then fewer actions.
"""

from collections.abc import Iterator, Mapping
from fractions import Fraction
from itertools import pairwise
from random import Random
from typing import Any, TypeAlias

Worth: TypeAlias = tuple[Fraction, int, int]
Belief: TypeAlias = frozenset[int]


class Oracle:
    """Worths of the best plans; None where the goal cannot be reached."""

    def __init__(self, problem: Mapping[str, Any]) -> None:
        self.hypotheses = [
            each for each in problem["hypotheses"] if each["possibility"] > problem.get("least_possibility", 0.0)
        ]
        self.ways = problem["places"]
        self.places = sorted({problem["start"], *self.ways, *(to for others in self.ways.values() for to in others)})
        self.objects = problem["objects"]
        self.is_worst = problem["value"] == "worst"
        self.anchors = 1 if problem["kind"] == "identify" else 0
        self.memo: dict[Belief, dict[str, Worth | None]] = {}
        self.start = problem["start"]

    def best(self) -> Worth | None:
        return self.worths(frozenset(range(len(self.hypotheses))))[self.start]

    def expected(self, worth: Worth) -> Fraction:
        return worth[0] / sum(Fraction(str(each["possibility"])) for each in self.hypotheses)

    def weight(self, belief: Belief) -> Fraction:
        if self.is_worst:
            return Fraction(1)
        return sum((Fraction(str(self.hypotheses[each]["possibility"])) for each in belief), Fraction(0))

    def sees(self, number: int, place: str, target: str) -> bool:
        return place in self.hypotheses[number]["visible_from"].get(target, ())

    def worths(self, belief: Belief) -> dict[str, Worth | None]:
        """From each place, of the best plan for a set of hypotheses."""
        if belief in self.memo:
            return self.memo[belief]
        one = self.weight(belief)
        found: dict[str, Worth | None] = dict.fromkeys(self.places)
        if len({self.hypotheses[each]["answer"] for each in belief}) == 1:
            found = dict.fromkeys(self.places, (one * self.anchors, 1, self.anchors))
        else:
            for place in self.places:
                looks = [look for target in self.objects if (look := self.look(belief, place, target))]
                found[place] = min(looks, default=None)
            for _ in self.places:
                for place in self.places:
                    for to in self.ways.get(place, ()):
                        after = found[to]
                        if after is not None:
                            moved = after[0] + one, after[1], after[2] + 1
                            here = found[place]
                            found[place] = moved if here is None else min(here, moved)
        self.memo[belief] = found
        return found

    def look(self, belief: Belief, place: str, target: str) -> Worth | None:
        seen = frozenset(each for each in belief if self.sees(each, place, target))
        if not seen or seen == belief:
            return None
        worths = [self.worths(each)[place] for each in (seen, belief - seen)]
        if any(each is None for each in worths):
            return None
        costs, leaves, actions = zip(*(each for each in worths if each is not None), strict=True)
        cost = self.weight(belief) + (max(costs) if self.is_worst else sum(costs))
        return cost, sum(leaves), 1 + sum(actions)

    def is_hopeless_pair(self, one: int, other: int) -> bool:
        """The two have different answers, and no look at a place that can be reached differs."""
        reached, waiting = {self.start}, [self.start]
        while waiting:
            for to in self.ways.get(waiting.pop(), ()):
                if to not in reached:
                    reached.add(to)
                    waiting.append(to)
        if self.hypotheses[one]["answer"] == self.hypotheses[other]["answer"]:
            return False
        looks = [(place, target) for place in reached for target in self.objects]
        return all(self.sees(one, *look) == self.sees(other, *look) for look in looks)


def generated(seed: int) -> dict[str, Any]:
    """A problem of 2 to 6 places and 1 to 3 objects; some are not solvable."""
    random = Random(seed)
    kind = random.choice(["identify", "identify", "search"])
    places = [f"r{number}" for number in range(1, random.randint(2, 6) + 1)]
    objects = ["b1"] if kind == "search" else [f"po{number}" for number in range(1, random.randint(1, 3) + 1)]
    hypotheses = list(_searched(random, places) if kind == "search" else _identified(random, places, objects))
    random.shuffle(hypotheses)
    return {
        "kind": kind,
        "places": _ways(random, places),
        "start": random.choice(places),
        "objects": objects,
        "hypotheses": hypotheses[: random.randint(2, 9)],
        "value": random.choice(["worst", "expected"]),
    }


def _ways(random: Random, places: list[str]) -> dict[str, list[str]]:
    """A connected net, sometimes with ways that lead in one direction only."""
    ways: dict[str, list[str]] = {place: [] for place in places}
    net = random.choice(["all", "line", "tree", "tree"])
    pairs = [(one, other) for number, other in enumerate(places) for one in places[:number]]
    if net == "line":
        pairs = list(pairwise(places))
    elif net == "tree":
        pairs = [(random.choice(places[:number]), places[number]) for number in range(1, len(places))]
    for one, other in pairs:
        ways[one].append(other)
        if random.random() < 0.9:
            ways[other].append(one)
    return ways


def _searched(random: Random, places: list[str]) -> Iterator[dict[str, Any]]:
    for place in places:
        also = random.sample(places, random.choice([0, 0, 0, 1]))
        yield {"possibility": 1.0, "visible_from": {"b1": sorted({place, *also})}, "answer": place}
    yield {"possibility": 0.5, "visible_from": {}, "answer": "f"}


def _identified(random: Random, places: list[str], objects: list[str]) -> Iterator[dict[str, Any]]:
    for target in objects:
        for _ in range(random.randint(1, 4)):
            seen = {target: random.sample(places, random.choice([1, 1, 2]) if len(places) > 1 else 1)}
            other = random.choice(objects)
            if other != target and random.random() < 0.2:
                seen[other] = [random.choice(places)]
            yield {"possibility": random.choice([1.0, 1.0, 0.7]), "visible_from": seen, "answer": target}
    yield {"possibility": random.choice([0.5, 0.3]), "visible_from": {}, "answer": "f"}
