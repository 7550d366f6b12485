"""Mediation and configuration: inputs, or whole processes, that come and go with a stream of objects (3.3.3, 3.3.4)."""

import re
from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from functools import partial

from dyknow.model.errors import SortError
from dyknow.model.labels import RESERVED, Label
from dyknow.model.sample import Sample, Value
from dyknow.model.values import NO_VALUE
from dyknow.network.process import Input, ProcessNetwork
from dyknow.network.processes import EVER_US, OnDemand
from dyknow.network.stream_proxy import StreamProxy
from dyknow.policies.sampling import Grid

MAX_MEMBERS = 4096
MAX_NAME = 128
"""Longest name of a member, in characters."""
EVER = 2**80
KEPT = 64
_OBJECT = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(-[A-Za-z0-9_]+)*|[0-9]+")


def members_of(value: Value) -> tuple[str, ...]:
    """The objects a value names: one, or a set of them as a tuple or frozenset; `no_value` names none.

    Raises:
        SortError: it names no objects, or too many.
    """
    if value is NO_VALUE:
        return ()
    several = value if isinstance(value, tuple | frozenset) else (value,)
    if len(several) > MAX_MEMBERS:
        raise SortError(f"{len(several)} objects at once; at most {MAX_MEMBERS} can be members")
    members = list(map(_name, several))
    return tuple(dict.fromkeys(sorted(members) if isinstance(value, frozenset) else members))


def _name(one: Value) -> str:
    if isinstance(one, int) and not isinstance(one, bool):
        if 0 <= one < 10**MAX_NAME:
            return str(one)
        raise SortError(f"{'a number of that size' if one > 0 else 'a negative number'} names no object")
    if not isinstance(one, str):
        raise SortError(f"a {type(one).__name__} names no object; a text or an integer does")
    if len(one) > MAX_NAME or not _OBJECT.fullmatch(one) or (one in RESERVED and one not in {"from", "to"}):
        raise SortError(f"{one[:80]!r} names no object")
    return one


