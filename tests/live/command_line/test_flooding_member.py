"""A member with a valid key and certificate that lies about hearing, or floods: sessions stay, answers and monitors go on."""

import json
import os
import socket
import ssl
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from random import Random
from statistics import median
from typing import Any

import psutil
import pytest

import dyknow as facade
from dyknow.federation import keys
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.beats import MAX_TAILS
from dyknow.federation.messages.codec import (
    Heartbeat,
    StreamSample,
    encode_description,
    encode_heartbeat,
    encode_samples,
)
from dyknow.federation.messages.contents import Alarm, CheckFormula, Search
from dyknow.federation.messages.descriptions import Description, LabelEntry, ServiceEntry
from dyknow.model.errors import NothingFound
from dyknow.runtime.configuration.run_directory import STATE_FILE
from dyknow.runtime.configuration.session import host_of
from tests.live.command_line import test_hostile_member
from tests.live.command_line.command import Dyknow
from tests.live.command_line.test_hostile_member import Member

pytestmark = pytest.mark.live
P = Performative
secured = test_hostile_member.secured
MOST_MB, HALF_OPEN = 50, 200
CYCLES, SLICE_S, SETTLED_S, PACE_S, FRESH_S = 8, 2.5, 4.0, 0.07, 20.0
"""Questions come less often than a platform takes acts of one member."""
WORDS = "abcdefghijkl"


def state_of(dyknow: Dyknow) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((dyknow.directory / "dyknow" / dyknow.federation / STATE_FILE).read_text())
    return found


def notes_of(dyknow: Dyknow) -> str:
    units = dyknow.directory / "dyknow" / dyknow.federation / "units"
    return "\n".join(path.read_text() for path in units.glob("*.out"))


@contextmanager
def repeated(step: Callable[[], None], every_s: float = 0.2) -> Iterator[None]:
    """Do it again and again, five times a second as heartbeats come, while the test does something else."""
    is_over = threading.Event()

    def run() -> None:
        while not is_over.wait(every_s):
            step()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join()


def test_a_member_that_says_it_hears_nobody_closes_no_session_and_is_named(secured: tuple[Dyknow, Member, str]) -> None:
    dyknow, member, _ = secured
    until, conditions = time.monotonic() + 60, ""
    named = "3 says that it does not hear this platform"
    with repeated(lambda: member.beat(member.boot)):
        while time.monotonic() < until and conditions.count(named) < 3:
            conditions = json.dumps(dyknow.run("ls"))
    assert conditions.count(named) == 3
    assert "opens a new session" not in notes_of(dyknow)
    assert {each["state"] for each in dyknow.run("ls") if each["unit"] != 3} == {"alive"}


class Flood:
    """What the member sends, again and again."""

    def __init__(self, member: Member, task: str) -> None:
        self.member, self.task, self.random, self.number = member, task, Random(23), 0
        self.version, self.labels_there = 1, 2

    def word(self) -> str:
        return "".join(self.random.choices(WORDS, k=12))

    def beat(self, tails: tuple[Any, ...] = (), version: int = 1) -> None:
        member = self.member
        member._beats += 1
        beat = Heartbeat("3", member.boot, member._beats, member.now_us(), version, ("0", "1", "2", "cc"), tails)
        member.session.put(keys.heartbeat("3"), encode_heartbeat(beat))

    def live(self) -> None:
        """Be there, and described."""
        self.beat(version=self.version)
        self.describe()

    def acts(self) -> None:
        self.member.say(self.random.choice("012"), P.QUERY_REF, Search(service=self.word()), f"3-s{self.number}")

    def formulas(self) -> None:
        text = " and ".join(f"heli-altitude[self] > {self.random.randrange(10**5)}" for _ in range(220))
        self.member.say(self.random.choice("012"), P.QUERY_IF, CheckFormula(text=text), f"3-f{self.number}")

    def alarms(self) -> None:
        made_up = Alarm(
            id=f"x/{self.number}",
            event="opened",
            monitor="proximity",
            by="3",
            units=("3", "0"),
            valid_us=1,
            detected_us=2,
        )
        self.member.say("0", P.INFORM, made_up, self.task)

    def heartbeats(self) -> None:
        self.beat(tuple((f"{self.word()}-{number}", "ab12cd34", number) for number in range(MAX_TAILS)), self.version)

    def describe(self) -> None:
        labels = tuple(
            LabelEntry(label=f"{self.word()}-{n}", sort="x", type_hash="0" * 8) for n in range(self.labels_there)
        )
        said = Description(
            unit="3",
            boot=self.member.boot,
            version=self.version,
            kind="uav",
            roster=self.member.roster,
            labels=labels,
            services=(ServiceEntry(agent="federation", service="dyknow-federation", visibility="protected"),),
        )
        self.member.session.put(keys.announcement("3"), encode_description(said))

    def descriptions(self) -> None:
        self.version, self.labels_there = self.version + 1, 250
        self.live()

    def labels(self) -> None:
        samples = [StreamSample(number + 1, self.member.now_us(), 1.0) for number in range(100)]
        self.member.session.put(keys.stream("3", self.word(), "ab12cd34"), encode_samples(self.member.boot, samples))


