"""Process refinement, level 4 of the JDL model (thesis 10.7): policies are changed while there is too much to do.

A monitor over the delays of the instance's own streams says when there is. Then the sample periods of the least
important streams are lengthened, one step at a time, or a unit is exchanged for one that is declared as cheaper; when
there is room again the steps are taken back, the most important stream first. Each step is a sample of the stream
`refinements`.
"""

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import TypeAlias

from dyknow import NO_VALUE, Field, Label, Network, Policy, Sample, Sort
from dyknow.kpl.checking.formulas import read_formula
from dyknow.kpl.checking.symbols import symbol_of
from dyknow.kpl.running.figures import WORST
from dyknow.kpl.running.formula_monitors import FormulaMonitor
from dyknow.kpl.running.instance import Instance
from dyknow.kpl.running.parts import inputs_taken
from dyknow.kpl.syntax import specification as spec
from dyknow.model.errors import TextError
from dyknow.model.instants import US_PER_MS, US_PER_S, print_duration, print_span
from dyknow.network.prototypes import UnitPrototype
from dyknow.network.refinement import RefinementProcess
from dyknow.network.stream_proxy import StreamProxy

REFINEMENTS = Label("refinements")
WORST_DELAY = Label("stream_delay", (WORST,))
SORT = Sort("refinement", (Field("stream", "text"), Field("change", "text"), Field("why", "text")))
LOOK_US = 100 * US_PER_MS
PATIENCE_US = 300 * US_PER_MS
"""How long a step is given to show in the delays before the next one."""
CALM_US = 2 * US_PER_S
"""How long there must be room before a step is taken back."""
SETTLED_US = 1_500 * US_PER_MS
"""After a step it takes this long until the load of the last second is that of the new setting."""
LIMIT_US = 50 * US_PER_MS
LONGEST_FACTOR = 16
ROOM = 0.8
"""So much of the time may be spent computing after a step has been taken back, as far as can be foreseen."""


