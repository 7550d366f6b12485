"""What `up` starts where some platforms of its federation run already."""

import os
from pathlib import Path

import psutil
import pytest

from dyknow.console.command import Call
from dyknow.console.output.output import Output
from dyknow.console.processes.launch import FleetPlan, fleet_of
from dyknow.console.processes.standing import forget, missing, note_state, running_units
from dyknow.console.processes.supervision import Fleet
from dyknow.runtime.configuration.config import NodeConfig
from dyknow.runtime.configuration.run_directory import (
    JOINED,
    ProcessState,
    Running,
    noted_state,
    read_state,
    write_state,
)
from dyknow.runtime.configuration.settings import Settings

NOW_US = 1_700_000_000_000_000
ALIVE = Running("", os.getpid(), psutil.Process().create_time())
DEAD = ALIVE._replace(started=1.0)


def configs_of(number: int, scenario: str, speed: float = 1.0, **settings: object) -> list[NodeConfig]:
    call = Call(Settings.model_validate({"federation": "test", **settings}), Output(json_lines=True))
    return fleet_of(call, FleetPlan(number, scenario, speed=speed), NOW_US)


@pytest.fixture
def standing(tmp_path: Path) -> Path:
    """The run directory of a federation of three, twice as fast as the wall, of which platform 1 has died."""
    (tmp_path / "units").mkdir()
    for config in configs_of(3, "hover", speed=2.0):
        (tmp_path / "units" / f"{config.unit}.json").write_text(config.model_dump_json())
    found = [ALIVE._replace(unit="0"), DEAD._replace(unit="1"), ALIVE._replace(unit="2")]
    write_state(tmp_path, ProcessState(tuple(found), ("tcp/127.0.0.1:7001",)))
    return tmp_path


def test_where_nothing_runs_all_are_missing(tmp_path: Path) -> None:
    configs = configs_of(3, "hover")
    assert missing(tmp_path, configs) == configs


def test_who_died_is_started_as_it_was_and_a_newcomer_takes_the_clock_that_runs(standing: Path) -> None:
    died, new = missing(standing, configs_of(4, "patrol", discover="none"))
    assert (died.unit, died.vehicle.model_dump()["scenario"]) == ("1", "hover")
    assert (new.unit, new.vehicle.model_dump()["scenario"]) == ("3", "patrol")
    assert new.clock == died.clock != configs_of(1, "patrol")[0].clock
    assert new.wire.connect == ("tcp/127.0.0.1:7001",)


def test_what_joined_is_not_started_once_more(standing: Path) -> None:
    write_state(standing / JOINED, ProcessState((ALIVE._replace(unit="1"),)), "1.json")
    assert running_units(standing) == {"0", "1", "2"}
    assert missing(standing, configs_of(3, "hover")) == []


def test_who_ends_leaves_what_others_have_started_noted(standing: Path) -> None:
    fleet = Fleet(standing, lifeline=False)
    fleet.running["1"] = DEAD._replace(unit="1")
    note_state(fleet, configs_of(1, "hover"), stays=True)
    assert [found.unit for found in noted_state(standing).running] == ["0", "2", "1", ""]
    forget(fleet)
    assert [found.unit for found in read_state(standing).running] == ["0", "2"]
    write_state(standing, ProcessState((DEAD._replace(unit="0"),)))
    forget(fleet)
    assert noted_state(standing) == ProcessState()
