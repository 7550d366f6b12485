"""Objects that are described before they are seen are anchored when, and only when, what is described comes into view."""

import random

import pytest

from anchoring.links.specification import LinkSpecification
from anchoring.links.states import NO_ATTRIBUTES, ObjectState, diagonal
from anchoring.links.structures import ObjectLinkage, Percept
from anchoring.ready import NEAR, NEW, VISION, WORLD
from kpl import parse_formula

COLOURS = ("red", "green", "blue", "white")
KINDS = ("car", "truck", "van")


def linkage() -> ObjectLinkage:
    return ObjectLinkage([LinkSpecification(VISION, WORLD, NEW, NEAR)])


def seen(t_ms: int, name: str, x_m: float, y_m: float = 0.0, **attributes: str) -> Percept:
    state = ObjectState(t_ms * 1000, x_m, y_m, 0.0, 0.0, diagonal(0.5), attributes or NO_ATTRIBUTES)
    return Percept(name, VISION, state)


@pytest.mark.parametrize("seed", range(200))
def test_among_distractors_it_is_the_one_that_is_described(seed: int) -> None:
    rng = random.Random(seed)
    wanted = {"colour": rng.choice(COLOURS), "kind": rng.choice(KINDS)}
    others = [{"colour": c, "kind": k} for c in COLOURS for k in KINDS if {"colour": c, "kind": k} != wanted]
    crowd = {f"d{n}": rng.choice(others) for n in range(6)}
    comes_ms = rng.choice([0, 500, 1500, 3000])
    found = linkage()
    asked_ms = rng.choice([0, 2000])
    for t in range(0, 4000, 200):
        if t == asked_ms:
            found.want("w", WORLD, wanted)
        percepts = [seen(t, name, 20.0 * n + rng.gauss(0, 0.5), **crowd[name]) for n, name in enumerate(sorted(crowd))]
        if t >= comes_ms:
            percepts.append(seen(t, "target", 300.0, **wanted))
        found.on_percepts(t * 1000, percepts)
        assert found.anchored("w") is (t >= max(comes_ms, asked_ms))
    (link,) = found.objects(WORLD)["w"].incoming.values()
    assert link.source.symbol == "target"
    assert len(found.objects(WORLD)) == 7, "no object has two symbols"
    assert [each for each in found.explain("w") if each.reason.cause == "wanted"]


def test_without_what_is_described_nothing_is_anchored_and_it_stays_wanted() -> None:
    found = linkage()
    found.want("w", WORLD, {"colour": "red"})
    for t in range(0, 3000, 200):
        found.on_percepts(t * 1000, [seen(t, "vp1", 0.0, colour="blue")])
    assert not found.anchored("w")
    assert found.wanted == ("w",)
    assert set(found.objects(WORLD)) == {"wo1"}


def test_a_description_may_need_time_and_a_place() -> None:
    found = linkage()
    near = ObjectState(0, 100.0, 0.0, 0.0, 0.0, diagonal(5.0))
    text = 'eventually [0, oo] always [0, 1000] (colour[from] = "red" and xy_dist[from, to] < 30)'
    found.want("w", WORLD, parse_formula(text), near)
    for t in range(0, 1200, 200):
        colour = "red" if t >= 200 else "blue"
        found.on_percepts(t * 1000, [seen(t, "far", 0.0, colour="red"), seen(t, "near", 90.0, colour=colour)])
        assert not found.anchored("w")
    found.on_percepts(1_200_000, [seen(1200, "far", 0.0, colour="red"), seen(1200, "near", 90.0, colour="red")])
    assert [link.source.symbol for link in found.objects(WORLD)["w"].incoming.values()] == ["near"]


def test_two_that_are_wanted_by_one_description_are_two_objects() -> None:
    found = linkage()
    found.want("a", WORLD, {"colour": "red"})
    found.want("b", WORLD, {"colour": "red"})
    for t in range(0, 1000, 200):
        found.on_percepts(t * 1000, [seen(t, "one", 0.0, colour="red")])
        assert found.anchored("a")
        assert not found.anchored("b")
    found.on_percepts(1_000_000, [seen(1000, "one", 0.0, colour="red"), seen(1000, "two", 50.0, colour="red")])
    assert found.anchored("b")


def test_once_found_it_is_lost_and_found_again_as_any_object() -> None:
    found = linkage()
    found.want("w", WORLD, {"colour": "red"})
    for t in range(0, 2000, 200):
        found.on_percepts(t * 1000, [seen(t, "one", 0.0, colour="red")])
    found.on_percepts(2_000_000, [Percept("one", VISION, None)])
    assert not found.anchored("w")
    events = found.on_percepts(3_000_000, [seen(3000, "two", 0.5, colour="red")]).events
    assert [(each.kind, each.target) for each in events] == [("reestablished", "w")]


def test_what_cannot_be_wanted_is_refused() -> None:
    found = linkage()
    with pytest.raises(ValueError, match="no link leads"):
        found.want("w", "car", {})
    found.want("w", WORLD, {"colour": "red"})
    with pytest.raises(ValueError, match="taken"):
        found.want("w", WORLD, {"colour": "blue"})
