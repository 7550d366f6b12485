import socket
import types
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, suppress

import pytest

from dyknow.console.commands.fleet import doctor
from dyknow.proxies.mavlink.endpoints import parse_endpoint
from dyknow.proxies.mavlink.links import UdpLink
from dyknow.runtime.configuration.config import MavlinkVehicle
from tests.proxies.vehicle import Wire, heartbeat, position


def test_the_package_of_ours_is_ours_here() -> None:
    assert [found.state for found in doctor._names()] == ["ok"]


def test_another_distribution_with_files_in_our_package_is_named_with_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    both = types.SimpleNamespace(packages_distributions=lambda: {"dyknow": ["dyknow-federation", "dyknow-other"]})
    monkeypatch.setattr(doctor, "metadata", both)
    [found] = doctor._names()
    assert (found.finding, found.state) == ("package dyknow", "missing")
    assert "dyknow-other" in found.detail
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
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        found = doctor._port("udp", socket.SOCK_DGRAM, taken.getsockname()[1])
    assert found.state == "optional"
    assert "udpin" in found.remedy


def test_a_vehicle_that_speaks_is_heard_and_one_that_does_not_is_waited_for_with_a_page_to_read() -> None:
    silent = doctor.vehicle_heard(MavlinkVehicle(endpoint="udpin:127.0.0.1:0"), within_s=0.1)
    assert (silent.state, silent.detail) == ("missing", "waiting for a HEARTBEAT at udpin:127.0.0.1:0")
    assert "docs/mavlink.md" in silent.remedy
    with closing(socket.create_server(("127.0.0.1", 0))) as server, ThreadPoolExecutor() as pool:
        host, port = server.getsockname()
        found = pool.submit(doctor.vehicle_heard, MavlinkVehicle(endpoint=f"tcp:{host}:{port}"), 30.0)
        connection, _ = server.accept()
        wire = Wire((host, port))
        with suppress(OSError):  # it has heard enough, and closes its end
            while not found.done():
                connection.sendall(wire.bytes_of(heartbeat()) + wire.bytes_of(position(1000)))
                connection.recv(65_535)
        assert found.result()[1:3] == ("ok", "hears system 1, ArduCopter, MAVLink 2")
        connection.close()
        wire.close()


def test_an_endpoint_that_a_platform_has_says_where_to_look() -> None:
    with closing(UdpLink(parse_endpoint("udpin:127.0.0.1:0"))) as held:
        found = doctor.vehicle_heard(MavlinkVehicle(endpoint=f"udpin:127.0.0.1:{held.address[1]}"))
    assert found.state == "missing"
    assert "dyknow ls" in found.remedy
