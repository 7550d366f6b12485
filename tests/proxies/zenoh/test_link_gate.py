"""The gate that reads the roster again: a file that cannot be used is reported, and the roster before it is kept."""

import queue
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from federation.security.tls import authority_certificate, platform_certificate, tls_key
from federation.security.trust import Roster, RosterMember
from federation.transport import HandlerFailed, RosterKept, RosterRead
from proxies.zenoh.link_gate import LinkGate

NOW_US = 1_700_000_000_000_000
ROSTER = Roster({"0": RosterMember("0", b"k" * 32), "3": RosterMember("3", b"m" * 32)}, "fed", "0123456789abcdef", 3)


@pytest.fixture
def gate(tmp_path: Path) -> Iterator[Callable[..., "queue.Queue[Any]"]]:
    authority_key, own_key = tls_key(b"a" * 48), tls_key(b"b" * 48)
    authority = authority_certificate(authority_key, "test", NOW_US)
    certificate = tmp_path / "certificate.pem"
    certificate.write_bytes(platform_certificate("0", own_key, authority_key, authority, NOW_US))
    (tmp_path / "roster.toml").write_text(str(ROSTER))
    opened: list[LinkGate] = []

    def watching(links: Callable[[], Any] = list) -> "queue.Queue[Any]":
        posted: queue.Queue[Any] = queue.Queue()
        opened.append(LinkGate(tmp_path / "roster.toml", certificate, links, posted.put, lambda: NOW_US))
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
