"""Objects that are described before they are seen are anchored when, and only when, what is described comes into view."""

import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import NO_VALUE
from dyknow.anchoring.links.deciding.wanted import WantedObject
from dyknow.anchoring.links.objects import LinkObject
from dyknow.anchoring.links.specification import LinkSpecification, unlikelihood
from dyknow.anchoring.links.states import NO_ATTRIBUTES, ObjectState, diagonal
from dyknow.anchoring.links.structures import ObjectLinkage, Percept
from dyknow.anchoring.ready import NEAR, NEW, VISION, WORLD
from dyknow.kpl import parse_formula
from dyknow.reasoning import make_progression
from dyknow.reasoning.formulas.tree import Eventually
from tests.anchoring.links import invariants

COLOURS = ("red", "green", "blue", "white")
KINDS = ("car", "truck", "van")
SEEDS = [pytest.param(seed, marks=() if seed % 10 == 0 else pytest.mark.full) for seed in range(200)]


def linkage() -> ObjectLinkage:
    return ObjectLinkage([LinkSpecification(VISION, WORLD, NEW, NEAR)])


def seen(t_ms: int, name: str, x_m: float, y_m: float = 0.0, **attributes: str) -> Percept:
    state = ObjectState(t_ms * 1000, x_m, y_m, 0.0, 0.0, diagonal(0.5), attributes or NO_ATTRIBUTES)
    return Percept(name, VISION, state)


@pytest.mark.parametrize("seed", SEEDS)
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


