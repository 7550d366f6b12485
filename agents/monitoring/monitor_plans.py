"""Plans of monitors by name: formula, inputs, period (thesis 9.4.2: the formula is local knowledge)."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from dyknow import US_PER_S, Policy, Value
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.tasks.requests import DEFAULT_TASK
from dyknow.agents.tasks.task import TaskPlan
from dyknow.federation.messages.contents import CreateMulticast
from dyknow.federation.sharing.translation import Translation
from dyknow.kpl import Specification, profile_formula
from dyknow.kpl.running.formula_states import states_of
from dyknow.kpl.syntax.specification import MonitorDeclaration, StreamTerm
from dyknow.model.errors import DyknowError, Refused, did_you_mean
from dyknow.model.instants import print_duration
from dyknow.reasoning import Derivation, Formula, clearance, instantiate, required_labels, split_growing
from dyknow.reasoning.monitoring.profiles import AIRCRAFT, Profile

MAX_DELAY_US = 60_000_000
"""A monitor keeps every state that is not complete yet, for as long as its delay."""


@dataclass(frozen=True, slots=True)
class MonitorPlan:
    """A named monitor with its period and delay settled.

    `variable` is what the formula quantifies over, if it grows with the units; None if it is about this unit alone.
    `in_instance`: the specification's instance runs it, over streams of its own.
    """

    profile: Profile
    formula: Formula
    variable: str | None
    in_instance: bool = False

    @property
    def name(self) -> str:
        return self.profile.name

    @property
    def period_us(self) -> int:
        return self.profile.sample_us

    @property
    def max_delay_us(self) -> int:
        return self.profile.max_delay_us

    @property
    def starts_avoidance(self) -> bool:
        return self.profile.starts_avoidance

    @property
    def labels(self) -> tuple[str, ...]:
        """The semantic labels it needs of each unit."""
        return self.profile.labels

    @property
    def grows(self) -> bool:
        return self.variable is not None

    def describe(self) -> str:
        return f"sample every {print_duration(self.period_us)}, max delay {print_duration(self.max_delay_us)}"


class StateMaker:
    """Turns synchronised states into the values one instance's formula speaks of.

    Attributes:
        values, lacks: see `Derivation`; a state brings the values of `shared`, then those of `own`.
        shared: inputs that this platform brings, the same for all instances of the plan.
        own: the other inputs.
        is_clear: whether a state is complete and its formula surely holds in it; quicker than `values`.
    """

    __slots__ = ("formula", "input_names", "inputs", "is_clear", "lacks", "own", "shared", "values")

    def __init__(self, plan: MonitorPlan, member: str, unit: str) -> None:
        self.formula = plan.formula if plan.variable is None else instantiate(plan.formula, plan.variable, member)
        profile = plan.profile
        derivation = Derivation(
            required_labels(self.formula), profile.vertical, profile.fence, first=unit, volume=profile.volume
        )
        self.inputs, self.input_names = derivation.inputs, derivation.input_names
        self.shared = tuple(each for each in self.inputs if each.unit == unit)
        self.own = self.inputs[len(self.shared) :]
        self.values, self.lacks = derivation.values, derivation.lacks
        clear = clearance(self.formula, profile.volume)
        self.is_clear = _never if clear is None else derivation.beyond(clear)


def _never(_state: Sequence[Value]) -> bool:
    return False


def states_declaration(plan: MonitorPlan, maker: StateMaker, translation: Translation) -> Specification:
    """The states of one instance of a plan as a KPL specification over the local streams."""
    taken = Policy(change="sample", sample_us=plan.period_us, from_us=0, max_delay_us=plan.max_delay_us)
    terms = tuple(StreamTerm(translation.local_label(label, unit), taken) for label, unit in maker.inputs)
    return states_of(plan.name, terms, replace(taken, from_us=None, exact=True))


class PlanBook:
    """The monitors this platform knows by name. `grid_us` is the period of its estimates: there are no states between."""

    def __init__(self, unit: str, profiles: Mapping[str, Profile], grid_us: int = 1) -> None:
        self._unit, self._profiles, self._grid_us = unit, profiles, grid_us
        self._declared: dict[str, MonitorPlan] = {}

    @classmethod
    def of(cls, ports: Ports, _parts: PartRegistry) -> "PlanBook":
        """Build it from the ports and parts of a platform."""
        return cls(ports.unit, ports.config.profiles, ports.config.period_us)

    def declare(self, plan: MonitorPlan) -> Callable[[], None]:
        """Know a monitor that the specification declares; returns how to forget it.

        Raises:
            Refused: a profile has the name.
        """
        if plan.name in self._profiles:
            raise Refused(f"{plan.name} is a monitor that each platform knows already; another name is needed", "taken")
        self._declared[plan.name] = plan

        def forget() -> None:
            if self._declared.get(plan.name) is plan:
                del self._declared[plan.name]

        return forget

    def named(self, name: str, period_us: int | None = None, delay_us: int | None = None) -> MonitorPlan:
        """The monitor `name`, with another period or delay if given.

        Raises:
            Refused: there is no such monitor here, its formula does not read, or its period or delay cannot be kept.
        """
        declared = self._declared.get(name)
        profile = self._profiles.get(name) if declared is None else declared.profile
        if profile is None:
            known = (*self._profiles, *self._declared)
            raise Refused(f"no monitor is called {name!r} here.{did_you_mean(name, known)}", "unknown-monitor")
        profile = replace(
            profile,
            sample_us=profile.sample_us if period_us is None else period_us,
            max_delay_us=profile.max_delay_us if delay_us is None else delay_us,
        )
        if declared is not None:
            return replace(declared, profile=profile)
        self._check(profile)
        try:
            formula = profile_formula(profile, self._unit)
        except DyknowError as wrong:
            raise Refused(f"the formula of {name} does not read: {wrong}", "text") from None
        split = split_growing(formula)
        if split is not None and split[1].base == AIRCRAFT:
            raise Refused(
                f"{name} is about aircraft that are no members: each platform watches them by itself", "no-task"
            )
        return MonitorPlan(profile, formula, None) if split is None else MonitorPlan(profile, split[2], split[0])

    def _check(self, profile: Profile) -> None:
        if profile.sample_us % self._grid_us or profile.sample_us <= 0:
            period, grid = print_duration(profile.sample_us), print_duration(self._grid_us)
            raise Refused(
                f"period: expected a multiple of {grid}, the period of this platform's estimates, got {period}",
                "period",
            )
        if profile.max_delay_us > MAX_DELAY_US:
            most, delay = print_duration(MAX_DELAY_US), print_duration(profile.max_delay_us)
            raise Refused(f"delay for late samples: expected at most {most}, got {delay}", "too-long")

    def prepare(self) -> None:
        """Read what tasks usually take, so that the first one is not slowed by it."""
        self.for_task(None)

    def for_task(
        self, profile: str | None, period_us: int | None = None, delay_us: int | None = None
    ) -> tuple[MonitorPlan, ...]:
        """The monitors of `monitor-proximity`: the named profile, or the violation and its warning."""
        names = DEFAULT_TASK if profile is None else (profile,)
        return tuple(self.named(name, period_us, delay_us) for name in names)


def declared_profile(declaration: MonitorDeclaration, features: Iterable[str]) -> Profile:
    """The profile of a monitor that a specification declares, over these features; a tenth of a second and a second unless set."""
    policy = declaration.policy
    return Profile(
        declaration.name,
        " ".join(features),
        policy.sample_us or US_PER_S // 10,
        US_PER_S if policy.max_delay_us is None else policy.max_delay_us,
        close_after=declaration.close_after,
        no_value=declaration.no_value,
        starts_avoidance=declaration.starts_avoidance,
    )


def exports_of(plans: Iterable[TaskPlan], to_units: tuple[str, ...]) -> list[CreateMulticast]:
    """All streams the plans need of a platform, one request per period and delay."""
    labels: dict[tuple[int, int], dict[str, None]] = {}
    for plan in plans:
        labels.setdefault((plan.period_us, plan.max_delay_us), {}).update(dict.fromkeys(plan.labels))
    return [
        CreateMulticast(
            semantic_labels=tuple(named), sample_period_s=period_us / US_PER_S, delay_s=delay_us / US_PER_S,
            to_units=to_units,
        )
        for (period_us, delay_us), named in labels.items()
        if named
    ]  # fmt: skip
