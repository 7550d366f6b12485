"""What a member that is revoked says and hears while it dials again and again: nothing."""

import json
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import zenoh

from dyknow.federation import transport as wire
from dyknow.federation.security.tls import LINKS
from dyknow.federation.security.trust import Roster
from dyknow.proxies.zenoh.configuration import ZenohOptions, zenoh_config
from dyknow.proxies.zenoh.edge import ZenohEdge
from dyknow.runtime.configuration.config import WireConfig
from dyknow.runtime.configuration.session import wire_options
from tests.live.command_line.command import Dyknow, free_tcp_ports

pytestmark = pytest.mark.live
PATIENCE_S = 60.0
REDIAL_MS = 50
MANY, HELD = 12, 70
"""Commands of the operator that run at once, and sessions of a member that it needs for nothing."""
DIALS = 1200 if os.environ.get("DYKNOW_FULL") else 60


def until(holds: Callable[[], bool]) -> None:
    begun = time.monotonic()
    while not holds():
        assert time.monotonic() - begun < PATIENCE_S
        time.sleep(0.005)


def options_of(unit: str, roster: Path, federation: str, **endpoints: tuple[str, ...]) -> ZenohOptions:
    files = roster.with_name("roster.d")
    return wire_options(
        WireConfig(
            federation=federation, discover="none", security=files / f"{unit}.wire.json", roster=roster, **endpoints
        )
    )


@pytest.fixture
def roster(dyknow: Dyknow, tmp_path: Path) -> Path:
    path = tmp_path / "roster.toml"
    dyknow.options = ("--roster", str(path))
    dyknow.run("roster", "init", "0", "3")
    return path


def test_a_revoked_member_that_dials_again_and_again_is_not_heard_and_hears_nothing(
    dyknow: Dyknow, roster: Path
) -> None:
    events: list[wire.WireEvent] = []
    endpoint = f"tls/127.0.0.1:{free_tcp_ports(1)}"
    edge = ZenohEdge(
        options_of("0", roster, dyknow.federation, listen=(endpoint,)), events.append, lambda: time.time_ns() // 1000
    )
    edge.open()
    config = zenoh_config(
        options_of("3", roster, dyknow.federation, listen=("tls/127.0.0.1:0",), connect=(endpoint,)),
        lambda _: "127.0.0.1",
    )
    config.pop("access_control")
    config["connect"]["retry"] = {"period_init_ms": REDIAL_MS, "period_max_ms": REDIAL_MS}
    hostile = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
    heard: list[str] = []
    dials: list[float] = []
    remote = zenoh.Locality.REMOTE
    declared: list[Any] = [
        hostile.declare_subscriber(key, lambda sample: heard.append(str(sample.key_expr)), allowed_origin=remote)
        for key in ("**", "x/**")
    ]
    declared += [
        hostile.info.declare_link_events_listener(
            lambda event: dials.append(time.monotonic()) if event.kind == zenoh.SampleKind.PUT else None
        ),
    ]
    ended = threading.Event()

    def talk() -> None:
        while not ended.wait(0.001):
            hostile.put("x/3/heli-position/1", b"-")

    def said() -> int:
        return sum(isinstance(event, wire.Arrived) for event in events)

    def speaks() -> bool:
        edge.perform(wire.Put("x/0/heli-position/1", b"-", wire.Urgency.STREAM))
        return True

    talking = threading.Thread(target=talk)
    talking.start()
    try:
        edge.perform(wire.Subscribe("x/**"))
        until(lambda: speaks() and said() > 50 and len(heard) > 50)
        dyknow.run("roster", "revoke", "3")
        until(lambda: any(isinstance(event, wire.LinkClosed) for event in events))
        until(lambda: len(dials) > 2)
        before, first = said(), len(dials)
        del heard[:]
        until(lambda: speaks() and len(dials) >= first + DIALS)
        assert (said() - before, heard) == (0, [])
    finally:
        ended.set()
        talking.join()
        del declared
        hostile.close()
        edge.close()
    assert Roster.parse(roster.read_text()).members["3"].revoked


def test_a_member_that_opens_session_after_session_leaves_those_of_the_operator(dyknow: Dyknow, roster: Path) -> None:
    events: list[wire.WireEvent] = []
    endpoint = f"tls/127.0.0.1:{free_tcp_ports(1)}"
    edge = ZenohEdge(
        options_of("0", roster, dyknow.federation, listen=(endpoint,)), events.append, lambda: time.time_ns() // 1000
    )
    edge.open()

    def opened(unit: str) -> zenoh.Session:
        ends = {"listen": ("tls/127.0.0.1:0",), "connect": (endpoint,)}
        config = zenoh_config(options_of(unit, roster, dyknow.federation, **ends), lambda _: "127.0.0.1")
        config.pop("access_control")
        config["connect"]["retry"] = {"period_init_ms": 60_000, "period_max_ms": 60_000}
        return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))

    def linked(session: zenoh.Session) -> bool:
        return bool(list(session.info.peers_zid()))

    held = list[zenoh.Session]()
    commands = [opened("cc") for _ in range(MANY)]
    try:
        held = [opened("3") for _ in range(HELD)]
        until(lambda: any(isinstance(each, wire.LinkClosed) for each in events))
        commands.append(opened("cc"))
        until(lambda: all(map(linked, commands)))
        closed = {(each.name, each.surplus) for each in events if isinstance(each, wire.LinkClosed)}
        assert closed == {("3", True)}
        assert LINKS["uav"] < len(commands) < LINKS["command-centre"]
        held[0].close()
        again = held[0] = opened("3")
        until(lambda: linked(again))
        assert all(map(linked, commands))
    finally:
        for each in [*commands, *held]:
            each.close()
        edge.close()
