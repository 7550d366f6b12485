"""An object that becomes an on-road object just when it is lost in a crossing is predicted along every way out of it."""

from math import hypot

from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import ObjectLinkage, Percept
from dyknow.anchoring.ready import ON_ROAD, VISION, ready_specification
from dyknow.sim_uavs.roads.layouts import cross, network_of

STEP_US = 100_000
END_US = 3_000_000


def test_it_remembers_the_road_by_which_it_came() -> None:
    linkage = ObjectLinkage(ready_specification(network_of(cross())))
    ways = []
    for now_us in range(0, END_US + 300_001, STEP_US):
        x_m = 8.0 * (now_us - END_US) / 1e6 - 7.0
        percepts = []
        if now_us < END_US:
            percepts = [Percept("vp1", VISION, ObjectState(now_us, x_m, -1.75, 0.0, 0.0, diagonal(0.3)))]
        elif now_us == END_US:
            percepts = [Percept("vp1", VISION, None)]
        for state in linkage.on_percepts(now_us, percepts).states:
            if state.type == ON_ROAD and state.prediction is not None:
                near_m = min(hypot(each.state.x_m - x_m, each.state.y_m + 1.75) for each in state.prediction.hypotheses)
                ways.append((len(state.prediction.hypotheses), near_m))
    assert len(ways) >= 3
    count, near_m = ways[-1]
    assert count == 3
    assert near_m < 2.0


def test_seen_again_in_a_crossing_before_the_middle_it_does_not_leap_to_the_road_behind() -> None:
    linkage = ObjectLinkage(ready_specification(network_of(cross())))
    off_m = []
    for now_us in range(0, 9_000_001, STEP_US):
        x_m = 8.0 * (now_us - 9_000_000) / 1e6
        is_seen = now_us < 7_000_000 or 7_800_000 <= now_us < 8_200_000
        state = ObjectState(now_us, x_m, -1.75, 0.0, 0.0, diagonal(0.3)) if is_seen else None
        percepts = [Percept(f"vp{now_us // 7_000_000}", VISION, state)] if is_seen else []
        for found in linkage.on_percepts(now_us, percepts).states:
            if found.type == ON_ROAD:
                places = [
                    found.state,
                    *(() if found.prediction is None else (h.state for h in found.prediction.hypotheses)),
                ]
                off_m.append(min(hypot(each.x_m - x_m, each.y_m + 1.75) for each in places))
    assert max(off_m) < 3.0
