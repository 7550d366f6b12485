"""A formula over a platform's live states, on request (thesis 7.5). Node clock but for states."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial

from agents.actions import COORDINATION, Offer
from agents.exchange.gateway import Gateway
from agents.interface import InterfaceAgent
from agents.monitoring.reasons import because
from agents.part import Part
from agents.tasks.life import TaskLife
from agents.tasks.requests import CHECK_FORMULA
from dyknow import NO_VALUE, US_PER_S, Policy
from dyknow.model.errors import ContentError, Refused, TextError, UnknownLabel
from federation.members.clock import FederationClock
from federation.members.deadlines import Deadlines
from federation.messages.acts import Act, Performative
from federation.messages.contents import CheckFormula, Verdict
from federation.messages.contents.parts import MAX_LIST
from kpl import Instance, print_specification
from kpl.running.asking import read_over
from kpl.running.formula_states import FormulaState, FormulaStates
from reasoning import Formula, Progressing, make_progression

PERIOD_US = 100_000
POLICY = Policy(change="sample", sample_us=PERIOD_US, max_delay_us=500_000)
TIMEOUT_S = 10.0
MOST = 16
MOST_REASONS = 8
"""Characters of a formula in an answer, so that it fits into one act."""
LONGEST_STATES = 4000


@dataclass(slots=True)
class Check:
    """One formula being progressed, and for whom."""

    act: Act
    progression: Progressing
    made: FormulaStates
    states: int = 0
    valid_us: int | None = None
    valued: set[str] = field(default_factory=set)
    """The features that have had a value."""

    def progress(self, state: FormulaState) -> None:
        """One more state; what was before anything had a value is unknown."""
        self.valued.update(name for name, value in state.values.items() if value is not NO_VALUE)
        if state.values and not self.valued:
            return
        self.states, self.valid_us = self.states + 1, state.valid_us
        self.progression.progress(state.valid_us, state.values, state.domains, state.events)


class Checks(Part):
    """The formulas under check on one platform, over the streams of its instance, derived ones too."""

    offers = (Offer(COORDINATION, (CHECK_FORMULA,)),)
    answers = (Verdict,)

    def __init__(
        self,
        clock: FederationClock,
        agent: InterfaceAgent,
        gateway: Gateway,
        tasks: TaskLife,
        instance: Instance,
    ) -> None:
        self._clock, self._agent, self._gateway = clock, agent, gateway
        self._tasks, self._instance = tasks, instance
        self._open: dict[str, Check] = {}
        self._deadlines: Deadlines[str] = Deadlines()

    def on_check(self, act: Act, content: CheckFormula, now_us: int) -> None:
        """`(check-formula ...)`: agree, then inform of the verdict, `undecided` when the time is over.

        Raises:
            ContentError: the formula is wrong, and where; or one of its streams has no producer.
            UnknownLabel: nothing here gives what a derived feature is made from.
            Refused: too many formulas are under check.
        """
        conversation = self._tasks.check_free(act.conversation_id)
        if conversation in self._open:
            raise Refused(f"conversation {conversation} is about another formula")
        if len(self._open) >= MOST:
            raise Refused(f"{MOST} formulas are under check here already; wait for one to end")
        try:
            formula = read_over(self._instance, content.text)
        except TextError as wrong:
            raise ContentError(str(wrong)) from None
        made = self._states_of(formula, partial(self._on_state, conversation))
        self._open[conversation] = Check(act, make_progression(formula, PERIOD_US), made)
        self._gateway.network.step(made)
        self._agent.answer(act, Performative.AGREE, None, now_us)
        self._deadlines.set(conversation, now_us + round((content.timeout_s or TIMEOUT_S) * US_PER_S))

    def _states_of(self, formula: Formula, on_state: Callable[[FormulaState], None]) -> FormulaStates:
        """Raise UnknownLabel if nothing here gives what a derived feature is made from."""
        network = self._gateway.network
        made = FormulaStates(network, formula, POLICY, on_state, since_us=network.now_us)
        try:
            for label, unit in made.derived_from:
                self._gateway.local(label, unit)
        except UnknownLabel:
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
        check = self._open.get(conversation)
        if check is None or check.act.sender.unit != act.sender.unit:
            return False
        self._drop(conversation)
        return True

    @property
    def deadline_us(self) -> int | None:
        return self._deadlines.next_us

    def on_time(self, now_us: int) -> None:
        for conversation in self._deadlines.pop_due(now_us):
            if conversation in self._open:
                self._end(conversation, now_us)

    def _end(self, conversation: str, now_us: int) -> None:
        check = self._open[conversation]
        verdict, made = check.progression.verdict, check.made
        decided = verdict != "undecided"
        silent, text = made.silent, print_specification(made.declarations("check"))
        said = Verdict(
            verdict=verdict,
            valid_us=check.valid_us if decided else None,
            index=check.states - 1 if decided else None,
            because=tuple(because(one) for one in check.progression.explain()[:MOST_REASONS]),
            no_value=_some(name for name in made.labels if name not in check.valued),
            missing=_some(silent),
            states=text if len(text) <= LONGEST_STATES else "",
        )
        self._drop(conversation)
        self._agent.answer(check.act, Performative.INFORM, said, now_us)

    def _drop(self, conversation: str) -> None:
        check = self._open.pop(conversation)
        self._deadlines.set(conversation, None)
        self._gateway.network.unstep(check.made)
        check.made.cancel()


def _some(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(sorted(names))[:MAX_LIST]
