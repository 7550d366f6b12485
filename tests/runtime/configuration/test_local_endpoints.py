"""The endpoint on loopback that a platform with TLS has for the programs of its machine."""

import os
import socket
from pathlib import Path

import psutil
import pytest

from dyknow.proxies.zenoh.configuration import ZenohOptions, zenoh_config
from dyknow.runtime.configuration import local_endpoints
from dyknow.runtime.configuration.config import WireConfig
from dyknow.runtime.configuration.local_endpoints import dialled, noted_local, with_local_endpoint
from dyknow.runtime.configuration.run_directory import JOINED, ProcessState, Running, write_state

SECURED = WireConfig(listen=("tls/192.168.1.10:7447",), security=Path("0.wire.json"))
ALIVE = Running("0", os.getpid(), psutil.Process().create_time())
LAN, HERE = "tls/192.168.1.10:7447", "tls/127.0.0.1:7447"


@pytest.fixture(autouse=True)
def _nothing_given(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_endpoints, "_GIVEN", set())


def test_its_port_is_that_of_an_endpoint_of_a_network_so_a_restart_keeps_it() -> None:
    assert with_local_endpoint(SECURED).local == HERE
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        other = with_local_endpoint(SECURED.model_copy(update={"listen": (f"tls/192.168.1.10:{port}",)})).local
    assert other not in {None, f"tls/127.0.0.1:{port}"}, "taken"
    second = with_local_endpoint(SECURED.model_copy(update={"listen": ("tls/192.168.1.11:7447",)})).local
    assert second not in {None, HERE}, "that of another platform"


@pytest.mark.parametrize("listen", ["tls/127.0.0.1:7447", "tls/localhost:7447", "tls/0.0.0.0:7447", "tls/[::]:7447"])
def test_where_others_are_met_on_loopback_too_it_has_a_port_of_its_own(listen: str) -> None:
    local = with_local_endpoint(SECURED.model_copy(update={"listen": (listen,)})).local
    assert local is not None
    assert local.startswith("tls/127.0.0.1:")
    assert not local.endswith(":7447")


@pytest.mark.parametrize(
    "wire", [WireConfig(), WireConfig(listen=("tcp/192.168.1.10:7447",)), SECURED.model_copy(update={"listen": ()})]
)
def test_without_tls_or_an_endpoint_that_others_dial_there_is_none(wire: WireConfig) -> None:
    assert with_local_endpoint(wire) == wire


def test_it_is_listened_at_next_to_the_others() -> None:
    options = ZenohOptions(listen=(LAN,), local=HERE)
    assert zenoh_config(options, lambda _: "")["listen"]["endpoints"] == [LAN, HERE]


def test_programs_dial_the_platforms_of_their_machine_there_and_others_where_they_are(tmp_path: Path) -> None:
    elsewhere = "tls/192.168.1.11:7447"
    assert dialled(tmp_path, (LAN, elsewhere)) == (LAN, elsewhere)
    local = noted_local([with_local_endpoint(SECURED)])
    file = write_state(tmp_path / JOINED, ProcessState((ALIVE,), local=local), "0.json")
    assert dialled(tmp_path, (LAN, elsewhere)) == (HERE, elsewhere)
    file.unlink()
    write_state(tmp_path, ProcessState((ALIVE,), (LAN,), local))
    assert dialled(tmp_path, (LAN, elsewhere)) == (HERE, elsewhere)
    write_state(tmp_path, ProcessState((ALIVE._replace(started=1.0),), (LAN,), local))
    assert dialled(tmp_path, (LAN, elsewhere)) == (LAN, elsewhere), "that platform has ended"
