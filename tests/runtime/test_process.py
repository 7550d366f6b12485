"""A federation without a roster, or without TLS, stays on loopback unless more is allowed, and notes what it lacks."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from dyknow.model.errors import RosterError
from dyknow.runtime.configuration.config import NodeConfig, TrustConfig, WireConfig
from dyknow.runtime.configuration.session import reaches_beyond, unprotected
from dyknow.runtime.process import PlatformProcess
from dyknow.runtime.vehicles import Vehicle


@pytest.mark.parametrize(
    ("wire", "beyond"),
    [
        (WireConfig(), ""),
        (WireConfig(listen=("tcp/127.0.0.1:0",), discover="none"), ""),
        (WireConfig(listen=("tcp/[::1]:7447",), connect=("tcp/localhost:7448",)), ""),
        (WireConfig(listen=("tcp/0.0.0.0:7447",)), "tcp/0.0.0.0:7447"),
        (WireConfig(connect=("tcp/router:7447",)), "tcp/router:7447"),
        (WireConfig(connect=("tcp/127.0.0.1.example:7447",)), "tcp/127.0.0.1.example:7447"),
        (WireConfig(connect=("tcp/127.1.2.3:7447", "tcp/[::ffff:10.0.0.1]:7447")), "tcp/[::ffff:10.0.0.1]:7447"),
        (WireConfig(interface="eth0"), "eth0"),
        (WireConfig(interface="eth0", listen=("tcp/127.0.0.1:0",), discover="none"), ""),
    ],
)
def test_what_lies_beyond_loopback_is_named(wire: WireConfig, beyond: str) -> None:
    assert reaches_beyond(wire) == beyond


def test_a_platform_starts_without_scipy() -> None:
    code = "import sys, dyknow.runtime.node, dyknow.runtime.hosts, dyknow.sim_uavs; sys.exit('scipy' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_an_open_federation_is_refused_beyond_loopback_with_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DYKNOW_OPEN", raising=False)
    said: list[dict[str, Any]] = []
    config = NodeConfig(unit="0", wire=WireConfig(listen=("tcp/0.0.0.0:7447",)))
    process = PlatformProcess(config, lambda _ports: Vehicle(), said.append)
    with pytest.raises(RosterError, match="dyknow roster init"):
        process.run()
    assert said == []


@pytest.mark.parametrize("beyond", [WireConfig(interface="eth0"), WireConfig(connect=("tcp/router:7447",))])
def test_a_roster_without_tls_is_refused_beyond_loopback(
    beyond: WireConfig, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("DYKNOW_OPEN", raising=False)
    trust = TrustConfig(roster=tmp_path / "roster.toml", key=tmp_path / "0.key")
    process = PlatformProcess(
        NodeConfig(unit="0", wire=beyond, trust=trust), lambda _ports: Vehicle(), lambda _said: None
    )
    with pytest.raises(RosterError, match=r"forge positions.*mutual TLS"):
        process.run()


@pytest.mark.parametrize(
    ("wire", "has_roster", "lacking"),
    [
        (WireConfig(), False, "acts are not signed"),
        (WireConfig(), True, "samples, heartbeats and clocks can be forged and read"),
        (WireConfig(security=Path("0.wire.json")), True, None),
    ],
)
def test_one_line_says_what_is_not_protected(wire: WireConfig, has_roster: bool, lacking: str | None) -> None:
    found = unprotected(wire, has_roster=has_roster)
    assert (found is None) == (lacking is None)
    assert found is None or (lacking or "") in found.note
