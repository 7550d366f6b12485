"""Stream proxies: a stream at its client, which stays while its producers come and go (thesis 5.2, 5.4.3)."""

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol, TypeAlias

from dyknow.model.instants import print_duration
from dyknow.model.labels import Label
from dyknow.model.sample import Sample
from dyknow.network.generator import Consumer, Generator, Subscription
from dyknow.policies.of_objects import adapted_to
from dyknow.policies.policy import Policy
from dyknow.policies.sampling import Grid, PolicyAdapter

OnLink: TypeAlias = Callable[[bool], None]


class ProxyNetwork(Protocol):
    """The part of a `Network` that its stream proxies use."""

    now_us: int
    on_fault: Callable[[Label, str], None]

    def wait(self, proxy: "StreamProxy") -> None: ...
    def forget(self, proxy: "StreamProxy") -> None: ...
    def tidy(self, label: Label) -> None: ...
    def watch(self, subscription: Subscription) -> Subscription: ...


class StreamProxy:
    """It knows the label of its producer only: when the generator is removed the client is notified, and when a
    generator carries the label again samples flow again, in the same order and on the same grid.

    Attributes:
        policy: the client's constraints.
        backlog: samples of the past, if the stream began there; the client takes them with `take_backlog`.
        stretched: how many times longer its sample period is than it was declared (10.7).
        current: whenever it is linked it begins with the newest sample that it would have had already.
    """

    __slots__ = (
        "_adapter", "_consumer", "_last_us", "_network", "_on_link", "_subscription", "_wanted", "backlog", "current",
        "label", "policy", "stretched",
    )  # fmt: skip

    def __init__(
        self,
        network: ProxyNetwork,
        label: Label,
        policy: Policy,
        consumer: Consumer,
        on_link: OnLink | None = None,
        *,
        current: bool = False,
    ) -> None:
        self.label, self.policy = label, policy
        self.backlog: list[Sample] = []
        self.stretched, self.current = 1, current
        self._network, self._consumer, self._on_link = network, consumer, on_link
        self._adapter = PolicyAdapter(policy)
        self._adapter.on_starved = self._starved
        self._subscription: Subscription | None = None
        self._wanted: Grid | None = None
        self._last_us: int | None = None

    @property
    def linked(self) -> bool:
        """Whether there is a generator."""
        return self._subscription is not None

    @property
    def adapter(self) -> PolicyAdapter:
        """The adapter at work: the policy in force, what was dropped and why."""
        return self._adapter

    def link(self, generator: Generator, from_us: int | None = None, after_us: int | None = None) -> None:
        """A generator carries the label; with `from_us` the stream begins with its held samples from there on, with
        `after_us` without those available then.

        Raises:
            ValueNotAvailable: it does not reach back so far.
        """
        newest: list[Sample] = []
        self._adapter = adapted_to(self._adapter, generator.sort)
        if from_us is not None:
            past = [s for s in generator.past(from_us) if after_us is None or s.available_us > after_us]
            self.backlog += self._adapter.replay(past, from_us if after_us is None else after_us, self._network.now_us)
        elif self.current:
            held = generator.held()
            newest = self._adapter.replay(held, held[0].available_us, self._network.now_us)[-1:] if held else []
        if self._last_us is not None:
            generator.last_us = max(generator.last_us, self._last_us)
        self._subscription = generator.subscribe(self._adapter, self._consumer, lambda: self._lost(generator))
        self._adapter = self._subscription.adapter
        self._network.watch(self._subscription)
        if self._on_link is not None:
            self._on_link(True)
        for sample in newest:
            self._consumer(sample)

    def take_backlog(self) -> list[Sample]:
        """The samples of the past, once."""
        backlog, self.backlog = self.backlog, []
        return backlog

    def want(self, grid: Grid | None) -> None:
        """Only what lies on `grid`, which has an anchor, is of use to the client; None: everything."""
        if grid != self._wanted:
            self._wanted = grid
            self._continue(self._adapter.policy)

    def stretch(self, factor: int) -> None:
        """Let every sample period be `factor` times as long as it would be; 1 takes that back."""
        if factor != self.stretched:
            self.stretched = factor
            self._retune()

    def change(self, policy: Policy) -> None:
        """The client wants another policy from now on."""
        self.policy = policy
        self._retune()

    def cancel(self) -> None:
        """No more samples. Cancelling twice is cancelling once."""
        self._network.forget(self)
        self._consumer, self._on_link = _ignore, None
        if self._subscription is not None:
            self._subscription.cancel()
            self._subscription = None
            self._network.tidy(self.label)

    def _retune(self) -> None:
        policy = self.policy
        if self.stretched > 1 and policy.sample_us is not None:
            policy = replace(policy, sample_us=policy.sample_us * self.stretched)
        if policy != self._adapter.policy:
            self._continue(policy)

    def _continue(self, policy: Policy) -> None:
        """The rest of the stream, under a policy, by an adapter of its own: the one until now may serve others."""
        self._adapter = self._adapter.continued(policy)
        self._adapter.on_starved = self._starved
        self._adapter.confine(self._wanted)
        if self._subscription is not None:
            self._subscription.retune(self._adapter)
            self._network.watch(self._subscription)

    def _starved(self) -> None:
        """Report a stream that satisfies its policy, but has hardly any samples."""
        period = print_duration(self._adapter.policy.sample_us or 0)
        self._network.on_fault(
            self.label,
            f"`sample every {period}` takes next to nothing of it: its samples lie off the grid; `use linear`, or `use "
            "most recent` with `from 0` and `max delay`, puts values on the grid, or let its maker keep to the grid",
        )

    def _lost(self, generator: Generator) -> None:
        self._last_us = generator.last_us
        self._subscription = None
        self._continue(self._adapter.policy)
        self._network.wait(self)
        if self._on_link is not None:
            self._on_link(False)


def _ignore(_sample: Sample) -> None:
    """The consumer of a cancelled stream."""
