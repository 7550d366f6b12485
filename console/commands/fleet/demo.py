"""`dyknow demo`: the main job end to end: find each other, share, delegate, warn, give way, answer, take down."""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import hypot
from typing import Annotated, Any, TypeAlias

import typer

from dyknow.console.centre.client import connected
from dyknow.console.centre.separation import ALTITUDE, POSITION, Separation
from dyknow.console.command import Call, command
from dyknow.console.commands.fleet.up import FleetStart, ended, gathered, planned
from dyknow.console.commands.members.query import value_text
from dyknow.console.errors import DONE, FAILED
from dyknow.console.output.shown import styled
from dyknow.console.processes.launch import FleetPlan
from dyknow.console.processes.supervision import Fleet, interruptible
from dyknow.federation.members.imports import ImportName
from dyknow.federation.messages import contents
from dyknow.federation.messages.acts import Act, Performative, parse_act
from dyknow.federation.messages.codec import StreamSample
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.model.errors import FederationFailed, TextError
from dyknow.runtime.client import Client
from dyknow.runtime.configuration.run_directory import run_directory
from dyknow.runtime.library.jobs import Subscriptions
from dyknow.runtime.library.jobs import monitors as all_monitors
from dyknow.runtime.library.jobs import tasks as all_tasks

P = Performative
Outcome: TypeAlias = tuple[str, dict[str, Any]]
"""A sentence, and further fields of its JSON line."""
UNITS, PAIR = ("0", "1", "2"), ("0", "1")
SAFE_M = 10.0
MOVING_M_S = 2.0
VELOCITY = "heli-velocity"
MEET_S = 45.0
PART_S = 40.0
_ANSWER_S = 3.0
_STEP_S = 0.1