class Stranger:
    """Connects without a certificate, and says a TLS greeting, bytes of no protocol, or nothing; 200 stay half open."""

    def __init__(self, endpoints: list[str]) -> None:
        self._places = [(host_of(each), int(each.rpartition(":")[2])) for each in endpoints]
        self._random, self._open, self.made = Random(7), deque[socket.socket](), 0
        self._greeting = _greeting()

    def connections(self) -> None:
        made = socket.socket()
        made.setblocking(False)
        self._open.append(made)
        self.made += 1
        with suppress(OSError):  # the platform may close first, or accept later
            made.connect_ex(self._places[self.made % len(self._places)])
            made.send((self._greeting, self._random.randbytes(2000), b"")[self.made % 3])
        while len(self._open) > HALF_OPEN:
            self._open.popleft().close()

    def end(self) -> None:
        while self._open:
            self._open.popleft().close()


def _greeting() -> bytes:
    """The first message of a client without a certificate."""
    outgoing = ssl.MemoryBIO()
    client = ssl.create_default_context().wrap_bio(ssl.MemoryBIO(), outgoing, server_hostname="127.0.0.1")
    with suppress(ssl.SSLWantReadError):
        client.do_handshake()
    return outgoing.read()


class Asking:
    """An honest member's questions, one after another, and how long each round trip takes."""

    def __init__(self, federation: facade.FederationClient) -> None:
        self._federation, self._pace, self.unanswered = federation, threading.Event(), 0

    def until(self, until_s: float) -> list[float]:
        took: list[float] = []
        while time.monotonic() < until_s:
            began_s = time.monotonic()
            try:
                is_answered = not self._federation.query("heli-position", unit=0).missing
            except NothingFound:
                is_answered = False
            took.append(time.monotonic() - began_s)
            self.unanswered += not is_answered
            self._pace.wait(PACE_S)
        return took


def quantile(values: list[float], part: float) -> float:
    return sorted(values)[min(len(values) - 1, int(part * len(values)))]


def figures_of(took: list[float]) -> dict[str, float]:
    return {
        "asked": len(took),
        "p50_ms": round(1000 * median(took), 1),
        "p99_ms": round(1000 * quantile(took, 0.99), 1),
        "most_ms": round(1000 * max(took), 1),
    }


@pytest.mark.full
@pytest.mark.timeout(900)
def test_floods_by_a_member_and_by_a_stranger_cost_no_memory_and_the_others_are_answered(
    secured: tuple[Dyknow, Member, str], tmp_path: Path
) -> None:
    dyknow, member, task = secured
    state = state_of(dyknow)
    processes = {one["unit"]: psutil.Process(one["pid"]) for one in state["running"]}
    figures: dict[str, Any] = {}
    flood, stranger = Flood(member, task), Stranger(state["endpoints"])

    def rss_mb() -> dict[str, int]:
        return {str(unit): process.memory_info().rss >> 20 for unit, process in processes.items()}

    def inputs() -> set[str]:
        return {each["inputs"] for each in dyknow.run("monitors") if 3 not in each.get("units", (3,))}

    def sent(kind: Callable[[], None]) -> Callable[[], None]:
        def once() -> None:
            flood.number += 1
            kind()

        return once

    roster = tmp_path / "trust" / "roster.toml"
    with (
        facade.connect(dyknow.federation, connect=tuple(state["endpoints"]), roster=roster) as federation,
        repeated(flood.live),
    ):
        asking = Asking(federation)
        asking.until(time.monotonic() + SETTLED_S)
        before = rss_mb()
        kinds = (flood.acts, flood.formulas, flood.alarms, flood.heartbeats, flood.descriptions, flood.labels)
        for kind in (*kinds, stranger.connections):
            quiet, flooded, start, seen = list[float](), list[float](), flood.number, set[str]()
            lost = {"quiet": 0, "flooded": 0}
            for _ in range(CYCLES):  # by turns, since others use the machine as well
                asking.unanswered = 0
                quiet += asking.until(time.monotonic() + SLICE_S)
                lost["quiet"] += asking.unanswered
                asking.unanswered = 0
                with repeated(sent(kind), 0.003):
                    flooded += asking.until(time.monotonic() + SLICE_S)
                lost["flooded"] += asking.unanswered
            with repeated(sent(kind), 0.003):
                seen = inputs()
            stranger.end()
            until_s = time.monotonic() + FRESH_S
            while (fresh := inputs()) != {"fresh"} and time.monotonic() < until_s:
                pass
            now = rss_mb()
            figures[kind.__name__] = {
                "sent": flood.number - start,
                "quiet": figures_of(quiet),
                "flooded": figures_of(flooded),
                "unanswered": lost,
                "p99_ratio": round(quantile(flooded, 0.99) / quantile(quiet, 0.99), 2),
                "rss_mb": now,
                "more_mb": max(now[unit] - before[unit] for unit in now),
                "monitors_meanwhile": sorted(seen),
                "monitors": sorted(fresh),
            }
    if "DYKNOW_FIGURES" in os.environ:
        Path(os.environ["DYKNOW_FIGURES"]).write_text(json.dumps(figures, indent=1))
    for found in figures.values():
        assert found["unanswered"]["flooded"] <= 2 * found["unanswered"]["quiet"], figures
        assert found["more_mb"] <= MOST_MB, figures
        assert found["monitors"] == ["fresh"], figures
        assert found["flooded"]["p99_ms"] <= max(2 * found["quiet"]["p99_ms"], 250.0), figures
