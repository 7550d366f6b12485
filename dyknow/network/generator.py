"""Stream generators: one output of a knowledge process, given to any number of subscribers (thesis 5.3.2)."""

from collections.abc import Callable
from math import gcd
from typing import Protocol, TypeAlias

from dyknow.model.errors import TooEarly
from dyknow.model.labels import Label
from dyknow.model.sample import Sample
from dyknow.model.values import Sort
from dyknow.network.history import History
from dyknow.network.instant import Instant
from dyknow.policies.of_objects import adapted_to
from dyknow.policies.policy import Policy
from dyknow.policies.sampling import Grid, PolicyAdapter

Consumer: TypeAlias = Callable[[Sample], object]
_ALONE = Instant()


class Owner(Protocol):
    """The knowledge process behind a generator, where there is one that works on demand."""

    def on_demand(self) -> None:
        """The subscriptions of the generator, or their policies, have changed."""

    def reach(self, from_us: int | None) -> None:
        """Make the history hold the samples valid from `from_us` on, None: all that can be had.

        Raises:
            TooEarly: so much cannot be had; the message says what can.
        """

    def since_us(self) -> int:
        """The earliest valid time that can be reached; -2**80: all there ever was."""


class Subscription:
    """One stream: the samples of one generator, adapted to one policy, handed to one consumer by a plain call."""

    __slots__ = ("_generator", "adapter", "consumer", "on_end", "unwatch")

    def __init__(
        self,
        generator: "Generator",
        policy: Policy | PolicyAdapter,
        consumer: Consumer,
        on_end: Callable[[], None] | None,
    ) -> None:
        self._generator: Generator | None = generator
        self.adapter = policy if isinstance(policy, PolicyAdapter) else PolicyAdapter(policy)
        self.consumer = consumer
        self.on_end = on_end
        self.unwatch: Callable[[Subscription], None] | None = None

    @property
    def policy(self) -> Policy:
        return self.adapter.policy

    @property
    def active(self) -> bool:
        """Whether samples can still come."""
        return self._generator is not None

    def cancel(self) -> None:
        """No more samples, also not of the one being delivered. Cancelling twice is cancelling once."""
        if self._generator is not None:
            generator, self._generator = self._generator, None
            self.consumer = _ignore
            if self.unwatch is not None:
                self.unwatch(self)
            generator.drop(self)

    def end(self) -> None:
        """The generator is gone: cancel, and tell the consumer."""
        if self._generator is not None:
            self.cancel()
            if self.on_end is not None:
                self.on_end()

    def retune(self, adapter: PolicyAdapter) -> None:
        """Continue under another policy, with what `PolicyAdapter.continued` gave."""
        self.adapter = adapter
        if self._generator is not None:
            self._generator.rearrange()

    def on_time(self, now_us: int) -> None:
        """Hand on the samples that the policy owes at `now_us`."""
        generator = self._generator
        for sample in self.adapter.on_time(now_us):
            try:
                self.consumer(sample)
            except Exception as error:
                if generator is None:
                    raise
                self.fail(generator, error, now_us)

    def fail(self, generator: "Generator", error: Exception, now_us: int) -> None:
        """The consumer raised: where that is contained it is left out for a while, and others get their samples."""
        consumer = self.consumer
        out_us = generator.instant.raised(consumer, generator.label, error)
        if self.consumer is consumer and self.active:
            self.consumer = _Resting(self, consumer, now_us + out_us)

    @property
    def deadline_us(self) -> int | None:
        """Next instant at which `on_time` has work, or None."""
        return None if self._generator is None else self.adapter.deadline_us


