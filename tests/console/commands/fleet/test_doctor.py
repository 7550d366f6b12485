import sys
import types
from pathlib import Path

import pytest

from console.commands.fleet import doctor


def test_packages_of_ours_are_ours_here() -> None:
    assert [found.state for found in doctor._names()] == ["ok"]


def test_a_foreign_package_under_one_of_our_names_is_named_with_a_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    foreign = tmp_path / "agents"
    foreign.mkdir()
    (foreign / "__init__.py").write_text("")
    monkeypatch.delitem(sys.modules, "agents", raising=False)
    monkeypatch.syspath_prepend(str(tmp_path))
    [found] = doctor._names()
    assert (found.finding, found.state) == ("package agents", "missing")
    assert str(tmp_path) in found.detail
    assert found.remedy


def test_a_package_that_is_too_old_is_told_with_the_command_that_mends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    old = types.SimpleNamespace(
        requires=lambda _name: [
            "rich>=999",
            "typer>=0.15",
            "nobody-has-this>=1; python_version > '3'",
            "x>=1; extra == 'dev'",
        ],
        version=lambda name: {"rich": "15.0.0", "typer": "0.29.2"}[name],
        PackageNotFoundError=KeyError,
    )
    monkeypatch.setattr(doctor, "metadata", old)
    found = list(doctor._packages())
    assert [(f.finding, f.state) for f in found] == [
        ("package rich", "missing"),
        ("package nobody-has-this", "missing"),
    ]
    assert found[0].remedy == "pip install 'rich>=999'"


def test_a_misspelt_variable_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DYKNOW_FEDERATON", "x")
    assert any("DYKNOW_FEDERATION" in found.remedy for found in doctor._variables())


def test_a_port_in_use_is_no_fault_but_has_a_remedy() -> None:
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        found = doctor._port("udp", socket.SOCK_DGRAM, taken.getsockname()[1])
    assert found.state == "optional"
    assert "udpin" in found.remedy
