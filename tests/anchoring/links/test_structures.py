"""Object linkage structures step by step: the paper's example, the timing of its conditions, and the rules."""

import gc
import random
import tracemalloc
from collections.abc import Iterable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.anchoring.links.objects import LinkEvent
from dyknow.anchoring.links.specification import LinkSpecification
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import ObjectLinkage, Percept
from dyknow.anchoring.ready import NEAR, NEW, ON_A_ROAD, ON_ROAD, STAYS_ON_ROADS, VISION, WORLD, ready_specification
from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.kpl import parse_formula
from tests.anchoring.roads.towns import link, text

STEP_MS = 100
ROAD = read_roads(text(link("l1", None, None, [(-100.0, 0.0), (900.0, 0.0)])))


def seen(t_ms: int, name: str, x_m: float, y_m: float = 0.0, type_: str = VISION, sd_m: float = 0.3) -> Percept:
    return Percept(name, type_, ObjectState(t_ms * 1000, x_m, y_m, 0.0, 0.0, diagonal(sd_m)))


def end(name: str, type_: str = VISION) -> Percept:
    return Percept(name, type_, None)


def run(
    linkage: ObjectLinkage, name: str, times_ms: Iterable[int], speed_m_s: float = 10.0, y_m: float = 0.0
) -> list[LinkEvent]:
    """One percept of something that moves east from x = 0 at time 0."""
    events: list[LinkEvent] = []
    for t_ms in times_ms:
        events += linkage.on_percepts(t_ms * 1000, [seen(t_ms, name, speed_m_s * t_ms / 1000, y_m)]).events
    return events


