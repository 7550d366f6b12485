"""Link processes against a transcription of their definition, over random events."""

import os
import random

import pytest

from dyknow.anchoring.links.objects import LinkObject
from dyknow.anchoring.links.prediction import ObjectPrediction, certain
from dyknow.anchoring.links.specification import LinkSpecification, Threshold
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import ObjectLinkage, Percept
from dyknow.kpl import parse_formula
from dyknow.reasoning.formulas.tree import Formula
from tests.anchoring.links.transcription import Place, Transcription

EVENTS = 100_000 if os.environ.get("DYKNOW_FULL") else 10_000
PERIOD_US = 100_000
SILENCE_US = 300_000
FORGET_US = 2_000_000
CONDITIONS = {
    "reference": ("eventually [1000, oo] true", "eventually [0, 1000] xy_dist[from, to] < thresh", "true"),
    "always": (
        "always [0, 300] x[from] >= 0",
        "eventually [200, 900] always [0, 200] xy_dist[from, to] < 6",
        "always x[from] < 14",
    ),
    "either": (
        "eventually [0, 400] x[from] > 8",
        "(eventually [0, 500] xy_dist[from, to] < 3) or eventually [300, 1200] (xy_dist[from, to] <= 8 and x[from] < 9)",
        "always eventually [0, 400] x[from] < 12",
    ),
    "ungated": ("eventually [600, oo] true", "eventually [300, 800] x[from] > 5", "eventually [0, 900] x[from] > 4"),
    "at once": ("x[from] > 3", "xy_dist[from, to] < 4", "always (x[from] > 2 or eventually [0, 300] x[from] > 6)"),
}


class Still:
    """Predicts that nothing moves."""

    def predict(self, history, to_us: int, before=None, individual=None) -> ObjectPrediction:
        return certain(history[-1]._replace(valid_us=to_us))


def state(t_us: int, at: Place) -> ObjectState:
    return ObjectState(t_us, *at, 0.0, 0.0, diagonal(1.0, 1.0))


def formulas(name: str) -> tuple[Formula, Formula, Formula]:
    establish, reestablish, maintain = (parse_formula(text) for text in CONDITIONS[name])
    return establish, reestablish, maintain


def linkage(name: str) -> ObjectLinkage:
    specification = LinkSpecification(
        "percept", "world", *formulas(name), unit=lambda one, _before: one, predictor=Still(), forget_us=FORGET_US,
        threshold=Threshold(1.0, 5.0, 5.0),
    )  # fmt: skip
    return ObjectLinkage([specification], period_us=PERIOD_US, silence_us=SILENCE_US)


class Crowd:
    """Percepts that come, wander, pause and end."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.at: dict[str, Place] = {}
        self.made = 0

    def tick(self) -> tuple[dict[str, Place], set[str]]:
        rng = self.rng
        samples, ended = {}, set()
        for p, (x, y) in list(self.at.items()):
            fate = rng.random()
            if fate < 0.05:
                ended.add(p)
                del self.at[p]
            elif fate < 0.08:
                del self.at[p]
            elif fate < 0.85:
                samples[p] = self.at[p] = (x + rng.gauss(0, 0.7), y + rng.gauss(0, 0.7))
        if len(self.at) < 4 and rng.random() < 0.5:
            self.made += 1
            p = f"p{self.made}"
            samples[p] = self.at[p] = (rng.uniform(0, 15), rng.uniform(0, 8))
        return samples, ended


def links(found: ObjectLinkage) -> dict[str, str]:
    return {
        p: next(iter(each.outgoing.values())).target.symbol
        for p, each in found.objects("percept").items()
        if each.outgoing
    }


def check_invariants(found: ObjectLinkage) -> None:
    objects: list[LinkObject] = [*found.objects("percept").values(), *found.objects("world").values()]
    for one in objects:
        for links_, end in ((one.outgoing, "source"), (one.incoming, "target")):
            assert len(links_) <= 1
            for link in links_.values():
                assert getattr(link, end) is one
                assert link.source in objects, "links are between live objects"
                assert link.target in objects
                assert link.target.incoming[link.process.name] is link.source.outgoing[link.process.name]


@pytest.mark.parametrize("name", CONDITIONS)
def test_over_random_events_links_are_those_of_the_definition_and_keep_its_invariants(name: str) -> None:
    ours, slow = linkage(name), Transcription(*formulas(name), 5.0, SILENCE_US, FORGET_US)
    crowd = Crowd(len(name))
    events = t_us = 0
    kinds = set()
    while events < EVENTS / len(CONDITIONS):
        t_us += PERIOD_US
        samples, ended = crowd.tick()
        percepts = [Percept(p, "percept", state(t_us, at)) for p, at in samples.items()]
        percepts += [Percept(p, "percept", None) for p in ended]
        crowd.rng.shuffle(percepts)
        outcome = ours.on_percepts(t_us, percepts)
        slow.tick(t_us, samples, ended)
        assert links(ours) == slow.links, t_us
        assert set(ours.objects("world")) == set(slow.objects)
        check_invariants(ours)
        events += len(percepts)
        kinds |= {event.kind for event in outcome.events}
    assert kinds == {"established", "reestablished", "unlinked", "forgotten"}
