"""No vehicle obeys a platform whose predecessor is here, nor one without the delegator's act, whatever a member with a valid key sends.

One member of four lies, with a vehicle or without; what it sends, which platforms end, start and lose sight of each other is drawn
from a seed, as what the command centre delegates, ends and commands meanwhile, to the liar, too. After each step everything that a
platform obeys is compared with what the command centre has asked for, and with which platforms that one sees; what was refused to the
liar is an alarm, and a vehicle that the command centre has taken from a mission has it wait.
"""

import os
from collections.abc import Iterator
from contextlib import suppress
from hashlib import sha256
from random import Random

import pytest

from dyknow.agents.capabilities.areas.assignment import AreaAssignment
from dyknow.agents.capabilities.missions.performing import Performing
from dyknow.agents.platform import Platform
from dyknow.agents.tasks.authority import LIFE_US
from dyknow.agents.tasks.command_watch import CommandWatch
from dyknow.federation.members.member import Member
from dyknow.federation.messages import contents
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.codec import encode_act
from dyknow.federation.security.trust import Role, Roster, RosterMember, Signer, Trust
from tests.box import EPOCH, METRE_DEG, Box, Vehicle

P = Performative
ROLES: dict[str, Role] = {"0": "uav", "1": "uav", "2": "uav", "3": "uav", "cc": "command-centre"}
UNITS = "0123"
AREA = ("58.000 15.000", "58.000 15.030", "58.010 15.030", "58.010 15.000")
FAR = contents.CommandEntry(name="goto", numbers=(58.0 + 1500 * METRE_DEG, 15.0, 45.0))
STEPS = 600 if os.environ.get("DYKNOW_FULL") else 40
SEEDS = 40 if os.environ.get("DYKNOW_FULL") else 2


def signer(unit: str) -> Signer:
    return Signer(sha256(unit.encode()).digest(), "default")


def trust(unit: str) -> Trust:
    roster = Roster({each: RosterMember(each, signer(each).public_key, ROLES[each]) for each in ROLES})
    return Trust.of(roster, sha256(unit.encode()).digest(), "default", EPOCH - 1_000_000)


