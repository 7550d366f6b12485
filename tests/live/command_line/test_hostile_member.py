"""A member with a valid key and certificate, against three UAVs with a roster and TLS: it gets nothing it has no right to."""

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh

from dyknow.federation import keys
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.codec import Heartbeat, decode_act, encode_act, encode_description, encode_heartbeat
from dyknow.federation.messages.contents import (
    Alarm,
    AreaRing,
    AssignArea,
    Cancel,
    CommandEntry,
    Content,
    CreateMonitor,
    Goto,
    HandOver,
    Hold,
    JoinMission,
    PerformCommands,
)
from dyknow.federation.messages.descriptions import Description, ServiceEntry
from dyknow.federation.security.trust import Roster, Signer
from dyknow.proxies.zenoh.configuration import zenoh_config
from dyknow.runtime.configuration.config import WireConfig
from dyknow.runtime.configuration.run_directory import STATE_FILE
from dyknow.runtime.configuration.session import wire_options
from tests.live.command_line.command import Dyknow

pytestmark = pytest.mark.live
P = Performative
UNITS = ("0", "1", "2")
BOTH = ("proximity", "proximity-warn")
WITHIN_S = 2.0
MOVED_M, METRE_DEG = 5.0, 111_320.0


class Member:
    """Unit 3 of the roster: its own session, key and certificate, and no filter of its own."""

    def __init__(self, directory: Path, federation: str, endpoints: list[str]) -> None:
        own = WireConfig(
            federation=federation,
            listen=("tls/127.0.0.1:0",),
            connect=tuple(endpoints),
            discover="none",
            security=directory / "roster.d/3.wire.json",
        )
        options = wire_options(own)
        for name in ("access_control", "low_pass_filter"):
            (options.security or {}).pop(name, None)
        self.session = zenoh.open(zenoh.Config.from_json5(json.dumps(zenoh_config(options, lambda _: "127.0.0.1"))))
        self.roster = Roster.parse((directory / "roster.toml").read_text()).fingerprint
        self._signer = Signer(bytes.fromhex((directory / "roster.d/keys/3.key").read_text().strip()), federation)
        self.boot, self._seq, self._beats = self.now_us() // 1000, 0, 0
        self.heard: list[Act] = []
        self._inbox = self.session.declare_subscriber("acl/3/**", self._take)

    def now_us(self) -> int:
        return time.time_ns() // 1000

    def _take(self, sample: zenoh.Sample) -> None:
        if not str(sample.key_expr).endswith("/receipt"):
            self.heard.append(decode_act(sample.payload.to_bytes())[0])

    def beat(self, boot: int, speed: float = 1.0) -> None:
        self._beats += 1
        self.session.put(keys.heartbeat("3"), encode_heartbeat(Heartbeat("3", boot, self._beats, self.now_us(), 1)))
        service = ServiceEntry(agent="federation", service="dyknow-federation", visibility="protected")
        said = Description(
            unit="3", boot=boot, version=1, kind="uav", clock_speed=speed, roster=self.roster, services=(service,)
        )
        self.session.put(keys.announcement("3"), encode_description(said))

    def say(
        self, to: str, performative: Performative, content: Content, conversation: str, evidence: bytes = b""
    ) -> None:
        self._seq += 1
        now_us = self.now_us()
        act = Act(
            performative, AgentName("interface", "3"), AgentName("interface", to), content.expr(), conversation,
            "fipa-request", reply_with=f"r{self._seq}", reply_by_us=now_us + 2_000_000, ontology="dyknow",
            boot=self.boot, seq=self._seq, created_us=now_us, evidence=evidence,
        )  # fmt: skip
        self.session.put(act.key, encode_act(act, self._signer))

    def answered(self, conversations: set[str], within_s: float = 20.0) -> dict[str, set[tuple[str, str]]]:
        """By conversation, the performatives and codes that came back."""
        until = time.monotonic() + within_s
        while not conversations <= {act.conversation_id for act in self.heard}:
            assert time.monotonic() < until, conversations - {act.conversation_id for act in self.heard}
            self.session.info.zid()
        found: dict[str, set[tuple[str, str]]] = {}
        for act in self.heard:
            code = "" if act.content is None else str(act.content.arguments.get("code", ""))
            found.setdefault(act.conversation_id or "", set()).add((act.performative.value, code))
        return found


