"""The states that a formula over derived features is about: distances, altitudes, ... out of the units' streams (9.4.2)."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial

from agents.gateway import Gateway
from agents.plans import MonitorPlan, StateMaker
from dyknow import NO_VALUE, Label, Policy, Sample, State, StateInput, StatePolicy, Subscription, Synchronizer, earlier
from dyknow.errors import Refused
from federation.ontology import Convert, Translation
from kpl import Instance, Specification
from kpl.asking import features_of
from kpl.formula_states import FAR_US, FormulaState, states_of
from reasoning import Derivation, Formula, required_labels


class DerivedStates:
    """Subscribes the streams that the features are derived from, and makes states of them. Federation time.

    Args:
        formula: over derived features only.
        policy: of the states, with its period and delay.
        on_state: told every state, in the order of their times.

    Attributes:
        labels: the features.

    Raises:
        UnknownLabel: there is no stream that a feature is derived from.
    """

    def __init__(
        self,
        gateway: Gateway,
        formula: Formula,
        policy: Policy,
        domains: Mapping[str, tuple[str, ...]],
        on_state: Callable[[FormulaState], None],
    ) -> None:
        self.labels = tuple(str(label) for label in required_labels(formula, domains))
        self._derivation, self._domains, self._on_state = Derivation(self.labels), domains, on_state
        self._policy = Policy(change="sample", sample_us=policy.sample_us, from_us=0, max_delay_us=policy.max_delay_us)
        self._silent = dict.fromkeys(self._derivation.input_names)
        self._synchronizer = Synchronizer(
            [StateInput(name, self._policy) for name in self._derivation.input_names],
            StatePolicy(policy.sample_us, policy.max_delay_us or 0, approximation="none"),
        )
        self._local = [gateway.local(label, unit) for label, unit in self._derivation.inputs]
        to_semantic = [gateway.translation.to_semantic(label) for label, _ in self._derivation.inputs]
        self._subscriptions: list[Subscription] = [
            gateway.network.subscribe(local, self._policy, partial(self._on_sample, i, to_semantic[i]))
            for i, local in enumerate(self._local)
        ]

    @property
    def silent(self) -> tuple[str, ...]:
        """The streams that have brought nothing yet."""
        return tuple(self._silent)

    @property
    def deadline_us(self) -> int | None:
        return earlier(self._synchronizer.deadline_us, FAR_US) if self._subscriptions else None

    def on_time(self, now_us: int) -> None:
        self._hand_on(self._synchronizer.on_time(now_us), now_us)

    def cancel(self) -> None:
        """Take no more streams."""
        for subscription in self._subscriptions:
            subscription.cancel()
        self._subscriptions = []

    def declarations(self, name: str) -> Specification:
        """Their state stream in KPL, called `NAME_states`, of the local streams."""
        return _states(name, self._local, self._policy)

    def _on_sample(self, i: int, to_semantic: Convert, sample: Sample) -> None:
        given = sample._replace(value=to_semantic(sample.value))
        if given.value is not NO_VALUE:
            self._silent.pop(self._derivation.input_names[i], None)
        self._hand_on(self._synchronizer.on_sample(i, given, sample.available_us), sample.available_us)

    def _hand_on(self, states: list[State], now_us: int) -> None:
        for state in states:
            values = self._derivation.values(state.values)
            self._on_state(FormulaState(state.valid_us, now_us, values, self._domains, frozenset()))


def derived_declaration(plan: MonitorPlan, maker: StateMaker, translation: Translation) -> Specification:
    """What the states of one instance of a plan are made of, in KPL, of the local streams."""
    labels = [translation.local_label(label, unit) for label, unit in maker.inputs]
    policy = Policy(change="sample", sample_us=plan.period_us, from_us=0, max_delay_us=plan.max_delay_us)
    return _states(plan.name, labels, policy)


def _states(name: str, labels: Iterable[Label], taken: Policy) -> Specification:
    return states_of(name, labels, taken, replace(taken, from_us=None, exact=True))


def derived_features(instance: Instance, formula: Formula, what: str) -> frozenset[str]:
    """The features of a formula if they are derived from the streams of units, else none.

    Raises:
        Refused: `what` speaks of streams of the instance, too.
    """
    derived, own = features_of(instance, formula)
    if derived and own:
        raise Refused(
            f"{what}: {', '.join(sorted(own))} are streams of this instance, {', '.join(sorted(derived))} are derived "
            "from the streams of several units; one formula cannot speak of both"
        )
    return derived