def brief(events: Iterable[LinkEvent]) -> list[tuple[int, str, str, str]]:
    return [(each.valid_us // 1000, each.kind, each.source, each.target) for each in events]


def test_example_iv_1_step_by_step() -> None:
    linkage = ObjectLinkage(ready_specification(ROAD))
    run(linkage, "vp1", range(0, 1000, STEP_MS))
    assert not linkage.objects(WORLD), (
        "establish of vp1 is being evaluated, and there is no world object to reestablish"
    )
    assert brief(run(linkage, "vp1", range(1000, 3000, STEP_MS))) == [(1000, "established", "vp1", "wo1")]
    assert linkage.anchored("wo1")
    assert brief(run(linkage, "vp1", range(3000, 5000, STEP_MS))) == [(3000, "established", "wo1", "oo1")]
    assert linkage.anchored("oo1")
    # the image processing loses vp1: its link goes, wo1 and oo1 and the link between them stay, and both are predicted
    events = linkage.on_percepts(5_000_000, [end("vp1")]).events
    assert brief(events) == [(5000, "unlinked", "vp1", "wo1")]
    predicted = linkage.on_time(7_000_000).states
    assert {each.symbol for each in predicted} == {"wo1", "oo1"}
    assert not linkage.anchored("wo1")
    assert not linkage.anchored("oo1")
    world, on_road = linkage.find("wo1"), linkage.find("oo1")
    assert world is not None
    assert on_road is not None
    assert [link.target.symbol for link in world.outgoing.values()] == ["oo1"]
    assert world.state.y_m == on_road.state.y_m != 0.0, "the on-road object restricts it to the centre of a lane"
    assert world.state.x_m == pytest.approx(world.state.valid_us / 1e5, abs=1.0)
    # vp2 appears where wo1 is expected: establish and reestablish are evaluated, and reestablish becomes true first
    events = run(linkage, "vp2", range(7000, 9000, STEP_MS))
    assert brief(events) == [(7000, "reestablished", "vp2", "wo1")]
    assert linkage.anchored("oo1"), "oo1 is once again anchored"
    assert [each.kind for each in linkage.explain("wo1")] == ["established", "established", "unlinked", "reestablished"]
    assert set(linkage.objects(WORLD)) == {"wo1"}


@pytest.mark.parametrize("step_ms", [40, 100, 300, 500])
def test_with_perfect_data_objects_are_established_at_the_first_samples_of_section_4(step_ms: int) -> None:
    events = run(ObjectLinkage(ready_specification(ROAD)), "vp1", range(200, 6000, step_ms))
    times = range(200, 6000, step_ms)
    world = next(t for t in times if t >= 1200)
    on_road = next(t for t in times if t >= world + 1000 + 1000)
    assert brief(events)[0] == (world, "established", "vp1", "wo1")
    assert brief(events)[1][1:] == ("established", "wo1", "oo1")
    assert on_road <= brief(events)[1][0] <= on_road + 2 * step_ms


def test_a_percept_shorter_than_a_second_is_no_object() -> None:
    linkage = ObjectLinkage(ready_specification())
    events = run(linkage, "vp1", range(0, 1000, STEP_MS))
    events += linkage.on_percepts(1_000_000, [end("vp1")]).events
    assert not events
    assert not linkage.objects(WORLD)


def test_four_tracks_with_gaps_are_one_symbol() -> None:
    linkage = ObjectLinkage(ready_specification(ROAD))
    events = []
    for number in range(4):
        events += run(linkage, f"vp{number + 1}", range(5000 * number, 5000 * number + 3000, STEP_MS))
    assert set(linkage.objects(WORLD)) == {"wo1"}
    assert set(linkage.objects(ON_ROAD)) == {"oo1"}
    assert [each[:3] for each in brief(events) if each[1] == "reestablished"] == [
        (5000 * number, "reestablished", f"vp{number + 1}") for number in (1, 2, 3)
    ]


def test_reestablish_wins_over_establish_in_the_same_state() -> None:
    """Rule L1: near only in the state in which a second has passed."""
    linkage = ObjectLinkage(ready_specification())
    still(linkage, "vp1", 0, 2000)
    linkage.on_percepts(2_000_000, [end("vp1")])
    far = [linkage.on_percepts(t * 1000, [seen(t, "vp2", 60.0)]).events for t in range(2100, 3100, STEP_MS)]
    assert not any(far)
    (event,) = linkage.on_percepts(3_100_000, [seen(3100, "vp2", 1.0)]).events
    assert (event.kind, event.target) == ("reestablished", "wo1")


def test_reestablish_fails_after_a_second_and_is_not_tried_again() -> None:
    never = LinkSpecification(VISION, WORLD, parse_formula("eventually [0, oo] x[from] < -5"), NEAR)
    linkage = ObjectLinkage([never])
    linkage.on_percepts(0, [seen(0, "vp1", -6.0)])
    linkage.on_percepts(100_000, [end("vp1")])
    for t in range(200, 1400, STEP_MS):
        linkage.on_percepts(t * 1000, [seen(t, "vp2", 60.0)])
    assert not linkage.on_percepts(1_400_000, [seen(1400, "vp2", -4.0)]).events


def still(linkage: ObjectLinkage, name: str, from_ms: int, to_ms: int, x_m: float = 0.0, y_m: float = 0.0) -> None:
    for t in range(from_ms, to_ms, STEP_MS):
        linkage.on_percepts(t * 1000, [seen(t, name, x_m, y_m)])


def two_known(apart_m: float = 10.0) -> ObjectLinkage:
    """wo1 at x = 0 and wo2 `apart_m` east of it, both not seen since 2.1 s."""
    linkage = ObjectLinkage([LinkSpecification(VISION, WORLD, NEW, NEAR)])
    for t in range(0, 2000, STEP_MS):
        linkage.on_percepts(t * 1000, [seen(t, "a", 0.0), seen(t, "b", apart_m)])
    linkage.on_percepts(2_000_000, [end("a"), end("b")])
    return linkage


def test_of_several_objects_a_percept_is_the_one_with_the_least_score() -> None:
    """Rule L2."""
    (event,) = two_known().on_percepts(2_100_000, [seen(2100, "c", 5.5)]).events
    assert (event.kind, event.target) == ("reestablished", "wo2")


def test_a_link_says_how_probable_it_was_among_the_objects_it_could_have_been() -> None:
    linkage = ObjectLinkage(ready_specification())
    for t in range(0, 2000, STEP_MS):
        linkage.on_percepts(t * 1000, [seen(t, "a", 0.0), seen(t, "b", 1.0)])
    linkage.on_percepts(2_000_000, [end("a"), end("b")])
    (event,) = linkage.on_percepts(3_000_000, [seen(3000, "c", 0.5)]).events
    assert event.weight == pytest.approx(0.5, abs=0.1), "it is as near to both"
    linkage.on_percepts(3_100_000, [end("c")])
    (event,) = linkage.on_percepts(3_200_000, [seen(3200, "d", -40.0), seen(3200, "e", 1.2)]).events
    assert event.weight > 0.5


def test_memory_stays_as_it_is_while_percepts_appear_and_vanish() -> None:
    linkage = ObjectLinkage(ready_specification(), period_us=100_000)
    sizes = []
    tracemalloc.start()
    for number in range(1500):
        t = number * 400
        linkage.on_percepts(t * 1000, [seen(t, f"p{number}", 50.0 * (number % 40))])
        linkage.on_percepts(t * 1000 + 100_000, [end(f"p{number}")])
        if number % 500 == 499:
            gc.collect()
            sizes.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert not linkage.objects(VISION)
    assert sizes[2] - sizes[1] < 200_000, "not even half a kilobyte for each of the last 500"


def test_percepts_that_compete_are_assigned_together() -> None:
    """Rule L3: each is nearer to wo2 than to wo1, and both are linked."""
    events = two_known(8.0).on_percepts(2_100_000, [seen(2100, "c", 4.5), seen(2100, "d", 7.0)]).events
    assert {(each.source, each.target) for each in events} == {("c", "wo1"), ("d", "wo2")}


@settings(max_examples=12)
@given(st.integers(0, 1000), st.randoms(use_true_random=False))
def test_the_order_of_percepts_within_a_tick_changes_nothing(seed: int, order: random.Random) -> None:
    """Rule L3."""
    rng = random.Random(seed)
    linkages = [ObjectLinkage(ready_specification(ROAD)) for _ in range(2)]
    for t in range(0, 4000, 200):
        names = [f"v{number}{'' if t < 2000 else 'b'}" for number in range(4) if rng.random() < 0.9]
        percepts = [seen(t, name, 10.0 * int(name[1]) + rng.gauss(0, 2), rng.gauss(0, 2)) for name in names]
        shuffled = list(percepts)
        order.shuffle(shuffled)
        one, other = (
            each.on_percepts(t * 1000, given) for each, given in zip(linkages, (percepts, shuffled), strict=True)
        )
        assert brief(one.events) == brief(other.events)
        assert [(each.symbol, *each.state[:5]) for each in one.states] == [
            (each.symbol, *each.state[:5]) for each in other.states
        ]


def test_an_object_that_leaves_the_road_keeps_its_world_symbol_and_loses_the_on_road_one() -> None:
    """Rule L6: the condition fails when ten seconds have passed without a second on the road."""
    linkage = ObjectLinkage(ready_specification(ROAD))
    run(linkage, "vp1", range(0, 5000, STEP_MS))
    events = []
    for t in range(5000, 17_000, STEP_MS):
        y_m = min(60.0, (t - 5000) / 50)
        events += linkage.on_percepts(t * 1000, [seen(t, "vp1", 10 * t / 1000, y_m)]).events
    (event,) = [each for each in events if each.kind == "unlinked"]
    assert (event.source, event.target, event.reason.formula) == ("wo1", "oo1", STAYS_ON_ROADS)
    off_us = 5_000_000 + 350_000
    assert off_us + 8_500_000 <= event.valid_us <= off_us + 11_500_000
    assert event.reason.explanations
    assert linkage.anchored("wo1")
    assert not linkage.anchored("oo1")


def test_what_is_lost_far_off_its_road_is_expected_where_it_went_and_not_on_the_road() -> None:
    linkage = ObjectLinkage(ready_specification(ROAD))
    events: list[LinkEvent] = []
    for t_ms in [*range(0, 9000, STEP_MS), *range(11_000, 13_000, STEP_MS)]:
        x_m, y_m = t_ms / 100, -max(0, t_ms - 5000) / 100
        name = "vp1" if t_ms < 9000 else "vp2"
        events += linkage.on_percepts(t_ms * 1000, [seen(t_ms, name, min(x_m, 50.0), y_m)]).events
    assert [(kind, source, target) for _, kind, source, target in brief(events)] == [
        ("established", "vp1", "wo1"), ("established", "wo1", "oo1"),
        ("unlinked", "vp1", "wo1"), ("reestablished", "vp2", "wo1"),
    ]  # fmt: skip


def test_what_was_seen_for_five_seconds_is_forgotten_ten_after_that_and_still_explained() -> None:
    linkage = ObjectLinkage(ready_specification(ROAD))
    run(linkage, "vp1", range(0, 5000, STEP_MS))
    events = linkage.on_time(60_000_000).events
    assert [(each[1], each[3]) for each in brief(events)] == [
        ("unlinked", "wo1"), ("unlinked", "oo1"), ("forgotten", "wo1"), ("forgotten", "oo1"),
    ]  # fmt: skip
    assert 14_800_000 <= events[-1].valid_us <= 15_300_000
    assert not linkage.objects(WORLD)
    assert linkage.explain("wo1")[-1].kind == "forgotten"
    assert linkage.deadline_us is None, "nothing is left to predict"
    assert not linkage.explain("nothing")


def test_a_percept_that_is_silent_has_ended_and_may_come_back_under_its_name() -> None:
    linkage = ObjectLinkage(ready_specification())
    run(linkage, "vp1", range(0, 2000, STEP_MS))
    events = run(linkage, "vp1", range(3000, 4000, STEP_MS))
    assert [(kind, source, target) for _, kind, source, target in brief(events)] == [
        ("unlinked", "vp1", "wo1"), ("reestablished", "vp1", "wo1"),
    ]  # fmt: skip
    assert events[0].reason.cause == "silent"


def test_a_slow_percept_beside_fast_ones_of_its_type_is_an_object_too() -> None:
    linkage = ObjectLinkage(ready_specification())
    events: list[LinkEvent] = []
    for t_ms in range(0, 10_000, 20):
        percepts = [seen(t_ms, "fast", t_ms / 100)] if t_ms % 40 == 0 else []
        percepts += [seen(t_ms, "slow", t_ms / 100, 100.0)] if t_ms % 500 == 0 else []
        events += linkage.on_percepts(t_ms * 1000, percepts).events if percepts else []
    assert brief(events) == [(1000, "established", "fast", "wo1"), (1500, "established", "slow", "wo2")]


def test_a_percept_that_comes_more_rarely_from_now_on_keeps_its_link() -> None:
    linkage = ObjectLinkage(ready_specification())
    run(linkage, "vp1", range(0, 5000, STEP_MS))
    events = run(linkage, "vp1", range(5000, 20_000, 500))
    assert brief(events) == [(5300, "unlinked", "vp1", "wo1"), (5500, "reestablished", "vp1", "wo1")]


def test_time_goes_forward() -> None:
    linkage = ObjectLinkage(ready_specification())
    linkage.on_percepts(100_000, [])
    with pytest.raises(ValueError, match="forward"):
        linkage.on_percepts(100_000, [])


def test_specifications_that_make_no_hierarchy_are_refused() -> None:
    with pytest.raises(ValueError, match="circle"):
        ObjectLinkage([LinkSpecification("a", "b", NEW, NEAR), LinkSpecification("b", "a", NEW, NEAR)])
    with pytest.raises(ValueError, match="one link specification"):
        ObjectLinkage([LinkSpecification("a", "b", NEW, NEAR), LinkSpecification("a", "b", NEW, NEAR)])
    assert ON_A_ROAD.lo_us == 1_000_000
