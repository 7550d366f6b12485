"""A mission: goals, the plan that is executed for them, and the recovery when it fails (thesis 7.5.3).

A value stepped by events and time; it returns effects. After any end of a plan, by a fault, a pilot, a pause or a lost
unit, the same follows: units hold, the state is rebuilt from the sensed states, and a new plan is searched for.
"""

from collections import Counter
from collections.abc import Mapping

from dyknow.model.errors import TextError
from dyknow.model.sample import Value
from dyknow.planning.domains import model
from dyknow.planning.domains.model import Declarations
from dyknow.planning.execution import events
from dyknow.planning.execution.beliefs import Beliefs
from dyknow.planning.execution.events import AskHuman, HoldWay, MissionEffect, MissionEnded, MissionNote
from dyknow.planning.execution.executor import ExecutionFault, PlanExecutor
from dyknow.planning.execution.flags import ExecutionFlags
from dyknow.planning.execution.generation import PlanMonitor
from dyknow.planning.recovery.goals import MissionGoals, name_of
from dyknow.planning.recovery.interrupted import hindrance, rest_of
from dyknow.planning.recovery.options import DROP, GIVE_UP, MissionOptions, MissionPhase, MissionStatus
from dyknow.planning.recovery.situation import assume, objects_of, past_events, problem_now, recovery_from
from dyknow.planning.recovery.units import MissionUnits
from dyknow.planning.search.plans import MissionPlan, bound_labels
from dyknow.planning.search.tasks import PlanningTask

_FRESH_PERIODS = 3
_GRACE_US = 5_000_000
"""So much longer than it may take a search is waited for."""


