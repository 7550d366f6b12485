"""What each platform process is configured with."""

from pathlib import Path
from typing import Any

import pytest

from dyknow.agents.capabilities.flight.options import AvoidanceOptions, FlightOptions
from dyknow.console.command import Call
from dyknow.console.commands.fleet.up import planned
from dyknow.console.output.output import Output
from dyknow.console.processes.launch import FleetPlan, fleet_of, journal_of, together
from dyknow.model.errors import WrongCall
from dyknow.runtime.configuration.config import MavlinkVehicle, ReplayedVehicle, SimulatedVehicleConfig
from dyknow.runtime.configuration.local_endpoints import free_ports
from dyknow.runtime.configuration.reach import wire_of
from dyknow.runtime.configuration.settings import Settings, UnitFile, load
from tests.navigation.terrain.ground import tile_bytes
from tests.proxies import logs

COMPOSE = sorted((Path(__file__).resolve().parents[3] / "compose").glob("*.toml"))
NOW_US = 1_800_000_000_000_000
PLAN = FleetPlan(2, "patrol", seed=4, start_us=7)


def _settings(**settings: Any) -> Settings:
    return Settings.model_validate({"federation": "test", **settings})


def _call(**settings: Any) -> Call:
    return Call(_settings(**settings), Output(json_lines=True))


def _vehicles(call: Call, **chosen: Any) -> dict[str, Any]:
    return {config.unit: config.vehicle for config in fleet_of(call, PLAN._replace(**chosen), NOW_US)}


def test_each_simulated_uav_gets_its_place_in_the_scenario() -> None:
    found = _vehicles(_call(), units=3)
    assert {unit: (v.index, v.count, v.seed, v.start_us) for unit, v in found.items()} == {
        str(number): (number, 3, 4, 7) for number in range(3)
    }


