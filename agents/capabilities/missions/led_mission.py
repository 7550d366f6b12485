"""One mission that this platform leads: vehicles, searches and users carry out decisions of `planning`, and the results
are reported to `planning` again. Times are the node clock, but for those of the mission, which are federation time.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from dyknow import Value
from dyknow.agents.capabilities.missions.command_run import VehicleCommand
from dyknow.agents.capabilities.missions.locating import Locating, UnitSights
from dyknow.agents.capabilities.missions.looking import FIRST_LOOK, EffectLooks
from dyknow.agents.capabilities.missions.mission_texts import ActionCommands, MissionTexts, texts_of, with_initial
from dyknow.agents.capabilities.missions.sensing import UnitSensors
from dyknow.agents.tasks.authority import TaskEvidence
from dyknow.federation.messages.acts import Act
from dyknow.federation.messages.contents import MissionEntry, MissionQuestion
from dyknow.model.errors import Refused
from dyknow.planning.domains.model import Declarations
from dyknow.planning.execution import events
from dyknow.planning.recovery.mission import Mission
from dyknow.planning.recovery.options import MissionOptions, MissionPhase
from dyknow.planning.search.plans import MissionPlan

PERIOD_US: Final = 200_000
NOTES: Final = 32
AWAITED_US: Final = 6_000_000
"""How long the mission waits for vehicles to join, and for their positions, before it begins without them."""


class MissionUnit(Protocol):
    """A vehicle that takes part: the platform's own, or that of another one."""

    waits: str
    lost: str

    @property
    def is_ready(self) -> bool:
        """Whether it has joined."""

    def perform(self, step: int, action: str, commands: tuple[VehicleCommand, ...], now_us: int) -> None: ...
    def abort(self, step: int, now_us: int) -> None: ...
    def hold(self, how: str, now_us: int, /) -> None: ...
    def on_time(self, now_us: int) -> None: ...
    def leave(self, now_us: int) -> None: ...


class MissionPorts(Protocol):
    """The ports of a mission to the part that holds it."""

    def search(self, led: "LedMission", effect: events.SearchPlan, texts: tuple[str, str], now_us: int) -> None: ...
    def end_search(self, led: "LedMission") -> None: ...
    def report(self, led: "LedMission", kind: str, text: str, now_us: int) -> None: ...
    def ended(self, led: "LedMission", effect: events.MissionEnded, now_us: int) -> None: ...
    def federation_us(self, now_us: int) -> int: ...


@dataclass(frozen=True, slots=True)
class MissionOrder:
    """A delegated mission: its act and its task.

    Attributes:
        plan: the one that was consented to, if one was proposed.
        continues: why this platform leads it from its middle on; empty: it begins.
        permit: by which the one that had it flown may lead it, also when that has run out; None: that is a command centre.
    """

    name: str
    act: Act
    conversation: str
    chain: tuple[str, ...]
    timeout_us: int
    plan: MissionPlan | None = None
    continues: str = ""
    permit: TaskEvidence | None = None


