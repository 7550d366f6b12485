"""Knowledge processes as their network sees them, and the network as they see it (thesis 3.3, 5.4)."""

from collections.abc import Callable
from typing import Final, NamedTuple, Protocol

from dyknow.model.labels import Label
from dyknow.network.generator import Consumer, Generator, Owner
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


class ProcessNetwork(ProxyNetwork, Protocol):
    """The part of a `Network` that its processes use."""

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