def kinds(found: ObjectLinkage, symbol: str) -> list[tuple[int, str]]:
    """Time in ms and kind of what happened to a wanted object, as such."""
    mine = ("find", "track", "reacquire", "lost")
    return [(each.valid_us // 1000, each.kind) for each in found.explain(symbol) if each.kind in mine]


def test_it_is_found_tracked_lost_and_found_again_where_it_is_expected() -> None:
    found = linkage()
    found.want("w", WORLD, {"colour": "red"})
    for t in range(0, 2000, 200):
        found.on_percepts(t * 1000, [seen(t, "one", 0.0, colour="red")])
    found.on_percepts(2_000_000, [Percept("one", VISION, None)])
    assert not found.anchored("w")
    events = found.on_percepts(3_000_000, [seen(3000, "two", 0.5, colour="blue")]).events
    assert [(each.kind, each.source, each.target) for each in events] == [
        ("reestablished", "two", "w"), ("reacquire", "two", "w"),
    ]  # fmt: skip
    found.on_percepts(3_500_000, [seen(3500, "two", 0.5)])
    assert kinds(found, "w") == [(0, "find"), (1000, "track"), (2000, "lost"), (3000, "reacquire")]
    assert found.explain("w")[-2].reason.cause == "reestablish"


def test_what_was_forgotten_is_looked_for_anew() -> None:
    found = linkage()
    found.want("w", WORLD, {"colour": "red"})
    for t in range(0, 60_000, 200):
        percepts = [seen(t, "one", 0.0, colour="red")] if t < 2000 else [seen(t, "other", 200.0, colour="blue")]
        found.on_percepts(t * 1000, percepts)
    assert found.wanted == ("w",)
    assert found.find("w") is None
    found.on_percepts(60_000_000, [seen(60_000, "two", 400.0, colour="red")])
    assert found.anchored("w")


def test_what_is_wanted_no_more_is_known_by_another_symbol_and_its_own_is_free() -> None:
    found = linkage()
    found.want("w", WORLD, {"colour": "red"})
    found.want("v", WORLD, {"colour": "green"})
    found.on_percepts(0, [seen(0, "one", 0.0, colour="red")])
    found.unwant("w")
    found.unwant("v")
    found.want("w", WORLD, {"colour": "blue"})
    outcome = found.on_percepts(200_000, [seen(200, "one", 0.0, colour="red"), seen(200, "two", 50.0, colour="blue")])
    assert {each.symbol: each.linked_to for each in outcome.states} == {"wo1": ("one",), "w": ("two",)}
    forgotten = next(each for each in outcome.events if each.kind == "forgotten")
    assert (forgotten.target, forgotten.reason.cause) == ("w", "released")
    assert found.wanted == ()


def test_what_is_described_is_the_object_and_not_the_percept() -> None:
    """A percept without a velocity is of an object that has one, once it is known well enough."""
    found = linkage()
    found.want("slow", WORLD, parse_formula("eventually speed[slow] < 1"))
    found.want("fast", WORLD, parse_formula("eventually speed[fast] > 5"))
    for t in range(0, 3000, 100):
        found.on_percepts(t * 1000, [seen(t, "mover", t / 100.0), seen(t, "stander", 0.0, 50.0)])
    for symbol, source in (("fast", "mover"), ("slow", "stander")):
        (link,) = found.objects(WORLD)[symbol].incoming.values()
        assert link.source.symbol == source


def test_what_is_only_expected_somewhere_is_not_in_view() -> None:
    found = ObjectLinkage([LinkSpecification(VISION, WORLD, NEW, NEAR), LinkSpecification(WORLD, "car", NEW, NEAR)])
    for t in range(0, 2000, 200):
        found.on_percepts(t * 1000, [seen(t, "one", 0.0, colour="red")])
    found.on_percepts(2_000_000, [Percept("one", VISION, None)])
    found.want("w", "car", {"colour": "red"})
    for t in range(2200, 4000, 200):
        found.on_percepts(t * 1000, [seen(t, "far", 900.0)])
    assert not found.anchored("w")
    found.on_percepts(4_000_000, [seen(4000, "two", 0.0)])
    assert found.anchored("w")


def test_what_is_found_again_under_a_symbol_is_no_candidate_that_was_forgotten_under_it() -> None:
    """Which of two a percept of another sensor shows stays open until one of them is forgotten, and comes again."""
    thermal = "thermal-percept"
    soon = parse_formula("eventually [300, oo] true")
    links = [
        LinkSpecification(of, WORLD, soon, NEAR, score=unlikelihood, candidates=2, forget_us=5_000_000)
        for of in (VISION, thermal)
    ]
    found = ObjectLinkage(links)
    found.want("w", WORLD, {"colour": "red"})
    for t in range(0, 8_200, 200):
        shown = [seen(t, "one", 0.0, colour="red"), seen(t, "two", 1.0)] if t < 1000 else []
        if t >= 1200:
            shown.append(Percept("warm", thermal, ObjectState(t * 1000, 0.6, 0.0, 0.0, 0.0, diagonal(8.0))))
        if t == 1200:
            shown += [Percept(name, VISION, None) for name in ("one", "two")]
        if t == 2000:
            (process,) = (each for each in found.into[WORLD] if each.specification.source == thermal)
            assert process.candidates["warm"].others() == ("w",)
        if t == 8000:
            assert found.find("w") is None
            assert not process.candidates
            shown.append(seen(t, "three", 30.0, colour="red"))
        invariants.check(found, found.on_percepts(t * 1000, shown))
    assert [link.source.symbol for link in found.objects(WORLD)["w"].incoming.values()] == ["three"]
    assert [link.source.symbol for link in found.objects(WORLD)["wo1"].incoming.values()] == ["warm"]


def test_what_an_object_has_shown_is_not_shown_by_the_next_one_of_its_symbol() -> None:
    """Half of what is described was seen of one that has another symbol since, the other half of one that has its own."""
    car = LinkSpecification(WORLD, "car", parse_formula("eventually [9000, oo] true"), NEAR)
    found = ObjectLinkage([LinkSpecification(VISION, WORLD, NEW, NEAR), car])
    found.want("w", WORLD, {"colour": "red"})
    found.want("c", "car", parse_formula('eventually (lamp[from] = "left" and eventually lamp[from] = "right")'))
    found.on_percepts(0, [seen(0, "one", 0.0, colour="red", lamp="left")])
    found.unwant("w")
    found.want("w", WORLD, {"colour": "blue"})
    for t in (200, 400):
        both = [seen(t, "one", 0.0, colour="red"), seen(t, "two", 50.0, colour="blue", lamp="right")]
        found.on_percepts(t * 1000, both)
        assert found.anchored("w")
        assert not found.anchored("c")
    found.on_percepts(600_000, [seen(600, "one", 0.0, lamp="right"), seen(600, "two", 50.0)])
    (link,) = found.objects("car")["c"].incoming.values()
    assert link.source.symbol == "wo1"


def test_what_cannot_be_wanted_is_refused() -> None:
    found = linkage()
    with pytest.raises(ValueError, match="no link leads"):
        found.want("w", "car", {})
    found.want("w", WORLD, {"colour": "red"})
    with pytest.raises(ValueError, match="taken"):
        found.want("w", WORLD, {"colour": "blue"})


DESCRIPTIONS = (
    "a[it] > 0 and b[it] = 1",
    "always[0, 300] a[it] > 0",
    "(always[0, 300] a[it] > 0) or b[it] = 1",
    "always[0, 200] (a[it] > 0 and eventually[0, 200] b[it] = 1)",
    "eventually[100, 300] always[0, 200] a[it] > 0",
    "(a[it] > 0) until[0, 400] (b[it] = 1)",
    "not (always[0, 200] a[it] > 0) and b[it] = 1",
    "always[100, 300] a[it] > 0",
    "(always (a[it] > 0)) or (always[0, 100] (b[it] = 1))",
)
STATES = st.lists(
    st.tuples(
        st.sampled_from([100, 70, 250]), st.sampled_from([-1, 1, 1, NO_VALUE]), st.sampled_from([0, 1, NO_VALUE])
    ),
    max_size=14,
)


@given(text=st.sampled_from(DESCRIPTIONS), values=STATES)
def test_states_that_are_only_read_change_no_verdict(text: str, values: list[tuple[int, Any, Any]]) -> None:
    description = Eventually(parse_formula(text, frozenset({"it"})))
    wanted = WantedObject("it", LinkSpecification(VISION, WORLD, NEW, NEAR), description)
    whole = make_progression(description)
    one = LinkObject("vp1", VISION, 0, ObjectState(0, 0.0, 0.0, 0.0, 0.0, diagonal(1.0)))
    valid_us = 0
    for later_ms, a, b in values:
        valid_us += 1000 * later_ms
        state = ObjectState(valid_us, 0.0, 0.0, 0.0, 0.0, diagonal(1.0), {"a": a, "b": b})
        whole.progress(valid_us, {"a[it]": a, "b[it]": b})
        sighting = wanted.step(valid_us, [(one, state)])
        assert (sighting is not None) == (whole.verdict == "true")
        if sighting is not None:
            assert sighting.reason.explanations
            return
