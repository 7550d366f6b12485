"""Sockets to programs that are absent, slow or gone: nothing waits, what is lost is counted."""

import socket
import time

import pytest

from dyknow.model.errors import TextError, WrongCall
from dyknow.proxies.outward.outlets import AGAIN_US, MOST_PER_S, MOST_WAITING, Destination, Outlet, parse_destination

S = 1_000_000


@pytest.mark.parametrize(
    "text", ["udp:127.0.0.1:1", "udp://127.0.0.1", "udp://host:1", "http://127.0.0.1:1", "udp://1.2.3:70000"]
)
def test_what_is_no_destination_is_refused_with_one_that_is(text: str) -> None:
    with pytest.raises(TextError, match=r"127\.0\.0\.1"):
        parse_destination(text, beyond=True)


@pytest.mark.parametrize(
    "text", ["udp://10.0.0.1:1", "tcp://[2001:db8::1]:1", "udp://0.0.0.0:1", "udp://239.2.3.1:6969"]
)
def test_other_machines_are_refused_unless_that_is_asked_for(text: str) -> None:
    with pytest.raises(WrongCall, match="--beyond-this-machine"):
        parse_destination(text, beyond=False)
    assert str(parse_destination(text, beyond=True)) == text


def test_datagrams_that_nothing_takes_are_counted() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
    outlet = Outlet(Destination("udp", "127.0.0.1", port))
    for at in range(10):
        outlet.send(b"x", at * S)
        time.sleep(0.01)
    assert outlet.lost + outlet.counts["sent"] == 10
    assert outlet.counts["connection refused"] >= 4
    assert outlet.trouble or outlet.counts["sent"]
    outlet.close()


def test_no_more_than_a_rate_is_sent() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
        end.bind(("127.0.0.1", 0))
        outlet = Outlet(Destination("udp", *end.getsockname()))
        for _ in range(MOST_PER_S + 100):
            outlet.send(b"x", S)
        assert outlet.counts["too many"] == 100
        outlet.send(b"x", 2 * S)
        assert outlet.counts["too many"] == 100
        outlet.close()


def test_a_connection_that_is_refused_broken_or_slow_is_made_again_and_messages_arrive_whole() -> None:
    server = socket.create_server(("127.0.0.1", 0))
    at = server.getsockname()
    server.close()
    outlet = Outlet(Destination("tcp", *at))
    now_us = S
    outlet.send(b"<1/>", now_us)
    outlet.on_time(now_us)
    server = socket.create_server(at)
    for _ in range(3):
        now_us += AGAIN_US
        outlet.on_time(now_us)
        time.sleep(0.01)
    taken, _ = server.accept()
    assert taken.recv(100) == b"<1/>"
    taken.close()
    for _ in range(5):
        now_us += AGAIN_US
        outlet.send(b"<2/>", now_us)
        time.sleep(0.01)
    taken, _ = server.accept()
    assert taken.recv(100).startswith(b"<2/>")
    block = b"x" * 100_000
    for _ in range(100):
        now_us += S // 100
        outlet.send(block, now_us)
    assert outlet._bytes <= MOST_WAITING
    assert outlet.counts["too slow"] > 50
    taken.close()
    server.close()
    outlet.close()
    assert outlet.counts["sent"] + outlet.lost == 106