class Sky:
    """The federation, what its command centre has asked for, and the liar.

    Attributes:
        asked: by task or mission: its order of succession, the content, and when.
        began_us: when the present life of each platform began.
    """

    def __init__(self, seed: int, *, liar_flies: bool) -> None:
        self.random, self.wire = Random(seed), Box(seed)
        self.liar = self.random.choice(UNITS) if liar_flies else "3"
        self.began_us: dict[str, int] = {}
        self.asked: dict[str, tuple[tuple[str, ...], contents.Content, int]] = {}
        self.evidence: dict[str, bytes] = {}
        self.over: set[str] = set()
        self.aborted: dict[tuple[str, str], int] = {}
        self.held: dict[str, tuple[int, str]] = {}
        self.obeyed: dict[tuple[str, str], tuple[object, ...]] = {}
        self.accepted = 0
        for unit in UNITS:
            if unit == self.liar and not liar_flies:
                self.wire.centre(unit, trust=trust(unit))
            else:
                self.begin(unit)
        self.flying = [unit for unit in UNITS if unit != self.liar or liar_flies]
        self.wire.centre("cc", trust=trust("cc"))
        self.wire.run(1.5)

    def begin(self, unit: str) -> None:
        place = Vehicle(north_m=3000.0 * int(unit), battery=0.8)
        self.wire.join(unit, place, trust=trust(unit), control=True)
        self.began_us[unit] = self.wire.now_us

    # -- what is done ------------------------------------------------------------------------------------------

    def step(self) -> None:
        seen = {unit: self.seen(unit) for unit in self.honest()}
        how = self.random.random()
        if how < 0.6:
            self.lie()
        elif how < 0.74:
            self.delegate()
        elif how < 0.78:
            self.command()
        elif how < 0.9:
            self.disturb()
        self.wire.run(self.random.choice((0.1, 0.4, 1.5)))
        self.check(seen)

    def honest(self) -> list[str]:
        return [unit for unit in self.wire.platforms if unit != self.liar]

    def delegate(self) -> None:
        if self.asked and self.random.random() < 0.2:
            self.cancel()
            return
        to = self.random.choice([unit for unit in self.flying if unit in self.wire.platforms] or ["0"])
        content = self.random.choice((contents.MonitorProximity(avoidance=False), contents.DivideArea(area=AREA), None))
        now_us = self.wire.now_us
        if content is not None:
            task = self.wire.question("cc", to, content).conversation
            order = (to, *sorted(set(UNITS) - {to}))
            self.asked[task] = order, content, now_us
        else:
            leaders = tuple(self.random.sample(UNITS, self.random.randint(1, 3)))
            task = f"m{len(self.asked)}"
            content = contents.PermitMission(mission=task, leaders=leaders, vehicles=tuple(self.flying))
            said = [self.wire.question("cc", unit, content) for unit in self.flying if unit in self.wire.platforms]
            self.asked[task] = leaders, content, now_us
            self.remember(task, *(each.conversation for each in said[:1]))
            return
        self.remember(task, task)

    def remember(self, task: str, *conversations: str) -> None:
        """The act that crossed, if one did."""
        self.wire.run(0.01)
        for conversation in conversations:
            with suppress(LookupError):
                self.evidence[task] = self.wire.evidence(conversation)

    def command(self) -> None:
        """The command centre ends a task at one platform, or takes its vehicle in person."""
        unit = self.random.choice(self.honest() or ["0"])
        if unit not in self.wire.platforms:
            return
        seen = self.wire.member("cc").directory.is_present(unit)
        if self.asked and self.random.random() < 0.5:
            task = self.random.choice(list(self.asked))
            ended = self.wire.asked("cc", unit, contents.TaskOver(task=task))
            if ended.performatives[-1:] == [P.INFORM]:
                self.aborted[unit, task] = self.boot(unit)
            return
        asked = self.wire.asked("cc", unit, contents.Hold())
        assert not seen or asked.performatives[:1] != [P.REFUSE] or "mission" not in asked.reason, asked.reason
        mission = self.wire.platform(unit).part(Performing).mission
        if asked.performatives[:1] == [P.AGREE] and mission:
            self.held[unit] = self.boot(unit), mission

    def boot(self, unit: str) -> int:
        return self.wire.platform(unit).config.boot

    def cancel(self) -> None:
        task = self.random.choice(list(self.asked))
        to = task.rpartition(".")[2]
        if to in self.wire.platforms:
            self.wire.cancel("cc", to, task)
            self.over.add(task)

    def disturb(self) -> None:
        others = [unit for unit in self.flying if unit != self.liar]
        unit, other = self.random.sample(others, 2)
        match self.random.choice(("end", "kill", "begin", "begin", "cut", "mend", "mend")):
            case "end" if unit in self.wire.platforms:
                self.wire.end(unit)
            case "kill" if unit in self.wire.platforms:
                self.wire.kill(unit)
            case "begin" if unit not in self.wire.platforms:
                self.begin(unit)
            case "cut":
                self.wire.cut(unit, other)
            case "mend":
                self.wire.wire.mend_all()

    def lie(self) -> None:
        draw = self.random.choice
        known = [*self.asked, f"{self.liar}-x.{self.liar}", f"{self.liar}-x.0", "cc-1-99.1", "m99"]
        task, to = draw(known), draw([unit for unit in UNITS if unit != self.liar])
        forged = Act(
            P.REQUEST, AgentName("interface", draw(("cc", self.liar))), AgentName("interface", self.liar),
            draw((contents.DivideArea(area=AREA, scan_m=45.0), contents.MonitorProximity())).expr(), task,
            boot=1, seq=1, created_us=self.wire.now_us,
        )  # fmt: skip
        shown = draw(
            (b"", self.evidence.get(task, b""), self.evidence.get(task, b""), draw([b"", *self.evidence.values()]),
             encode_act(forged, signer(self.liar)), b"\x93\x01")
        )  # fmt: skip
        performative, content = draw(list(self.said(task)))

        def speak(member: Member, now_us: int) -> None:
            if performative is P.INFORM:
                member.acts.tell(to, content, now_us, evidence=shown)
            else:
                member.acts.ask(to, content, now_us, performative=performative, on_reply=self.on_reply, evidence=shown)

        self.wire.speak(self.liar, speak)

    def on_reply(self, act: Act, _content: object, _is_last: bool, _now_us: int) -> None:
        self.accepted += act.performative is P.AGREE

    def said(self, task: str) -> Iterator[tuple[P, contents.Content]]:
        """Everything that vehicles, pieces and coordinators are commanded by."""
        ring = contents.AreaRing(corners=AREA[:3])
        number = self.random.choice((1, 2, 3, 99, 2**31))
        boot = self.random.choice((1, self.wire.now_us // 1000))
        yield P.INFORM, contents.AssignArea(task=task, generation=number, rings=(ring,), share=0.5, units=tuple(UNITS))
        yield P.INFORM, contents.AssignArea(task=task, generation=number)
        yield P.INFORM, contents.TaskOver(task=task)
        yield P.INFORM, contents.HandOver(task=task, coordinator=self.liar, boot=boot, generation=number)
        yield P.REQUEST, contents.CreateMonitor(name="proximity", task=task, generation=number)
        yield P.REQUEST, contents.JoinMission(mission=task)
        yield P.REQUEST, contents.JoinMission(mission=task)
        yield P.REQUEST, contents.PerformCommands(mission=task, step=1, action="flies", commands=(FAR,))
        yield P.REQUEST, contents.PermitMission(mission=task, leaders=(self.liar,), vehicles=tuple(UNITS))
        yield P.REQUEST, contents.FlyMission(mission=task, domain="", problem="")
        yield P.CFP, contents.CallForMission(mission=task, domain="", problem="")
        yield P.REQUEST, contents.DivideArea(area=AREA, scan_m=45.0)
        yield P.REQUEST, contents.Goto(latitude_deg=58.0, longitude_deg=15.0, altitude_m=100.0)
        yield P.REQUEST, contents.Hold()
        yield P.REQUEST, contents.Land()
        yield P.REQUEST, contents.ReturnHome()
        yield P.REQUEST, contents.Leave()
        yield P.REQUEST, contents.ControlMission(mission=task, how="suspend")
        yield P.REQUEST_WHEN, contents.When(do=contents.Hold().expr(), condition="true")
        yield P.REQUEST, contents.Follow(object="car1")
        yield P.REQUEST, contents.Attend()
        yield P.REQUEST, contents.WantObject(symbol="a", type="car", description="colour[a] = 1", recover="yes")
        yield P.REQUEST, contents.TaskOver(task=task)
        yield P.CFP, contents.CallForStream(call="c1", semantic_label="heli-position", sample_period_s=0.1, delay_s=1.0)

    # -- what must hold ----------------------------------------------------------------------------------------

    def seen(self, unit: str) -> set[str]:
        """The platforms that one sees, itself included."""
        directory = self.wire.platform(unit).ports.directory
        return {entry.unit for entry in directory.entries() if entry.kind == "uav" and entry.state.value != "gone"}

    def before(self, task: str, leader: str) -> set[str]:
        """Those that lead a task before `leader`, as the command centre has it; later lives come last."""
        order, _, at_us = self.asked[task]

        def place(unit: str) -> tuple[int, int]:
            began_us = self.began_us.get(unit, 0)
            return began_us if began_us > at_us + LIFE_US else 0, order.index(unit)

        assert leader in order, f"{leader} may never lead {task}"
        return {unit for unit in order if place(unit) < place(leader)}

    def check(self, seen: dict[str, set[str]]) -> None:
        for unit in self.honest():
            platform = self.wire.platform(unit)
            self.check_told(platform)
            for task, leader, what in obeyed(platform):
                assert self.aborted.get((unit, task)) != self.boot(unit), (
                    f"{unit} obeys {leader} in {task}, which is over"
                )
                assert task in self.asked, f"{unit} obeys {leader} in {task}, which nobody has delegated"
                both = self.seen(unit) & seen.get(unit, set())
                is_new = self.obeyed.get((unit, task)) != (leader, what)
                if is_new:
                    assert not self.before(task, leader) & both, f"{unit} obeys {leader} in {task}: {what}"
                self.obeyed[unit, task] = leader, what
            boot, mission = self.held.get(unit, (0, ""))
            if mission and boot == self.boot(unit) and platform.part(Performing).mission == mission:
                assert platform.part(Performing).waits, f"the command centre has the vehicle of {unit}, not {mission}"
            for _, command in self.wire.vehicle(unit).commands:
                performing = platform.part(Performing)
                assert performing.mission in self.asked or not commands_of(command), f"{unit}: {command}"
            self.wire.vehicle(unit).commands.clear()

    def check_told(self, platform: Platform) -> None:
        """What was refused to the liar for who it is, users are told of."""
        entries = platform.ports.agent.audit_log.entries
        new = [each for each in entries if each.direction == "in" and each.at_us >= self.wire.now_us - 100_000]
        codes = [each.outcome for each in new if each.act is not None and each.act.sender.unit == self.liar]
        if any(each.startswith(("role:", "succession:", "unproven:")) for each in codes):
            assert self.liar in platform.part(CommandWatch).refused


def commands_of(command: object) -> bool:
    return type(getattr(command, "order", None)).__name__ in {"GoToOrder", "TakeOffOrder", "LandOrder"}


def obeyed(platform: Platform) -> Iterator[tuple[str, str, object]]:
    """What a platform does because another one says so: task, leader, and what."""
    performing = platform.part(Performing)
    if performing.mission:
        yield performing.mission, performing.leader, "its vehicle takes part"
    for task, piece in platform.part(AreaAssignment).known.items():
        if piece.leader != platform.unit:
            yield task, piece.leader, ("piece", piece.content.generation)
    for task, led in platform.built.tasks.coordinated.items():
        if led.leader != platform.unit:
            yield task, led.leader, ("monitors", led.generation)


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("liar_flies", [True, False])
@pytest.mark.parametrize("seed", range(SEEDS))
def test_what_a_platform_obeys_is_by_the_word_of_the_command_centre(seed: int, liar_flies: bool) -> None:
    sky = Sky(seed, liar_flies=liar_flies)
    for _ in range(STEPS):
        sky.step()
    assert len(sky.asked) > STEPS // 20
    print(f"seed {seed}: {len(sky.asked)} delegations, {sky.accepted} requests of {sky.liar} agreed to")
