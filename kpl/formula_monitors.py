"""A monitor over streams of one instance: its states are made of the streams its formula names (7.5, 7.8).

A domain is the newest value of the generator called like it: `forall car in car_ids: ...` ranges over what the stream
`car_ids` names.
"""

from collections.abc import Callable
from functools import partial

from dyknow import (
    NO_VALUE,
    Label,
    Network,
    Policy,
    Sample,
    State,
    StateInput,
    StatePolicy,
    Synchronizer,
    Value,
    earlier,
)
from dyknow.errors import SortError, TextError, UnknownLabel
from dyknow.instants import US_PER_MS, US_PER_S
from dyknow.mediation import members_of
from dyknow.stream_proxy import StreamProxy
from kpl.specification import MonitorDeclaration
from reasoning import AlarmEvent, Monitor
from reasoning.formulas import Domain, Exists, Forall, Formula, event_labels, required_labels, walk

PERIOD_US = 100 * US_PER_MS
MAX_DELAY_US = US_PER_S
FAR_US = 2**80


class FormulaMonitor:
    """Subscribes what the formula reads, and hands every state to a `Monitor`.

    Without `sample every` and `max delay` in the declaration a state is made every 100 ms and waits 1 s for its inputs.
    A value counts until it is a period and the delay older than the state: what has fallen silent is not known to hold
    (F5). With `use most recent` it counts until another one comes.

    Args:
        formula: over streams only, without free variables.
        on_alarm: told every opening and closing.
    """

    def __init__(
        self,
        network: Network,
        declaration: MonitorDeclaration,
        formula: Formula,
        unit: str,
        on_alarm: Callable[[AlarmEvent], None],
        since_us: int,
    ) -> None:
        policy = declaration.policy
        self.period_us = policy.sample_us or PERIOD_US
        self.max_delay_us = MAX_DELAY_US if policy.max_delay_us is None else policy.max_delay_us
        self.monitor = Monitor(
            declaration.name,
            formula,
            (unit,),
            self.period_us,
            self.max_delay_us,
            declaration.no_value,
            declaration.close_after,
            inputs=(),
            since_us=since_us,
        )
        self._network, self._formula, self._on_alarm, self._policy = network, formula, on_alarm, policy
        self._lasts_us = FAR_US if policy.approximation == "most recent" else self.period_us + self.max_delay_us
        self._domains: dict[str, tuple[str, ...]] = dict.fromkeys(domains_of(formula), ())
        self._labels: tuple[str, ...] = ()
        self._events: tuple[str, ...] = ()
        self._states: Synchronizer | None = None
        self._happened: list[tuple[int, str]] = []
        self._tick_us = -(-since_us // self.period_us) * self.period_us
        self.proxies: list[StreamProxy] = []
        self._members: list[StreamProxy] = []
        self._begun = False
        self._failing: set[str] = set()
        try:
            for name in self._domains:
                on_members = partial(self._on_members, name)
                self._members.append(network.connect(Label(name), Policy(), on_members, current=True))
            self._subscribe()
        except TextError:
            self.cancel()
            raise
        self._begun = True
        network.step(self)

    @property
    def deadline_us(self) -> int | None:
        if not self._members and not self.proxies:
            return None
        states_us = None if self._states is None else self._states.deadline_us
        if self._states is None and self._events:
            states_us = self._tick_us + self.max_delay_us
        due_us = earlier(states_us, self.monitor.deadline_us)
        return FAR_US if due_us is None else due_us

    def on_time(self, now_us: int) -> None:
        if self._states is not None:
            self._take(self._states.on_time(now_us))
        elif self._events:
            self._tick(now_us)
        for event in self.monitor.on_time(now_us):
            self._on_alarm(event)

    def cancel(self) -> None:
        """Take no more streams."""
        for proxy in (*self._members, *self.proxies):
            proxy.cancel()
        self._members, self.proxies, self._states = [], [], None
        self._network.unstep(self)

    def awaited(self) -> tuple[str, ...]:
        """Why there is no state yet, input by input."""
        return () if self._states is None else tuple(map(str, self._states.awaited()))

    def _on_members(self, name: str, sample: Sample) -> None:
        """Of too many those before stay, and what holds is not known until there are fewer."""
        before = self._domains[name]
        try:
            self._domains[name] = members_of(sample.value)
            if self._begun and (self._domains[name] != before or not self.proxies):
                self._subscribe()
        except (SortError, TextError) as wrong:
            self._domains[name] = before
            self._fails(name, wrong)
        else:
            self._failing.discard(name)
            self.monitor.mark_present(name, self._network.now_us)

    def _fails(self, which: str, wrong: SortError | TextError) -> None:
        if which in self._failing:
            return
        self._failing.add(which)
        said = wrong.message if isinstance(wrong, TextError) else str(wrong)
        self._network.on_fault(Label(which), f"monitor {self.monitor.name}: {said}")
        self.monitor.mark_missing(which, self._network.now_us, "too many")

    def _subscribe(self) -> None:
        """Streams of what the formula reads now; states begin anew with those."""
        try:
            labels = required_labels(self._formula, self._domains)
            events = event_labels(self._formula, self._domains)
        except UnknownLabel:
            return
        if (labels, events) == (self._labels, self._events) and self.proxies:
            return
        self._labels, self._events = labels, events
        policy = Policy(max_delay_us=self.max_delay_us, importance=self._policy.importance)
        wanted = StatePolicy(
            self.period_us,
            self.max_delay_us,
            self._policy.delay_before_us,
            self._policy.from_us,
            self._policy.to_us,
        )
        states = self._states = (
            Synchronizer([StateInput(label, policy) for label in labels], wanted, explains=True) if labels else None
        )
        before, self.proxies = self.proxies, []
        for i, label in enumerate(labels):
            self.proxies.append(self._network.connect(Label.parse(label), policy, partial(self._on_sample, states, i)))
        for label in events:
            self.proxies.append(self._network.connect(Label.parse(label), Policy(), partial(self._on_event, label)))
        for proxy in before:
            proxy.cancel()

    def _on_sample(self, states: Synchronizer | None, i: int, sample: Sample) -> None:
        if states is not None and states is self._states:
            self._take(states.on_sample(i, sample, sample.available_us))

    def _on_event(self, label: str, sample: Sample) -> None:
        """Something happened: it belongs to the first state that is not earlier, or is still to be made."""
        self._happened.append((sample.valid_us, label))

    def _take(self, states: list[State]) -> None:
        for state in states:
            oldest_us = state.valid_us - self._lasts_us
            values: dict[str, Value] = {
                label: NO_VALUE if origin.valid_us is None or origin.valid_us < oldest_us else value
                for label, value, origin in zip(self._labels, state.values, state.origins, strict=True)
            }
            self._give(state.valid_us, state.available_us, values)

    def _tick(self, now_us: int) -> None:
        """States of events only are made at their times, when what happened until then has come."""
        while self._tick_us + self.max_delay_us <= now_us:
            self._give(self._tick_us, now_us, {})
            self._tick_us += self.period_us

    def _give(self, valid_us: int, now_us: int, values: dict[str, Value]) -> None:
        events = {label for at_us, label in self._happened if at_us <= valid_us}
        self._happened = [each for each in self._happened if each[0] > valid_us]
        for event in self.monitor.on_state(valid_us, now_us, values, domains=self._domains, events=events):
            self._on_alarm(event)


def domains_of(formula: Formula) -> tuple[str, ...]:
    """The named domains over which a formula quantifies."""
    found: dict[str, None] = {}
    for node in walk(formula):
        if isinstance(node, Forall | Exists):
            domain: Domain = node.domain
            found.update(dict.fromkeys(one for one in (domain.base, *domain.minus) if isinstance(one, str)))
    return tuple(found)