@dataclass(slots=True)
class Demo:
    """The context of the steps, each of which returns an outcome or raises FederationFailed."""

    call: Call
    seed: int
    alarms: list[contents.Alarm] = field(default_factory=list)
    separation: Separation = field(default_factory=lambda: Separation(PAIR))
    done: list[tuple[str, bool, float, str]] = field(default_factory=list)
    facts: dict[str, Any] = field(default_factory=dict)
    task: Dialogue | None = None
    streams: list[Dialogue] = field(default_factory=list)
    news: Callable[[float], list[tuple[str, contents.Content]]] | None = None

    def step(self, name: str, perform: Callable[[], Outcome]) -> bool:
        """Do one step and report it."""
        began = time.monotonic()
        try:
            said, facts = perform()
            good = True
        except FederationFailed as failed:
            said, facts, good = str(failed), {"error": str(failed)}, False
        took_s = time.monotonic() - began
        self.done.append((name, good, took_s, said))
        self.facts |= facts if good else {}
        mark = styled("done", "green") if good else styled("failed", "red")
        self.call.out.item(
            (mark, styled(name, "bold"), said),
            event="step",
            step=name,
            ok=good,
            took_ms=round(took_s * 1000),
            **facts,
        )
        return good

    # The steps that ask

    def ls(self, client: Client) -> Outcome:
        client.wait_for(lambda: len(self._described(client)) == len(UNITS), _ANSWER_S)
        found = self._described(client)
        if len(found) < len(UNITS):
            raise FederationFailed(f"only {len(found)} of {len(UNITS)} platforms are in the directory")
        labels = sorted({label for _, labels in found for label in labels})
        return f"{len(found)} platforms offer {', '.join(labels)}", {"labels": labels}

    def _described(self, client: Client) -> list[tuple[str, list[str]]]:
        entries = [(seen.unit, seen.entry) for seen in client.centre.platforms() if seen.state == "alive"]
        named = [(unit, [label.label for label in entry.labels]) for unit, entry in entries if entry is not None]
        return [(unit, labels) for unit, labels in named if {POSITION, ALTITUDE} <= set(labels)]

    def delegate(self, client: Client) -> Outcome:
        subscriptions = Subscriptions(client, contents.Alarms())
        self.news = lambda seconds: client.run(subscriptions.news(seconds))
        self._hear(0.0)
        self.task = task = client.say("0", P.REQUEST, contents.MonitorProximity(), within_s=_ANSWER_S, standing=True)
        client.wait_for(lambda: task.agreed or task.over, _ANSWER_S)
        if not task.agreed:
            raise FederationFailed(f"platform 0: {task.trouble or 'no answer'}")
        self._watch(client)
        fresh = 0
        until = time.monotonic() + 4 * _ANSWER_S
        while time.monotonic() < until and fresh < len(UNITS) * (len(UNITS) - 1):
            self._hear(2 * _STEP_S)
            found = [m for m in client.run(all_monitors(client)) if m.name == "proximity"]
            fresh = sum(monitor.inputs == "fresh" for monitor in found)
        if fresh < len(UNITS) * (len(UNITS) - 1):
            raise FederationFailed(f"only {fresh} monitors have fresh inputs")
        return f"platform 0 agrees to monitor-proximity; {fresh} monitors have fresh inputs", {"monitors": fresh}

    def _watch(self, client: Client) -> None:
        """Streams of the two that will meet, to this command centre."""

        def on_sample(name: ImportName, sample: StreamSample, _at_us: int) -> None:
            if isinstance(sample.value, tuple):
                self.separation.on_sample(*name[:2], sample.valid_us, sample.value)

        client.centre.on_sample = on_sample
        content = contents.CreateMulticast(
            semantic_labels=(POSITION, ALTITUDE), sample_period_s=0.1, delay_s=1.0, to_units=(client.centre.unit,)
        )
        self.streams = [client.say(unit, P.REQUEST, content, standing=True) for unit in PAIR]

    def _hear(self, seconds: float) -> None:
        """Let time pass, noting alarms."""
        if self.news is not None:
            self.alarms += [said for _, said in self.news(seconds) if isinstance(said, contents.Alarm)]

    # The steps that wait

    def encounter(self) -> Outcome:
        """Both of the pair warn of each other, or have agreed before that which one makes room."""
        self._until(self._has_begun, MEET_S, "0 and 1 fly towards each other")
        if not self._has_begun():
            raise FederationFailed(f"no warning by {', '.join(sorted(set(PAIR) - self._warned()))} in {MEET_S:.0f} s")
        opened = [alarm for alarm in self.alarms if alarm.event == "opened"]
        if not opened:
            return f"0 and 1 agree, {self.separation.latest_m or 0:.0f} m apart, before there is a warning", {}
        first = min(opened, key=lambda alarm: alarm.detected_us)
        delay_ms = (first.detected_us - first.valid_us) // 1000
        said = (
            f"0 and 1 warn of each other, {self.separation.latest_m or 0:.0f} m apart, {delay_ms} ms after the sample"
        )
        return said, {"alarm_delay_ms": delay_ms}

    def _has_begun(self) -> bool:
        steps = [] if self.task is None else [s.step for s in self.task.results if isinstance(s, contents.Progress)]
        return self._warned() >= set(PAIR) or any(" agrees with " in step for step in steps)

    def _warned(self) -> set[str]:
        return {a.by for a in self.alarms if a.event == "opened" and a.monitor == "proximity-warn"}

    def _open(self) -> set[str]:
        """The alarms that are open, by id."""
        closed = {alarm.id for alarm in self.alarms if alarm.event != "opened"}
        return {alarm.id for alarm in self.alarms if alarm.event == "opened"} - closed

    def avoidance(self, client: Client) -> Outcome:
        """The pair passes, never too close, by a manoeuvre that the two agreed on."""
        self._until(self._passed, PART_S, "0 and 1 give way")
        smallest_m = self.separation.smallest_m
        if smallest_m is None or not self._passed():
            raise FederationFailed(f"0 and 1 have not passed each other in {PART_S:.0f} s")
        if smallest_m <= SAFE_M or any(alarm.monitor == "proximity" for alarm in self.alarms):
            raise FederationFailed(f"0 and 1 came as close as {smallest_m:.1f} m")
        yielding = self._agreed(client)
        if yielding is None:
            raise FederationFailed("0 and 1 have not agreed which of them makes room")
        self._until(lambda: self._flies_on(client), PART_S, "0 and 1 fly on")
        if not self._flies_on(client):
            raise FederationFailed("0 and 1 have not resumed their routes")
        said = f"they agreed that {yielding} makes room, stayed {smallest_m:.1f} m apart or more, and fly on"
        return said, {"yielding": yielding, "smallest_separation_m": round(smallest_m, 2)}

    def _passed(self) -> bool:
        apart = self.separation
        if apart.latest_m is None or apart.smallest_m is None:
            return False
        return not self._open() and apart.latest_m > apart.smallest_m + 2 * SAFE_M

    def _flies_on(self, client: Client) -> bool:
        """Both of the pair move along again."""
        asked = client.ask(list(PAIR), contents.Query(semantic_label=VELOCITY), P.QUERY_REF, _ANSWER_S)
        found = [
            said
            for dialogue in asked
            for said in dialogue.results
            if isinstance(said, contents.Samples) and said.samples
        ]
        speeds = [hypot(*(_field(said.samples[-1], name) for name in ("north_m_s", "east_m_s"))) for said in found]
        return len(speeds) == len(PAIR) and min(speeds) > MOVING_M_S

    def _agreed(self, client: Client) -> str | None:
        """The platform that makes room, by a proposal that was agreed to."""
        proposed: dict[str, str] = {}
        agreed: set[str] = set()
        for dialogue in client.ask(list(PAIR), contents.ActList(), P.QUERY_REF, _ANSWER_S):
            logs = [log for said in dialogue.results if isinstance(said, contents.ActList) for log in said.acts or ()]
            for log in logs:
                act = _act_of(log)
                if act is not None and act.content is not None and act.content.head == "avoid":
                    proposed[act.conversation_id or ""] = act.sender.unit
                elif act is not None and act.performative is P.AGREE:
                    agreed.add(act.conversation_id or "")
        return next((yielding for conversation, yielding in proposed.items() if conversation in agreed), None)

    def _until(self, condition: Callable[[], bool], timeout_s: float, what: str) -> None:
        until = time.monotonic() + timeout_s
        with self.call.out.waiting(what) as tell:
            while not condition() and time.monotonic() < until:
                self._hear(_STEP_S)
                if self.separation.latest_m is not None:
                    tell(f"{what}: {self.separation.latest_m:.0f} m apart")

    # Questions, and the end

    def queries(self, client: Client) -> Outcome:
        now_us = client.federation_us()
        asked = (
            contents.Query(semantic_label=ALTITUDE),
            contents.Query(semantic_label=POSITION, op="at", at_us=now_us - 5_000_000),
            contents.Query(semantic_label=POSITION, op="between", from_us=now_us - 5_000_000, to_us=now_us - 1_000_000),
        )
        answers: list[list[contents.Samples]] = []
        for query in asked:
            dialogues = list(client.ask(list(UNITS), query, P.QUERY_REF, _ANSWER_S))
            found = [said for dialogue in dialogues for said in dialogue.results if isinstance(said, contents.Samples)]
            silent = set(UNITS) - {said.unit for said in found if said.samples}
            if silent:
                why = "; ".join(f"{d.unit}: {d.trouble or 'no value'}" for d in dialogues if d.unit in silent)
                raise FederationFailed(f"no answer to a query for {query.op}: {why}")
            answers.append(found)
        first = min(answers[0], key=lambda said: said.unit)
        values = sum(len(said.samples) for said in answers[2])
        said = f"latest: {value_text(first.samples[-1].value)} on 0; one 5 s ago each; {values} values of 4 s"
        return said, {"values": values}

    def cancel(self, client: Client) -> Outcome:
        """Nothing of the task is left anywhere."""
        task = self.task
        if task is None:
            raise FederationFailed("there is no task to cancel")
        ends = [client.cancel(one.unit, one.conversation) for one in (task, *self.streams) if not one.over]
        client.wait_for(lambda: all(end.over for end in ends), _ANSWER_S)
        left = 1
        until = time.monotonic() + 2 * _ANSWER_S
        while left and time.monotonic() < until:
            client.wait_for(lambda: False, 2 * _STEP_S)
            left = len(client.run(all_tasks(client, UNITS))) + len(client.run(all_monitors(client)))
        if left:
            raise FederationFailed(f"{left} tasks and monitors are still set up")
        return "the task and all it set up are taken down", {}


