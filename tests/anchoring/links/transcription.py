"""Section 3 of the specification of links, word by word: slow, without gates, one evaluation for each pair."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from itertools import permutations
from math import dist

from dyknow.reasoning.formulas.tree import Formula
from tests.reasoning.plain import Progression

Place = tuple[float, float]


@dataclass
class SlowPercept:
    """One state machine: linked to an object, or unlinked with its evaluations."""

    at: Place
    seen_us: int
    linked: str | None = None
    from_us: int = 0
    establish: Progression | None = None
    reestablish: dict[str, Progression] = field(default_factory=dict)
    maintain: Progression | None = None


@dataclass
class SlowObject:
    at: Place
    anchored_us: int


class Transcription:
    """One link process over percepts; objects stay where they were seen last."""

    def __init__(
        self,
        establish: Formula,
        reestablish: Formula,
        maintain: Formula,
        thresh: float,
        silence_us: int,
        forget_us: int,
    ) -> None:
        self.formulas = establish, reestablish, maintain
        self.thresh, self.silence_us, self.forget_us = thresh, silence_us, forget_us
        self.percepts: dict[str, SlowPercept] = {}
        self.objects: dict[str, SlowObject] = {}
        self.made = 0

    @property
    def links(self) -> dict[str, str]:
        return {p: each.linked for p, each in self.percepts.items() if each.linked is not None}

    def free(self) -> list[str]:
        return [o for o in self.objects if o not in self.links.values()]

    def enter_unlinked(self, p: str, from_us: int) -> None:
        each = self.percepts[p]
        each.linked, each.from_us, each.maintain = None, from_us, None
        each.establish = Progression(self.formulas[0])
        each.reestablish = {o: Progression(self.formulas[1]) for o in self.free()}

    def available(self, o: str) -> None:
        for p, each in self.percepts.items():
            if each.linked is None and p not in self.links:
                each.reestablish[o] = Progression(self.formulas[1])

    def unlink(self, p: str, from_us: int) -> None:
        o = self.percepts[p].linked
        assert o is not None
        self.percepts[p].linked = None
        self.available(o)
        self.enter_unlinked(p, from_us)

    def remove(self, p: str) -> None:
        o = self.percepts.pop(p).linked
        if o is not None:
            self.available(o)

    def values(self, p: str, o: str | None) -> dict[str, object]:
        here = self.percepts[p].at
        values: dict[str, object] = {"x[from]": here[0], "thresh": self.thresh}
        if o is not None:
            values["xy_dist[from, to]"] = dist(here, self.objects[o].at)
        return values

    def tick(self, t_us: int, samples: Mapping[str, Place], ended: Collection[str]) -> None:
        for p in list(self.percepts):
            silent_us = t_us - self.percepts[p].seen_us
            if p in ended or silent_us > self.silence_us or (silent_us == self.silence_us and p not in samples):
                self.remove(p)
        for p, at in sorted(samples.items(), key=lambda each: (len(each[0]), each)):
            if p not in self.percepts:
                self.percepts[p] = SlowPercept(at, t_us)
                self.enter_unlinked(p, t_us)
            self.percepts[p].at, self.percepts[p].seen_us = at, t_us
        order = sorted(samples, key=lambda p: (len(p), p))
        for p in order:
            self.keep(t_us, p)
        self.decide(t_us, order)
        for o in list(self.objects):
            if o in self.links.values():
                self.objects[o].anchored_us = t_us
            elif t_us - self.objects[o].anchored_us >= self.forget_us:
                del self.objects[o]
                for each in self.percepts.values():
                    each.reestablish.pop(o, None)

    def keep(self, t_us: int, p: str) -> None:
        each = self.percepts[p]
        if each.linked is None or each.maintain is None:
            return
        was = self.objects[each.linked].at
        self.objects[each.linked].at = each.at
        each.maintain.progress(t_us, self.values(p, each.linked))
        if each.maintain.verdict == "false":
            self.objects[each.linked].at = was
            self.unlink(p, t_us + 1)

    def decide(self, t_us: int, seen: list[str]) -> None:
        true: dict[str, dict[str, float]] = {}
        new = []
        for p in seen:
            each = self.percepts[p]
            if each.linked is not None or each.from_us > t_us:
                continue
            assert each.establish is not None
            if each.establish.verdict == "undecided":
                each.establish.progress(t_us, self.values(p, None))
            if each.establish.verdict == "true":
                new.append(p)
            for o, evaluation in each.reestablish.items():
                if evaluation.verdict == "undecided":
                    evaluation.progress(t_us, self.values(p, o))
                if evaluation.verdict == "true":
                    true.setdefault(p, {})[o] = dist(each.at, self.objects[o].at)
        chosen = best(true)
        for p, o in chosen.items():
            self.link(t_us, p, o)
        for p in new:
            if p not in chosen:
                self.made += 1
                o = f"wo{self.made}"
                self.objects[o] = SlowObject(self.percepts[p].at, t_us)
                self.link(t_us, p, o)

    def link(self, t_us: int, p: str, o: str) -> None:
        each = self.percepts[p]
        each.linked, each.establish, each.reestablish = o, None, {}
        for other in self.percepts.values():
            other.reestablish.pop(o, None)
        self.objects[o].at = each.at
        each.maintain = Progression(self.formulas[2])
        each.maintain.progress(t_us, self.values(p, o))
        if each.maintain.verdict == "false":
            self.unlink(p, t_us + 1)


def best(true: Mapping[str, Mapping[str, float]]) -> dict[str, str]:
    """The largest matching with the least sum, by trying all."""
    percepts = sorted(true)
    objects = sorted({o for scores in true.values() for o in scores})
    places: list[str | None] = [*objects, *([None] * len(percepts))]
    found: tuple[int, float, dict[str, str]] = (0, 0.0, {})
    for chosen in set(permutations(places, len(percepts))) if percepts else ():
        pairs = {p: o for p, o in zip(percepts, chosen, strict=True) if o is not None}
        if all(o in true[p] for p, o in pairs.items()):
            cost = (-len(pairs), sum(true[p][o] for p, o in pairs.items()), pairs)
            found = min(found, cost, key=lambda each: (*each[:2], [(len(o), o) for _, o in sorted(each[2].items())]))
    return found[2]