@dataclass(slots=True)
class Longer:
    """A sampled stream whose period can be doubled.

    Like `Cheaper` it is something that can be done less: `step` does so and says what was done, `back` takes the last
    step back, `relieves` is how many samples per second one more step saves (0: there is none), and when it is `gone`
    nothing is left to take back.
    """

    target: str
    proxy: StreamProxy
    importance: float

    @property
    def name(self) -> str:
        return f"{self.proxy.label} for {self.target}"

    @property
    def relieves(self) -> float:
        period_us = self.proxy.adapter.policy.sample_us
        if not self.proxy.linked or period_us is None or self.proxy.stretched >= LONGEST_FACTOR:
            return 0.0
        return US_PER_S / (2 * period_us)

    def step(self) -> str:
        self.proxy.stretch(2 * self.proxy.stretched)
        return self._said()

    def back(self) -> str:
        self.proxy.stretch(self.proxy.stretched // 2)
        return self._said()

    @property
    def gone(self) -> bool:
        return not self.proxy.linked

    def _said(self) -> str:
        return f"sample every {print_duration(self.proxy.adapter.policy.sample_us or 0)}"


@dataclass(slots=True)
class Cheaper:
    """A process with a unit that has a cheaper variant."""

    label: Label
    process: RefinementProcess
    importance: float
    find: Callable[[str], UnitPrototype | None]
    before: UnitPrototype | None = None

    @property
    def name(self) -> str:
        return str(self.label)

    @property
    def relieves(self) -> float:
        other = self._other()
        return 0.5 if self.before is None and other is not None and self.process.running else 0.0

    def step(self) -> str:
        other = self._other()
        if other is not None:
            self.before = self.process.prototype
            self.process.exchange(other)
        return f"made by {self.process.prototype.name}"

    def back(self) -> str:
        if self.before is not None:
            self.process.exchange(self.before)
            self.before = None
        return f"made by {self.process.prototype.name}"

    @property
    def gone(self) -> bool:
        return not self.process.running

    def _other(self) -> UnitPrototype | None:
        prototype = self.process.prototype
        other = self.find(prototype.cheaper) if prototype.cheaper else None
        same = other is not None and (other.sort, other.inputs) == (prototype.sort, prototype.inputs)
        return other if same else None


Option: TypeAlias = Longer | Cheaper


@dataclass(slots=True)
class GovernorStep:
    """A step that was taken, and the loads before and, once it has shown, after it."""

    option: Option
    at_us: int
    before: float
    after: float | None = None

    def growth(self) -> float:
        """How many times the load may become when it is taken back: twice for half the period, else as it was before."""
        after = self.before if self.after is None else self.after
        return 2.0 if isinstance(self.option, Longer) else max(2.0, self.before / max(after, 0.01))


class Governor:
    """Watches one instance. Call `on_time` at `deadline_us`; federation time.

    Args:
        waited_us: how long, all in all, the loop of the instance has waited because there was nothing to do.
        limit_us: delays beyond this are too long.

    Attributes:
        load: the part of the last second that was spent computing, from 0 to 1.
        steps: the reductions now in force, the last one last.
    """

    def __init__(self, instance: Instance, waited_us: Callable[[], int], now_us: int, limit_us: int = LIMIT_US) -> None:
        self._instance, self._waited_us, self.limit_us = instance, waited_us, limit_us
        self.load = 0.0
        self.steps: list[GovernorStep] = []
        self._looks: list[tuple[int, int]] = [(now_us, waited_us())]
        self._due_us = now_us + LOOK_US
        self._worst_us: float = 0.0
        self._acted_us = self._calm_since_us = now_us
        self._delay_then_us: float = 0.0
        network = instance.network
        if not network.has(REFINEMENTS):
            speaks(network)
        instance.governor = self
        formula = read_formula(f"always {WORST_DELAY} <= {limit_us / US_PER_MS}")
        declared = spec.MonitorDeclaration("overload", formula, Policy.parse("sample every 100ms, max delay 200ms"))
        self.monitor = FormulaMonitor(network, declared, formula, instance.unit, lambda _event: None, now_us)

    @property
    def deadline_us(self) -> int | None:
        return self._due_us

    @property
    def overloaded(self) -> bool:
        """Whether the monitor's alarm is open."""
        return self.monitor.monitor.alarm_id is not None

    @property
    def full(self) -> bool:
        """Whether there is no time for more."""
        return self.overloaded or self.load > ROOM

    def refusals(self, new: Iterable[spec.Declaration], text: str) -> list[TextError]:
        """Errors for declarations that cost time, while there is no time for more."""
        idle = spec.SourceDeclaration | spec.UnitDeclaration | spec.Define
        work = next((each for each in new if not isinstance(each, idle)), None)
        if work is None or not self.full:
            return []
        said = f"there is no time for more: {self.load:.0%} of it is spent"
        repair = "later, or with the choice to admit it at a longer period"
        return [TextError.at(work.place, said, text=text, repair=repair)]

    def hold_back(self, known: Collection[int], now_us: int) -> None:
        """Let sampled streams that are new begin at twice their period, until there is room; `known` are the others."""
        importance = _importances(self._instance)
        for target, proxy in self._instance.proxies():
            option = Longer(target, proxy, importance[id(proxy)])
            if id(proxy) not in known and option.relieves:
                said = option.step()
                self.steps.append(GovernorStep(option, now_us, self.load))
                self._tell(option, said, "admitted while there is no time for more", now_us)

    def on_time(self, now_us: int) -> None:
        """Look at the delays, and act."""
        if now_us < self._due_us:
            return
        self._due_us = now_us + LOOK_US
        self._measure(now_us)
        self.steps = [step for step in self.steps if not step.option.gone]
        if self.steps and self.steps[-1].after is None and now_us - self.steps[-1].at_us >= SETTLED_US:
            self.steps[-1].after = self.load
        if self.overloaded:
            self._calm_since_us = now_us
            if now_us - self._acted_us >= PATIENCE_US and not self._improves():
                self._step(now_us)
        elif self.steps and self._has_room(now_us):
            self._back(now_us)

    def _measure(self, now_us: int) -> None:
        """Measure the longest recent delay, and the share of the last second that was spent computing."""
        waited_us = self._waited_us()
        self._looks.append((now_us, waited_us))
        while len(self._looks) > 2 and self._looks[1][0] <= now_us - US_PER_S:
            del self._looks[0]
        began_us, had_waited_us = self._looks[0]
        if now_us > began_us:
            self.load = max(0.0, min(1.0, 1.0 - (waited_us - had_waited_us) / (now_us - began_us)))
        history = self._instance.network.generator(WORST_DELAY).history
        newest = history.get_latest().value if history.get_size() else NO_VALUE
        self._worst_us = 0.0 if newest is NO_VALUE else newest * US_PER_MS

    def _improves(self) -> bool:
        """Whether the delay has fallen since the last step."""
        improves = bool(self.steps) and self._worst_us < self._delay_then_us
        self._delay_then_us = self._worst_us
        return improves

    def _options(self) -> list[Option]:
        found: dict[int, Option] = {}
        taken = {id(getattr(step.option, "process", None)): step.option for step in self.steps}
        importance = _importances(self._instance)
        for target, proxy in self._instance.proxies():
            found[id(proxy)] = Longer(target, proxy, importance[id(proxy)])
        for label in self._instance.network.labels():
            process = self._instance.network.process(label)
            if isinstance(process, RefinementProcess) and id(process) not in taken:
                most = max((importance[id(proxy)] for proxy in process.proxies), default=1.0)
                found[id(process)] = Cheaper(label, process, most, self._unit)
        return list(found.values())

    def _unit(self, name: str) -> UnitPrototype | None:
        prototype = self._instance.lookup(name)
        return prototype if isinstance(prototype, UnitPrototype) and prototype.elsewhere is None else None

    def _step(self, now_us: int) -> None:
        options = [option for option in self._options() if option.relieves > 0.0]
        if not options:
            return
        least = min(option.importance for option in options)
        option = max((each for each in options if each.importance == least), key=lambda each: each.relieves)
        said = option.step()
        self.steps.append(GovernorStep(option, now_us, self.load))
        self._acted_us, self._delay_then_us = now_us, self._worst_us
        self._tell(option, said, f"delays of {print_span(self._worst_us)}", now_us)

    def _back(self, now_us: int) -> None:
        """Take a step back."""
        step = self._next_back()
        self.steps.remove(step)
        option = step.option
        said = option.back()
        self._acted_us = self._calm_since_us = now_us
        self._tell(option, said, f"{self.load:.0%} of the time is spent", now_us)

    def _next_back(self) -> GovernorStep:
        """The step of the most important stream; the last of them first."""
        return max(reversed(self.steps), key=lambda step: step.option.importance)

    def _has_room(self, now_us: int) -> bool:
        """At worst all that is computed is computed for the stream whose step is to be taken back."""
        if self.load * self._next_back().growth() > ROOM:
            self._calm_since_us = now_us
        return now_us - self._calm_since_us >= CALM_US

    def _tell(self, option: Option, said: str, why: str, now_us: int) -> None:
        self._instance.network.push(REFINEMENTS, Sample(now_us, now_us, (option.name, said, why)))


def speaks(network: Network) -> None:
    """Declare the stream of the governor's steps."""
    network.add_source(REFINEMENTS, SORT)


def listens(specification: Iterable[spec.Declaration]) -> bool:
    """Whether a specification takes what a governor tells."""
    return any(need.term.label == REFINEMENTS for each in specification for need in symbol_of(each).takes)


def _importances(instance: Instance) -> dict[int, float]:
    """The importance of each stream, by its identity: at least that of every stream computed from it."""
    served = [*instance.streams.values(), *(each for one in instance.monitors.values() for each in one.states.proxies)]
    taken = {label: [*inputs_taken(instance.network.process(label))] for label in instance.network.labels()}
    found: dict[int, float] = {}
    waiting = [(proxy, 0.0) for proxy in (*served, *(each for inputs in taken.values() for each in inputs))]
    while waiting:
        proxy, of_consumer = waiting.pop()
        importance = max(of_consumer, proxy.policy.importance)
        if importance > found.get(id(proxy), 0.0):
            found[id(proxy)] = importance
            waiting += [(each, importance) for each in taken.get(proxy.label, ())]
    return found
