"""A knowledge process host: an own operating system process that runs processes for a platform (thesis 5.2, 5.3).

A value that is stepped: messages of the platform go in, `work` lets one process work on one sample, and messages
for it come out. Sources are read outside, where iterators may block.
"""

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple, TypeAlias

from dyknow import ComputationalUnit, Policy, PolicyAdapter, Prototype, Sample, SourcePrototype, UnitPrototype, Value
from dyknow.agents.hosts.scheduling import Scheduler
from dyknow.federation.hosts import messages
from dyknow.model.errors import PolicyNotSupported, raised
from dyknow.policies.sampling import Grid

MAX_BATCH: Final = 256


class Read(NamedTuple):
    """Read a source from a time on, only samples on `grid` (None: all)."""

    process: int
    source: SourcePrototype
    from_us: int
    grid: Grid | None


HostStep: TypeAlias = messages.FromHost | Read | messages.Want | messages.End | messages.Welcome | messages.Refuse
"""Messages for the platform, and steps of the host's process: to read a source, or the platform's message about that."""


class _Item(NamedTuple):
    i: int
    sample: Sample
    past: bool
    counted: bool  # it came from the platform, which counts what is taken


class _Working:
    """A process of a unit, at work."""

    def __init__(self, name: str, unit: ComputationalUnit, adapter: PolicyAdapter | None) -> None:
        self.name, self.unit, self.adapter = name, unit, adapter
        self.taken = 0
        self.last_us = -(2**80)