class Generator:
    """The stream generator that carries `label`; its stream, unadapted, is its history.

    Attributes:
        owner: the process that is notified of demand; None: samples are pushed with or without demand.
        instant: of its network: all samples of one push belong together.
        last_us: available time of the last sample.
    """

    __slots__ = (
        "_adapted", "_begin_us", "_beginning", "_closed_us", "_open", "history", "instant", "label", "last_us", "owner", "sort", "subscriptions",
    )  # fmt: skip

    def __init__(self, label: Label, sort: Sort, capacity: int) -> None:
        self.label, self.sort = label, sort
        self.history = History(capacity)
        self.owner: Owner | None = None
        self.instant = _ALONE
        self.subscriptions: tuple[Subscription, ...] = ()
        self._open: tuple[Subscription, ...] = ()  # no constraint: every sample passes as it is
        self._adapted: tuple[tuple[PolicyAdapter, tuple[Subscription, ...]], ...] = ()
        self.last_us = self._closed_us = self._begin_us = -(2**80)
        self._beginning: dict[Policy, PolicyAdapter] = {}  # of the streams that begin after `_begin_us`

    def push(self, sample: Sample) -> Sample:
        """Add a sample that has become available and hand it on. A tie of available times is moved by 1 us."""
        now_us = sample.available_us
        if now_us <= self.last_us:
            sample = sample.available_at(self.last_us + 1)
        self.last_us = sample.available_us
        self.history.add(sample)
        instant = self.instant
        is_outermost = instant.joins > 0 and not instant.is_open
        if is_outermost:
            instant.is_open = True
        adapted_to = self._adapted  # who subscribes while consumers are called begins with the next sample
        try:
            for subscription in self._open:
                try:
                    subscription.consumer(sample)
                except Exception as error:  # noqa: BLE001  (contained)
                    subscription.fail(self, error, now_us)
            for adapter, subscriptions in adapted_to:
                try:
                    for adapted in adapter.on_sample(sample, now_us):
                        for subscription in subscriptions:
                            try:
                                subscription.consumer(adapted)
                            except Exception as error:  # noqa: BLE001  (contained)
                                subscription.fail(self, error, now_us)
                except Exception as error:  # noqa: BLE001  (contained)
                    instant.raised(adapter.on_sample, self.label, error)
        finally:
            if is_outermost:
                instant.close()
        return sample

    def remember(self, sample: Sample) -> None:
        """Add a sample of the past: to the history, not to the streams."""
        if sample.available_us <= self._closed_us:
            return
        self.last_us = max(sample.available_us, self.last_us + 1)
        self.history.add(sample.available_at(self.last_us))

    def succeed(self) -> None:
        """Another process takes over: the samples until now stay as they are."""
        self._closed_us = self.last_us

    def reset(self) -> None:
        """Forget the past."""
        self.history.reset()
        self.last_us = self._closed_us = -(2**80)
        self._beginning = {}

    def prepare(self, from_us: int) -> int:
        """Make the history reach back to `from_us` as far as possible; returns since when it is complete."""
        if self.owner is not None:
            self.owner.reach(max(from_us, self.owner.since_us()))
        return max(from_us, self.since_us)

    def past(self, from_us: int) -> list[Sample]:
        """The samples valid from `from_us` on that have come already, in the order in which they came.

        Raises:
            TooEarly: not all of it is held; the message names the earliest time from which it is.
        """
        if self.owner is not None:
            self.owner.reach(from_us)
        starts_us = self.since_us
        if from_us < starts_us:
            if self.owner is not None:
                self.owner.on_demand()
            raise TooEarly(self.label, from_us, starts_us)
        return sorted(self.history.get_between(from_us, 2**80), key=_available_us)

    def held(self) -> list[Sample]:
        """All of the past that can be had now, as it came."""
        if self.owner is not None:
            self.owner.reach(None)
        return self.history.get_slice(0, self.history.get_size() - 1)

    @property
    def since_us(self) -> int:
        """The earliest valid time from which all can be had; -2**80: all there ever was."""
        starts_us = self.history.whole_since_us
        held_us = -(2**80) if starts_us is None else starts_us
        return held_us if self.owner is None else max(held_us, self.owner.since_us())

    def subscribe(
        self, policy: Policy | PolicyAdapter, consumer: Consumer, on_end: Callable[[], None] | None = None
    ) -> Subscription:
        """A stream of samples pushed from now on; `on_end` is called when the generator is removed.

        Subscriptions of one policy that begin with the same sample are one stream: they share its adapter.
        """
        subscription = Subscription(self, policy, consumer, on_end)
        subscription.adapter = adapted_to(subscription.adapter, self.sort)
        if self._begin_us != self.last_us:
            self._beginning, self._begin_us = {}, self.last_us
        if subscription.adapter.is_fresh:
            subscription.adapter = self._beginning.setdefault(subscription.policy, subscription.adapter)
        self.subscriptions = (*self.subscriptions, subscription)
        self.rearrange()
        return subscription

    def drop(self, subscription: Subscription) -> None:
        self.subscriptions = tuple([s for s in self.subscriptions if s is not subscription])
        self.rearrange()

    def rearrange(self) -> None:
        """Subscriptions have come or gone, or one has another policy."""
        streams: dict[PolicyAdapter, list[Subscription]] = {}
        self._open = tuple([s for s in self.subscriptions if s.adapter.is_open])
        for subscription in self.subscriptions:
            streams.setdefault(subscription.adapter, []).append(subscription)
        self._adapted = tuple([(adapter, tuple(each)) for adapter, each in streams.items() if not adapter.is_open])
        if self.owner is not None:
            self.owner.on_demand()

    def end(self) -> None:
        """Remove the generator: all its streams end."""
        self.owner = None
        for subscription in self.subscriptions:
            subscription.end()

    @property
    def wanted(self) -> Grid | None:
        """The coarsest grid with every valid time that a subscriber can take; None: all times.

        Until a subscriber has got its first sample its grid is unknown, unless its policy says so.
        """
        period_us, anchor_us = 0, 0
        for subscription in self.subscriptions:
            grid = subscription.adapter.needed
            if grid is None or grid.anchor_us is None:
                return None
            period_us = gcd(period_us, grid.period_us, grid.anchor_us - anchor_us if period_us else 0)
            anchor_us = grid.anchor_us
        return Grid(period_us, anchor_us % period_us) if period_us else None


def _available_us(sample: Sample) -> int:
    return sample.available_us


def _ignore(_sample: Sample) -> None:
    """The consumer of a cancelled subscription."""


class _Resting:
    """In place of a consumer that raised: takes nothing until it is tried again."""

    __slots__ = ("_consumer", "_subscription", "_until_us")

    def __init__(self, subscription: Subscription, consumer: Consumer, until_us: int) -> None:
        self._subscription, self._consumer, self._until_us = subscription, consumer, until_us

    def __call__(self, sample: Sample) -> None:
        if sample.available_us >= self._until_us:
            self._subscription.consumer = self._consumer
            self._consumer(sample)
