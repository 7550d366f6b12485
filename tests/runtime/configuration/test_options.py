"""An option is one field of one model: its flag, keys, variable, field and argument follow from it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from pydantic import ValidationError

from dyknow.agents.capabilities.flight.options import AvoidanceOptions, FlightOptions
from dyknow.agents.exchange.options import SheddingOptions
from dyknow.agents.options import BASE, FLAGS, Chosen, platform_options
from dyknow.agents.specification.options import RunOptions, SpecificationOptions
from dyknow.model.errors import WrongCall
from dyknow.runtime.configuration.config import NodeConfig
from dyknow.runtime.configuration.settings import Settings, UnitFile

ROOT = Path(__file__).parents[3]
OPTIONS = """
from typing import Annotated
from pydantic import Field
from dyknow.agents.options import Everywhere, Flag, Options

class WhistleOptions(Options):
    pitch_hz: Annotated[float, Flag("--pitch", metavar="HZ"), Everywhere()] = Field(
        440.0, gt=0, description="How high it whistles."
    )

OPTIONS = (WhistleOptions,)
"""
PART = """
from dyknow.agents.capabilities.whistling.options import WhistleOptions
from dyknow.agents.part import Part

class Whistle(Part):
    def __init__(self, ports, parts):
        self.pitch_hz = ports.config.options[WhistleOptions].pitch_hz
"""
CAPABILITY = """
from dyknow.agents.capabilities.capability import Capability, Group, Stage, always

def _parts():
    from dyknow.agents.capabilities.whistling.whistle import Whistle
    return (Whistle,)

CAPABILITY = Capability((Group(Stage.REACTING, always, _parts),))
"""
FOUND = """
import json, sys
from pathlib import Path
from dyknow.agents import capabilities
folder = Path(sys.argv[1])
capabilities.__path__.append(str(folder))

from dyknow.agents.platform import Platform
from dyknow.console.command import Call, loaded
from dyknow.console.output.output import Output
from dyknow.console.processes.launch import FleetPlan, fleet_of
from dyknow.federation.members.clock import FederationClock
from dyknow.runtime.configuration.config import NodeConfig
from dyknow.runtime.configuration.resolved import platform_config
from dyknow.runtime.configuration.settings import VARIABLES, load

def pitches(flags):
    call = Call(load(flags, None), Output(json_lines=True))
    texts = [each.model_dump_json() for each in fleet_of(call, FleetPlan(2, "patrol"), 1_800_000_000_000_000)]
    configs = [platform_config(NodeConfig.model_validate_json(text), FederationClock(), 1, "") for text in texts]
    platforms = [Platform(config, 1) for config in configs]
    parts = [part for platform in platforms for part in platform.parts if type(part).__name__ == "Whistle"]
    return [part.pitch_hz for part in parts], [json.loads(text)["pitch_hz"] for text in texts]

flags = {name: [each for each in loaded(where, name).params if "--pitch" in each.opts]
         for name, where in (("join", "dyknow.console.commands.fleet.join:join"), ("up",
         "dyknow.console.commands.fleet.up:up"))}
