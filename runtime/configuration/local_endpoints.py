"""Local endpoints: where programs of a machine reach its platforms, whatever arrives at the endpoints for others.

A listener of TLS takes in about ten connections a second that fail their handshake, one after the other (Zenoh waits
100 ms after each), and no other meanwhile. Each endpoint has a listener of its own. A platform with TLS therefore has
one more on loopback, which no other machine reaches, with the same certificates and the same access control; the run
directory says which platform has which.
"""

import socket
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path

from dyknow.runtime.configuration.config import WireConfig
from dyknow.runtime.configuration.run_directory import joined_states, noted_state, read_state
from dyknow.runtime.configuration.session import host_of

_LOOPBACK = "127.0.0.1"
_GIVEN: set[int] = set()
_EVERYWHERE = ("0.0.0.0", "::", "localhost")  # noqa: S104 - compared with, not listened at


def with_local_endpoint(wire: WireConfig) -> WireConfig:
    """The same with a local endpoint, where TLS is spoken at endpoints that others dial.

    It has the port of the endpoint for others, if that is at an address of a network and the port is free on loopback, so
    that it stays what it was when the platform starts again.
    """
    first = next((each for each in wire.listen if each.startswith("tls/")), None)
    if wire.security is None or first is None:
        return wire
    host, port = host_of(first), first.partition("?")[0].partition("#")[0].rpartition(":")[2]
    is_loopback = host in _EVERYWHERE or host.startswith("127.") or host == "::1"
    number = free_ports(1)[0] if is_loopback or not _is_free(int(port)) else int(port)
    _GIVEN.add(number)
    return wire.model_copy(update={"local": f"tls/{_LOOPBACK}:{number}"})


def noted_local(wires: Iterable[WireConfig]) -> tuple[tuple[str, str], ...]:
    """The endpoints of platforms for the run directory: each endpoint for others with the local one."""
    return tuple((endpoint, wire.local) for wire in wires if wire.local is not None for endpoint in wire.listen)


def dialled(directory: Path, endpoints: tuple[str, ...]) -> tuple[str, ...]:
    """These endpoints, with the local ones for platforms that run on this machine."""
    states = [noted_state(directory), *joined_states(directory).values()]
    if not any(state.local for state in states):
        return endpoints
    endpoints = read_state(directory).dialled(endpoints)
    for state in joined_states(directory).values():
        if state.local and any(found.unit and found.process() is not None for found in state.running):
            endpoints = state.dialled(endpoints)
    return endpoints


def _is_free(port: int) -> bool:
    """Whether nothing listens at that port of loopback, and this process has not given it to another platform."""
    try:
        with socket.create_server((_LOOPBACK, port)):
            return port not in {0, *_GIVEN}
    except (OSError, OverflowError):
        return False


def free_ports(count: int) -> list[int]:
    """Ports of this machine that are free just now, none of them given twice by this process."""
    found: list[int] = []
    with ExitStack() as kept:
        while len(found) < count:
            probe = kept.enter_context(socket.socket(socket.AF_INET, socket.SOCK_STREAM))
            probe.bind((_LOOPBACK, 0))
            if (port := int(probe.getsockname()[1])) not in _GIVEN:
                found.append(port)
    _GIVEN.update(found)
    return found