class LedMission:
    """See the module.

    Attributes:
        is_passed_on: another platform leads it from now on, so that it is not over.
    """

    def __init__(
        self,
        order: MissionOrder,
        texts: MissionTexts,
        sensors: UnitSensors,
        sights: UnitSights,
        units: dict[str, MissionUnit],
        ports: MissionPorts,
        begun_us: int,
    ) -> None:
        self.order, self.texts, self.units, self.sensors = order, texts, units, sensors
        self._ports, self._begun_us = ports, begun_us
        self._ended: tuple[str, int] | None = None
        self._sights, self._locating = sights, Locating(sights, units)
        self._effects = EffectLooks(sights, units)
        recoveries = (*texts.domain.recoveries, *texts.problem.recoveries)
        operators = (*texts.domain.operators, *texts.problem.operators)
        self._locates = any(one.located for one in recoveries) or any(one.located for one in operators)
        self._commands = ActionCommands(texts, sensors.frame)
        self.mission: Mission | None = None
        self.is_passed_on = False
        self.notes: deque[str] = deque(maxlen=NOTES)
        self.question: events.AskHuman | None = None
        self.nodes = 0
        self._waits: dict[str, str] = {}
        self._lost: dict[str, str] = {}
        self._due_us = begun_us

    @property
    def deadline_us(self) -> int:
        return self._due_us

    def on_time(self, now_us: int) -> None:
        """Look at vehicles and at the state."""
        if now_us < self._due_us:
            return
        self._due_us = now_us + PERIOD_US
        federation_us = self._ports.federation_us(now_us)
        values = self.sensors.sample(federation_us)
        if self.mission is None:
            self._begin(values, now_us)
            return
        self._look(now_us)
        self.take(events.StateSampled(federation_us, values), now_us)
        for ended in self._effects.step(now_us, federation_us):
            self._end_action(ended, now_us)
        for event in self._locating.step(now_us, federation_us):
            if isinstance(event, events.StateSampled):
                self._note("found", _shown(event.values), now_us)
            self.take(event, now_us)
        if self.mission.ended is None:
            self._do(self.mission.on_time(federation_us), now_us)

    def _begin(self, values: dict[str, Value], now_us: int) -> None:
        """Begin when all vehicles have joined and their state is known, or when it has taken too long."""
        is_late = now_us >= self._begun_us + AWAITED_US
        if not is_late and not all(unit.is_ready or unit.lost for unit in self.units.values()):
            return
        unknown = [label for label, value in values.items() if not isinstance(value, bool | int | float)]
        if unknown and not is_late:
            return
        problem = with_initial(self.texts.problem, values)
        options = MissionOptions(period_us=PERIOD_US, search_us=self.order.timeout_us)
        self.mission = Mission(self.order.name, self.texts.domain, problem, options)
        self._do(self.mission.start(self._ports.federation_us(now_us), self.order.plan, self.order.continues), now_us)
        self._look(now_us)

    def _look(self, now_us: int) -> None:
        """Tell the mission which vehicles their pilots have, and which are lost."""
        for name, unit in self.units.items():
            unit.on_time(now_us)
            if unit.lost != self._lost.get(name, ""):
                self._lost[name] = unit.lost
                lost = events.UnitLost(name, unit.lost) if unit.lost else events.UnitBack(name)
                self.take(lost, now_us)
            if unit.waits != self._waits.get(name, ""):
                self._waits[name] = unit.waits
                waits = events.PilotTookOver(name, unit.waits) if unit.waits else events.PilotGaveBack(name)
                self.take(waits, now_us)

    def left(self, now_us: int) -> Declarations | None:
        """The problem as it is now; None: it has not begun, or a lost object is being looked for."""
        if self.mission is None or self.mission.status.phase is MissionPhase.LOCATING:
            return None
        return self.mission.problem_at(self._ports.federation_us(now_us))

    def begin(self, now_us: int) -> None:
        """Have the streams of other platforms come."""
        self.sensors.begin(now_us)
        if self._locates:
            self._sights.need(now_us, wanted=True)

    # -- reports -----------------------------------------------------------------------------------------------

    def take(self, event: events.MissionEvent, now_us: int) -> None:
        """Pass an event to the mission, unless it has ended, and carry out the effects."""
        if self.mission is not None and self.mission.ended is None:
            self._do(self.mission.on_event(event, self._ports.federation_us(now_us)), now_us)

    def on_performed(self, step: int, why: str, now_us: int) -> None:
        """A vehicle has done the commands of a step, or not."""
        if step >= FIRST_LOOK or not self._locating.on_performed(step, why):
            ended = self._effects.on_performed(step, why, now_us, self._ports.federation_us(now_us))
            if ended is not None:
                self._end_action(ended, now_us)

    def _end_action(self, ended: events.ActionEnded, now_us: int) -> None:
        if ended.seen:
            self._note("seen", _shown(ended.seen), now_us)
        self.take(ended, now_us)

    def on_searched(self, search: int, plan: MissionPlan | None, reason: str, *, is_certain: bool, now_us: int) -> None:
        """A search is over."""
        self.take(events.PlanSearched(search, plan, reason, is_certain), now_us)

    def answer(self, number: int, answer: str, by: str, now_us: int) -> None:
        """The answer to the open question; raises Refused: it is another one, or no answer to it."""
        asked = self.question
        if asked is None or asked.question != number:
            raise Refused(
                f"question {number} is not open; {'none' if asked is None else asked.question} is", "no-question"
            )
        if answer not in asked.options:
            raise Refused(f"expected one of {', '.join(asked.options)}, got {answer!r}", "no-answer")
        self.take(events.QuestionAnswered(number, answer, by), now_us)

    def end(self, reason: str, now_us: int) -> None:
        """End it: vehicles that fly for it hold."""
        if self.mission is None:
            self._ended = reason, now_us
            self._ports.ended(self, events.MissionEnded("aborted", reason, ()), now_us)
        else:
            self.take(events.MissionAborted(reason), now_us)

    def release(self, now_us: int) -> None:
        """Release the vehicles and streams of a mission that is over."""
        self._ports.end_search(self)
        self._locating.pause(now_us)
        self._effects.end(now_us)
        for unit in self.units.values():
            unit.leave(now_us)
        self.sensors.end(now_us)
        if self._locates:
            self._sights.need(now_us, wanted=False)

    # -- done --------------------------------------------------------------------------------------------------

    def _do(self, effects: Sequence[events.MissionEffect], now_us: int) -> None:
        mission = self.mission
        for effect in effects:
            match effect:
                case events.StartAction():
                    self._start(effect, now_us)
                case events.AbortAction(step, unit):
                    self._effects.abort(step, now_us)
                    self.units[unit].abort(step, now_us)
                case events.HoldUnit(unit, how, _):
                    self.units[unit].hold(how, now_us)
                case events.SearchPlan():
                    self._ports.search(self, effect, texts_of(effect.domain, effect.problem), now_us)
                case events.CancelSearch():
                    self._ports.end_search(self)
                case events.Locate():
                    self._locating.locate(effect, self._ports.federation_us(now_us))
                    for name in self._locating.vague:
                        text = f"{name} has no colour in the problem: what else lies there may be taken for it"
                        self._note("uncertain", text, now_us)
                case events.AskHuman(_, text, options, default, _):
                    self._note("asks", f"{text} ({', '.join(options)}; without an answer: {default})", now_us)
                case events.MissionNote(kind, text):
                    self._note(kind, text, now_us)
                case events.MissionEnded():
                    self._ports.ended(self, effect, now_us)
        status = None if mission is None else mission.status
        self.question = None if status is None else status.question
        if self._locating.is_looking and (status is None or status.phase is not MissionPhase.LOCATING):
            self._locating.pause(now_us)

    def _start(self, start: events.StartAction, now_us: int) -> None:
        step, unit, action = start[:3]
        try:
            commands = self._commands.of(action)
        except Refused as refused:
            self.on_performed(step, refused.reason, now_us)
            return
        if len(action.objects) > 1 and VehicleCommand("magnet", (1.0,)) in commands:
            self.sensors.take(unit, action.objects[1])
        self._locating.on_started(unit, action)
        self._effects.on_started(start, now_us)
        self.units[unit].perform(step, action.shown, commands, now_us)

    def _note(self, kind: str, text: str, now_us: int) -> None:
        self.notes.append(f"{kind}: {text}")
        self._ports.report(self, kind, text, now_us)

    def entry(self) -> MissionEntry:
        """Its state, for a list."""
        order, mission = self.order, self.mission
        if mission is None and self._ended is not None:
            why, since_us = self._ended
            return MissionEntry(
                mission=order.name, conversation=order.conversation, phase="ended", since_us=since_us, why=why[:1000], chain=order.chain,
            )  # fmt: skip
        if mission is None:
            joining = [name for name, unit in self.units.items() if not (unit.is_ready or unit.lost)]
            return MissionEntry(
                mission=order.name, conversation=order.conversation, phase="joining", since_us=self._begun_us,
                why=f"waits for {', '.join(joining) or 'the state of vehicles'}", chain=order.chain,
            )  # fmt: skip
        status, asked = mission.status, self.question
        question = None if asked is None else MissionQuestion(
            number=asked.question, text=asked.text[:1000], options=tuple(one[:200] for one in asked.options),
            default=asked.default[:200], until_us=asked.until_us,
        )  # fmt: skip
        searched = f", {self.nodes} nodes so far" if self.nodes and "search" in status.phase else ""
        return MissionEntry(
            mission=order.name, conversation=order.conversation, phase=str(status.phase), since_us=status.since_us,
            why=f"{status.why}{searched}"[:1000], replans=status.replans, chain=order.chain, question=question,
            actions=tuple(f"{phase}  {shown}" for _, _, shown, phase, _ in status.steps[:128]),
        )  # fmt: skip


def _shown(places: Mapping[str, Value]) -> str:
    return ", ".join(f"{label} = {value:.1f}" for label, value in places.items())
