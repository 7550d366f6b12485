"""Missions of the scenario `logistics` with a fault each, drawn from a seed: noticed at once, recovered from, boxes found by sight."""

import os
from typing import NamedTuple

import pytest

from sim_uavs.dynamics.faults import drawn
from tests.agents.missions.flown import is_over, told
from tests.agents.missions.test_boxes import Depot

STEP_S = 0.1
LONGEST_S = 600.0


class Outcome(NamedTuple):
    """`noticed_s`: from when the fault began until the mission said so."""

    seed: int
    kind: str
    begun: bool
    said_so: bool
    reached: bool
    noticed_s: float | None
    lines: list[str]


def flown(seed: int) -> Outcome:
    fault = drawn(seed, 0)
    depot = Depot(seed, faults=(fault,))
    dialogue = depot.begin()
    until_us, noticed_us = depot.world.now_us + round(LONGEST_S * 1e6), None
    while not is_over(dialogue) and depot.world.now_us < until_us:
        depot.world.run_for(STEP_S)
        if noticed_us is None and any(each.startswith("fault: ") for each in told(dialogue)):
            noticed_us = depot.world.now_us
    lines, injected = told(dialogue), depot.vehicle.injected
    noticed_s = (noticed_us - injected[0][0]) / 1e6 if noticed_us is not None and injected else None
    said_so = lines[-1].startswith("inform: reached")
    return Outcome(seed, fault.fault.kind, bool(injected), said_so, said_so and depot.is_delivered(), noticed_s, lines)


@pytest.mark.full
@pytest.mark.timeout(1800)
def test_missions_with_drawn_faults_reach_their_goal() -> None:
    found = [flown(seed) for seed in range(int(os.environ.get("DYKNOW_MISSIONS", "50")))]
    assert all(each.begun for each in found), [each.seed for each in found if not each.begun]
    falsely = [(each.seed, each.kind) for each in found if each.said_so and not each.reached]
    assert not falsely, falsely
    missed = [(each.seed, each.kind, each.lines[-6:]) for each in found if not each.reached]
    assert len(missed) <= 0.05 * len(found), missed
    dropped = [each for each in found if each.kind == "dropped-box"]
    assert all(each.noticed_s is not None and each.noticed_s <= 1.0 for each in dropped), dropped
    sought = [each for each in dropped if any("looking for" in line for line in each.lines)]
    seen = [each for each in sought if any(line.startswith("found: ") for line in each.lines)]
    assert len(seen) >= 0.9 * len(sought), [each.lines for each in sought if each not in seen]
