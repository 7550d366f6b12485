"""Why nothing comes from an endpoint, by sockets that listen, or do not."""

import socket
import ssl
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from threading import Thread

import pytest

from dyknow.federation.security.tls import authority_certificate, platform_certificate, tls_key
from dyknow.proxies.zenoh.reachability import unreachable


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        yield listening


def port_of(listener: socket.socket) -> int:
    return int(listener.getsockname()[1])


def served(listener: socket.socket, context: ssl.SSLContext | None) -> Thread:
    """Take one caller, in TLS if there is a context; what else it says is answered by hanging up."""

    def serve() -> None:
        link, _ = listener.accept()
        with link, suppress(OSError):
            if context is None:
                link.recv(1)
            else:
                context.wrap_socket(link, server_side=True).close()

    thread = Thread(target=serve)
    thread.start()
    return thread


@pytest.fixture
def with_tls(tmp_path: Path) -> ssl.SSLContext:
    authority_key, own_key = tls_key(b"a" * 48), tls_key(b"b" * 48)
    authority = authority_certificate(authority_key, "test", 1_700_000_000_000_000)
    own = platform_certificate("0", own_key, authority_key, authority, 1_700_000_000_000_000)
    (tmp_path / "key.pem").write_bytes(own_key)
    (tmp_path / "certificate.pem").write_bytes(own)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(tmp_path / "certificate.pem", tmp_path / "key.pem")
    return context


def test_a_port_where_nothing_listens_is_named(listener: socket.socket) -> None:
    port = port_of(listener)
    listener.close()
    assert unreachable([f"tcp/127.0.0.1:{port}"]) == [
        f"connection refused by tcp/127.0.0.1:{port}: nothing listens there"
    ]


def test_a_host_that_there_is_not_is_named() -> None:
    (why,) = unreachable(["tcp/no-such-host.invalid:7447"])
    assert why.startswith("tcp/no-such-host.invalid:7447 cannot be reached (")


@pytest.mark.parametrize("protocol", ["tcp", "tls"])
def test_an_endpoint_that_speaks_the_protocol_is_no_trouble(
    listener: socket.socket, with_tls: ssl.SSLContext, protocol: str
) -> None:
    thread = served(listener, with_tls if protocol == "tls" else None)
    assert unreachable([f"{protocol}/127.0.0.1:{port_of(listener)}"]) == []
    thread.join()


@pytest.mark.parametrize(("asked", "spoken"), [("tcp", "tls"), ("tls", "tcp")])
def test_an_endpoint_of_another_protocol_is_said_to_be(
    listener: socket.socket, with_tls: ssl.SSLContext, asked: str, spoken: str
) -> None:
    place = f"127.0.0.1:{port_of(listener)}"
    thread = served(listener, with_tls if spoken == "tls" else None)
    (why,) = unreachable([f"{asked}/{place}"])
    thread.join()
    assert why.startswith(f"{asked}/{place} does not speak {asked}: write {spoken}/{place}")
    assert ("--roster" in why) is (spoken == "tls")


def test_a_certificate_for_another_address_is_said_to_be(with_tls: ssl.SSLContext) -> None:
    """The one of this listener is for 127.0.0.1 and localhost; 127.0.0.2 reaches the same machine."""
    with socket.create_server(("127.0.0.2", 0)) as other:
        thread = served(other, with_tls)
        endpoint = f"tls/127.0.0.2:{port_of(other)}"
        assert unreachable([endpoint]) == [
            f"the certificate at {endpoint} is for 127.0.0.1, localhost: dyknow roster add --host"
        ]
        thread.join()


def test_what_cannot_be_tried_out_is_not_judged() -> None:
    assert unreachable(["udp/127.0.0.1:7447", "unixsock-stream//tmp/socket"]) == []
