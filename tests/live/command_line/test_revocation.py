"""Certificates that are revoked, come back, expire or were never right, against running UAVs with a roster."""

import json
import os
import secrets
import shutil
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import zenoh

from dyknow.federation.messages.codec import decode_samples
from dyknow.federation.security.tls import authority_certificate, platform_certificate, tls_key
from dyknow.proxies.zenoh.configuration import ZenohOptions, zenoh_config
from dyknow.runtime.configuration.config import WireConfig
from dyknow.runtime.configuration.run_directory import STATE_FILE
from dyknow.runtime.configuration.session import wire_options
from tests.live.command_line.command import Dyknow

pytestmark = pytest.mark.live
WITHIN_S = 5.0
PATIENCE_S = 20.0
REDIAL_MS = 50
SESSIONS = 66
REDIALS = 1200 if os.environ.get("DYKNOW_FULL") else 60


class Holder:
    """Who holds a certificate of the roster's folder: a session without a filter of its own that listens to all streams.

    It dials again 50 ms after each end of a link, and takes whatever comes over one before it has said what it listens to.
    """

    def __init__(self, folder: Path, unit: str, federation: str, endpoints: list[str], **files: str) -> None:
        wire = WireConfig(
            federation=federation,
            listen=("tls/127.0.0.1:0",),
            connect=tuple(endpoints),
            discover="none",
            security=folder / f"{unit}.wire.json",
        )
        options = wire_options(wire)
        security: dict[str, Any] = dict(options.security or {})
        for name in ("access_control", "low_pass_filter"):
            security.pop(name, None)
        security["transport"]["link"]["tls"].update(files)
        self.heard: list[tuple[float, str]] = []
        self.steps: dict[str, list[tuple[int, int]]] = defaultdict(list)
        self.dialled = 0
        config = zenoh_config(options, lambda _: "127.0.0.1")
        config["connect"]["retry"] = {"period_init_ms": REDIAL_MS, "period_max_ms": REDIAL_MS}
        self.session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
        self._all = self.session.declare_subscriber(
            "**", lambda sample: self.heard.append((time.monotonic(), str(sample.key_expr)))
        )
        self._streams = self.session.declare_subscriber("x/**", self._take)
        self._listener = self.session.info.declare_link_events_listener(self._on_link, history=True)

    def _take(self, sample: zenoh.Sample) -> None:
        said = decode_samples(sample.payload.to_bytes())
        self.steps[str(sample.key_expr)] += [(each.seq, said.every) for each in said.samples]

    def _on_link(self, event: zenoh.LinkEvent) -> None:
        self.dialled += event.kind == zenoh.SampleKind.PUT

    @property
    def links(self) -> int:
        """How many sessions it is linked with: both UAVs, and maybe other holders, of which it hears by gossip."""
        return len(list(self.session.info.peers_zid()))

    def heard_since(self, instant_s: float) -> list[tuple[float, str]]:
        """The samples that came after that instant: seconds after it, and key."""
        return [(at_s - instant_s, key) for at_s, key in self.heard if at_s > instant_s]

    def lost(self) -> int:
        """How many samples are missing among those that came."""
        return sum(
            max(0, after - before - every)
            for steps in self.steps.values()
            for (before, _), (after, every) in pairwise(steps)
        )


@pytest.fixture
def secured(dyknow: Dyknow, tmp_path: Path) -> Iterator[tuple[Dyknow, Path, Callable[..., Holder]]]:
    """Two hovering UAVs, the roster's folder, and what makes another session with a certificate of it."""
    roster = tmp_path / "trust" / "roster.toml"
    dyknow.options = ("--roster", str(roster))
    dyknow.run("roster", "init", "0", "1", "3")
    dyknow.run("up", "2", "--scenario", "hover", "--discover", "none", "--detach")
    dyknow.run("delegate", "monitor-proximity", "--to", "0")
    state = json.loads((dyknow.directory / "dyknow" / dyknow.federation / STATE_FILE).read_text())
    made: list[Holder] = []

    def holder(unit: str, folder: Path = roster.parent / "roster.d", **files: str) -> Holder:
        made.append(Holder(folder, unit, dyknow.federation, state["endpoints"], **files))
        return made[-1]

    yield dyknow, roster.parent / "roster.d", holder
    for each in made:
        each.session.close()


def until(holds: Callable[[], bool], within_s: float = PATIENCE_S, seen: Callable[[], object] = str) -> float:
    """Wait until it holds; returns the seconds that it took. If it does not hold in time, the error shows `seen()`."""
    begun = time.monotonic()
    while not holds():
        assert time.monotonic() - begun < within_s, seen()
        time.sleep(0.01)
    return time.monotonic() - begun


def follow(holder: Holder, samples: int) -> None:
    """Wait until it has heard so many samples more."""
    begun = len(holder.heard)
    until(lambda: len(holder.heard) >= begun + samples)