print(json.dumps({
    "flags": {name: [(each.help, each.metavar, each.default) for each in found] for name, found in flags.items()},
    "variable": VARIABLES.get("pitch_hz"),
    "file": pitches({"federation": str(folder / "f.toml")}),
    "flag": pitches({"federation": str(folder / "f.toml"), "pitch_hz": 880.0}),
}))
"""


def test_a_field_of_a_model_is_a_flag_a_key_a_variable_a_field_of_the_process_and_the_value_of_its_part(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "whistling"
    folder.mkdir()
    for name, text in (("__init__", ""), ("options", OPTIONS), ("whistle", PART), ("capability", CAPABILITY)):
        (folder / f"{name}.py").write_text(text)
    (tmp_path / "f.toml").write_text('name = "f"\n[unit.1]\npitch_hz = 220.0\n')
    run = subprocess.run(
        [sys.executable, "-c", FOUND, str(tmp_path)],
        capture_output=True, text=True, check=False, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout)
    flag = ["How high it whistles.", "HZ", 440.0]
    assert found["flags"] == {"join": [flag], "up": [flag]}
    assert found["variable"] == "DYKNOW_PITCH_HZ"
    assert found["file"] == [[440.0, 220.0], [440.0, 220.0]]
    assert found["flag"] == [[880.0, 220.0], [880.0, 220.0]]


def test_every_option_of_a_part_is_a_key_of_the_file_and_a_field_of_the_process_and_has_a_help() -> None:
    fields = {name: field for model in platform_options() for name, field in model.model_fields.items()}
    assert sum(len(model.model_fields) for model in platform_options()) == len(fields), "two parts with one option"
    assert fields.keys() <= UnitFile.model_fields.keys() & NodeConfig.model_fields.keys()
    assert [name for name, field in fields.items() if not field.description] == []


def test_the_process_is_handed_what_was_set_and_reads_it_as_it_was() -> None:
    config = NodeConfig(unit="3", govern="250ms", floor_m=4.0, units=("gas.py",))
    again = NodeConfig.model_validate_json(config.model_dump_json())
    assert again == config
    assert (again[RunOptions].govern_us, again[FlightOptions].floor_m, again[RunOptions].modules) == (
        250_000, 4.0, ("gas.py",),
    )  # fmt: skip
    assert json.loads(config.model_dump_json())["govern_us"] == "250000us"


def test_journals_with_the_duration_in_milliseconds_are_read() -> None:
    assert NodeConfig.model_validate_json('{"unit": "3", "govern_ms": 50.0}')[RunOptions].govern_us == 50_000
    assert NodeConfig.model_validate_json('{"unit": "3", "govern_ms": null}')[RunOptions].govern_us is None


@pytest.mark.parametrize("text", ["5", "0s", "fast", "1us"])
def test_a_duration_that_is_none_names_the_option_as_it_was_written(text: str) -> None:
    with pytest.raises(WrongCall, match=r"^govern: "):
        UnitFile.model_validate({"govern": text})
    with pytest.raises(WrongCall, match=r"^--govern: "):
        UnitFile.model_validate({"govern": text}, context={FLAGS: True})


def test_a_number_without_a_unit_and_a_duration_beyond_the_longest_are_refused() -> None:
    with pytest.raises(ValidationError, match="should be a valid string"):
        UnitFile.model_validate({"govern": 50})
    with pytest.raises(ValidationError, match="2min is too long; write"):
        UnitFile.model_validate({"govern": "2min"})


def test_paths_and_modules_are_relative_to_the_folder_that_is_given_and_else_stay_as_they_are() -> None:
    given = {"spec": "a.kpl", "roads": "/roads.json", "units": "gas.py, compunits.distance"}
    placed = UnitFile.model_validate(given, context={BASE: Path("/at")})
    assert placed[SpecificationOptions].spec == Path("/at/a.kpl")
    assert (placed[RunOptions].roads, placed[RunOptions].modules) == (
        Path("/roads.json"), ("/at/gas.py", "compunits.distance"),
    )  # fmt: skip
    assert UnitFile.model_validate(given)[SpecificationOptions].spec == Path("a.kpl")


def test_settings_of_a_platform_go_before_those_of_all_and_those_before_the_default() -> None:
    settings = Settings.model_validate({"avoidance": False, "unit": {"1": {"avoidance": True}}})
    every = settings.for_all()
    assert every[AvoidanceOptions].avoidance is False
    assert settings.by_unit["1"].over(every)[AvoidanceOptions].avoidance is True
    assert UnitFile().over(every)[AvoidanceOptions].avoidance is False
    assert UnitFile()[AvoidanceOptions].avoidance is True


def test_a_part_has_the_options_that_were_chosen_and_else_the_defaults() -> None:
    chosen = Chosen(AvoidanceOptions(avoidance=False))
    assert chosen[AvoidanceOptions].avoidance is False
    assert chosen[SheddingOptions].shedding is True
