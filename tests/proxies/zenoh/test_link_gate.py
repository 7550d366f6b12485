"""The gate that reads the roster again: a file that cannot be used is reported, and the roster before it is kept."""

import queue
import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any, NamedTuple

import pytest

from dyknow.federation.security.tls import LINKS, SESSIONS, authority_certificate, platform_certificate, tls_key
from dyknow.federation.security.trust import Roster, RosterMember
from dyknow.federation.transport import CertificateEnds, HandlerFailed, RosterKept, RosterRead
from dyknow.proxies.zenoh import link_gate
from dyknow.proxies.zenoh.link_gate import LinkGate

NOW_US = 1_700_000_000_000_000
DAY_US = 86_400_000_000
ROSTER = Roster({"0": RosterMember("0", b"k" * 32), "3": RosterMember("3", b"m" * 32)}, "fed", "0123456789abcdef", 3)


@pytest.fixture
def ends_days() -> float:
    """How long our certificate is good."""
    return 365.0


@pytest.fixture
def gate(tmp_path: Path, ends_days: float) -> Iterator[Callable[..., "queue.Queue[Any]"]]:
    authority_key, own_key = tls_key(b"a" * 48), tls_key(b"b" * 48)
    authority = authority_certificate(authority_key, "test", NOW_US)
    certificate = tmp_path / "certificate.pem"
    certificate.write_bytes(platform_certificate("0", own_key, authority_key, authority, NOW_US, days=ends_days))
    (tmp_path / "roster.toml").write_text(str(ROSTER))
    opened: list[LinkGate] = []

    def watching(links: Callable[[], Any] = list) -> "queue.Queue[Any]":
        posted: queue.Queue[Any] = queue.Queue()
        opened.append(LinkGate(tmp_path / "roster.toml", certificate, links, list, posted.put, lambda: NOW_US))
        return posted

    yield watching
    for each in opened:
        each.close()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("[3\n", "the roster is not TOML"),
        (str(replace(ROSTER, generation=2)), "its generation 2 is not later than 3"),
        (str(replace(ROSTER, members={}, generation=3)), "its generation 3 is not later than 3"),
        (str(replace(ROSTER, identity="f" * 16, generation=9)), "another federation"),
    ],
    ids=["torn", "older", "changed by hand", "another"],
)
def test_a_roster_that_cannot_be_used_is_reported_and_the_next_one_is_read(
    gate: Callable[..., "queue.Queue[Any]"], tmp_path: Path, text: str, why: str
) -> None:
    posted = gate()
    (tmp_path / "roster.toml").write_text(text)
    kept = posted.get(timeout=20.0)
    assert isinstance(kept, RosterKept)
    assert why in kept.why
    (tmp_path / "roster.toml").write_text(str(replace(ROSTER, generation=4)))
    assert isinstance(posted.get(timeout=20.0), RosterRead)


def test_a_gate_whose_look_fails_says_so_and_looks_again(gate: Callable[..., "queue.Queue[Any]"]) -> None:
    looked: queue.Queue[int] = queue.Queue()

    def links() -> list[Any]:
        looked.put(1)
        if looked.qsize() == 1:
            raise OSError("too many open files")
        return []

    failed = gate(links).get(timeout=20.0)
    assert isinstance(failed, HandlerFailed)
    assert "too many open files" in failed.error
    for _ in range(3):
        looked.get(timeout=20.0)


@pytest.mark.parametrize(("ends_days", "is_announced"), [(0.99, True), (1.01, False)])
def test_the_end_of_our_certificate_is_announced_a_day_ahead_and_once(
    gate: Callable[..., "queue.Queue[Any]"], ends_days: float, is_announced: bool
) -> None:
    looked: queue.Queue[int] = queue.Queue()

    def links() -> list[Any]:
        looked.put(1)
        return []

    posted = gate(links)
    for _ in range(3):
        looked.get(timeout=20.0)
    ends_us = NOW_US + round(ends_days * DAY_US)
    found = [posted.get_nowait() for _ in range(posted.qsize())]
    assert found == ([CertificateEnds(ends_us, NOW_US)] if is_announced else [])


class Links:
    """Connections over loopback, as the listening side has them: the gate shuts their sockets down."""

    def __init__(self) -> None:
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.sockets: list[tuple[Any, socket.socket, socket.socket]] = []

    def __call__(self) -> list[Any]:
        return [link for link, near, _ in self.sockets if near.fileno() >= 0]

    def add(self, name: str) -> Any:
        far = socket.create_connection(self.listener.getsockname())
        near, _ = self.listener.accept()
        far.setblocking(False)
        here, there = ("tls/{}:{}".format(*end) for end in (near.getsockname(), near.getpeername()))
        self.sockets.append((SimpleNamespace(auth_identifier=name, src=here, dst=there), near, far))
        return self.sockets[-1][0]

    def open(self) -> list[int]:
        """Which of them are open, by their numbers."""
        found = []
        for number, (_, _, far) in enumerate(self.sockets):
            try:
                is_open = far.recv(1) != b""
            except BlockingIOError:
                is_open = True
            found += [number] if is_open else []
        return found


