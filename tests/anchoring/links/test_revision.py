"""Classifications that turn out to be wrong: the world symbol stays, types that exclude each other are never both."""

import random

import pytest

from dyknow.anchoring.links.specification import LinkSpecification
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import ObjectLinkage, Percept
from dyknow.anchoring.ready import NEAR, NEW, VISION, WORLD
from dyknow.kpl import parse_formula

FITS = {
    "car": "length_m[from] < 7",
    "truck": "length_m[from] >= 7",
    "building": "speed[from] < 1 and length_m[from] < 0",
}
SEEDS = [pytest.param(seed, marks=() if seed % 10 == 0 else pytest.mark.full) for seed in range(200)]


def kind(name: str) -> LinkSpecification:
    fits = FITS[name]
    return LinkSpecification(
        WORLD,
        name,
        parse_formula(f"eventually [500, oo] always [0, 500] ({fits})"),
        parse_formula(f"eventually [0, 1000] (xy_dist[from, to] < thresh and always [0, 400] ({fits}))"),
        parse_formula(f"always eventually [0, 1000] always [0, 400] ({fits})"),
        unit=lambda state, _before: state,
        exclusive="kind",
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_a_car_that_turns_out_to_be_a_truck_or_back_keeps_its_world_symbol(seed: int) -> None:
    rng = random.Random(seed)
    world = LinkSpecification(VISION, WORLD, NEW, NEAR)
    linkage = ObjectLinkage([world, kind("car"), kind("truck")])
    lengths = (rng.uniform(3, 6), rng.uniform(8, 15))
    first, second = ("car", "truck") if seed % 2 else ("truck", "car")
    change_ms = rng.randrange(5000, 7000, 100)
    events = []
    for t in range(0, 13_000, 100):
        now = first if t < change_ms else second
        length = lengths[0] if now == "car" else lengths[1]
        if rng.random() < 0.03:
            length = sum(lengths) - length
        state = ObjectState(t * 1000, 0.01 * t, rng.gauss(0, 0.2), 10.0, 0.0, diagonal(0.3, 1.0), {"length_m": length})
        events += linkage.on_percepts(t * 1000, [Percept("vp1", VISION, state)]).events
        for one in linkage.objects(WORLD).values():
            assert len(one.outgoing) <= 1, "car and truck exclude each other"
    assert set(linkage.objects(WORLD)) == {"wo1"}
    (link,) = linkage.objects(WORLD)["wo1"].outgoing.values()
    assert link.target.type == second
    assert link.target.state.attributes["length_m"] == linkage.objects(WORLD)["wo1"].state.attributes["length_m"]
    changes = [each for each in events if each.kind == "reclassified"]
    assert [(each.source, each.target_type) for each in changes][-1] == ("wo1", second)
    withdrawn = [each for each in linkage.explain("wo1") if each.kind == "unlinked"]
    assert withdrawn
    assert all(each.reason.explanations for each in withdrawn), "with the samples that decided it"


def test_what_was_taken_for_a_building_begins_to_move() -> None:
    building = LinkSpecification(
        WORLD, "building", parse_formula("eventually [1000, oo] always [0, 1000] speed[from] < 1"),
        parse_formula("eventually [0, 1000] (xy_dist[from, to] < 2 and speed[from] < 1)"),
        parse_formula("always eventually [0, 500] speed[from] < 1"), exclusive="kind", unit=lambda state, _: state,
    )  # fmt: skip
    vehicle = LinkSpecification(
        WORLD, "vehicle", parse_formula("eventually [0, oo] always [0, 500] speed[from] > 2"),
        parse_formula("eventually [0, 1000] (xy_dist[from, to] < thresh and speed[from] > 2)"),
        exclusive="kind", unit=lambda state, _: state,
    )  # fmt: skip
    linkage = ObjectLinkage([LinkSpecification(VISION, WORLD, NEW, NEAR), building, vehicle])
    kinds = []
    for t in range(0, 12_000, 100):
        x_m = max(0.0, (t - 6000) / 100)
        state = ObjectState(t * 1000, x_m, 0.0, 0.0, 0.0, diagonal(0.1))
        kinds += [
            (each.kind, each.target) for each in linkage.on_percepts(t * 1000, [Percept("p", VISION, state)]).events
        ]
    assert kinds == [
        ("established", "wo1"), ("established", "bo1"), ("unlinked", "bo1"), ("established", "vo1"), ("reclassified", "vo1"),
    ]  # fmt: skip