class Mediation(OnDemand):
    """Passes on the samples of the members that a stream names: of all of them (merge), or of the one (select).

    Args:
        domain: the stream that names the members; its newest sample counts from the beginning.
        member: the input of one member.
        single: with more than one member at a time none is selected, and that is a fault.

    Attributes:
        recent: valid times and values that were passed on last, each with the label of the stream it came from.
    """

    def __init__(self, domain: Input, member: Callable[[str], Input], *, single: bool) -> None:
        super().__init__()
        self._domain, self._member, self.single = domain, member, single
        self.members: dict[str, StreamProxy] = {}
        self.recent: deque[tuple[int, Value, Label]] = deque(maxlen=KEPT)
        self._past: list[tuple[int, str, Sample]] = []
        self._grid: Grid | None = None
        self._is_told = False

    def inputs(self) -> Sequence[Input]:
        return (self._domain,)

    def taken(self) -> Iterable[Label]:
        return [proxy.label for proxy in (*self.proxies, *self.members.values())]

    def begin(self) -> None:
        self.members = {}

    def want(self, grid: Grid | None) -> bool:
        self._grid = grid
        for proxy in self.members.values():
            proxy.want(grid)
        return grid is not None

    def on_sample(self, i: int, sample: Sample) -> None:
        del i
        self._replay(sample.available_us)
        try:
            members = members_of(sample.value)
        except SortError as wrong:
            self.fault(str(wrong))
            return
        if self.single and len(members) > 1:
            self._is_of_several(len(members))
        elif self.single:
            self._is_told = False
        if self.single and len(members) != 1:
            members = ()
        staying = set(members)
        gone = self.members.keys() - staying
        for member in gone:
            self.members.pop(member).cancel()
        if gone:
            self._past = [each for each in self._past if each[1] not in gone]
        for member in members:
            if member not in self.members:
                self._join(member, sample)
        if self._in_past:
            self._past.sort(key=lambda each: each[:2])

    def _is_of_several(self, named: int) -> None:
        """None of several can be the one that is selected; reported once, until one is named again."""
        if not self._is_told:
            self._is_told = True
            self.fault(
                f"{self._domain.label} names {named} objects at once, so that none is selected: `select` passes one "
                "input at a time, `merge` those of all"
            )

    def end(self) -> None:
        members, self.members = self.members, {}
        self._past.clear()
        self.recent.clear()
        for proxy in members.values():
            proxy.cancel()

    def _connect(self, i: int, wanted: Input, from_us: int | None) -> StreamProxy:
        """Take the current members; for the past also the former ones."""
        network, consumer = self._network, partial(self.on_sample, i)
        assert network is not None  # noqa: S101  (only what is attached starts)
        generator = None if from_us is None else network.find(wanted.label)
        if from_us is None or generator is None:
            return network.connect(wanted.label, wanted.policy, consumer, current=True)
        begins_us = generator.prepare(EVER_US)
        if begins_us > EVER_US:
            held = generator.held()
            self._since_us = max(self._since_us, held[0].available_us if held else begins_us)
        return network.connect(wanted.label, wanted.policy, consumer, from_us=begins_us, current=True)

    def _relive(self, _from_us: int | None) -> None:
        for proxy in self.proxies:
            for named in proxy.take_backlog():
                self.on_sample(0, named)
        self._replay(EVER)

    def _join(self, member: str, named: Sample) -> None:
        """A member's stream, from when the member was named."""
        network, wanted = self._network, self._member(member)
        if network is None:
            return
        generator = network.find(wanted.label) if self._in_past else None
        consumer = partial(self._pass, wanted.label)
        if generator is None:
            proxy = network.connect(wanted.label, wanted.policy, consumer)
        else:
            begins_us = generator.prepare(EVER_US)
            held = generator.held()
            if begins_us > EVER_US and (not held or held[0].available_us > named.available_us):
                self._since_us = max(self._since_us, begins_us)
            proxy = network.connect(
                wanted.label, wanted.policy, consumer, from_us=begins_us, after_us=named.available_us
            )
        self.members[member] = proxy
        self._past += [(sample.available_us, member, sample) for sample in proxy.take_backlog()]
        proxy.want(self._grid)

    def _replay(self, until_us: int) -> None:
        """Pass on what the members brought in the past before `until_us`."""
        passed = bisect_left(self._past, until_us, key=lambda each: each[0])
        for _, member, sample in self._past[:passed]:
            self._pass(self._member(member).label, sample)
        del self._past[:passed]

    def maker_of(self, sample: Sample) -> Label | None:
        """From which stream a sample came that was passed on lately; None: it is not known, or approximated."""
        found = [
            label for valid_us, value, label in self.recent if (valid_us, value) == (sample.valid_us, sample.value)
        ]
        return found[-1] if found else None

    def _pass(self, label: Label, sample: Sample) -> None:
        generator = self._generator
        if generator is None:
            return
        try:
            generator.sort.check(sample.value)
        except SortError as wrong:
            self.fault(f"a member brings what is not of the sort: {wrong}")
        else:
            self.recent.append((sample.valid_us, sample.value, label))
            self.emit(sample.valid_us, sample.value, sample.available_us, sample.quality)


class Configuration:
    """Sees to it that for each member that a stream names there is what belongs to it (Def. 3.3.4).

    Args:
        create: a member came, or may lack what belongs to it; `remove`: it went.
        admit: called before any change with the number of newcomers; raises SortError, and all stays.
    """

    def __init__(
        self,
        network: ProcessNetwork,
        domain: Input,
        create: Callable[[str], None],
        remove: Callable[[str], None],
        admit: Callable[[int], None] = lambda _more: None,
    ) -> None:
        self._network, self.domain, self._create, self._remove, self._admit = network, domain, create, remove, admit
        self.members: dict[str, None] = {}
        self.proxy = network.connect(domain.label, domain.policy, self._on_sample, current=True)

    def renew(self) -> None:
        """Some of what belongs to the members may be gone: create it again where it is."""
        for member in tuple(self.members):
            self._create(member)

    def cancel(self) -> None:
        """All members go."""
        self.proxy.cancel()
        self._set(())

    def _on_sample(self, sample: Sample) -> None:
        try:
            members = members_of(sample.value)
            self._admit(len(members) - len(self.members))
        except SortError as wrong:
            self._network.on_fault(self.domain.label, str(wrong))
        else:
            self._set(members)

    def _set(self, members: Sequence[str]) -> None:
        staying = set(members)
        for gone in [member for member in self.members if member not in staying]:
            del self.members[gone]
            self._remove(gone)
        for new in members:
            if new not in self.members:
                self.members[new] = None
                self._create(new)