@pytest.fixture
def linked() -> Iterator[Links]:
    links = Links()
    yield links
    for _, near, far in links.sockets:
        near.close()
        far.close()
    links.listener.close()


def test_the_oldest_links_of_one_certificate_are_closed_bit_by_bit_and_those_of_others_stay(
    gate: Callable[..., "queue.Queue[Any]"], linked: Links
) -> None:
    most = LINKS["uav"]
    for _ in range(5):
        linked.add("0")
    for _ in range(most + 5):
        linked.add("3")
    posted = gate(linked)
    for _ in range(5):
        closed = posted.get(timeout=20.0)
        assert (closed.name, closed.surplus) == ("3", True)
    assert linked.open() == [*range(5), *range(10, 10 + most)]
    linked.add("3")
    posted.get(timeout=20.0)
    assert linked.open() == [*range(5), *range(11, 11 + most)], "a new one is admitted, the oldest ends"
    assert posted.empty()


@pytest.mark.parametrize("seed", range(4))
def test_while_places_are_scarce_all_surplus_is_closed_at_the_next_link_whatever_member_it_is_of(
    gate: Callable[..., "queue.Queue[Any]"], linked: Links, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """The gate does not look of its own here: what is closed is closed at the event."""
    random = Random(seed)
    most = LINKS["uav"]
    places = random.randrange(2 * most + 2, 4 * most)
    monkeypatch.setattr(link_gate, "RESERVED", SESSIONS - places)
    monkeypatch.setattr(link_gate, "CLOSED_AT_ONCE", 0)
    made: list[LinkGate] = []

    def look(one: LinkGate) -> None:
        made.append(one)

    monkeypatch.setattr(LinkGate, "look", look)
    posted = gate(list)
    while not made:
        threading.Event().wait(0.01)
    names = ["3"] * (places - 1) + ["0"]
    random.shuffle(names)
    for name in names:
        made[0].on_link(linked.add(name))
    assert len(linked.open()) == places, "there is room"
    assert posted.empty()
    made[0].on_link(linked.add("0"))
    of_three = [number for number, name in enumerate([*names, "0"]) if name == "3"]
    of_others = [number for number, name in enumerate([*names, "0"]) if name != "3"]
    assert linked.open() == sorted([*of_others, *of_three[-most:]]), "the newest stay"
    assert posted.qsize() == len(of_three) - most
    for _ in range(random.randrange(1, 6)):
        made[0].on_link(linked.add("3"))
    assert {*linked.open()} >= {*of_others}


class Denied(NamedTuple):
    """A link whose certificate no roster has; there is no socket of these ends."""

    zid: str
    src: str = "tls/127.0.0.1:1"
    dst: str = "tls/127.0.0.1:2"
    auth_identifier: str = "stranger"


@pytest.mark.parametrize("seed", range(20))
def test_a_put_waits_for_the_ends_of_denied_transports_and_never_longer_than_half_of_the_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """Drawn: sessions dial and end, or stay; time passes where a put sleeps."""
    rng, now_s = Random(seed), 0.0
    ends_s: dict[str, float] = {}

    def sleep(for_s: float) -> None:
        nonlocal now_s
        now_s += for_s

    def there() -> list[str]:
        return [zid for zid, end_s in ends_s.items() if end_s > now_s]

    monkeypatch.setattr(link_gate.threading.Thread, "start", lambda _: None)
    monkeypatch.setattr(link_gate.threading.Thread, "join", lambda _: None)
    monkeypatch.setattr(link_gate, "time", SimpleNamespace(monotonic=lambda: now_s, sleep=sleep))
    authority = authority_certificate(tls_key(b"a" * 48), "test", NOW_US)
    certificate = tmp_path / "certificate.pem"
    certificate.write_bytes(
        platform_certificate("0", tls_key(b"b" * 48), tls_key(b"a" * 48), authority, NOW_US, days=365)
    )
    (tmp_path / "roster.toml").write_text(str(ROSTER))
    gate = LinkGate(
        tmp_path / "roster.toml",
        certificate,
        lambda: [Denied(zid) for zid in there()],
        there,
        lambda _: None,
        lambda: 0,
    )
    waited_s = 0.0
    for _ in range(300):
        now_s += rng.expovariate(100)
        if rng.random() < 0.5:
            zid = str(rng.randrange(5))
            ends_s[zid] = now_s + rng.choice([0.002, 0.01, 0.15])
            gate.on_transport(zid)
        begun_s, (left_s, at_s) = now_s, gate._may_wait
        left_s = min(0.1, left_s + (begun_s - at_s) / 2)
        gate.wait()
        waited_s += now_s - begun_s
        assert now_s - begun_s <= left_s + 0.001
        assert not there() or now_s - begun_s >= left_s
    assert 0.0 < waited_s <= 0.1 + now_s / 2 + 300 * 0.0005
    now_s += 1.0
    gate._have_ended()
    assert not gate._ending