@pytest.fixture
def secured(dyknow: Dyknow, tmp_path: Path) -> Iterator[tuple[Dyknow, Member, str]]:
    """Three hovering UAVs over TLS, their monitoring delegated to 0, and the fourth member."""
    roster = tmp_path / "trust" / "roster.toml"
    dyknow.options = ("--roster", str(roster))
    dyknow.run("roster", "init", *UNITS, "3")
    dyknow.run("up", "3", "--scenario", "hover", "--discover", "none", "--detach")
    (agreed, *_) = dyknow.run("delegate", "monitor-proximity", "--to", "0")
    dyknow.until("monitors", inputs="fresh")
    state = json.loads((dyknow.directory / "dyknow" / dyknow.federation / STATE_FILE).read_text())
    member = Member(roster.parent, dyknow.federation, state["endpoints"])
    yield dyknow, member, agreed["conversation"]
    member.session.close()


def places(dyknow: Dyknow) -> dict[Any, dict[str, float]]:
    """By unit, latitude, longitude and altitude."""
    found: dict[Any, dict[str, float]] = {}
    for label in ("heli-position", "heli-altitude"):
        for reading in (each for each in dyknow.run("query", label) if "value" in each):
            found.setdefault(reading["unit"], {}).update(reading["value"])
    return found


def test_a_member_with_a_valid_key_ends_halts_and_moves_nothing(secured: tuple[Dyknow, Member, str]) -> None:
    dyknow, member, task = secured
    before, watched = places(dyknow), {(m["by"], m["monitor"], *m["units"]) for m in dyknow.run("monitors")}
    assert {by for by, *_ in watched} == {0, 1, 2}
    asked, own = dict[str, str](), f"3-{member.boot:x}-"
    for to in UNITS:
        for generation in (1, 2, 2**31):
            for name in BOTH:
                asked[f"{own}{to}-{generation}-{name}"] = to
                claim = CreateMonitor(name=name, task=task, coordinator="3", generation=generation, avoidance=False)
                member.say(to, P.REQUEST, claim, f"{own}{to}-{generation}-{name}")
        commands = (Hold(), Goto(latitude_deg=58.0, longitude_deg=15.0, altitude_m=100.0))
        for number, command in enumerate(commands):
            asked[f"{own}{to}-fly-{number}"] = to
            member.say(to, P.REQUEST, command, f"{own}{to}-fly-{number}")
        member.say(to, P.INFORM, HandOver(task=task, coordinator="3", boot=member.boot, generation=2), task)
        made_up = Alarm(
            id="x/1", event="opened", monitor="proximity", by="3", units=("1", "0"), valid_us=1, detected_us=2
        )
        member.say(to, P.INFORM, made_up, task)
    answers = member.answered(set(asked))
    for conversation in asked:
        performatives = {performative for performative, _ in answers[conversation]}
        assert performatives == {"refuse"}, (conversation, answers[conversation])
        codes = {code for _, code in answers[conversation]}
        assert codes == ({"role"} if "fly" in conversation else {"unproven"})
    for conversation, to in asked.items():
        member.say(to, P.CANCEL, Cancel(), conversation)
    for boot, speed in ((1, 2.0), (member.boot, 2.0)):
        for _ in range(10):
            member.beat(boot, speed)
    for unit in UNITS:  # under names that are not its own: the wire takes nothing
        member.session.put(keys.heartbeat(unit), encode_heartbeat(Heartbeat(unit, 1, 10**9, member.now_us(), 0)))

    assert {(each["unit"], each["state"]) for each in dyknow.run("ls") if each["unit"] != 3} == {
        (unit, "alive") for unit in (0, 1, 2)
    }
    now = [m for m in dyknow.run("monitors") if 3 not in m.get("units", (3,))]  # 3 is shown as it is: silent
    assert {(m["by"], m["monitor"], *m["units"]) for m in now} == watched
    assert {m["inputs"] for m in now} == {"fresh"}
    assert [(each["state"], each["conversation"]) for each in dyknow.run("tasks")] == [("running", task)]
    refused = [each for each in dyknow.run("acts") if each["peer"] == 3 and each["outcome"].startswith("refused")]
    assert {each["unit"] for each in refused} == {0, 1, 2}
    assert any("shows no act of a delegator" in each["outcome"] for each in refused)
    after = places(dyknow)
    for unit in (0, 1, 2):
        moved = [abs(after[unit][name] - before[unit][name]) for name in ("latitude_deg", "longitude_deg")]
        assert max(moved) * METRE_DEG < MOVED_M
        assert abs(after[unit]["altitude_m"] - before[unit]["altitude_m"]) < MOVED_M
    records = dyknow.directory / "dyknow" / dyknow.federation / "units"
    assert not any('"halted"' in path.read_text() for path in records.glob("*.out"))
    assert sorted(dyknow.run("down")[0]["units"]) == [0, 1, 2]


