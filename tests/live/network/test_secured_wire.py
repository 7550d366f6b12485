"""Real Zenoh with certificates and access control: a unit speaks, streams and lives under its own name only."""

import json
import secrets
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from queue import Empty, SimpleQueue

import pytest
import zenoh

from dyknow.federation import keys
from dyknow.federation.security.tls import (
    Paths,
    authority_certificate,
    platform_certificate,
    tls_key,
    zenoh_security_config,
)
from dyknow.federation.security.trust import Roster, RosterMember
from dyknow.proxies.zenoh.configuration import ZenohOptions, zenoh_config

pytestmark = pytest.mark.live
PATIENCE_S = 20.0
UNITS = ["uav0", "uav1", "uav2", "cc"]


class Federation:
    """A roster with its certificates in a directory, and sessions that are closed at the end."""

    def __init__(self, directory: Path) -> None:
        self.directory, self.name = directory, f"secured-{secrets.token_hex(4)}"
        key = bytes(32)
        self.roster = Roster(
            {unit: RosterMember(unit, key, "command-centre" if unit == "cc" else "uav") for unit in UNITS}
        )
        self.sessions: list[zenoh.Session] = []
        now_us = time.time_ns() // 1000
        authority_key = tls_key(secrets.token_bytes(48))
        authority = authority_certificate(authority_key, "test authority", now_us)
        (directory / "ca.pem").write_bytes(authority)
        for unit in [*UNITS, "stranger"]:
            own_key = tls_key(secrets.token_bytes(48))
            (directory / f"{unit}.key").write_bytes(own_key)
            (directory / f"{unit}.pem").write_bytes(
                platform_certificate(unit, own_key, authority_key, authority, now_us)
            )
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.endpoint = f"tls/127.0.0.1:{probe.getsockname()[1]}"

    def open(self, unit: str, *, roster: Roster | None = None) -> zenoh.Session:
        paths = Paths(*(str(self.directory / name) for name in ("ca.pem", f"{unit}.pem", f"{unit}.key")))
        security = zenoh_security_config(roster or self.roster, unit, paths, self.name)
        listens = unit == "uav0"
        options = ZenohOptions(
            federation=self.name,
            listen=(self.endpoint,) if listens else ("tls/127.0.0.1:0",),
            connect=() if listens else (self.endpoint,),
            discover="none",
            security=security,
        )
        session = zenoh.open(zenoh.Config.from_json5(json.dumps(zenoh_config(options, lambda _: "127.0.0.1"))))
        self.sessions.append(session)
        return session


@pytest.fixture
def federation(tmp_path: Path) -> Iterator[Federation]:
    made = Federation(tmp_path)
    yield made
    for session in reversed(made.sessions):
        session.close()


def subscribe(session: zenoh.Session, key_expr: str) -> SimpleQueue[str]:
    heard: SimpleQueue[str] = SimpleQueue()
    session.declare_subscriber(key_expr, lambda sample: heard.put(str(sample.key_expr)))
    return heard


def say_until_heard(session: zenoh.Session, key: str, heard: SimpleQueue[str]) -> list[str]:
    """Put on `key` until it arrives; returns all that was heard until then."""
    found: list[str] = []
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        session.put(key, b"x")
        try:
            while True:
                found.append(heard.get(timeout=0.1))
                if found[-1] == key:
                    return found
        except Empty:
            continue
    raise AssertionError(f"{key} never arrived; heard {found}")


def test_an_own_act_passes_and_one_under_a_foreign_name_is_dropped(federation: Federation) -> None:
    uav0 = federation.open("uav0")
    acts, streams, tokens = subscribe(uav0, keys.inbox("uav0")), subscribe(uav0, "x/**"), SimpleQueue[str]()
    uav0.liveliness().declare_subscriber(keys.TOKENS, lambda sample: tokens.put(str(sample.key_expr)), history=True)
    uav1 = federation.open("uav1")
    say_until_heard(uav1, keys.act("uav0", "uav1", "ready"), acts)

    for foreign in [keys.act("uav0", "uav2", "interface"), keys.act("uav0", "cc", "interface"), "acl/*/uav1/**", "**"]:
        uav1.put(foreign, b"forged")
    uav1.put(keys.stream("uav2", "battery", "ab12cd34"), b"forged")
    uav1.put(keys.stream("uav1", "battery", "ab12cd34"), b"own")
    forged = uav1.liveliness().declare_token(keys.token_platform("ab", "uav2", "uav", 1))
    own = uav1.liveliness().declare_token(keys.token_platform("ab", "uav1", "uav", 1))

    heard = say_until_heard(uav1, keys.act("uav0", "uav1", "end"), acts)
    assert set(heard) <= {keys.act("uav0", "uav1", "ready"), keys.act("uav0", "uav1", "end"), "acl/*/uav1/**"}
    assert keys.parse_key("acl/*/uav1/**") is None, "a wildcard that may pass is no key of ours"
    assert streams.get(timeout=PATIENCE_S) == keys.stream("uav1", "battery", "ab12cd34")
    assert streams.empty()
    assert tokens.get(timeout=PATIENCE_S) == keys.token_platform("ab", "uav1", "uav", 1)
    assert tokens.empty()
    del forged, own


def test_a_command_centre_speaks_with_the_number_of_its_process(federation: Federation) -> None:
    acts = subscribe(federation.open("uav0"), keys.inbox("uav0"))
    centre = federation.open("cc")
    say_until_heard(centre, keys.act("uav0", "cc-4711", "ready"), acts)
    centre.put(keys.act("uav0", "uav1", "interface"), b"forged")
    heard = say_until_heard(centre, keys.act("uav0", "cc-4711", "end"), acts)
    assert keys.act("uav0", "uav1", "interface") not in heard


def test_who_is_not_in_the_roster_is_not_heard_in_spite_of_a_certificate(federation: Federation) -> None:
    acts = subscribe(federation.open("uav0"), keys.inbox("uav0"))
    stranger = federation.open("stranger", roster=federation.roster.added(RosterMember("stranger", bytes(32))))
    until = time.monotonic() + PATIENCE_S
    while not list(stranger.info.peers_zid()) and time.monotonic() < until:
        stranger.put(keys.act("uav0", "stranger", "interface"), b"x")
    for _ in range(20):
        stranger.put(keys.act("uav0", "stranger", "interface"), b"x")
        stranger.put(keys.act("uav0", "uav1", "interface"), b"x")
    heard = say_until_heard(federation.open("uav1"), keys.act("uav0", "uav1", "end"), acts)
    assert set(heard) == {keys.act("uav0", "uav1", "end")}
