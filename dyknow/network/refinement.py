"""Computational units as processes: called on the spot while that is fast, else in a worker (Def. 4.3.15, 4.5.8).

The output of a unit is available when the unit has finished (3.2). On a platform the time that a call takes is
measured. In simulated time it is what the prototype declares, and a unit works on one element of its join after the
other.
"""

from collections import deque
from collections.abc import Sequence
from functools import partial
from typing import Final, NamedTuple

from dyknow.model.errors import SortError, TooEarly, raised
from dyknow.model.instants import US_PER_S, earlier, print_span
from dyknow.model.sample import Sample
from dyknow.network.instant import JoinElements
from dyknow.network.process import Input, Outcome, Work
from dyknow.network.processes import OnDemand
from dyknow.network.prototypes import UnitPrototype
from dyknow.network.unit_at_work import UnitAtWork
from dyknow.policies.policy import Policy
from dyknow.policies.sampling import Grid, PolicyAdapter

SLOW_US: Final = 5_000
"""A call that takes longer has no place in the thread of a platform."""
SHOWN: Final = 3
"""Fast calls in a row after which a unit is taken for fast."""
LATE_US: Final = US_PER_S
"""An element that has waited longer for its unit, and is not the newest, is dropped."""
STUCK_US: Final = 10 * US_PER_S
MAX_WAITING: Final = 64


class Pace:
    """Whether calls of the unit of one process are fast; it has to show that, each time it fails ten times as often."""

    __slots__ = ("_is_declared_slow", "_missing", "_needed", "is_known_slow")

    def __init__(self, cost_us: int | None) -> None:
        self._is_declared_slow = self.is_known_slow = cost_us is not None and cost_us > SLOW_US
        self._needed = SHOWN
        self._missing = SHOWN if cost_us is None or self._is_declared_slow else 0

    @property
    def is_slow(self) -> bool:
        """Whether it is called in a worker: it is slow, or has not shown yet that it is fast."""
        return self._missing > 0

    def took(self, took_us: int) -> None:
        """A call took so long."""
        if took_us > SLOW_US:
            if not self._missing:
                self._needed *= 10
            self._missing = self._needed
            self.is_known_slow = True
        elif self._missing and not self._is_declared_slow:
            self._missing -= 1
            self.is_known_slow = self.is_known_slow and self._missing > 0


class WaitingElement(NamedTuple):
    """An element of the join that waits for its unit."""

    element: dict[int, Sample]
    available_us: int
    is_past: bool


