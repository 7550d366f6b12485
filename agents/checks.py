"""A formula over a platform's live states, for a person who wants to know now (thesis 7.5). Node clock but for states."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import islice

from agents.context import Context
from dyknow import NO_VALUE, US_PER_S, Policy, Sample, State, StateInput, StatePolicy, Subscription, Synchronizer
from dyknow.errors import Refused
from federation.acts import Act, Performative
from federation.contents import Because, CheckFormula, Verdict
from federation.contents.parts import MAX_LIST
from federation.deadlines import Deadlines
from kpl import print_formula, read_formula, unit_vocabulary
from reasoning import Derivation, Formula, Progressing, Reason, make_progression, required_labels

PERIOD_US = 100_000
MAX_DELAY_US = 500_000
TIMEOUT_S = 10.0
MOST = 16
MOST_REASONS = 8
LONGEST = 1000
"""Characters of a formula in an answer, so that it fits into one act."""


@dataclass(slots=True)
class Check:
    """One formula being progressed, and for whom."""

    act: Act
    labels: tuple[str, ...]
    progression: Progressing
    derivation: Derivation
    synchronizer: Synchronizer
    domains: dict[str, tuple[str, ...]]
    subscriptions: list[Subscription]
    due_us: int
    states: int = 0
    valid_us: int | None = None
    valued: set[str] = field(default_factory=set)
    """The features and inputs that have had a value."""

    def progress(self, state: State) -> None:
        """One more state."""
        values = self.derivation.values(state.values)
        self.valued.update(name for name, value in values.items() if value is not NO_VALUE)
        self.progression.progress(state.valid_us, values, self.domains)
        self.valid_us = state.valid_us

    def unvalued(self, names: Iterable[str]) -> tuple[str, ...]:
        """Those of them that never had a value."""
        return tuple(sorted(name for name in names if name not in self.valued))[:MAX_LIST]


class Checks:
    """The formulas under check on one platform."""

    def __init__(self, context: Context) -> None:
        self._c = context
        self._open: dict[str, Check] = {}
        self._deadlines: Deadlines[str] = Deadlines()

    def on_check(self, act: Act, content: CheckFormula, now_us: int) -> None:
        """`(check-formula ...)`: agree, then inform of the verdict, `undecided` when the time is over.

        Raises:
            TextError: the formula is wrong, and where.
            UnknownLabel: it speaks of a feature that nothing here gives.
            Refused: too many formulas are under check, or it is about streams this platform does not have.
        """
        conversation = self._c.tasks.check_free(act.conversation_id)
        if conversation in self._open:
            raise Refused(f"conversation {conversation} is about another formula")
        if len(self._open) >= MOST:
            raise Refused(f"{MOST} formulas are under check here already; wait for one to end")
        formula = read_formula(content.text, unit_vocabulary(self._c.unit))
        units = (self._c.unit, *self._c.gateway.monitors.members)
        domains = {"units": units}
        labels = tuple(str(label) for label in required_labels(formula, domains))
        derivation = Derivation(labels)
        policy = Policy(change="sample", sample_us=PERIOD_US, max_delay_us=MAX_DELAY_US)
        synchronizer = Synchronizer(
            [StateInput(name, policy) for name in derivation.input_names],
            StatePolicy(PERIOD_US, MAX_DELAY_US, approximation="none"),
        )
        timeout_us = round((content.timeout_s or TIMEOUT_S) * US_PER_S)
        for label, unit in derivation.inputs:
            self._c.gateway.local(label, unit)
        check = Check(
            act,
            labels,
            make_progression(formula, PERIOD_US),
            derivation,
            synchronizer,
            domains,
            [],
            now_us + timeout_us,
        )
        check.subscriptions = [self._subscribe(conversation, check, at) for at in range(len(derivation.inputs))]
        self._open[conversation] = check
        self._c.desk.answer(act, Performative.AGREE, None, now_us)
        self._schedule(conversation, check)

    def _subscribe(self, conversation: str, check: Check, at: int) -> Subscription:
        label, unit = check.derivation.inputs[at]
        wanted = Policy(change="sample", sample_us=PERIOD_US, from_us=0, max_delay_us=MAX_DELAY_US)
        local = self._c.gateway.local(label, unit)
        to_semantic = self._c.gateway.translation.to_semantic(label)
        name = check.derivation.input_names[at]

        def on_sample(sample: Sample) -> None:
            given = sample._replace(value=to_semantic(sample.value))
            if given.value is not NO_VALUE:
                check.valued.add(name)
            self._progress(
                conversation, check, check.synchronizer.on_sample(at, given, sample.available_us), sample.available_us
            )

        return self._c.gateway.network.subscribe(local, wanted, on_sample)

    def _progress(self, conversation: str, check: Check, states: list[State], now_us: int) -> None:
        for state in states:
            check.progress(state)
            if check.progression.verdict != "undecided":
                self._end(conversation, self._c.clock.wall_us(now_us))
                return
            check.states += 1
        self._schedule(conversation, check)

    def _schedule(self, conversation: str, check: Check) -> None:
        due_us = check.due_us
        states_us = check.synchronizer.deadline_us
        if states_us is not None:
            due_us = min(due_us, self._c.clock.wall_us(states_us))
        self._deadlines.set(conversation, due_us)

    def cancel(self, conversation: str, by: str) -> bool:
        """Whoever asked does not want to know any more; whether there was such a check."""
        check = self._open.get(conversation)
        if check is None or check.act.sender.unit != by:
            return False
        self._drop(conversation)
        return True

    @property
    def deadline_us(self) -> int | None:
        return self._deadlines.next_us

    def on_time(self, now_us: int) -> None:
        for conversation in self._deadlines.pop_due(now_us):
            check = self._open.get(conversation)
            if check is None:
                continue
            federation_us = self._c.clock.federation_us(now_us)
            self._progress(conversation, check, check.synchronizer.on_time(federation_us), federation_us)
            if now_us >= check.due_us and conversation in self._open:
                self._end(conversation, now_us)

    def _end(self, conversation: str, now_us: int) -> None:
        check = self._drop(conversation)
        verdict = check.progression.verdict
        decided = verdict != "undecided"
        said = Verdict(
            verdict=verdict,
            valid_us=check.valid_us if decided else None,
            index=check.states if decided else None,
            because=tuple(_because(one) for one in check.progression.explain()[:MOST_REASONS]),
            no_value=check.unvalued(check.labels),
            missing=check.unvalued(check.derivation.input_names),
        )
        self._c.desk.answer(check.act, Performative.INFORM, said, now_us)

    def _drop(self, conversation: str) -> Check:
        check = self._open.pop(conversation)
        self._deadlines.set(conversation, None)
        for subscription in check.subscriptions:
            subscription.cancel()
        return check


def _because(reason: Reason) -> Because:
    return Because(
        part=_short(reason.part),
        holds=reason.holds,
        samples=dict(islice(reason.samples.items(), MOST_REASONS)),
        members=dict(reason.binding),
        within=None if reason.obligation is None else _short(reason.obligation),
        since_us=reason.since_us,
        until_us=reason.until_us,
    )


def _short(formula: Formula) -> str:
    """At most `LONGEST` characters of it."""
    text = print_formula(formula)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
