"""How boxes fall, and that all who fold the same list see the same world."""

import json
from itertools import pairwise
from math import hypot
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.sim_uavs.boxes.bodies import BOX, Air, Surface, fall
from dyknow.sim_uavs.boxes.handled import BoxWorld, Handling
from dyknow.sim_uavs.boxes.shared import HandlingFile, SharedBoxes
from dyknow.sim_uavs.dynamics.quadcopter import GRAVITY_M_S2
from dyknow.sim_uavs.dynamics.slung import Thing
from tests.strategies import examples

heights = st.floats(0.1, 60.0)
speeds = st.floats(-15.0, 15.0)
THINGS = [
    Thing("b1", "box", "red", 0.0, 0.0),
    Thing("b2", "box", "blue", 5.0, 0.0),
    Thing("c1", "carrier", "grey", 9, 9),
]


@settings(max_examples=examples(60))
@given(heights, speeds, speeds, speeds, speeds, st.integers(0, 99))
def test_what_is_let_go_comes_to_rest_on_the_ground_and_never_gains_energy_in_still_air(
    up: float, vx: float, vy: float, wind_x: float, wind_y: float, seed: int
) -> None:
    path = fall(BOX, (0.0, 0.0, up), (vx, vy, 0.0), np.random.default_rng(seed), Air(wind_x, wind_y))
    assert path[-1][2] == 0.0
    assert len(path) < 1500
    assert all(place[2] >= 0.0 for place in path)
    smooth = Surface(tumble=0.0)
    calm = fall(BOX, (0.0, 0.0, up), (vx, vy, 0.0), np.random.default_rng(seed), surface=smooth)
    energies = [
        GRAVITY_M_S2 * place[2] + 0.5 * sum(((a - b) / 0.02) ** 2 for a, b in zip(place, before, strict=True))
        for before, place in pairwise(calm)
    ]
    first = GRAVITY_M_S2 * up + 0.5 * hypot(vx, vy) ** 2
    assert max(energies, default=0.0) <= first * 1.02 + 0.5


@settings(max_examples=examples(40))
@given(st.floats(1.0, 40.0))
def test_it_falls_no_faster_than_its_drag_allows(up: float) -> None:
    path = fall(BOX, (0.0, 0.0, up), (0.0, 0.0, 0.0), np.random.default_rng(0))
    fastest = max((a[2] - b[2]) / 0.02 for a, b in pairwise([(0.0, 0.0, up), *path]))
    assert fastest <= (GRAVITY_M_S2 / BOX.drag_per_m) ** 0.5 * 1.01


places = st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(0, 20))
handlings = st.lists(
    st.builds(
        lambda after, what, thing, by, place: (after, what, thing, by, place),
        st.integers(0, 6_000_000),
        st.sampled_from(["take", "carry", "release"]),
        st.sampled_from(["b1", "b2", "c1", "b9"]),
        st.sampled_from(["0", "1"]),
        places,
    ),
    max_size=12,
)


@settings(max_examples=examples(80))
@given(handlings, st.lists(st.integers(0, 12), max_size=6))
def test_whenever_one_looks_the_same_list_makes_the_same_world(steps: list, looks: list[int]) -> None:
    seldom, often = BoxWorld(THINGS, 5), BoxWorld(THINGS, 5)
    now_us = 1_000_000
    for number, (after_us, *rest) in enumerate(steps):
        now_us += after_us
        handling = Handling(now_us, *rest)
        seldom.on_handling(handling)
        often.on_handling(handling)
        if number in looks:
            often.at(now_us)
    later_us = now_us + 60_000_000
    assert seldom.at(later_us) == often.at(later_us)
    held = [each.holder for each in seldom.at(now_us)]
    assert all(holder in {None, "0", "1"} for holder in held)


def test_of_two_that_take_a_box_the_first_in_the_list_has_it(tmp_path: Path) -> None:
    first, second = (SharedBoxes(BoxWorld(THINGS, 5), HandlingFile(tmp_path / "boxes.jsonl")) for _ in range(2))
    assert first.do(Handling(10, "take", "b1", "0", (0.0, 0.0, 0.0)))
    assert not second.do(Handling(9, "take", "b1", "1", (0.0, 0.0, 0.0)))
    assert second.world.holder("b1") == "0"
    first.do(Handling(20, "release", "b1", "0", (3.0, 4.0, 5.0)))
    assert first.at(30_000_000) == second.at(30_000_000)


def test_what_a_dead_process_carried_falls_from_where_it_was_last(tmp_path: Path) -> None:
    boxes = SharedBoxes(BoxWorld(THINGS, 5), HandlingFile(tmp_path / "boxes.jsonl"))
    boxes.do(Handling(0, "take", "b1", "0", (0.0, 0.0, 0.0)))
    boxes.do(Handling(1_000_000, "carry", "b1", "0", (20.0, 0.0, 6.0)))
    box = boxes.at(20_000_000)[0]
    assert box.holder is None
    assert box.place[2] == 0.0
    assert 15.0 < box.place[0] < 25.0
    assert not boxes.do(Handling(21_000_000, "carry", "b1", "0", (0.0, 0.0, 6.0)))


def test_lines_that_are_no_handlings_are_left_out_and_counted(tmp_path: Path) -> None:
    file = tmp_path / "boxes.jsonl"
    good = json.dumps(Handling(10, "take", "b1", "0", (0.0, 0.0, 0.0)))
    infinite = json.dumps(Handling(5, "take", "b2", "0", (float("inf"), 0.0, 0.0)))
    file.write_text(f"nonsense\n[1,2]\n{infinite}\n{'9' * 5000}\n{good}\n[3")
    log = HandlingFile(file)
    boxes = SharedBoxes(BoxWorld(THINGS, 5), log)
    assert [each.holder for each in boxes.at(11)] == ["0", None, None]
    assert log.damaged == 3
