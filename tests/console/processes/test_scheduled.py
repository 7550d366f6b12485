"""Faults that simulated UAVs are started with, by option or drawn."""

import pytest

from dyknow.console.command import Call
from dyknow.console.output.output import Output
from dyknow.console.processes.launch import FleetPlan, fleet_of
from dyknow.console.processes.scheduled import with_faults
from dyknow.model.errors import WrongCall
from dyknow.runtime.configuration.config import NodeConfig, SimulatedVehicleConfig
from dyknow.runtime.configuration.settings import Settings


def configs() -> list[NodeConfig]:
    call = Call(Settings.model_validate({"federation": "test"}), Output(json_lines=True))
    return fleet_of(call, FleetPlan(2, "logistics", start_us=7), 1_800_000_000_000_000)


def faults(*texts: str, seed: int | None = None) -> dict[str, tuple[str, ...]]:
    return {
        each.unit: each.vehicle.faults
        for each in with_faults(configs(), texts, seed)
        if isinstance(each.vehicle, SimulatedVehicleConfig)
    }


def test_each_vehicle_gets_the_faults_that_are_written_for_it() -> None:
    assert faults("0 dropped-box at load+4s", "0 late at 3s") == {
        "0": ("dropped-box at load+4s", "late=3 at 3s"),
        "1": (),
    }


def test_a_seed_draws_one_for_each_and_another_seed_others() -> None:
    assert faults(seed=3) == faults(seed=3)
    assert all(len(each) == 1 for each in faults(seed=3).values())
    assert len({faults(seed=seed)["0"] for seed in range(20)}) > 4


@pytest.mark.parametrize("text", ["7 late at 3s", "0 latte at 3s", "0 late", "late at 3s"])
def test_what_is_no_fault_of_a_vehicle_here_is_refused(text: str) -> None:
    with pytest.raises(WrongCall, match="--fault"):
        faults(text)
