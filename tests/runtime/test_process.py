"""A federation without a roster stays on loopback unless somebody allows more, and says that it is open."""

from typing import Any

import pytest

from dyknow.model.errors import RosterError
from runtime.configuration.config import NodeConfig, WireConfig
from runtime.configuration.session import reaches_beyond
from runtime.process import PlatformProcess
from runtime.vehicles import Vehicle


@pytest.mark.parametrize(
    ("wire", "beyond"),
    [
        (WireConfig(), ""),
        (WireConfig(listen=("tcp/127.0.0.1:0",), discover="none"), ""),
        (WireConfig(listen=("tcp/[::1]:7447",), connect=("tcp/localhost:7448",)), ""),
        (WireConfig(listen=("tcp/0.0.0.0:7447",)), "tcp/0.0.0.0:7447"),
        (WireConfig(connect=("tcp/router:7447",)), "tcp/router:7447"),
        (WireConfig(interface="eth0"), "eth0"),
        (WireConfig(interface="eth0", listen=("tcp/127.0.0.1:0",), discover="none"), ""),
    ],
)
def test_what_lies_beyond_loopback_is_named(wire: WireConfig, beyond: str) -> None:
    assert reaches_beyond(wire) == beyond


def test_an_open_federation_is_refused_beyond_loopback_with_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DYKNOW_OPEN", raising=False)
    said: list[dict[str, Any]] = []
    config = NodeConfig(unit="0", wire=WireConfig(listen=("tcp/0.0.0.0:7447",)))
    process = PlatformProcess(config, lambda _ports: Vehicle(), said.append)
    with pytest.raises(RosterError, match="dyknow roster init"):
        process.run()
    assert said == []