class RefinementProcess(OnDemand):
    """A computational unit over streams (Def. 4.3.15, 4.5.8). Exceptions of a unit are reported and end nothing.

    With an `output` policy, one without approximation, what the unit makes is adapted to it first.

    Attributes:
        dropped: elements of the join that waited too long for the unit; their samples count with the next one.
        adapter: of the output, to its policy, which counts what it drops; None: there is no such policy, or no subscriber.
    """

    def __init__(self, prototype: UnitPrototype, inputs: Sequence[Input], output: Policy | None = None) -> None:
        super().__init__()
        self.prototype = prototype
        self._output = output
        self.adapter: PolicyAdapter | None = None
        self.history_us = prototype.history_us
        self._wanted = tuple(inputs)
        self._unit: UnitAtWork | None = None
        self._pace = Pace(prototype.cost_us)
        self._join = JoinElements()
        self._waiting: deque[WaitingElement] = deque()
        self._number = 0  # of the call that is under way
        self._began_us = self._ended_us = 0
        self._is_past = self._is_stuck = self._wants_past = self._is_apart = False
        self._due: tuple[int, Outcome] | None = None
        self.dropped = 0

    def inputs(self) -> Sequence[Input]:
        return self._wanted

    @property
    def is_apart(self) -> bool:
        """Whether its unit is called in a worker."""
        return self._is_apart and self._network is not None and self._network.calls.workers is not None

    @property
    def arity(self) -> int:
        return len(self._wanted)

    @property
    def priority(self) -> int:
        return self.prototype.priority

    @property
    def rank(self) -> int:
        network, generator = self._network, self._generator
        return 0 if network is None or generator is None else network.rank(generator.label)

    def begin(self) -> None:
        if self._output is not None:
            self.adapter = PolicyAdapter(self._output)
            self.adapter.on_starved = partial(self.fault, f"its output hardly meets its own policy, {self._output}")
        self._count_in(1)
        self._renew()

    def end(self) -> None:
        self._count_in(-1)
        self._forget()
        self._unit = None

    def _count_in(self, more: int) -> None:
        """It takes part in instants from now on, or no more (-1)."""
        if self._network is not None:
            self._network.instant.joins += more * (self.arity > 1 or self.priority != 0)
            self._network.instant.priorities += more * (self.priority != 0)

    def want(self, grid: Grid | None) -> bool:
        if not self.prototype.samplewise or self._output is not None:
            grid = None
        for proxy in self.proxies:
            proxy.want(grid)
        return grid is not None

    def exchange(self, prototype: UnitPrototype) -> None:
        """Let another unit over the same sorts do the work from now on; its memory begins empty."""
        if self.running:
            self._count_in(-1)
        self.prototype, self._pace = prototype, Pace(prototype.cost_us)
        self.history_us = prototype.history_us
        if self.running:
            self._count_in(1)
            self._renew()
            self._narrow()

    def _renew(self) -> None:
        self._forget()
        self._unit = UnitAtWork(self.prototype, len(self._wanted))
        if self._network is None or self._network.calls.workers is None:
            self._is_apart = bool(self.prototype.cost_us)
        else:
            self._is_apart = self._pace.is_known_slow if self._wants_past else self._pace.is_slow
        if not self.is_apart:
            self._report(self._unit.make())

    def _forget(self) -> None:
        """Elements that wait, and the call under way, are of no use."""
        if self._number and self._network is not None:
            self._network.calls.abandon(self._number)
        self._number, self._due = 0, None
        self._is_stuck = False
        self._waiting.clear()
        self._join.take()

    # The past: a unit that is called in a worker has none to offer

    def since_us(self) -> int:
        if not self.running and self._network is not None and self._pace.is_known_slow and self._network.calls.workers:
            return self._network.now_us
        return super().since_us()

    def reach(self, from_us: int | None) -> None:
        if from_us is not None and from_us < self.since_us():
            raise TooEarly(self._label, from_us, self.since_us())
        if self._network is None or self._network.calls.workers is None or not self._pace.is_known_slow:
            super().reach(from_us)

    def _start(self, from_us: int | None) -> None:
        self._wants_past = from_us is not None
        super()._start(from_us)
        self._wants_past = False
        if from_us is not None and self.is_apart:
            self._since_us = self._now_us()

    # Calls

    def on_sample(self, i: int, sample: Sample) -> None:
        network = self._network
        if len(self._wanted) == 1 and (network is None or not network.instant.priorities):
            self._on_element({i: sample}, sample.available_us)
            return
        self._join.put(i, sample)
        if not self._in_past and network is not None:
            network.instant.put(self)

    def on_instant(self) -> None:
        for element in self._join.take():
            self._on_element(element, max([sample.available_us for sample in element.values()]))
        if self._waiting and not self._is_busy:
            self._next(self._ended_us)

    def _on_element(self, element: dict[int, Sample], available_us: int) -> None:
        work, network = self._unit, self._network
        if work is None or network is None:
            return
        workers, unit = network.calls.workers, work.unit
        if self._is_apart and not (self._in_past and workers is None):
            self._wait(WaitingElement(element, available_us, self._in_past))
            return
        if unit is None:
            return
        clock = None if self.prototype.cost_us == 0 else workers
        now_us = available_us + (self.prototype.cost_us or 0)
        began_us = 0 if clock is None else clock.now_us()
        try:
            outputs = unit.outputs_of(element, available_us)
        except Exception as wrong:  # noqa: BLE001  (it is a user's code)
            outputs = ()
            self.fault(raised(self.prototype.name, wrong))
        if clock is not None:
            ended_us = clock.now_us()
            self._pace.took(ended_us - began_us)
            self._is_apart = self._pace.is_slow and (not self._in_past or self._pace.is_known_slow)
            now_us = available_us + ended_us - began_us if self._in_past else max(available_us, ended_us)
        for output in outputs:
            self._hand_on(output, now_us)
        if unit.due_us is not None and not self._in_past:
            network.step(self)

    def _hand_on(self, output: Sample, now_us: int) -> None:
        """Hand on the unit's output, available now."""
        generator = self._generator
        if generator is None or self._unit is None:
            return
        try:
            generator.sort.check(output.value)
        except SortError as wrong:
            self.fault(f"{self.prototype.name} made what is not of its sort: {wrong}")
            return
        if self.adapter is None:
            self.emit(output.available_at(now_us))
            return
        for each in self.adapter.on_sample(output.available_at(now_us), now_us):
            self.emit(each.available_at(now_us))

    def _report(self, faults: Sequence[str]) -> None:
        for each in faults:
            self.fault(each)

    # Calls that take time

    def _wait(self, came: WaitingElement) -> None:
        """Let the unit have it when it has finished; late elements are dropped, and not queued."""
        self._waiting.append(came)
        if not self._is_busy:
            self._next(came.available_us)
            return
        self._drop_late(came.available_us)
        if came.available_us - self._began_us > STUCK_US and not self._is_stuck and not came.is_past:
            self._is_stuck = True
            self.fault(f"{self.prototype.name} has not returned for {print_span(STUCK_US)}; what comes is dropped")

    @property
    def _is_busy(self) -> bool:
        return bool(self._number) or self._due is not None

    def _drop_late(self, now_us: int) -> None:
        waiting = self._waiting
        while len(waiting) > 1 and not waiting[0].is_past:
            if now_us - waiting[0].available_us <= LATE_US and len(waiting) <= MAX_WAITING:
                return
            late, following = waiting.popleft(), waiting.popleft()
            waiting.appendleft(following._replace(element=late.element | following.element))
            self.dropped += 1
            if self.dropped == 10 ** (len(str(self.dropped)) - 1):
                self.fault(
                    f"{self.prototype.name} is slower than its inputs come: late inputs are dropped, until now {self.dropped}"
                )

    def _next(self, now_us: int) -> None:
        """Call the unit with what waits: all of the past, or one element."""
        self._drop_late(now_us)
        waiting, unit, network = self._waiting, self._unit, self._network
        if not waiting or unit is None or network is None:
            return
        taken = [waiting.popleft()]
        while taken[0].is_past and waiting and waiting[0].is_past:
            taken.append(waiting.popleft())
        self._began_us, self._is_past, self._is_stuck = now_us, taken[0].is_past, False
        work = _work(unit, taken)
        if network.calls.workers is not None:
            self._number = network.calls.start(self, work)
        else:
            self._due = now_us + (self.prototype.cost_us or 0), work()
            network.step(self)

    def on_computed(self, outcome: Outcome, took_us: int, now_us: int) -> None:
        """The worker has finished."""
        self._number = 0
        self._pace.took(took_us)
        self._finish(outcome, now_us)
        if not self._is_busy and not self._waiting and not self._pace.is_slow:
            self._is_apart = False

    def on_time(self, now_us: int) -> None:
        if self._due is not None and self._due[0] <= now_us:
            (_, outcome), self._due = self._due, None
            self._finish(outcome, now_us)
        unit = None if self._is_apart else self._unit
        if unit is not None and unit.due_us is not None and unit.due_us <= now_us:
            outcome = unit.on_time(now_us)
            for output in outcome.outputs:
                self._hand_on(output, now_us)
            self._report(outcome.faults)

    @property
    def deadline_us(self) -> int | None:
        unit = None if self._is_apart else self._unit
        return earlier(None if self._due is None else self._due[0], None if unit is None else unit.due_us)

    def _finish(self, outcome: Outcome, now_us: int) -> None:
        if self._is_past:
            self._in_past = True
            for output in outcome.outputs:
                self._hand_on(output, output.available_us)
            self._in_past = False
        else:
            for output in outcome.outputs:
                self._hand_on(output, now_us)
        self._report(outcome.faults)
        self._ended_us = now_us
        if self._network is not None:
            self._network.instant.put(self)  # samples of this instant come before the next call


def _work(unit: UnitAtWork, taken: Sequence[WaitingElement]) -> Work:
    def work() -> Outcome:
        outputs: list[Sample] = []
        faults: list[str] = []
        for element, available_us, _ in taken:
            outcome = unit.take(element, available_us)
            outputs += [each.available_at(available_us) for each in outcome.outputs]
            faults += outcome.faults
        return Outcome(tuple(outputs), tuple(faults))

    return work
