"""Mediation and configuration: inputs, or whole processes, that come and go with a stream of objects (3.3.3, 3.3.4)."""

import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from dyknow.errors import SortError
from dyknow.processes import Input, OnDemand
from dyknow.sample import Sample, Value
from dyknow.stream_proxy import StreamProxy
from dyknow.values import NO_VALUE

if TYPE_CHECKING:
    from dyknow.network import Network

MAX_MEMBERS = 4096
EVER = 2**80
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
    members = [str(one) if isinstance(one, str | int) and not isinstance(one, bool) else "" for one in several]
    wrong = next((one for one, name in zip(several, members, strict=True) if not _OBJECT.fullmatch(name)), None)
    if wrong is not None:
        raise SortError(f"{wrong!r:.80} names no object")
    return tuple(dict.fromkeys(sorted(members) if isinstance(value, frozenset) else members))


class Mediation(OnDemand):
    """Passes on the samples of the members that a stream names: of all of them (merge), or of the one (select).

    Args:
        domain: the stream that names the members; its newest sample counts from the beginning.
        member: the input of one member.
        single: with more than one member at a time none is selected.
    """

    def __init__(self, domain: Input, member: Callable[[str], Input], *, single: bool) -> None:
        super().__init__()
        self._domain, self._member, self.single = domain, member, single
        self.members: dict[str, StreamProxy] = {}
        self._past: list[tuple[int, str, Sample]] = []

    def inputs(self) -> Sequence[Input]:
        return (self._domain,)

    def begin(self) -> None:
        self.members = {}

    def on_demand(self) -> None:
        super().on_demand()
        if self._generator is not None and self.running:
            wanted = self._generator.wanted
            for proxy in self.members.values():
                proxy.want(wanted)

    def on_sample(self, i: int, sample: Sample) -> None:
        del i
        self._replay(sample.available_us)
        try:
            members = members_of(sample.value)
        except SortError as wrong:
            self.fault(str(wrong))
            return
        if self.single and len(members) != 1:
            members = ()
        for gone in self.members.keys() - set(members):
            self.members.pop(gone).cancel()
            self._past = [each for each in self._past if each[1] != gone]
        for new in members:
            if new not in self.members:
                self._join(new, sample)

    def end(self) -> None:
        members, self.members = self.members, {}
        self._past.clear()
        for proxy in members.values():
            proxy.cancel()

    def _start(self, from_us: int | None) -> None:
        super()._start(from_us)
        self._in_past = True
        self._replay(EVER)
        self._in_past = False
        newest = _newest(self._network, self._domain)
        if newest is not None and not self.members:
            self.on_sample(0, newest)

    def _join(self, member: str, named: Sample) -> None:
        """A member's stream, from when the member was named."""
        network, wanted = self._network, self._member(member)
        if network is None:
            return
        begins_us = named.available_us if self._in_past and network.has(wanted.label) else None
        from_us = None if begins_us is None else network.generator(wanted.label).since_us
        proxy = network.connect(wanted.label, wanted.policy, self._pass, from_us=from_us, after_us=begins_us)
        self.members[member] = proxy
        self._past += [(sample.available_us, member, sample) for sample in proxy.take_backlog()]
        self._past.sort(key=lambda each: each[:2])
        if self._generator is not None:
            proxy.want(self._generator.wanted)

    def _replay(self, until_us: int) -> None:
        """Pass on what the members brought in the past before `until_us`."""
        while self._past and self._past[0][0] < until_us:
            self._pass(self._past.pop(0)[2])

    def _pass(self, sample: Sample) -> None:
        self.emit(sample.valid_us, sample.value, sample.available_us, sample.quality)


class Configuration:
    """Sees to it that for each member that a stream names there is what belongs to it (Def. 3.3.4).

    Args:
        create: a member came, or may lack what belongs to it; `remove`: it went.
    """

    def __init__(
        self, network: "Network", domain: Input, create: Callable[[str], None], remove: Callable[[str], None]
    ) -> None:
        self._network, self.domain, self._create, self._remove = network, domain, create, remove
        self.members: dict[str, None] = {}
        self.proxy = network.connect(domain.label, domain.policy, self._on_sample, self._on_link)
        self._look()

    def renew(self) -> None:
        """Some of what belongs to the members may be gone: create it again where it is."""
        for member in self.members:
            self._create(member)

    def cancel(self) -> None:
        """All members go."""
        self.proxy.cancel()
        self._set(())

    def _on_link(self, linked: bool) -> None:
        if linked:
            self._look()

    def _look(self) -> None:
        newest = _newest(self._network, self.domain)
        if newest is not None:
            self._on_sample(newest)

    def _on_sample(self, sample: Sample) -> None:
        try:
            self._set(members_of(sample.value))
        except SortError as wrong:
            self._network.on_fault(self.domain.label, str(wrong))

    def _set(self, members: Sequence[str]) -> None:
        for gone in [member for member in self.members if member not in members]:
            del self.members[gone]
            self._remove(gone)
        for new in members:
            if new not in self.members:
                self.members[new] = None
                self._create(new)


def _newest(network: "Network | None", domain: Input) -> Sample | None:
    """What a stream of members says now."""
    if network is None or not network.has(domain.label):
        return None
    history = network.snapshot(domain.label)
    return history.get_latest_vtime() if history.get_size() else None