def _act_of(log: contents.ActLog) -> Act | None:
    """The act that was noted; none if it is noted only in part, since it is long."""
    try:
        return parse_act(log.act) if log.act else None
    except TextError:
        return None


def _field(reading: contents.Reading, name: str) -> float:
    value = reading.value.get(name) if isinstance(reading.value, dict) else None
    return float(value) if isinstance(value, int | float) else 0.0


@command(example="dyknow demo")
def demo(
    call: Call, *, seed: Annotated[int, typer.Option(metavar="K", min=0, help="Wind and noise follow from it.")] = 1
) -> int:
    """The main job end to end, in under a minute; exit 0 only if every step happened."""
    name = f"demo-{os.getpid()}" if call.settings.federation == "default" else call.settings.federation
    call = replace(call, settings=call.settings.model_copy(update={"federation": name}))
    shown = Demo(call, seed)
    began = time.monotonic()
    fleet = Fleet(run_directory(name), lifeline=True)
    with interruptible():
        try:
            _play(shown, fleet)
        finally:
            ended(fleet)
    alive = [found for found in fleet.running.values() if found.process() is not None]
    shown.step("down", lambda: _down(alive))
    return _summary(shown, time.monotonic() - began)


def _play(shown: Demo, fleet: Fleet) -> None:
    """The steps in order; without platforms or the task the rest has no meaning."""

    def up() -> Outcome:
        configs = planned(shown.call, FleetPlan(len(UNITS), "crossing", shown.seed))
        gathering: FleetStart = gathered(shown.call, fleet, configs)
        found_ms = gathering.discovery_ms
        return f"{len(UNITS)} UAVs found each other in {found_ms} ms", {"discovery_ms": found_ms}

    if not shown.step("up", up):
        return
    with connected(shown.call) as client:
        if not (shown.step("ls", lambda: shown.ls(client)) and shown.step("delegate", lambda: shown.delegate(client))):
            return
        if shown.step("encounter", shown.encounter):
            shown.step("avoidance", lambda: shown.avoidance(client))
        shown.step("queries", lambda: shown.queries(client))
        shown.step("cancel", lambda: shown.cancel(client))


