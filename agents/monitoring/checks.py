"""A formula over a platform's live states, on request (thesis 7.5), and tasks that begin when one becomes true.

Node clock but for states.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial

from dyknow import NO_VALUE, US_PER_S, Label, Policy, earlier
from dyknow.agents.actions import COORDINATION, Offer
from dyknow.agents.admission.admission import reason_of
from dyknow.agents.exchange.gateway import Gateway
from dyknow.agents.exchange.label_agreements import LabelAgreements
from dyknow.agents.monitoring.reasons import because
from dyknow.agents.monitoring.text_reading import TextReading
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.tasks.life import TaskLife
from dyknow.agents.tasks.requests import CHECK_FORMULA, LATER, WHEN
from dyknow.agents.tasks.task import Task
from dyknow.federation.members.deadlines import Deadlines
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import CheckFormula, Reason, Verdict, When, read
from dyknow.federation.messages.contents.parts import MAX_LIST
from dyknow.kpl import parse_formula, print_specification
from dyknow.kpl.checking.needs import domains_of
from dyknow.kpl.running.asking import read_over
from dyknow.kpl.running.formula_states import FormulaState, FormulaStates
from dyknow.model.errors import ContentError, DyknowError, Refused, TextError, UnknownLabel
from dyknow.reasoning import Formula, Progressing, make_progression
from dyknow.reasoning.formulas.tree import Eventually

PERIOD_US = 100_000
MOST_WAITING, MOST_OF_ONE = 16, 4
"""Requests that wait for a condition: of all members, and of one."""
POLICY = Policy(change="sample", sample_us=PERIOD_US, max_delay_us=500_000)
TIMEOUT_S = 10.0
MOST, MOST_CHECKS_OF_ONE = 16, 8
MOST_REASONS = 8
"""Characters of a formula in an answer, so that it fits into one act."""
LONGEST_STATES = 4000
LONGEST_STATE = 200
WAITS = "; waits for "
LOOK_US = 1_000_000
"""After so long, and then as often, the task of a request that waits shows which streams have brought nothing."""


@dataclass(slots=True)
class Check:
    """One formula being progressed, and for whom; `do`: what to do when it is true."""

    act: Act
    progression: Progressing
    made: FormulaStates
    do: When | None = None
    states: int = 0
    valid_us: int | None = None
    valued: set[str] = field(default_factory=set)
    """The features that have had a value."""

    def progress(self, state: FormulaState) -> None:
        """Progress over one more state; states before the first value of any feature are skipped."""
        self.valued.update(name for name, value in state.values.items() if value is not NO_VALUE)
        if state.values and not self.valued:
            return
        self.states, self.valid_us = self.states + 1, state.valid_us
        self.progression.progress(state.valid_us, state.values, state.domains, state.events)


class Checks(Part):
    """The formulas under check on one platform, over the streams of its instance, derived ones too."""

    offers = (Offer(COORDINATION, (CHECK_FORMULA, WHEN)),)
    answers = (Verdict,)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._note = ports.note
        self._agreements = parts[LabelAgreements]
        self._clock, self._agent, self._gateway = ports.clock, ports.agent, parts[Gateway.of]
        self._tasks, self._instance = parts[TaskLife], ports.instance()
        self._open: dict[str, Check] = {}
        self._parsing: dict[str, Act] = {}
        self._deadlines: Deadlines[str] = Deadlines()
        self._looks: Deadlines[str] = Deadlines()

    def on_check(self, act: Act, content: CheckFormula, now_us: int) -> None:
        """`(check-formula ...)`: agree, then inform of the verdict, `undecided` when the time is over.

        Raises:
            ContentError: the formula is wrong, and where; or one of its streams has no producer.
            UnknownLabel: nothing here gives what a derived feature is made from.
            Refused: too many formulas are under check; the requester may not see one of its streams.
        """
        sender = act.sender.unit
        checking = [check.act.sender.unit for check in self._open.values() if check.do is None]
        of_one, shares = self._of_one(sender, checking)
        if len(checking) + len(self._parsing) >= MOST or of_one >= MOST_CHECKS_OF_ONE * shares:
            text = f"{len(checking)} formulas are under check here, {of_one} of {sender}; wait for one to end"
            raise Refused(text, "too-many-checks")

        def begin(formula: Formula, at_us: int) -> None:
            self._begin(act, formula, None, at_us)
            self._set_due(act, content.timeout_s or TIMEOUT_S, at_us)

        self._read(act, content.text, begin, now_us)

    def _of_one(self, unit: str, senders: list[str]) -> tuple[int, int]:
        """How many of these, and of those that are parsed, are of the member behind a unit, and how many shares it has."""
        share_of = self._agent.acts.share_of
        owner, shares = share_of(unit)
        senders = senders + [each.sender.unit for each in self._parsing.values()]
        return sum(share_of(each).owner == owner for each in senders), shares

    def on_when(self, act: Act, content: When, now_us: int) -> None:
        """`(when do: (create-multicast ...) condition: "gas[self] > 40")`: agree, and do it once that is true.

        It is a task until then, and is done as if it were requested at that moment, in the same conversation:
        limits and roles are those of then. It fails when the time is over.

        Raises:
            ContentError, UnknownLabel: as `on_check`, or the content of `do` is not understood.
            Refused: it may not be asked for in advance; too many requests wait; as `on_check`.
        """
        if content.do.head not in LATER:
            raise Refused(
                f"on a condition, unattended: expected a request that can be cancelled, {', '.join(sorted(LATER))}, got "
                f"({content.do.head} ...); follow the condition (dyknow alarms --follow) and request it then",
                "not-in-advance",
            )
        read(content.do)
        sender = act.sender.unit
        waiting = [check.act.sender.unit for check in self._open.values() if check.do is not None]
        of_one, shares = self._of_one(sender, waiting)
        if len(waiting) + len(self._parsing) >= MOST_WAITING or of_one >= MOST_OF_ONE * shares:
            text = f"{len(waiting)} requests wait for their conditions here, {of_one} of {sender}; cancel one"
            raise Refused(text, "too-many-waiting")
        self._read(act, content.condition, partial(self._wait, act, content), now_us)

    def _wait(self, act: Act, content: When, condition: Formula, now_us: int) -> None:
        conversation = self._begin(act, Eventually(condition), content, now_us)
        state = f"{content.do.head} when {content.condition}"[:LONGEST_STATE]

        def take_down(_at_us: int) -> tuple[str, ...]:
            self._drop(conversation)
            return ()

        self._tasks.add(Task(conversation, act.sender.unit, When.head, take_down, " ".join(state.split()), now_us))
        self._looks.set(conversation, now_us + LOOK_US)
        self._set_due(act, content.timeout_s, now_us)

    def _read(self, act: Act, text: str, then: Callable[[Formula, int], None], now_us: int) -> None:
        """Read a formula, a long one in a worker, and then do the rest; raises what is wrong with it, or answers that later."""
        conversation = act.conversation_id or ""

        def go_on(reading: TextReading[Formula], at_us: int) -> None:
            try:
                formula = read_over(self._instance, text, reading.result)
            except TextError as wrong:
                raise ContentError(str(wrong)) from None
            then(formula, at_us)

        def on_parsed(reading: TextReading[Formula], federation_us: int) -> None:
            if self._parsing.pop(conversation, None) is not act:
                return
            at_us = self._clock.wall_us(federation_us)
            try:
                go_on(reading, at_us)
            except ContentError as wrong:
                self._agent.answer(act, Performative.NOT_UNDERSTOOD, reason_of(wrong), at_us)
            except DyknowError as wrong:
                self._agent.answer(act, Performative.REFUSE, reason_of(wrong), at_us)

        if conversation in self._parsing:
            raise Refused(f"conversation {conversation} is about another formula", "other-task")
        reading = TextReading(text, parse_formula, on_parsed)
        if reading.begin(self._gateway.network.calls):
            self._parsing[conversation] = act
        else:
            go_on(reading, now_us)

    def _begin(self, act: Act, formula: Formula, do: When | None, now_us: int) -> str:
        conversation = self._tasks.check_free(act.conversation_id, act.sender.unit)
        if conversation in self._open:
            raise Refused(f"conversation {conversation} is about another formula", "other-task")
        made = self._states_of(formula, act.sender.unit, partial(self._on_state, conversation))
        self._open[conversation] = Check(act, make_progression(formula, PERIOD_US), made, do)
        self._gateway.network.step(made)
        self._agent.answer(act, Performative.AGREE, None, now_us)
        return conversation

    def _set_due(self, act: Act, timeout_s: float, now_us: int) -> None:
        self._deadlines.set(act.conversation_id or "", now_us + round(timeout_s * US_PER_S))

    def _states_of(self, formula: Formula, unit: str, on_state: Callable[[FormulaState], None]) -> FormulaStates:
        """Raise UnknownLabel if nothing here gives what a derived feature is made from, Refused if `unit` may not see it."""
        network = self._gateway.network
        made = FormulaStates(network, formula, POLICY, on_state, since_us=network.now_us)
        try:
            for label, owner in made.derived_from:
                if self._instance.parts.objects.sources(borne := Label(label, (owner,))):
                    self._agreements.check_stream(unit, borne)
                    continue
                self._gateway.local(label, owner)
                if owner == self._gateway.unit:
                    self._agreements.check(unit, label)
            for taken in (*(each.label for each in made.inputs), *map(Label, domains_of(formula))):
                stream = network.behind(taken)
                self._agreements.check_stream(unit, taken if stream is None else stream.label)
        except (UnknownLabel, Refused):
            made.cancel()
            raise
        return made

    def _on_state(self, conversation: str, state: FormulaState) -> None:
        check = self._open.get(conversation)
        if check is None:
            return
        check.progress(state)
        if check.progression.verdict != "undecided":
            self._end(conversation, self._clock.wall_us(state.now_us))

    def on_cancel(self, act: Act, now_us: int) -> bool:
        return self.on_lost(act, now_us)

    def on_lost(self, act: Act, _now_us: int) -> bool:
        """The requester no longer wants the verdict."""
        conversation = act.conversation_id or ""
        parsing = self._parsing.get(conversation)
        if parsing is not None and parsing.sender.unit == act.sender.unit:
            del self._parsing[conversation]
            return True
        check = self._open.get(conversation)
        if check is None or check.act.sender.unit != act.sender.unit:
            return False
        self._drop(conversation)
        return True

    @property
    def deadline_us(self) -> int | None:
        return earlier(self._deadlines.next_us, self._looks.next_us)

    def on_time(self, now_us: int) -> None:
        for conversation in self._looks.pop_due(now_us):
            self._look(conversation, now_us)
        for conversation in self._deadlines.pop_due(now_us):
            if conversation in self._open:
                self._end(conversation, now_us)

    def _look(self, conversation: str, now_us: int) -> None:
        """Show in a task which streams its condition waits for, until all have come."""
        check, task = self._open.get(conversation), self._tasks.get(conversation)
        if check is None or task is None:
            return
        state, _, before = task.state.partition(WAITS)
        silent = ", ".join(check.made.silent)
        shown = f"{silent[:LONGEST_STATE]}, which has brought nothing here" if silent else ""
        if shown != before:
            task.state = f"{state}{WAITS}{shown}" if silent else state
            if silent:
                self._note(f"{conversation}: {task.state}")
        if silent:
            self._looks.set(conversation, now_us + LOOK_US)

    def _end(self, conversation: str, now_us: int) -> None:
        check = self._open[conversation]
        verdict, made = check.progression.verdict, check.made
        if check.do is not None:
            self._do(conversation, check, check.do, now_us)
            return
        decided = verdict != "undecided"
        silent, text = made.silent, print_specification(made.declarations("check"))
        verdict_content = Verdict(
            verdict=verdict,
            valid_us=check.valid_us if decided else None,
            index=check.states - 1 if decided else None,
            because=tuple(because(one) for one in check.progression.explain()[:MOST_REASONS]),
            no_value=_some(name for name in made.labels if name not in check.valued),
            missing=_some(silent),
            states=text if len(text) <= LONGEST_STATES else "",
        )
        self._drop(conversation)
        self._agent.answer(check.act, Performative.INFORM, verdict_content, now_us)

    def _do(self, conversation: str, check: Check, when: When, now_us: int) -> None:
        """The condition is true: the request comes in as any other. Or time is over."""
        self._drop(conversation)
        self._tasks.forget(conversation)
        if check.progression.verdict == "true":
            asked = check.act._replace(performative=Performative.REQUEST, content=when.do)
            self._agent.requests.append(asked)
        else:
            text = f"{when.condition} was not true within {when.timeout_s:g} s"
            self._agent.answer(check.act, Performative.FAILURE, Reason(text=text, code="not-true"), now_us)

    def _drop(self, conversation: str) -> None:
        check = self._open.pop(conversation)
        self._deadlines.set(conversation, None)
        self._looks.set(conversation, None)
        self._gateway.network.unstep(check.made)
        check.made.cancel()


def _some(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(sorted(names))[:MAX_LIST]
