"""Knowledge processes as their network sees them, and the network as they see it (thesis 3.3, 5.4)."""

from collections.abc import Callable
from typing import Final, NamedTuple, Protocol, TypeAlias

from dyknow.model.labels import Label
from dyknow.model.sample import Sample
from dyknow.network.generator import Consumer, Generator, Owner
from dyknow.network.instant import Instant
from dyknow.network.stream_proxy import OnLink, ProxyNetwork, StreamProxy
from dyknow.policies.policy import Policy

FAR_US: Final = 2**80
"""A deadline that means: perhaps later."""


class Input(NamedTuple):
    """An input stream: the label of its generator, and a policy."""

    label: Label
    policy: Policy = Policy()


class TimedProcess(Protocol):
    """A process that makes samples when time passes; without a deadline it will not again."""

    @property
    def deadline_us(self) -> int | None: ...
    def on_time(self, now_us: int) -> None: ...


class Outcome(NamedTuple):
    """The outputs of a computational unit, in order, and its exceptions."""

    outputs: tuple[Sample, ...] = ()
    faults: tuple[str, ...] = ()


Work: TypeAlias = Callable[[], Outcome]
"""Calls of a unit, for one thread; it raises nothing that a unit may raise."""


class Workers(Protocol):
    """Where slow units are called, and the clock that says how long a call takes."""

    def now_us(self) -> int:
        """Federation time as it is now, also within a step."""

    def start(self, number: int, work: Work) -> None:
        """Do it next to the thread of the network, and let `Network.on_computed` have the outcome."""


class Computing(Protocol):
    """A process whose unit is called in a worker."""

    def on_computed(self, outcome: Outcome, took_us: int, now_us: int) -> None:
        """The work is done, and took so long."""


class CallsApart:
    """The calls of units in workers that are under way, by number.

    Attributes:
        workers: where slow units are called; None: time is simulated, and passes as units declare.
    """

    __slots__ = ("_processes", "_started", "workers")

    def __init__(self) -> None:
        self.workers: Workers | None = None
        self._processes: dict[int, Computing] = {}
        self._started = 0

    def __len__(self) -> int:
        return len(self._processes)

    def start(self, process: Computing, work: Work) -> int:
        """Have a worker do it for the process; its number."""
        assert self.workers is not None  # noqa: S101  (it asks only where there are workers)
        self._started += 1
        self._processes[self._started] = process
        self.workers.start(self._started, work)
        return self._started

    def abandon(self, number: int) -> None:
        """The results of that work are of no use."""
        self._processes.pop(number, None)

    def on_computed(self, number: int, outcome: Outcome, took_us: int, now_us: int) -> None:
        """A worker has finished."""
        process = self._processes.pop(number, None)
        if process is not None:
            process.on_computed(outcome, took_us, now_us)


class ProcessNetwork(ProxyNetwork, Protocol):
    """The part of a `Network` that its processes use."""

    calls: CallsApart
    instant: Instant
    on_producer: Callable[[Label, Label | None], None]

    def rank(self, label: Label) -> int: ...
    def process(self, label: Label) -> "Process | None": ...
    def behind(self, label: Label) -> Generator | None: ...
    def find(self, label: Label) -> Generator | None: ...
    def connect(
        self,
        label: Label,
        policy: Policy,
        consumer: Consumer,
        on_link: OnLink | None = None,
        *,
        from_us: int | None = None,
        after_us: int | None = None,
        current: bool = False,
    ) -> StreamProxy: ...
    def meet(self, on_label: Callable[[Label], None]) -> Callable[[], None]: ...
    def step(self, timed: TimedProcess) -> None: ...
    def unstep(self, timed: TimedProcess) -> None: ...


class Process(Owner, Protocol):
    """A knowledge process that feeds one generator and works while its stream is subscribed (3.3)."""

    def attach(self, network: ProcessNetwork, generator: Generator) -> None:
        """Feed this generator from now on."""

    def detach(self) -> None:
        """Stop feeding it, and release everything."""
