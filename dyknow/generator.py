"""Stream generators: one output of a knowledge process, given to any number of subscribers (thesis 5.3.2)."""

from collections.abc import Callable
from typing import TypeAlias

from dyknow.history import History
from dyknow.labels import Label
from dyknow.policy import Policy
from dyknow.sample import SURE, Quality, Sample, Value
from dyknow.sampling import PolicyAdapter
from dyknow.values import Sort

Consumer: TypeAlias = Callable[[Sample], None]
_UNRESTRICTED = Policy()
_new = tuple.__new__  # makes a NamedTuple in half the time; every sample of the instance is made here


class Subscription:
    """One stream: the samples of one generator, adapted to one policy, handed to one consumer by a plain call."""

    __slots__ = ("_generator", "adapter", "consumer", "on_end")

    def __init__(
        self, generator: "Generator", policy: Policy, consumer: Consumer, on_end: Callable[[], None] | None
    ) -> None:
        self._generator: Generator | None = generator
        self.adapter = PolicyAdapter(policy)
        self.consumer = consumer
        self.on_end = on_end

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
            self._generator.drop(self)
            self._generator = None
            self.consumer = _ignore

    def end(self) -> None:
        """The generator is gone: cancel, and tell the consumer."""
        if self._generator is not None:
            self.cancel()
            if self.on_end is not None:
                self.on_end()

    def on_time(self, now_us: int) -> None:
        """Hand on what the policy owes at `now_us`."""
        for sample in self.adapter.on_time(now_us):
            self.consumer(sample)

    @property
    def deadline_us(self) -> int | None:
        """Next instant at which `on_time` has work, or None."""
        return None if self._generator is None else self.adapter.deadline_us


class Generator:
    """The stream generator that carries `label`; its stream, unadapted, is its history."""

    __slots__ = ("_adapted", "_last_us", "_open", "history", "label", "sort", "subscriptions")

    def __init__(self, label: Label, sort: Sort, capacity: int) -> None:
        self.label, self.sort = label, sort
        self.history = History(capacity)
        self.subscriptions: tuple[Subscription, ...] = ()
        self._open: tuple[Subscription, ...] = ()  # no constraint: every sample passes as it is
        self._adapted: tuple[Subscription, ...] = ()
        self._last_us = -(2**80)

    def push(self, valid_us: int, value: Value, now_us: int, quality: Quality = SURE) -> Sample:
        """Add a sample that became available at `now_us` and hand it on. A tie of available times is moved by 1 us."""
        available_us = now_us if now_us > self._last_us else self._last_us + 1
        self._last_us = available_us
        sample = _new(Sample, (available_us, valid_us, value, quality))
        self.history.add(sample)
        for subscription in self._open:
            subscription.consumer(sample)
        for subscription in self._adapted:
            for adapted in subscription.adapter.on_sample(sample, now_us):
                subscription.consumer(adapted)
        return sample

    def subscribe(self, policy: Policy, consumer: Consumer, on_end: Callable[[], None] | None = None) -> Subscription:
        """A stream of what is pushed from now on; `on_end` is called when the generator is removed."""
        subscription = Subscription(self, policy, consumer, on_end)
        self._arrange((*self.subscriptions, subscription))
        return subscription

    def drop(self, subscription: Subscription) -> None:
        self._arrange(tuple(s for s in self.subscriptions if s is not subscription))

    def end(self) -> None:
        """Remove the generator: all its streams end."""
        for subscription in self.subscriptions:
            subscription.end()

    def _arrange(self, subscriptions: tuple[Subscription, ...]) -> None:
        self.subscriptions = subscriptions
        self._open = tuple(s for s in subscriptions if s.policy == _UNRESTRICTED)
        self._adapted = tuple(s for s in subscriptions if s.policy != _UNRESTRICTED)


def _ignore(_sample: Sample) -> None:
    """The consumer of a cancelled subscription."""
