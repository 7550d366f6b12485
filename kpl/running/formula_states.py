"""The states of a formula over streams of one instance: the streams that it reads, synchronised (thesis 7.5, 7.8).

A domain is the value of the generator called like it that is valid at the state's time: `forall car in car_ids: ...`
ranges over what the stream `car_ids` names then, also if it names others when the state is made, up to `max delay` later.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from dyknow import NO_VALUE, Label, Network, Policy, Sample, Value, earlier
from dyknow.kpl.checking.needs import domains_of
from dyknow.kpl.syntax import specification as syntax
from dyknow.model.errors import SortError, TextError, UnknownLabel
from dyknow.model.instants import US_PER_MS, US_PER_S
from dyknow.model.members import members_of
from dyknow.model.sample import oldest
from dyknow.network.process import FAR_US, Input
from dyknow.network.stream_proxy import StreamProxy
from dyknow.policies.policy import Approximation
from dyknow.reasoning.features.derivation import FeatureInput
from dyknow.reasoning.features.derived_streams import DerivedStream, stream_of
from dyknow.reasoning.formulas.tree import Formula, Occurred, event_labels, required_labels, walk
from dyknow.states.synchronization import State, StateInput, StatePolicy, Synchronizer, recent

PERIOD_US = 100 * US_PER_MS
MAX_DELAY_US = US_PER_S
PREDICTED = "cpa_time, cpa_xy and cpa_z, which are of the closest approach, or streams of your own"
MOST_ERAS = 64
"""Changes of the members that may await the states before them; beyond, states are left out."""


class FormulaState(NamedTuple):
    """A state of a formula: values by label, the members of its domains, and the events.

    `samples_us`: valid time of the sample that each value is, or was made of; None: that of the state. `made_us`: when the
    oldest prediction among them was made; None: all are measured.
    """

    valid_us: int
    now_us: int
    values: Mapping[str, Value]
    domains: Mapping[str, tuple[str, ...]]
    events: frozenset[str]
    samples_us: Mapping[str, int] | None = None
    made_us: int | None = None


class _Era:
    """The states from one change of the members to the next, which are made of other streams.

    Attributes:
        states: None: the formula reads no streams but events.
        ready: states that wait for those of an era before.
        ends_us: from this valid time on the states are those of the era after.
    """

    def __init__(
        self,
        labels: tuple[str, ...],
        events: tuple[str, ...],
        inputs: tuple[Input, ...],
        states: Synchronizer | None,
        begins_us: int,
    ) -> None:
        self.labels, self.events, self.inputs, self.states = labels, events, inputs, states
        self.places = {label: i for i, label in enumerate(labels)}
        self.begins_us, self.ends_us = begins_us, FAR_US
        self.ready: list[State] = []

    def on_sample(self, label: str, sample: Sample, now_us: int) -> None:
        """A sample of one stream, if the states are made of it."""
        place = self.places.get(label)
        if place is not None and self.states is not None:
            self.ready += self.states.on_sample(place, sample, now_us)

    def first_us(self, period_us: int, from_us: int) -> int:
        """The time of its first state."""
        return from_us - (from_us - self.begins_us) // period_us * period_us


class _SharedStreams:
    """The streams that several eras are made of, each taken once, as long as one of them needs it."""

    def __init__(self) -> None:
        self.proxies: dict[tuple[str, bool], StreamProxy] = {}
        self._users: Counter[tuple[str, bool]] = Counter()

    def take(self, names: Iterable[tuple[str, bool]], connect: Callable[[str, bool], StreamProxy]) -> None:
        """Connect the labels and events of one more era; samples that come at once may end the era before it."""
        needed = tuple(names)
        self._users.update(needed)
        for name in needed:
            if name not in self.proxies:
                self.proxies[name] = connect(*name)

    def leave(self, names: Iterable[tuple[str, bool]]) -> None:
        """An era is over."""
        for name in names:
            self._users[name] -= 1
            if not self._users[name]:
                del self._users[name]
                self.proxies.pop(name).cancel()


class FormulaStates:
    """Subscribes what a formula reads, and makes states of it. Call `on_time` at `deadline_us`.

    Without `sample every` and `max delay` in the policy a state is made every 100 ms and waits 1 s for its inputs.
    A value counts until it is a period and the delay older than the state: an input without new samples is not known to hold
    (F5). With `use most recent` it counts until another one comes.

    Args:
        formula: over streams only, without free variables.
        policy: of the states (Def. 7.8.6).
        on_state: called with every state, in the order of their times.
        on_domain: called with the error of a domain's members, and "" when they are known.
        since_us: states of events only begin then.
    """

    def __init__(
        self,
        network: Network,
        formula: Formula,
        policy: Policy,
        on_state: Callable[[FormulaState], None],
        on_domain: Callable[[str, str], None] = lambda _name, _wrong: None,
        *,
        since_us: int = 0,
    ) -> None:
        self.period_us, self.max_delay_us = timing(policy)
        self._network, self._formula, self._policy = network, formula, policy
        self._taken = Policy(
            max_delay_us=self.max_delay_us, importance=policy.importance, predict_us=policy.predict_us,
            prediction_age_us=policy.prediction_age_us,
        )  # fmt: skip
        self._derived = replace(
            self._taken,
            change="sample",
            sample_us=self.period_us,
            from_us=0,
            exact=policy.approximation != "most recent",
        )
        self._on_state, self._on_domain = on_state, on_domain
        self._lasts_us = FAR_US if policy.approximation == "most recent" else self.period_us + self.max_delay_us
        self._domains: dict[str, list[tuple[int, tuple[str, ...]]]] = {name: [] for name in domains_of(formula)}
        self._eras: list[_Era] = []
        self._streams = _SharedStreams()
        self._asks_for_events = any(isinstance(node, Occurred) for node in walk(formula))
        self._newest: dict[str, Sample] = {}
        self._last_us = -FAR_US
        self._happened: list[tuple[int, str]] = []
        self._tick_us = -(-since_us // self.period_us) * self.period_us
        self._members: list[StreamProxy] = []
        self._begun = False
        try:
            for name in self._domains:
                on_members = partial(self._on_members, name)
                self._members.append(network.connect(Label(name), Policy(), on_members, current=True))
            self._subscribe(-FAR_US)
        except TextError:
            self.cancel()
            raise
        self._begun = True

    @property
    def proxies(self) -> list[StreamProxy]:
        """The streams its states are made of."""
        return list(self._streams.proxies.values())

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels that its states have a value of now."""
        return self._eras[-1].labels if self._eras else ()

    @property
    def inputs(self) -> tuple[Input, ...]:
        """The stream of each, and how it is taken."""
        return self._eras[-1].inputs if self._eras else ()

    @property
    def derived_from(self) -> tuple[FeatureInput, ...]:
        """The inputs of derived features among its inputs."""
        processes = (self._network.process(each.label) for each in self.inputs)
        return tuple(one for each in processes if isinstance(each, DerivedStream) for one in each.needed)

    @property
    def silent(self) -> tuple[str, ...]:
        """The streams and domains without a sample so far; for a derived feature, its inputs."""
        domains = [name for name, known in self._domains.items() if not known]
        streams: dict[str, None] = {}
        for label, each in zip(self.labels, self.inputs, strict=True):
            process = self._network.process(each.label)
            if isinstance(process, DerivedStream):
                streams.update(dict.fromkeys(process.missing))
            elif label not in self._newest:
                streams[label] = None
        return (*domains, *streams)

    @property
    def deadline_us(self) -> int | None:
        """None: it no longer takes streams. Far away, and not none, while nothing is due."""
        if not self._members and not self.proxies:
            return None
        due_us: int | None = FAR_US
        for era in self._eras:
            if era.states is not None:
                due_us = earlier(due_us, era.states.deadline_us)
            elif era.events:
                due_us = earlier(due_us, self._tick_us + self.max_delay_us)
        return due_us

    def on_time(self, now_us: int) -> None:
        """Make the states that are due."""
        for era in self._eras:
            if era.states is not None:
                era.ready += era.states.on_time(now_us)
        self._hand_on(now_us)

    def cancel(self) -> None:
        """Take no more streams."""
        for proxy in (*self._members, *self.proxies):
            proxy.cancel()
        self._members, self._eras, self._streams = [], [], _SharedStreams()

    def declarations(self, name: str) -> syntax.Specification:
        """The streams it takes now, in KPL: `NAME_states` are its states, with other names the domains and events."""
        events = self._eras[-1].events if self._eras else ()
        policy = replace(self._policy, sample_us=self.period_us, max_delay_us=self.max_delay_us, change="sample")
        terms: dict[syntax.StreamTerm, None] = {}
        for each in self.inputs:
            process = self._network.process(each.label)
            made_of = process.taken_with(each.policy) if isinstance(process, DerivedStream) else (each,)
            terms.update(dict.fromkeys(syntax.StreamTerm(*one) for one in made_of))
        if terms and all(term.policy.exact for term in terms):
            # A policy that all inputs share is declared once, of the state.
            terms = dict.fromkeys(replace(term, policy=replace(term.policy, exact=False)) for term in terms)
            policy = replace(policy, exact=True)
        states = states_of(name, tuple(terms), policy)
        other = [(f"{name}_{one.label}".replace(".", "_"), one.label) for one in self._members]
        other += [(f"{name}_event{i}", Label.parse(one)) for i, one in enumerate(events, start=1)]
        return (*states, *(syntax.StreamDeclaration(called, syntax.StreamTerm(label)) for called, label in other))

    def awaited(self) -> tuple[str, ...]:
        """Why there is no state yet, input by input."""
        states = self._eras[0].states if self._eras else None
        return () if states is None else tuple(map(str, states.awaited()))

    def _on_members(self, name: str, sample: Sample) -> None:
        """If there are too many, the members before stay, and the verdict is unknown until there are fewer.

        The first known members count for earlier states, too; once a later naming has come, an earlier one is ignored.
        """
        known = self._domains[name]
        before = known.copy()
        if known and sample.valid_us < known[-1][0]:
            return
        begins_us = max([sample.valid_us, *(era.begins_us for era in self._eras)]) if known else -FAR_US
        try:
            members = members_of(sample.value)
            if not known or members != known[-1][1]:
                known.append((begins_us, members))
                del known[:-MOST_ERAS]
            if self._begun and (known != before or not self.proxies):
                self._subscribe(begins_us)
        except (SortError, TextError) as wrong:
            self._domains[name] = before
            self._on_domain(name, wrong.message if isinstance(wrong, TextError) else str(wrong))
        else:
            self._on_domain(name, "")

    def _domains_at(self, valid_us: int) -> dict[str, tuple[str, ...]]:
        """The members at a time; those of before are forgotten, as states come in the order of their times."""
        for known in self._domains.values():
            while len(known) > 1 and known[1][0] <= min(valid_us, self._last_us):
                del known[0]
        return {
            name: next((members for at_us, members in reversed(known) if at_us <= valid_us), ())
            for name, known in self._domains.items()
        }

    def _subscribe(self, begins_us: int) -> None:
        """Subscribe the formula's streams from a valid time on; states before it still use the earlier ones."""
        members = self._domains_at(FAR_US)
        try:
            labels = required_labels(self._formula, members)
            events = event_labels(self._formula, members) if self._asks_for_events else ()
        except UnknownLabel:
            return
        last = self._eras[-1] if self._eras else None
        if last is not None and (labels, events) == (last.labels, last.events) and self.proxies:
            return
        inputs = tuple(map(self._input, labels))
        era = _Era(labels, events, inputs, self._synchronizer(labels, inputs), begins_us)
        if last is not None:
            last.ends_us = begins_us
        self._eras.append(era)
        self._newest = {label: sample for label, sample in self._newest.items() if label in era.places}
        for label, sample in self._newest.items():
            era.on_sample(label, sample, self._network.now_us)
        self._streams.take(_names(era), partial(self._connect, era))
        if last in self._eras and last.first_us(self.period_us, self._policy.from_us or 0) >= begins_us:
            self._eras.remove(last)  # no state lies between the two changes
            self._end(last)
        self._hand_on(self._network.now_us)

    def _connect(self, era: _Era, label: str, is_event: bool) -> StreamProxy:
        if is_event:
            return self._network.connect(Label.parse(label), Policy(), partial(self._on_event, label))
        return self._network.connect(*era.inputs[era.places[label]], partial(self._on_sample, label))

    def _end(self, era: _Era) -> None:
        self._streams.leave(_names(era))

    def _synchronizer(self, labels: tuple[str, ...], inputs: tuple[Input, ...]) -> Synchronizer | None:
        if not labels:
            return None
        policy = self._policy
        approximation: Approximation = "none" if policy.exact else "most recent"
        wanted = StatePolicy(
            self.period_us, self.max_delay_us, policy.delay_before_us, policy.from_us, policy.to_us, approximation
        )
        named = [StateInput(label, each.policy) for label, each in zip(labels, inputs, strict=True)]
        return Synchronizer(named, wanted, explains=True)

    def _input(self, label: str) -> Input:
        """The stream of a feature; a derived one is exact, as its inputs are of one time."""
        stream = stream_of(self._network, Label.parse(label))
        self._network.find(stream)  # creates a derived stream on demand
        is_derived = isinstance(self._network.process(stream), DerivedStream)
        if is_derived and self._policy.predict_us is not None:
            raise TextError(f"{label} is derived, and does not change along a straight line", repair=PREDICTED)
        return Input(stream, self._derived if is_derived else self._taken)

    def _on_sample(self, label: str, sample: Sample) -> None:
        """Eras that are over, but for states that are late, need no more than the first sample after them."""
        if label in self._eras[-1].places:
            self._newest[label] = sample
        for era in self._eras:
            if sample.valid_us < era.ends_us + self.period_us:
                era.on_sample(label, sample, sample.available_us)
        self._hand_on(sample.available_us)

    def _on_event(self, label: str, sample: Sample) -> None:
        """Something happened: it belongs to the first state that is not earlier, or is still to be made."""
        self._happened.append((sample.valid_us, label))

    def _hand_on(self, now_us: int) -> None:
        """The states that are ready, in the order of their times: those of an era when the ones before are over."""
        while self._eras:
            era = self._eras[0]
            ready, era.ready = era.ready, []
            for state in ready:
                if max(era.begins_us, self._last_us + 1) <= state.valid_us < era.ends_us:
                    self._take(era, recent(state, self._policy.max_age_us), now_us)
            if era.states is None and era.events:
                self._tick(era, now_us)
            if len(self._eras) < 2 or not (self._is_over(era) or len(self._eras) > MOST_ERAS):
                return
            self._end(self._eras.pop(0))

    def _is_over(self, era: _Era) -> bool:
        if era.states is None:
            return not era.events or self._tick_us >= era.ends_us
        sync_us = era.states.sync_us
        return sync_us is None or sync_us >= era.ends_us

    def _take(self, era: _Era, state: State, now_us: int) -> None:
        oldest_us = state.valid_us - self._lasts_us
        values: dict[str, Value] = {
            label: NO_VALUE if origin.valid_us is None or origin.valid_us < oldest_us else value
            for label, value, origin in zip(era.labels, state.values, state.origins, strict=True)
        }
        samples_us = {
            label: origin.valid_us
            for label, origin in zip(era.labels, state.origins, strict=True)
            if origin.valid_us is not None and values[label] is not NO_VALUE
        }
        prediction = oldest(
            origin.prediction for label, origin in zip(era.labels, state.origins, strict=True) if label in samples_us
        )
        made_us = None if prediction is None else prediction.made_us
        self._give(state.valid_us, max(now_us, state.available_us), values, samples_us, made_us)

    def _tick(self, era: _Era, now_us: int) -> None:
        """States of events only are made at their times, when what happened until then has come."""
        while self._tick_us + self.max_delay_us <= now_us and self._tick_us < era.ends_us:
            self._give(self._tick_us, now_us, {}, {})

    def _give(
        self,
        valid_us: int,
        now_us: int,
        values: dict[str, Value],
        samples_us: dict[str, int],
        made_us: int | None = None,
    ) -> None:
        domains, self._last_us = self._domains_at(valid_us), valid_us
        self._tick_us = max(self._tick_us, (valid_us // self.period_us + 1) * self.period_us)
        events = frozenset(label for at_us, label in self._happened if at_us <= valid_us)
        self._happened = [each for each in self._happened if each[0] > valid_us]
        self._on_state(FormulaState(valid_us, now_us, values, domains, events, samples_us, made_us))


def _names(era: _Era) -> Iterator[tuple[str, bool]]:
    """The streams of an era by their labels, and whether they are of events."""
    yield from ((label, False) for label in era.labels)
    yield from ((label, True) for label in era.events)


def states_of(name: str, terms: tuple[syntax.StreamTerm, ...], policy: Policy) -> syntax.Specification:
    """The declaration of states of these streams, called `NAME_states`; none of no streams."""
    return (syntax.GeneratorDeclaration(Label(f"{name}_states"), syntax.StateStream(terms, policy)),) if terms else ()


def timing(policy: Policy) -> tuple[int, int]:
    """The period of the states, and how long one waits for its inputs."""
    return policy.sample_us or PERIOD_US, MAX_DELAY_US if policy.max_delay_us is None else policy.max_delay_us
