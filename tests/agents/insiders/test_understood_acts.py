"""Whatever members say that is understood: no platform ends, no vehicle is moved by whom it should not, and little is kept."""

import os
from pathlib import Path

import pytest

from dyknow.federation.sharing.exports import LINGER_US
from tests.agents.insiders.federations import HONEST, MOST, SCENARIOS, HostileFederation

WHOLE = 1_000_000
SEEDS = (1, 2, 3)
FEW = {"hover": 500, "emergency": 120, "traffic": 60, "logistics": 100}
MANY = WHOLE // (len(SCENARIOS) * len(SEEDS) * 2)
SPEAKERS = {"members": ("2", "obs"), "all": ("2", "obs", "cc")}
"""A UAV and an observer, or a command centre, too: it may have vehicles moved, so that only of the first it is looked at who moved them."""
MORE_BYTES = 50 * 2**20
FILLED_S = 420.0
"""So long the histories of streams grow without anything hostile: 4096 samples, 10 a second."""
RUNS = [
    pytest.param(name, seed, speakers, MANY if is_full else FEW[name], id=f"{name}-{seed}-{speakers}-{'full' if is_full else 'few'}",
                 marks=[pytest.mark.full, pytest.mark.timeout(7200)] if is_full else [])
    for is_full in (False, True)
    for name in SCENARIOS
    for seed in (SEEDS if is_full else SEEDS[:1])
    for speakers in (SPEAKERS if is_full or name == "hover" else ["members"])
]  # fmt: skip


def resident() -> int:
    """Bytes of memory that this process has now."""
    return int(Path("/proc/self/statm").read_text("ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.parametrize(("name", "seed", "speakers", "acts"), RUNS)
def test_no_act_ends_a_platform_moves_a_vehicle_or_stays_for_good(
    name: str, seed: int, speakers: str, acts: int
) -> None:
    federation = HostileFederation(name, seed, SPEAKERS[speakers])
    if acts == MANY:
        federation.world.run_for(FILLED_S)
        federation.check()
    early = 0
    while federation.acts < acts:
        federation.say(min(2000, acts))
        early = early or (resident() if federation.acts >= acts // 10 else 0)
        assert max(size for _, size in federation.collections()) <= MOST, sorted(
            federation.collections(), key=lambda each: -each[1]
        )[:5]
    more = resident() - early
    assert more <= MORE_BYTES, f"{more / 2**20:.0f} MB more than after the first tenth"
    assert federation.answered > acts // 2, "most of it was heard"
    assert all(federation.world.nodes[unit].process is not None for unit in HONEST)
    federation.check_standing()
    if name == "hover" or acts == MANY:  # what else they do in that time costs too much
        federation.world.kill("2")
        federation.world.run_for(LINGER_US / 1e6 + 10.0)
        federation.check()
        assert federation.of_the_gone("2") == []