AREA = ("55.7270 13.4590", "55.7270 13.4610", "55.7280 13.4610", "55.7280 13.4590")


def test_a_member_that_is_shown_the_evidence_takes_no_aircraft_and_ends_no_division(
    secured: tuple[Dyknow, Member, str], tmp_path: Path
) -> None:
    """It takes part in a division, so that it has the command centre's act; it would lead it, and fly the vehicles for it."""
    dyknow, member, _ = secured
    area = tmp_path / "field.geojson"
    ring = [[float(x) for x in reversed(corner.split())] for corner in (*AREA, AREA[0])]
    area.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    before = places(dyknow)
    for _ in range(10):
        member.beat(member.boot)
    (agreed, *_) = dyknow.run("delegate", "divide-area", f"area={area}", "--to", "0")
    task, until = agreed["conversation"], time.monotonic() + 20.0
    shown: list[Act] = []
    while not shown:
        assert time.monotonic() < until, "no piece, and so no evidence, came"
        member.beat(member.boot)
        shown = [act for act in member.heard if act.evidence and decode_act(act.evidence)[0].conversation_id == task]
        time.sleep(0.2)
    evidence, asked = shown[0].evidence, set()
    commands = (
        CommandEntry(name="take-off", numbers=(20.0,)),
        CommandEntry(name="goto", numbers=(55.7275, 13.46, 118.0)),
    )
    own = f"3-{member.boot:x}-"
    for to in UNITS:
        for number, proof in enumerate((evidence, b"")):
            rings = (AreaRing(corners=AREA[:3]),)
            for name in (task, "3-x.3"):
                member.say(to, P.INFORM, AssignArea(task=name, generation=99, rings=rings), name, proof)
            member.say(to, P.REQUEST, JoinMission(mission=task), f"{own}join-{to}-{number}", proof)
            asked.add(f"{own}join-{to}-{number}")
        fly = PerformCommands(mission=task, step=1, action="scans 50% of it", commands=commands)
        member.say(to, P.REQUEST, fly, f"{own}fly-{to}")
        asked.add(f"{own}fly-{to}")
    answers = member.answered(asked)
    for conversation in asked:
        assert {performative for performative, _ in answers[conversation]} == {"refuse"}, conversation
    refused = [each for each in dyknow.run("acts") if each["peer"] == 3 and each["outcome"].startswith("refused")]
    assert {each["unit"] for each in refused} == {0, 1, 2}, "the operator sees by whom"
    after = places(dyknow)
    for unit in (0, 1, 2):
        moved = [abs(after[unit][name] - before[unit][name]) for name in ("latitude_deg", "longitude_deg")]
        assert max(moved) * METRE_DEG < MOVED_M
        assert abs(after[unit]["altitude_m"] - before[unit]["altitude_m"]) < MOVED_M
    assert {(each["unit"], each["task"]) for each in dyknow.run("tasks")} >= {(0, "divide-area")}
    dyknow.run("down")