class Mission:
    """The goals of a problem pursued.

    Args:
        name: of the mission, for users.
        domain: checked, as `parse_domain` gives it.
        problem: checked against it; its times count from the start of the mission.
        options: limits.

    Attributes:
        ended: the last effect, once it has ended.
    """

    def __init__(
        self, name: str, domain: Declarations, problem: Declarations, options: MissionOptions | None = None
    ) -> None:
        self.name, self._domain, self._problem = name, domain, problem
        self.options = options or MissionOptions()
        self.ended: MissionEnded | None = None
        self._declared = domain.joined(problem)
        self._task = PlanningTask(self._declared)
        self._recoveries = {one.name: one for one in self._declared.recoveries}
        self._units = MissionUnits(tuple(u for sort in self._declared.units for u in self._task.types.members[sort]))
        self._goals = MissionGoals(problem.goals)
        self._beliefs = Beliefs({}, 0, 0, self._task.default_of)
        self._flags = ExecutionFlags()
        self._executor: PlanExecutor | None = None
        self._rest: MissionPlan | None = None
        self._phase, self._since_us, self._why = MissionPhase.READY, 0, "it has not begun"
        self._begun_us, self._told_ms = 0, 0
        self._next_step, self._search, self._question = 1, 0, 0
        self._asked: AskHuman | None = None
        self._until_us: int | None = None
        self._faults: Counter[str] = Counter()
        self._replans = 0
        self._assumed: list[str] = []
        self._unknown: tuple[str, ...] = ()
        self._problem_now = problem

    def start(self, now_us: int, plan: MissionPlan | None = None, why: str = "") -> list[MissionEffect]:
        """Begin: with a plan that is given, or by a search for one; `why`: in the middle, as its former leader is gone."""
        self._begun_us, fresh_us = now_us, _FRESH_PERIODS * self.options.period_us
        self._beliefs = Beliefs(dict(self._task.values), now_us, fresh_us, self._task.default_of)
        if plan is not None:
            return self._execute(plan, now_us)
        return self._replan(why, now_us) if why else self._search_plan("the mission begins", now_us)

    @property
    def deadline_us(self) -> int | None:
        """When `on_time` is to be called if nothing comes before."""
        times = [] if self._until_us is None else [self._until_us]
        if self._phase is MissionPhase.EXECUTING and self._executor is not None:
            deadline_us = self._executor.deadline_us
            times += [] if deadline_us is None else [deadline_us]
        return min(times, default=None)

    @property
    def labels(self) -> frozenset[str]:
        """Labels whose values states should have now."""
        found = set(self._unknown)
        if self._executor is not None:
            found |= self._executor.labels
        return frozenset(found)

    @property
    def flags(self) -> ExecutionFlags:
        return self._flags

    @property
    def monitors(self) -> tuple[PlanMonitor, ...]:
        """The active monitors."""
        executor = self._executor
        return () if executor is None or self._phase is not MissionPhase.EXECUTING else executor.monitors

    @property
    def status(self) -> MissionStatus:
        steps = () if self._executor is None else tuple(self._executor.steps.values())
        return MissionStatus(
            self.name, self._phase, self._since_us, self._why,
            tuple((one.number, one.unit, one.shown, str(one.phase), one.since_us) for one in steps),
            self._flags.now(), tuple(self._faults.items()), self._replans, tuple(self._assumed),
            self._goals.kept, tuple(self._goals.dropped), self._units.missing, self._asked,
        )  # fmt: skip

    def on_event(self, event: events.MissionEvent, now_us: int) -> list[MissionEffect]:
        """Take an event; after the end of the mission nothing follows from any."""
        if self._phase in {MissionPhase.READY, MissionPhase.ENDED}:
            return []
        match event:
            case events.StateSampled(valid_us, values):
                return self._on_state(valid_us, values, now_us)
            case events.ActionEnded():
                if self._executor is None or self._phase is not MissionPhase.EXECUTING:
                    return []
                return self._after(self._executor.on_ended(event, now_us), now_us)
            case events.PlanSearched():
                return self._on_searched(event, now_us)
            case events.QuestionAnswered(question, answer, by):
                is_open = self._asked is not None and self._asked.question == question
                return self._on_answer(answer, f"{by or 'a user'}:", now_us) if is_open else []
            case events.NotLocated(reason):
                return self._ask(reason, now_us) if self._phase is MissionPhase.LOCATING else []
            case events.PilotTookOver(unit, reason):
                return self._on_pilot(unit, reason, now_us)
            case events.PilotGaveBack(unit, reason):
                return self._on_given_back(unit, now_us)
            case events.UnitLost(unit, reason):
                return self._on_lost(unit, reason, now_us)
            case events.UnitBack(unit, _):
                return self._on_back(unit, now_us)
            case events.MissionSuspended(reason, keeps_plan):
                self._rest = rest_of(self._executor) if keeps_plan else None
                found = self._leave(reason or "the mission is suspended", "loiter", now_us)
                return [*found, *self._wait(MissionPhase.SUSPENDED, reason or "a user asked for it", now_us)]
            case events.MissionResumed():
                return self._resume(now_us) if self._phase is MissionPhase.SUSPENDED else []
            case events.MissionAborted(reason):
                found = self._leave(reason or "the mission is aborted", "loiter", now_us)
                return [*found, *self._end("aborted", reason or "a user asked for it", now_us)]

    def on_time(self, now_us: int) -> list[MissionEffect]:
        """Let time pass."""
        if self._phase is MissionPhase.EXECUTING and self._executor is not None:
            self._let_happen(now_us)
            return self._after(self._executor.on_time(now_us), now_us)
        if self._until_us is None or now_us < self._until_us:
            return []
        match self._phase:
            case MissionPhase.SEARCHING:
                late = events.PlanSearched(self._search, None, "the search has not answered", is_certain=False)
                return [events.CancelSearch(self._search), *self._on_searched(late, now_us)]
            case MissionPhase.ASKING if self._asked is not None:
                return self._on_answer(self._asked.default, "no answer came: the default is", now_us)
            case MissionPhase.LOCATING:
                return self._ask(f"not found: {', '.join(self._unseen())}", now_us)
        return []

    def _on_state(self, valid_us: int, values: Mapping[str, Value], now_us: int) -> list[MissionEffect]:
        self._beliefs.on_state(valid_us, values)
        if self._phase is MissionPhase.LOCATING and not self._unseen():
            self._beliefs.settle(self._unknown)
            self._unknown = ()
            return self._replan("what was lost is found", now_us)
        if self._phase is MissionPhase.EXECUTING and self._executor is not None:
            self._let_happen(now_us)
            return self._after(self._executor.on_state(valid_us, now_us), now_us)
        return []

    def _let_happen(self, now_us: int) -> None:
        """Take in the problem's events up to now."""
        elapsed_ms = (now_us - self._begun_us) // 1000
        self._beliefs.change(now_us, past_events(self._task, self._told_ms, elapsed_ms))
        self._told_ms = elapsed_ms

    def _after(self, found: list[MissionEffect], now_us: int) -> list[MissionEffect]:
        """The effects of the executor's progress: recovery from a fault, or the end of the plan."""
        executor = self._executor
        assert executor is not None  # noqa: S101 - a plan is executed
        if executor.fault is not None:
            return [*found, *self._recover(executor.fault, now_us)]
        return [*found, *self._finish(now_us)] if executor.is_done else found

    def _finish(self, now_us: int) -> list[MissionEffect]:
        """The plan has ended well: goals that do not hold after all are a fault."""
        missed = self._goals.missed(self._declared, self._beliefs)
        if missed:
            text = f"the plan is done, and {', '.join(missed)} does not hold"
            fault = ExecutionFault("missed", f"goals {', '.join(missed)}", text, 0, now_us)
            return self._recover(fault, now_us)
        is_whole = not (self._goals.dropped or self._goals.unreached)
        return self._end("reached" if is_whole else "partly reached", "the plan is done", now_us)

    def _execute(self, plan: MissionPlan, now_us: int) -> list[MissionEffect]:
        declared = self._domain.joined(self._problem_now)
        try:
            executor = PlanExecutor(
                *(declared, plan, now_us, self._beliefs, self._flags, self._next_step, self.options.patience_us),
                missing=self._units.missing,
            )
        except TextError as error:
            return self._end("gave up", f"the plan cannot be monitored: {error}", now_us)
        self._executor, self._goals.unreached = executor, plan.unreached
        self._next_step += len(plan.actions)
        self._units.release()
        self._turn(MissionPhase.EXECUTING, f"{len(plan.actions)} actions", now_us)
        found: list[MissionEffect] = [MissionNote("plan", f"{len(plan.actions)} actions, {plan.end_ms / 1000:g} s")]
        found += [MissionNote("unreached", f"the plan does not reach {name}") for name in plan.unreached]
        return self._after([*found, *executor.on_time(now_us)], now_us)

    def _recover(self, fault: ExecutionFault, now_us: int) -> list[MissionEffect]:
        """Hold, assume what the recovery operator says, find what is lost, and make a new plan."""
        recovery = recovery_from(fault, self._recoveries, self._declared, self._beliefs)
        self._faults[fault.name] += 1
        times = self._faults[fault.name]
        found = self._leave(fault.text, recovery.act, now_us)
        text = f"{fault.text}; {recovery.name}, time {times} of {recovery.times}"
        found.append(MissionNote("fault", text, fault.step))
        found += self._assume(recovery, fault.bound, now_us)
        found += self._units.leave_out(str(fault.bound.get(term.name, term.name)) for term in recovery.without)
        if times > recovery.times:
            return [*found, *self._last_resort(recovery.then, fault.text, now_us)]
        if recovery.located:
            self._unknown = bound_labels(recovery.located, fault.bound)
            self._beliefs.forget(self._unknown)
        return [*found, *self._replan(fault.text, now_us)]

    def _assume(self, recovery: model.RecoveryOperator, bound: Mapping[str, Value], now_us: int) -> list[MissionEffect]:
        changed = assume(self._declared, recovery, bound, self._beliefs, now_us)
        texts = [f"{label} := {value}" for label, value in changed]
        self._assumed += texts
        return [MissionNote("assumed", ", ".join(texts))] if texts else []

    def _locate(self, why: str, now_us: int) -> list[MissionEffect]:
        objects = tuple(dict.fromkeys(one for label in self._unknown for one in objects_of(label)))
        self._turn(MissionPhase.LOCATING, f"looking for {', '.join(objects)}", now_us, self.options.locate_us)
        return [
            MissionNote("locating", f"looking for {', '.join(objects)}"),
            events.Locate(objects, self._unknown, now_us, why, self._beliefs.values()),
        ]

    def _unseen(self) -> tuple[str, ...]:
        """Labels that no state has shown since they were to be located."""
        return tuple(label for label in self._unknown if not self._beliefs.seen_since(label, self._since_us))

    def _last_resort(self, then: str, why: str, now_us: int) -> list[MissionEffect]:
        if then == "give-up":
            return self._end("gave up", why, now_us)
        if then == "drop-goal" and self._goals.droppable:
            return self._drop(self._goals.droppable[0], why, now_us)
        return self._ask(why, now_us)

    def _drop(self, name: str, why: str, now_us: int) -> list[MissionEffect]:
        self._goals.dropped.append(name)
        note = MissionNote("dropped", f"the goal {name} is dropped: {why}")
        if not self._goals.kept:
            return [note, *self._end("gave up", f"no goal is left: {why}", now_us)]
        self._unknown = ()
        return [note, *self._replan(why, now_us)]

    def _ask(self, why: str, now_us: int) -> list[MissionEffect]:
        self._question += 1
        self._asked = self.options.question(self._question, why, self._goals.droppable, now_us)
        self._turn(MissionPhase.ASKING, why, now_us, self.options.question_us)
        return [self._asked]

    def _on_answer(self, answer: str, by: str, now_us: int) -> list[MissionEffect]:
        asked = self._asked
        assert asked is not None  # noqa: S101 - a question is open
        if answer not in asked.options:
            return [MissionNote("answer", f"{answer!r} is no answer; answers are {', '.join(asked.options)}")]
        self._asked = None
        note = MissionNote("answer", f"{by} {answer}")
        if answer == GIVE_UP:
            return [note, *self._end("gave up", asked.text, now_us)]
        if answer.startswith(DROP):
            return [note, *self._drop(answer.removeprefix(DROP), asked.text, now_us)]
        self._faults.clear()
        return [note, *self._replan(asked.text, now_us)]

    def _replan(self, why: str, now_us: int) -> list[MissionEffect]:
        """A new plan from the state now, unless a pilot flies, or something is to be found first."""
        if self._units.pilots:
            return self._wait(MissionPhase.WITH_PILOT, f"{self._units.flown_by_hand} is flown by hand", now_us)
        if self._unknown:
            return self._locate(why, now_us)
        self._replans += 1
        if self._replans > self.options.most_replans:
            return self._end("gave up", f"{self._replans - 1} plans were made: {why}", now_us)
        return [*self._assume_again(now_us), *self._search_plan(why, now_us)]

    def _assume_again(self, now_us: int) -> list[MissionEffect]:
        """Make the assumptions of the recovery `replan`, which precede every new plan."""
        recovery = self._recoveries.get(model.REPLANNING)
        return [] if recovery is None else self._assume(recovery, {}, now_us)

    def _search_plan(self, why: str, now_us: int) -> list[MissionEffect]:
        self._rebuild(now_us)
        self._search, self._executor = self._search + 1, None
        limit_us = self.options.search_us
        self._turn(MissionPhase.SEARCHING, why, now_us, limit_us + _GRACE_US)
        return [events.SearchPlan(self._search, self._domain, self._problem_now, self._units.acting, limit_us, why)]

    def _rebuild(self, now_us: int) -> None:
        self._let_happen(now_us)
        if now_us - self._begun_us >= 1000 or self._replans:
            self._problem_now = self.problem_at(now_us)

    def problem_at(self, now_us: int) -> Declarations:
        """The problem as it is now: the state that is held for true, the goals that are pursued."""
        goals = [one for one in self._problem.goals if name_of(one) not in self._goals.dropped]
        elapsed_ms = (now_us - self._begun_us) // 1000
        return problem_now(self._problem, self._task, self._beliefs, self._unknown, goals, elapsed_ms)

    def _resume(self, now_us: int) -> list[MissionEffect]:
        """After a pause: the plan where it was interrupted, if it was kept and can continue, else a new one."""
        rest, self._rest = self._rest, None
        if rest is None or self._units.pilots or self._unknown:
            return self._replan("the mission is resumed", now_us)
        found = self._assume_again(now_us)
        self._rebuild(now_us)
        why = hindrance(self._domain.joined(self._problem_now), rest)
        if why:
            return [*found, MissionNote("replans", why), *self._replan(why, now_us)]
        return [*found, MissionNote("continues", f"at {rest.actions[0].shown}"), *self._execute(rest, now_us)]

    def _on_searched(self, event: events.PlanSearched, now_us: int) -> list[MissionEffect]:
        if self._phase is not MissionPhase.SEARCHING or event.search != self._search:
            return []
        if event.plan is not None:
            return self._execute(event.plan, now_us)
        gave_up = "" if event.is_certain else "the search gave up: "
        found: list[MissionEffect] = [MissionNote("no plan", f"{gave_up}{event.reason}")]
        return [*found, *self._ask(f"no plan: {gave_up}{event.reason}", now_us)]

    def _on_pilot(self, unit: str, reason: str, now_us: int) -> list[MissionEffect]:
        """The pilot goes first: nothing is sent to that vehicle, the others hold, and the mission waits."""
        if unit in self._units.pilots or unit not in self._units.everyone:
            return []
        self._units.pilots.add(unit)
        why = f"{unit} is flown by hand{f': {reason}' if reason else ''}"
        if self._phase in {MissionPhase.SUSPENDED, MissionPhase.WITH_PILOT}:
            return [MissionNote("pilot", why)]
        found = self._leave(why, "loiter", now_us)
        return [*found, *self._wait(MissionPhase.WITH_PILOT, why, now_us)]

    def _on_given_back(self, unit: str, now_us: int) -> list[MissionEffect]:
        if unit not in self._units.pilots:
            return []
        self._units.pilots.discard(unit)
        note = MissionNote("pilot", f"{unit} takes commands again")
        if self._phase is not MissionPhase.WITH_PILOT or self._units.pilots:
            return [note]
        return [note, *self._replan(f"{unit} takes commands again", now_us)]

    def _on_lost(self, unit: str, reason: str, now_us: int) -> list[MissionEffect]:
        if unit in self._units.lost or unit not in self._units.everyone:
            return []
        self._units.lost.add(unit)
        why = f"{unit} is lost{f': {reason}' if reason else ''}"
        note = MissionNote("unit lost", why)
        if self._phase is MissionPhase.EXECUTING and self._executor is not None and self._executor.needs(unit):
            return [note, *self._leave(why, "loiter", now_us), *self._replan(why, now_us)]
        if self._phase is MissionPhase.SEARCHING:
            return [note, events.CancelSearch(self._search), *self._search_plan(why, now_us)]
        return [note]

    def _on_back(self, unit: str, now_us: int) -> list[MissionEffect]:
        """A unit can act again: where there is no plan, or it leaves goals aside, there is a new one."""
        if unit not in self._units.lost:
            return []
        self._units.lost.discard(unit)
        why = f"{unit} can act again"
        is_in_need = self._phase is MissionPhase.EXECUTING and self._goals.unreached
        if is_in_need or self._phase in {MissionPhase.SEARCHING, MissionPhase.ASKING}:
            return [MissionNote("unit back", why), *self._leave(why, "loiter", now_us), *self._replan(why, now_us)]
        return [MissionNote("unit back", why)]

    def _leave(self, why: str, how: HoldWay, now_us: int) -> list[MissionEffect]:
        """Leave the plan, the search or the question; units that the mission has commanded hold."""
        found: list[MissionEffect] = []
        if self._phase is MissionPhase.SEARCHING:
            found.append(events.CancelSearch(self._search))
        self._asked = None
        executor = self._executor
        if executor is None:
            return found
        commanded = {one.unit for one in executor.steps.values() if one.phase != "waiting"}
        found += [
            one
            for one in executor.abort(why, now_us)
            if not isinstance(one, events.AbortAction) or one.unit not in self._units.pilots
        ]
        found += self._units.hold(commanded, how, why)
        return found

    def _wait(self, phase: MissionPhase, why: str, now_us: int) -> list[MissionEffect]:
        self._turn(phase, why, now_us)
        return [MissionNote("waits", f"{phase}: {why}")]

    def _turn(self, phase: MissionPhase, why: str, now_us: int, limit_us: int | None = None) -> None:
        self._phase, self._since_us, self._why = phase, now_us, why
        self._until_us = None if limit_us is None else now_us + limit_us

    def _end(self, outcome: events.Outcome, reason: str, now_us: int) -> list[MissionEffect]:
        missed = () if outcome == "reached" else self._goals.open(self._declared, self._beliefs)
        self.ended = MissionEnded(outcome, reason, missed)
        self._turn(MissionPhase.ENDED, reason, now_us)
        return [self.ended]