def _down(alive: list[Any]) -> Outcome:
    if alive:
        raise FederationFailed(f"processes {', '.join(str(found.pid) for found in alive)} are still there")
    return "all processes have ended", {}


STEPS = ("up", "ls", "delegate", "encounter", "avoidance", "queries", "cancel", "down")


def _summary(shown: Demo, took_s: float) -> int:
    happened = {name for name, good, _, _ in shown.done if good}
    missing = [name for name in STEPS if name not in happened]
    if shown.call.out.json_lines:
        facts = {"event": "summary", "ok": not missing, "missing": missing, "took_ms": round(took_s * 1000)}
        shown.call.out.line(facts | shown.facts | {"alarms": len(shown.alarms)})
    else:
        rows = [
            ("found each other in", f"{shown.facts.get('discovery_ms', '-')} ms"),
            ("first alarm after its sample", f"{shown.facts.get('alarm_delay_ms', '-')} ms"),
            ("smallest separation of 0 and 1", f"{shown.facts.get('smallest_separation_m', '-')} m"),
            ("alarms opened and closed", str(len(shown.alarms))),
            ("steps done", f"{len(STEPS) - len(missing)} of {len(STEPS)}"),
            ("in all", f"{took_s:.0f} s"),
        ]
        shown.call.out.table("", ("summary", ""), rows, right=("",))
        if missing:
            shown.call.out.show(styled(f"did not happen: {', '.join(missing)}", "red"))
    return FAILED if missing else DONE
