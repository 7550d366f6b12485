"""Missions of the scenario `logistics` with a fault each, drawn from a seed: noticed at once, recovered from, boxes found by sight."""

import os
import re
from typing import NamedTuple

import pytest

from dyknow.sim_uavs.dynamics.faults import drawn
from tests.agents.capabilities.missions.flown import is_over, told
from tests.agents.capabilities.missions.test_boxes import Depot

STEP_S = 0.1
NOTICED_S = 0.6
"""Two periods of the states of missions, the step of this test, and 0.1 s until the delegator has heard of it."""
LONGEST_S = 600.0


class Outcome(NamedTuple):
    """`noticed_s`: from when the fault was visible until the mission said so, to 0.1 s; it was visible

    * in what hangs on the line, at once: a dropped box; when the action had ended that was to take it: a failed attach;
    * in the place where the camera has seen it: a misplaced box;
    * from the end of the time that the action may take on: a failed take-off, a late vehicle.
    """

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
    until_us, times_us = depot.world.now_us + round(LONGEST_S * 1e6), list[int]()
    while not is_over(dialogue) and depot.world.now_us < until_us:
        depot.world.run_for(STEP_S)
        times_us += [depot.world.now_us] * (len(told(dialogue)) - len(times_us))
    lines, injected, kind = told(dialogue), depot.vehicle.injected, fault.fault.kind
    noticed_us = None
    if injected:
        visible = visible_us(kind, injected[0][0], lines, times_us)
        faults = [at_us for at_us, each in zip(times_us, lines, strict=True) if each.startswith("fault: ")]
        noticed_us = faults[0] - visible if faults and visible is not None else None
    said_so = lines[-1].startswith("inform: reached")
    noticed_s = None if noticed_us is None else noticed_us / 1e6
    return Outcome(seed, kind, bool(injected), said_so, said_so and depot.is_delivered(), noticed_s, lines)


def visible_us(kind: str, injected_us: int, lines: list[str], times_us: list[int]) -> int | None:
    at = next((number for number, each in enumerate(lines) if each.startswith("fault: ")), None)
    if at is None:
        return None
    before = list(zip(times_us[:at], lines[:at], strict=True))
    words = {"failed-attach": "ended: attach-box", "misplaced-box": "seen: "}
    if kind in words:
        return max((at_us for at_us, each in before if each.startswith(words[kind])), default=None)
    if limit := re.search(r"until\[0, ([0-9.]+)(us|ms|s)\]", lines[at]):
        begun_us = max(at_us for at_us, each in before if each.startswith("started: "))
        return begun_us + round(float(limit[1]) * {"us": 1, "ms": 1e3, "s": 1e6}[limit[2]])
    return injected_us if kind == "dropped-box" else None


@pytest.mark.full
@pytest.mark.timeout(1800)
def test_missions_with_drawn_faults_reach_their_goal() -> None:
    found = [flown(seed) for seed in range(int(os.environ.get("DYKNOW_MISSIONS", "50")))]
    assert all(each.begun for each in found), [each.seed for each in found if not each.begun]
    falsely = [(each.seed, each.kind) for each in found if each.said_so and not each.reached]
    assert not falsely, falsely
    missed = [(each.seed, each.kind, each.lines[-6:]) for each in found if not each.reached]
    assert len(missed) <= 0.05 * len(found), missed
    late = [(each.seed, each.kind, each.noticed_s) for each in found if (each.noticed_s or 0.0) > NOTICED_S]
    assert not late, late
    unnoticed = [each.seed for each in found if each.noticed_s is None and each.kind != "late"]
    assert not unnoticed, unnoticed
    dropped = [each for each in found if each.kind == "dropped-box"]
    sought = [each for each in dropped if any("looking for" in line for line in each.lines)]
    seen = [each for each in sought if any(line.startswith("found: ") for line in each.lines)]
    assert len(seen) >= 0.9 * len(sought), [each.lines for each in sought if each not in seen]