@pytest.mark.parametrize("source", ["flag", "variable", "options", "federation"])
def test_extensions_that_are_named_anywhere_reach_every_platform(
    source: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    line = 'extensions = ["examples.extension"]\n'
    (tmp_path / "options.toml").write_text(line)
    (tmp_path / "federation.toml").write_text(f'name = "f"\n{line}')
    if source == "variable":
        monkeypatch.setenv("DYKNOW_EXTENSIONS", "examples.extension")
    flags = {
        "flag": {"extensions": ["examples.extension"]},
        "federation": {"federation": str(tmp_path / "federation.toml")},
    }.get(source, {})
    settings = load(flags, tmp_path / "options.toml" if source == "options" else None)
    configs = fleet_of(Call(settings, Output(json_lines=True)), PLAN, NOW_US)
    assert [config.extensions for config in configs] == [("examples.extension",)] * 2


def test_an_extension_that_a_federations_file_names_as_a_file_is_relative_to_it(tmp_path: Path) -> None:
    (tmp_path / "federation.toml").write_text('name = "f"\nextensions = ["beep.py"]\n')
    settings = load({"federation": str(tmp_path / "federation.toml")}, None)
    assert settings.extensions == (str(tmp_path / "beep.py"),)


def test_a_federations_file_has_its_say_per_unit(tmp_path: Path) -> None:
    (tmp_path / "a.tlog").write_bytes(logs.tlog())
    own = _call(
        unit={
            "1": {"persona": "px4", "avoidance": False},
            "visitor": {"mavlink": "udpin:127.0.0.1:14560", "sysid": 3, "control": True},
            "log": {"replay": str(tmp_path / "a.tlog"), "from": "3s"},
        }
    )
    configs = {config.unit: config for config in fleet_of(own, PLAN, NOW_US)}
    assert list(configs) == ["0", "1", "visitor", "log"]
    second, visitor, log = configs["1"].vehicle, configs["visitor"].vehicle, configs["log"].vehicle
    assert isinstance(second, SimulatedVehicleConfig)
    assert (second.persona, second.index, second.count) == ("px4", 1, 2)
    assert [configs[unit][AvoidanceOptions].avoidance for unit in ("0", "1")] == [True, False]
    assert isinstance(visitor, MavlinkVehicle)
    assert (visitor.endpoint, visitor.sysid, visitor.control) == ("udpin:127.0.0.1:14560", 3, True)
    assert isinstance(log, ReplayedVehicle)
    assert (log.from_us, log.epoch_us) == (3_000_000, NOW_US)


def test_the_elevation_of_a_federations_file_is_relative_to_it_and_looked_at_before_anything_starts(
    tmp_path: Path,
) -> None:
    (tmp_path / "federation.toml").write_text('name = "f"\n[unit.0]\nelevation = "N55E013.hgt"\nfloor_m = 20\n')
    tile = tmp_path / "N55E013.hgt"
    tile.write_bytes(tile_bytes(55, 13, lambda latitudes, _: 0.0 * latitudes))
    own = Call(load({"federation": str(tmp_path / "federation.toml")}, None), Output(json_lines=True))
    zero, one = fleet_of(own, PLAN, NOW_US)
    assert (zero[FlightOptions].elevation, zero[FlightOptions].floor_m) == (tile, 20.0)
    assert one[FlightOptions].elevation is None
    tile.write_bytes(tile.read_bytes()[:-1])
    with pytest.raises(WrongCall, match=r"--elevation: .*N55E013\.hgt: a tile has .* bytes, and this 2884801"):
        fleet_of(own, PLAN, NOW_US)


def test_vehicles_of_one_endpoint_share_a_process_and_all_others_have_their_own() -> None:
    port = "udpin:127.0.0.1:14560"
    own = _call(
        unit={"a": {"mavlink": port, "sysid": 1}, "b": {"mavlink": port, "sysid": 2}, "c": {"mavlink": "tcp:h:1"}}
    )
    groups = together(fleet_of(own, PLAN, NOW_US))
    assert [[config.unit for config in group] for group in groups] == [["0"], ["1"], ["a", "b"], ["c"]]


@pytest.mark.parametrize(
    ("others", "refusal"),
    [({}, "system id"), ({"sysid": 1}, "system id"), ({"sysid": 2, "signing_key": "KEY"}, "one key")],
)
def test_vehicles_of_one_endpoint_have_ids_of_their_own_and_one_key(tmp_path: Path, others, refusal) -> None:
    key = tmp_path / "key"
    key.write_bytes(bytes(32))
    key.chmod(0o600)
    given = {name: str(key) if value == "KEY" else value for name, value in others.items()}
    port = "udpin:127.0.0.1:14560"
    own = _call(unit={"a": {"mavlink": port, "sysid": 1}, "b": {"mavlink": port, **given}})
    with pytest.raises(WrongCall, match=refusal):
        together(fleet_of(own, PLAN, NOW_US))


def test_a_vehicle_commanded_over_a_network_needs_a_key_or_a_word() -> None:
    beyond = {"mavlink": "udpin:0.0.0.0:14560", "control": True}
    with pytest.raises(WrongCall, match=r"\[unit\.a\] mavlink: udpin:0\.0\.0\.0:14560 lies beyond this machine"):
        fleet_of(_call(unit={"a": beyond}), PLAN, NOW_US)
    configs = {each.unit: each for each in fleet_of(_call(unit={"a": {**beyond, "unsigned": True}}), PLAN, NOW_US)}
    assert configs["a"].vehicle.unsigned


def test_only_starts_one_of_them_in_its_own_place() -> None:
    found = _vehicles(_call(), units=3, only=("2",))
    assert list(found) == ["2"]
    assert (found["2"].index, found["2"].count) == (2, 3)
    with pytest.raises(WrongCall, match="no platform '7'"):
        _vehicles(_call(), only=("7",))


def test_with_endpoints_to_connect_to_there_is_no_multicast() -> None:
    assert wire_of(_settings(), "0").discover == "multicast"
    assert wire_of(_settings(connect=("tcp/127.0.0.1:7447",)), "0").discover == "none"


def test_without_multicast_each_dials_those_before_it_and_never_both() -> None:
    configs = fleet_of(_call(discover="none"), PLAN._replace(units=4), NOW_US)
    endpoints = [config.wire.listen[0] for config in configs]
    assert len(set(endpoints)) == 4
    for at, config in enumerate(configs):
        assert list(config.wire.connect) == endpoints[:at]


def test_certificates_need_a_roster() -> None:
    with pytest.raises(WrongCall, match="needs a roster"):
        wire_of(_settings(connect=("tls/127.0.0.1:7447",)), "0")


def test_a_unit_without_a_key_is_told_how_to_get_one(tmp_path: Path) -> None:
    roster = tmp_path / "roster.toml"
    roster.write_text("")
    with pytest.raises(WrongCall, match="or add 0"):
        fleet_of(_call(roster=roster), PLAN, NOW_US)


def test_a_faster_clock_begins_now_and_is_one_for_all() -> None:
    clocks = {config.clock for config in fleet_of(_call(), PLAN._replace(speed=10.0), NOW_US)}
    assert [(clock.epoch_us, clock.speed) for clock in clocks] == [(NOW_US, 10.0)]


@pytest.mark.parametrize("gcs", ["127.0.0.1", "here:there", ":14550", "127.0.0.1:0"])
def test_a_ground_station_needs_host_and_port(gcs: str) -> None:
    with pytest.raises(WrongCall, match="--gcs"):
        _vehicles(_call(gcs=gcs))


@pytest.mark.parametrize(
    ("scenario", "units", "said"), [("patrl", 3, "Did you mean 'patrol'"), ("crossing", 1, "crossing needs 2 vehicles")]
)
def test_a_scenario_that_cannot_be_flown_is_a_wrong_call(scenario: str, units: int, said: str) -> None:
    with pytest.raises(WrongCall, match=said):
        planned(_call(), FleetPlan(units, scenario))


@pytest.mark.parametrize("path", COMPOSE, ids=lambda path: path.name)
def test_every_federation_that_is_ready_to_start_can_be_started(path: Path) -> None:
    settings = load({"federation": str(path)}, None)
    call = Call(settings, Output(json_lines=True))
    configs = planned(call, FleetPlan(settings.units or 3, settings.scenario or "patrol", settings.seed or 1))
    assert len(configs) >= (settings.units or 3)


def test_free_ports_are_distinct() -> None:
    assert len(set(free_ports(8))) == 8


def test_platforms_keep_their_journals_where_the_file_says(tmp_path: Path) -> None:
    path = tmp_path / "f.toml"
    path.write_text('name = "f"\njournal = "flights/today"\n')
    configs = fleet_of(Call(load({"federation": str(path)}, None), Output(json_lines=True)), PLAN, NOW_US)
    assert [config.journal for config in configs] == [
        tmp_path / "flights" / "today" / f"{unit}.mcap" for unit in (0, 1)
    ]
    assert all(config.journal is None for config in fleet_of(_call(), PLAN, NOW_US))


def test_a_journal_that_cannot_be_kept_is_refused(tmp_path: Path) -> None:
    (tmp_path / "taken").write_bytes(b"")
    with pytest.raises(WrongCall, match=r"journal: .*taken is no directory that can be written"):
        fleet_of(_call(journal=tmp_path / "taken"), PLAN, NOW_US)
    flown = tmp_path / "log.mcap"
    flown.write_bytes(b"")
    with pytest.raises(WrongCall, match="is what platform log replays"):
        journal_of(tmp_path, "log", ReplayedVehicle(file=flown))
    assert flown.exists()


@pytest.mark.parametrize(
    "wrong",
    [
        {"connect": ("garbage",)},
        {"connect": ("tcp/127.0.0.1",)},
        {"listen": ("foo/1.2.3.4:5",)},
        {"interface": "nope0"},
    ],
)
def test_what_no_session_opens_with_is_a_wrong_call(wrong: dict[str, Any]) -> None:
    [option] = wrong
    with pytest.raises(WrongCall, match=f"^--{option}: "):
        wire_of(_settings(**wrong), "0")


@pytest.mark.parametrize("endpoint", ["tcp/[::1]:7447", "udp/router:7447", "ws/10.0.0.1:80", "unixsock-stream//tmp/x"])
def test_endpoints_of_every_kind_are_taken(endpoint: str) -> None:
    assert wire_of(_settings(connect=(endpoint,)), "0").connect == (endpoint,)


def test_each_platform_runs_the_specification_of_the_command_unless_the_file_has_its_own(tmp_path: Path) -> None:
    path = tmp_path / "federation.toml"
    path.write_text('name = "f"\n[unit.1]\nspec = "own.kpl"\nunits = ["gps.py"]\nfeed = "f.jsonl"\ngovern = "50ms"\n')
    each = UnitFile(spec=Path("/all.kpl"), admit="longer")
    call = Call(load({"federation": str(path)}, None), Output(json_lines=True))
    first, second = fleet_of(call, PLAN._replace(each=each), NOW_US)
    assert (first.spec, first.modules, first.feed, first.govern_us, first.admit) == (
        each.spec,
        (),
        None,
        None,
        "longer",
    )
    assert (second.spec, second.feed) == (tmp_path / "own.kpl", tmp_path / "f.jsonl")
    assert (second.modules, second.govern_us, second.admit) == ((str(tmp_path / "gps.py"),), 50_000, "longer")