class KnowledgeHost:
    """The processes of one host.

    Args:
        prototypes: the prototypes that it offers.
        pid, module: its identity, for users.
        batch: number of input samples of a process that are processed together.
        train: whether a sample passes a whole chain of processes before the next scheduled action.

    Raises:
        ValueError: the batch is none, or larger than `MAX_BATCH`.
    """

    def __init__(
        self, prototypes: Iterable[Prototype], pid: int, module: str, *, batch: int = 1, train: bool = False
    ) -> None:
        if not 1 <= batch <= MAX_BATCH:
            raise ValueError(f"batch: expected 1 to {MAX_BATCH} samples, got {batch}")
        self._prototypes = {prototype.name: prototype for prototype in prototypes}
        self._pid, self._module, self._batch, self._train = pid, module, batch, train
        self.reset()

    def reset(self) -> None:
        """The platform is gone: nothing runs."""
        self._scheduler: Scheduler[int, _Item] = Scheduler(self._batch, train=self._train, bound=4 * messages.KEPT)
        self._working: dict[int, _Working] = {}
        self._followers: dict[int, list[tuple[int, int]]] = {}
        self._serial = 0
        self._made: dict[tuple[int, int, bool], list[Sample]] = {}
        self._faults: list[messages.HostFault] = []

    def registration(self) -> messages.Register:
        """The first message."""
        units = [
            messages.UnitOffer(p.name, p.sort, p.inputs, p.samplewise, p.history_us, p.cheaper, p.priority)
            for p in self._prototypes.values()
            if isinstance(p, UnitPrototype)
        ]
        sources = [
            messages.SourceOffer(p.name, p.sort, p.label)
            for p in self._prototypes.values()
            if isinstance(p, SourcePrototype)
        ]
        shapes = dict.fromkeys(shape for p in self._prototypes.values() for shape in p.checked_sorts)
        sorts = [
            messages.SortOffer(
                each.name, each.unit, tuple(messages.FieldOffer(part.name, part.unit) for part in each.fields)
            )
            for each in shapes
        ]
        return messages.Register(self._pid, self._module, self._train, tuple(units), tuple(sources), tuple(sorts))

    @property
    def is_train(self) -> bool:
        """Whether sources are part of chains, so that their readings belong here."""
        return self._train

    @property
    def acting(self) -> bool:
        """Whether an action has begun and is not over: nothing else is to be done before."""
        return self._scheduler.acting

    def on_message(self, message: messages.FromPlatform) -> list[HostStep]:
        """Take a message of the platform; returns the steps that follow at once."""
        match message:
            case messages.Welcome() | messages.Refuse() | messages.Want():
                return [message]
            case messages.Begin():
                return self._begin(message)
            case messages.HostInputs(process, past, inputs):
                for i, sample in inputs:
                    self._scheduler.put(process, _Item(i, sample, past, True))
            case messages.Chain():
                self._chain(message)
            case messages.End(process):
                self._working.pop(process, None)
                self._scheduler.remove(process)
                self._followers.pop(process, None)
                for followers in self._followers.values():
                    followers[:] = [each for each in followers if each[0] != process]
                return [message]
        return []

    def on_reading(self, process: int, samples: Sequence[Sample]) -> list[messages.FromHost]:
        """A source that is read has new samples of one instant, which may begin chains."""
        for sample in samples:
            for follower, item in self._following(process, sample):
                self._scheduler.put(follower, item)
        return [messages.HostOutput(process, 0, self._serial, False, tuple(samples))]

    def work(self, now_us: int) -> list[messages.FromHost] | None:
        """Let one process work on one sample; its messages, at the end of an action. None: nothing to do.

        `now_us` is federation time.
        """
        turn = self._scheduler.next()
        if turn is None:
            return None
        process, item = turn
        working = self._working.get(process)
        if working is not None:
            self._work(process, working, item, now_us)
        return [] if self._scheduler.acting else self._pending()

    def _work(self, process: int, working: _Working, item: _Item, now_us: int) -> None:
        working.taken += item.counted
        made = self._made.setdefault((process, self._serial, item.past), [])  # also what brings nothing is taken
        try:
            made_now = working.unit.outputs_of({item.i: item.sample}, item.sample.available_us)
        except Exception as wrong:  # noqa: BLE001  (it is a user's code)
            self._faults.append(messages.HostFault(process, raised(working.name, wrong)))
            return
        for output in made_now:
            available_us = item.sample.available_us
            if not item.past:
                available_us = working.last_us = max(now_us, available_us, working.last_us + 1)
            outputs = [output._replace(available_us=available_us)]
            if working.adapter is not None:
                outputs = working.adapter.on_sample(outputs[0], available_us)
            made += outputs
            if not item.past:
                for each in outputs:
                    self._scheduler.follow(self._following(process, each))

    def _following(self, process: int, sample: Sample) -> list[tuple[int, _Item]]:
        return [(each, _Item(i, sample, False, False)) for each, i in self._followers.get(process, ())]

    def _pending(self) -> list[messages.FromHost]:
        pending: list[messages.FromHost] = [
            messages.HostOutput(process, self._working[process].taken, serial, past, tuple(samples))
            for (process, serial, past), samples in self._made.items()
            if process in self._working
        ]
        self._made = {}
        pending += self._faults
        self._faults = []
        return pending

    def _begin(self, begin: messages.Begin) -> list[HostStep]:
        prototype, process = self._prototypes.get(begin.prototype), begin.process
        if isinstance(prototype, SourcePrototype):
            return [Read(process, prototype, begin.now_us, begin.grid)]
        if prototype is None:
            return [messages.HostFault(process, f"this host offers no {begin.prototype}")]
        try:
            adapter = _adapter(prototype, begin.output)
            unit = ComputationalUnit(prototype.make(), len(prototype.inputs))
        except Exception as wrong:  # noqa: BLE001  (it is a user's code)
            return [messages.HostFault(process, f"{prototype.name} cannot be made: {wrong!r}")]
        self._working[process] = _Working(prototype.name, unit, adapter)
        self._scheduler.add(process, prototype.priority)
        return []

    def _chain(self, chain: messages.Chain) -> None:
        """Which process takes what another one makes; the serial in a message shows that it held then."""
        follower = chain.process, chain.i
        for followers in self._followers.values():
            if follower in followers:
                followers.remove(follower)
        if chain.maker:
            self._followers.setdefault(chain.maker, []).append(follower)
        self._serial = chain.serial


def _adapter(prototype: UnitPrototype, output: str) -> PolicyAdapter | None:
    if not output:
        return None
    policy = Policy.parse(output)
    if not prototype.supports(policy):
        raise PolicyNotSupported(f"{prototype.name} cannot provide its output with {policy}")
    return PolicyAdapter(policy)


def on_grid(valid_us: int, grid: Grid | None) -> bool:
    """Whether a reading is wanted; where the grid has no anchor yet every reading may be the one that gives it."""
    return grid is None or grid.anchor_us is None or (valid_us - grid.anchor_us) % grid.period_us == 0


def reading(valid_us: int | None, value: Value | list[Value], now_us: int) -> tuple[Sample, ...]:
    """A reading of a source as samples; without a valid time they are valid now."""
    at_us = now_us if valid_us is None else int(valid_us)
    return tuple(Sample(now_us, at_us, each) for each in (value if isinstance(value, list) else (value,)))
