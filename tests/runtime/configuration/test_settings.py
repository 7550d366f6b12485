from pathlib import Path

import pytest

from dyknow.model.errors import WrongCall
from dyknow.runtime.configuration.settings import load, read_federation


@pytest.fixture(autouse=True)
def _no_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    import os

    for name in [name for name in os.environ if name.startswith("DYKNOW_")]:
        monkeypatch.delenv(name)


def _written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_flags_go_before_variables_before_the_file_before_the_federations_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    federation = _written(
        tmp_path / "f.toml", 'name = "f"\nscenario = "hover"\nseed = 1\npersona = "px4"\ninterface = "eth9"'
    )
    config = _written(tmp_path / "c.toml", 'scenario = "patrol"\nseed = 2\npersona = "ardupilot"')
    monkeypatch.setenv("DYKNOW_SCENARIO", "swarm")
    monkeypatch.setenv("DYKNOW_SEED", "3")
    settings = load({"federation": str(federation), "scenario": "crossing"}, config)
    assert (settings.scenario, settings.seed, settings.persona, settings.interface) == (
        "crossing",
        3,
        "ardupilot",
        "eth9",
    )
    assert settings.federation == "f"
    assert settings.timeout is None, "nobody set it: the command's own default holds"


def test_a_variable_holds_several_endpoints_with_commas_between(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DYKNOW_CONNECT", "tcp/127.0.0.1:1, tcp/127.0.0.1:2")
    monkeypatch.setenv("DYKNOW_JSON", "1")
    settings = load({}, None)
    assert settings.connect == ("tcp/127.0.0.1:1", "tcp/127.0.0.1:2")
    assert settings.json_lines


def test_the_file_of_options_may_come_from_a_variable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DYKNOW_CONFIG", str(_written(tmp_path / "c.toml", 'json = true\nfederation = "delta"')))
    settings = load({}, None)
    assert (settings.federation, settings.json_lines) == ("delta", True)


def test_an_unknown_key_is_an_error_with_file_and_remedy(tmp_path: Path) -> None:
    config = _written(tmp_path / "c.toml", 'scenaro = "patrol"')
    with pytest.raises(WrongCall, match=r"c\.toml: unknown key 'scenaro'\. Did you mean 'scenario'\?"):
        load({}, config)


def test_a_mistyped_value_names_where_it_was_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DYKNOW_SEED", "many")
    with pytest.raises(WrongCall, match=r"the variable DYKNOW_SEED: seed: .*'many'"):
        load({}, None)


def test_every_mistake_in_a_federations_file_is_told_with_its_line(tmp_path: Path) -> None:
    path = _written(
        tmp_path / "f.toml", 'name = "f"\nscenari = "hover"\n\n[unit.1]\npersona = "iris"\nreplai = "x.tlog"\n'
    )
    with pytest.raises(WrongCall) as caught:
        read_federation(path)
    said = str(caught.value)
    assert "f.toml:2: unknown key 'scenari'. Did you mean 'scenario'?" in said
    assert "f.toml:5: unit.1.persona:" in said
    assert "f.toml:6: unknown key 'unit.1.replai'. Did you mean 'replay'?" in said


def test_paths_in_a_federations_file_are_relative_to_it(tmp_path: Path) -> None:
    path = _written(
        tmp_path / "f.toml", 'name = "f"\nroster = "keys/roster.toml"\n[unit.0]\nreplay = "a.tlog"\nfrom = "5s"'
    )
    found = load({"federation": str(path)}, None)
    assert found.roster == tmp_path / "keys/roster.toml"
    assert found.by_unit["0"].replay == tmp_path / "a.tlog"
    assert found.by_unit["0"].from_ == "5s"


def test_a_platform_has_one_vehicle(tmp_path: Path) -> None:
    path = _written(tmp_path / "f.toml", 'name = "f"\n[unit.0]\nreplay = "a.tlog"\nmavlink = "udpin:127.0.0.1:14550"')
    with pytest.raises(WrongCall, match=r"\[unit\.0\] has both"):
        read_federation(path)


@pytest.mark.parametrize("name", ["Alpha", "a/b", "", "*", "@df", "x" * 65, "-a"])
def test_a_federation_has_a_name_that_can_be_one_chunk_of_a_key(name: str) -> None:
    with pytest.raises(WrongCall, match="--federation"):
        load({"federation": name}, None)


def test_a_file_that_is_not_there_is_told_by_its_path() -> None:
    with pytest.raises(WrongCall, match=r"nowhere\.toml: cannot be read"):
        load({"federation": "nowhere.toml"}, None)


def test_the_file_of_options_has_the_keys_of_a_federations_file(tmp_path: Path) -> None:
    config = _written(tmp_path / "c.toml", 'journal = "flights"\n[clock]\nspeed = 4.0\n[unit.1]\npersona = "px4"')
    settings = load({}, config)
    assert (settings.speed, settings.by_unit["1"].persona, settings.journal) == (4.0, "px4", Path("flights"))


def test_a_federations_file_names_its_own_federation(tmp_path: Path) -> None:
    path = _written(tmp_path / "f.toml", 'name = "f"\nfederation = "g"')
    with pytest.raises(WrongCall, match="unknown key 'federation'"):
        load({"federation": str(path)}, None)


def test_one_module_or_endpoint_of_a_platform_needs_no_list(tmp_path: Path) -> None:
    file = tmp_path / "one.toml"
    file.write_text('name = "one"\n[unit.5]\nunits = "gas.py"\nconnect = "tcp/127.0.0.1:7447"\n', encoding="utf-8")
    (own,) = load({"federation": str(file)}, None).by_unit.values()
    assert own.modules == (str(tmp_path / "gas.py"),)
    assert own.connect == ("tcp/127.0.0.1:7447",)
