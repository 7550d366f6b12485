"""B12: how long a platform waits for an answer of another."""

import hashlib
import os
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import Any

from bench.fleet.members import Member, Source
from bench.rows import Options, Ratio, Side
from bench.wire.raw import PATIENCE_S, latencies
from bench.workers import Worker
from dyknow.agents.capabilities.flight.flight import FlightAgent
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import Content, Fault, Query
from dyknow.federation.security.trust import Roster, Signer, Trust, Verifier
from dyknow.federation.security.trust import RosterMember as Entry

SPADE = 1100.0 / 150.0
"""A request to a SPADE agent and its answer, the fastest seen, in terms of Zenoh's get and reply on that machine."""

TITLE = "request -> inform: `query` is answered by inform, `request` by agree and inform; raw is Zenoh's get and reply"
BARS = (
    Ratio("p50_us", 2.5, ours="query"),
    Ratio("p50_us", 2.5, ours="request"),
    Ratio("p50_us", SPADE / 3, ours="query"),
    Ratio("p50_us", SPADE / 3, ours="request"),
)
ASKER, ANSWERER = "0", "1"
PERIOD_US = 5000
ACTS: dict[str, tuple[Performative, Content]] = {
    "query": (Performative.QUERY_REF, Query(semantic_label="heli-position", op="latest")),
    "request": (Performative.REQUEST, Fault(kind="none")),
}


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    count = round(200 * options.effort)
    with ExitStack() as stack:

        def pair(name: str, asking: str, answering: str, *given: dict[str, Any]) -> tuple[Worker, Worker]:
            federation = f"bench-b12-{os.getpid()}-{name}"
            to, by = (
                stack.enter_context(Worker(what, {"federation": federation, **one}))
                for what, one in zip((answering, asking), given or ({}, {}), strict=True)
            )
            return to, by

        raw = pair("raw", "bench.wire.raw:Asker", "bench.wire.raw:Answerer")
        ours: dict[str, tuple[Worker, Worker]] = {}
        for name, signed in (("", False), (" signed", True)):
            given = ({"unit": ANSWERER, "signed": signed}, {"unit": ASKER, "signed": signed})
            ours[name] = pair(f"ours{signed:d}", "bench.wire.b12:Asking", "bench.wire.b12:Asking", *given)
        pace = {"count": count, "period_us": PERIOD_US}
        found: dict[str, Side] = {"raw": partial(_ready(raw).call, "ask", **pace)}
        for name, both in ours.items():
            asker = _ready(both)
            found |= {what + name: partial(asker.call, "ask", what=what, **pace) for what in ACTS}
        yield found


def _ready(pair: tuple[Worker, Worker]) -> Worker:
    """The one that asks, once both are there."""
    to, by = pair
    to.begin("ready")
    by.call("ready")
    to.end()
    return by


def trust(unit: str, federation: str, now_us: int) -> Trust:
    """Both platforms make the same roster; the asker may command."""
    signers = {name: Signer(hashlib.sha256(name.encode()).digest(), federation) for name in (ASKER, ANSWERER)}
    roster = Roster(
        {
            name: Entry(name, signer.public_key, "command-centre" if name == ASKER else "uav")
            for name, signer in signers.items()
        }
    )
    return Trust(signers[unit], Verifier(roster, federation, now_us))


class Asking(Member):
    """One platform of the two; both know their position, and take faults, which no vehicle is there to have."""

    def __init__(self, federation: str, unit: str, *, signed: bool) -> None:
        secured = trust(unit, federation, time.time_ns() // 1000) if signed else None
        super().__init__(unit, federation, trust=secured, simulated=True, acts_per_s=1e6, acts_burst=1e6)
        self._left = 0
        self._found_ns: list[int] = []
        self._wrong: list[str] = []

    def _source(self) -> Source:
        return Source(self.platform, 0, lambda _valid_us: (57.7, 16.5, 60.0))

    def ready(self, platforms: int = 2) -> bool:
        super().ready(platforms)
        self.give()
        self.wait_for(
            lambda: (
                self.platform.ports.network.generator(
                    self.platform.part(FlightAgent).streams.estimate
                ).history.get_size()
                > 0
            ),
            "a position",
        )
        self.rest()
        return True

    def ask(self, what: str, count: int, period_us: int) -> dict[str, float]:
        """`count` questions, one per period: how long until what was asked for is there, as the agent sees it."""
        self._found_ns.clear()

        def begin() -> None:
            self._left, self.node.on_wake = count, lambda now_us: self._say(what, period_us, now_us)
            self.node.wake_us = self.clock.now_us() + period_us

        self.do(begin)
        until = time.monotonic() + PATIENCE_S + count * period_us / 1e6
        while self._left and time.monotonic() < until:
            time.sleep(0.01)
        if self._left or self._wrong:
            raise TimeoutError(f"{self._left} not answered, {self._wrong[:1]}")
        return latencies(self._found_ns)

    def _say(self, what: str, period_us: int, now_us: int) -> None:
        performative, content = ACTS[what]
        began = time.monotonic_ns()

        def on_reply(act: Act, _content: Content | None, at_us: int) -> None:
            if act.performative is Performative.AGREE:
                return
            self._found_ns.append(time.monotonic_ns() - began)
            if act.performative is not Performative.INFORM:
                self._wrong.append(str(act))
            self._left -= 1
            if self._left:
                self.node.wake_us = at_us + period_us

        self.platform.ports.agent.delegate(
            ANSWERER,
            content,
            now_us,
            performative=performative,
            on_reply=on_reply,
            on_silence=lambda why, _at_us: self._wrong.append(why),
        )