def test_a_revoked_certificate_hears_nothing_after_5_s_however_often_it_dials_and_nobody_else_notices(
    secured: tuple[Dyknow, Path, Callable[..., Holder]], tmp_path: Path
) -> None:
    dyknow, folder, holder = secured
    old = shutil.copytree(folder, tmp_path / "old")
    watcher, revoked = holder("cc"), holder("3", old)
    until(lambda: revoked.links >= 2 and len(revoked.heard) > 50 and len(watcher.heard) > 50)
    dyknow.run("roster", "revoke", "3")
    at = time.monotonic()
    follow(watcher, 300)
    until(lambda: time.monotonic() > at + WITHIN_S, 2 * WITHIN_S)
    assert {(each["unit"], each["state"]) for each in dyknow.run("ls")} == {(0, "alive"), (1, "alive")}
    dialled = revoked.dialled
    until(lambda: revoked.dialled >= dialled + REDIALS, REDIALS + PATIENCE_S)
    assert revoked.heard_since(at + WITHIN_S) == []
    dyknow.run("roster", "add", "3")
    back = holder("3")
    until(lambda: back.links >= 2 and len(back.heard) > 50, seen=lambda: (back.links, back.dialled, len(back.heard)))
    again = holder("3", old)
    until(lambda: again.dialled >= REDIALS, REDIALS + PATIENCE_S)
    assert again.heard == []
    assert {(each["unit"], each["state"]) for each in dyknow.run("ls")} == {(0, "alive"), (1, "alive")}
    assert watcher.lost() == back.lost() == 0
    said = [
        json.loads(line)
        for path in (dyknow.directory / "dyknow" / dyknow.federation / "units").glob("*.out")
        for line in path.read_text().splitlines()
    ]
    noted = {(each["unit"], each["text"]) for each in said if each["event"] == "note"}
    for unit in ("0", "1"):
        assert any(who == unit and "3 is revoked" in text for who, text in noted), noted
        assert any(who == unit and "does not admit the certificate of 3" in text for who, text in noted), noted


def test_a_certificate_that_expires_while_connected_is_out_within_5_s(
    secured: tuple[Dyknow, Path, Callable[..., Holder]], tmp_path: Path
) -> None:
    _, folder, holder = secured
    pki, now_us = folder / "pki", time.time_ns() // 1000
    short = tmp_path / "short.pem"
    authority = (pki / "ca.key").read_bytes(), (pki / "ca.pem").read_bytes()
    ends_s = time.time() + 6.0
    short.write_bytes(platform_certificate("3", (pki / "3.key").read_bytes(), *authority, now_us, days=6.0 / 86_400))
    watcher = holder("cc")
    expiring = holder("3", listen_certificate=str(short), connect_certificate=str(short))
    until(lambda: expiring.links >= 2 and len(expiring.heard) > 50)
    until(lambda: time.time() > ends_s + WITHIN_S)
    begun = time.monotonic()
    follow(watcher, 100)
    assert expiring.heard_since(begun) == []
    assert watcher.lost() == 0


def test_five_bad_identities_hear_and_say_nothing(
    secured: tuple[Dyknow, Path, Callable[..., Holder]], tmp_path: Path
) -> None:
    dyknow, folder, holder = secured
    pki, now_us, year_us = folder / "pki", time.time_ns() // 1000, 365 * 86_400_000_000
    authority = (pki / "ca.key").read_bytes(), (pki / "ca.pem").read_bytes()
    key, foreign_key = tls_key(secrets.token_bytes(48)), tls_key(secrets.token_bytes(48))
    foreign = authority_certificate(foreign_key, "foreign", now_us)
    (tmp_path / "key").write_bytes(key)
    certificates = {
        "foreign authority": platform_certificate("0", key, foreign_key, foreign, now_us),
        "self-signed": authority_certificate(key, "0", now_us),
        "expired": platform_certificate("3", key, *authority, now_us - 2 * year_us),
        "not in the roster": platform_certificate("99", key, *authority, now_us),
    }
    watcher = holder("cc")
    bad: dict[str, Holder] = {}
    for name, certificate in certificates.items():
        (tmp_path / name).write_bytes(certificate)
        both = {f"{side}_certificate": str(tmp_path / name) for side in ("listen", "connect")}
        keys = {f"{side}_private_key": str(tmp_path / "key") for side in ("listen", "connect")}
        bad[name] = holder("3", **both, **keys)
    state = json.loads((dyknow.directory / "dyknow" / dyknow.federation / STATE_FILE).read_text())
    plain = ZenohOptions(
        federation=dyknow.federation,
        connect=tuple(each.replace("tls/", "tcp/") for each in state["endpoints"]),
        discover="none",
    )
    tcp = zenoh.open(zenoh.Config.from_json5(json.dumps(zenoh_config(plain, lambda _: "127.0.0.1"))))
    follow(watcher, 300)
    assert {name: len(each.heard) for name, each in bad.items()} == dict.fromkeys(bad, 0)
    assert not list(tcp.info.peers_zid())
    tcp.close()
    for name in ("foreign authority", "self-signed", "expired"):
        assert bad[name].links == 0, name
    assert {(each["unit"], each["state"]) for each in dyknow.run("ls")} == {(0, "alive"), (1, "alive")}
    assert watcher.lost() == 0


def test_quiet_sessions_of_one_certificate_leave_room_for_the_commands_of_the_operator(
    secured: tuple[Dyknow, Path, Callable[..., Holder]],
) -> None:
    dyknow, _, holder = secured
    held = [holder("3") for _ in range(SESSIONS)]
    until(lambda: sum(each.links for each in held) > SESSIONS)
    for _ in range(2):
        assert {(each["unit"], each["state"]) for each in dyknow.run("ls")} == {(0, "alive"), (1, "alive")}
    asked = dyknow.run("delegate", "hold", "--to", "0")
    assert asked[0]["performative"] == "agree"
    until(lambda: any("3 has too many" in note for note in notes_of(dyknow)))


def notes_of(dyknow: Dyknow) -> list[str]:
    """What the UAVs have noted."""
    paths = (dyknow.directory / "dyknow" / dyknow.federation / "units").glob("*.out")
    said = [json.loads(line) for path in paths for line in path.read_text().splitlines() if line.endswith("}")]
    return [each["text"] for each in said if each["event"] == "note"]
