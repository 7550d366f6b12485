"""Parts that raise when they are told to: each callback of each part of one platform has a fuse."""

from collections import Counter
from collections.abc import Callable
from functools import partial, wraps
from typing import Any

import pytest

from dyknow.agents.containment import place_of
from dyknow.agents.extensions import own_parts
from dyknow.agents.interface import InterfaceAgent
from dyknow.agents.part import Part
from dyknow.agents.platform import Platform
from dyknow.network.generator import Generator

CALLED = ("labels", "conditions", "on_time", "flush", "on_peer", "on_alarm", "on_cancel", "on_lost")
READ = ("deadline_us", "is_owing")
ERRORS = (RuntimeError, KeyError, ZeroDivisionError, RecursionError, MemoryError, OverflowError, AssertionError)


def callbacks(kind: type[Part]) -> list[str]:
    """The names of what a platform calls of a part of that class."""
    own = [name for name in (*CALLED, *READ) if getattr(kind, name) is not getattr(Part, name)]
    handlers = [action.handler for offer in kind.offers for action in offer.actions]
    return list(dict.fromkeys([*own, *handlers, *kind.takes.values(), *kind.arrivals.values()]))


CASES = [(kind.__name__, name) for kind in own_parts() for name in callbacks(kind)]
"""Every callback of every part there is."""


class Fuses:
    """What of `platform` raises, by class and method; consumers and takers of answers by their place.

    Attributes:
        fired: how often each has raised.
    """

    def __init__(self, patch: pytest.MonkeyPatch, kinds: tuple[type[Part], ...] = own_parts()) -> None:
        self.armed: set[tuple[str, str]] = set()
        self.fired: Counter[tuple[str, str]] = Counter()
        self.seen: set[tuple[str, str]] = set()
        self.platforms: list[Platform] = []
        self._errors = 0
        for kind in kinds:
            for name in callbacks(kind):
                patch.setattr(kind, name, self._fused(kind, name))
        subscribe, delegate = Generator.subscribe, InterfaceAgent.delegate

        def subscribed(generator: Generator, policy: Any, consumer: Any, on_end: Any = None) -> Any:
            return subscribe(
                generator, policy, self._wrapped("consumer", consumer, lambda: self._is_of(generator)), on_end
            )

        def delegated(
            agent: InterfaceAgent, *args: Any, on_reply: Any = None, on_silence: Any = None, **more: Any
        ) -> Any:
            is_ours = lambda: any(each.ports.agent is agent for each in self.platforms)  # noqa: E731
            takers = [each and self._wrapped("answer", each, is_ours) for each in (on_reply, on_silence)]
            return delegate(agent, *args, on_reply=takers[0], on_silence=takers[1], **more)

        patch.setattr(Generator, "subscribe", subscribed)
        patch.setattr(InterfaceAgent, "delegate", delegated)

    def _is_of(self, generator: Generator) -> bool:
        return any(each.ports.network.instant is generator.instant for each in self.platforms)

    def blow(self, case: tuple[str, str]) -> None:
        """Raise, if that is armed."""
        if case in self.armed:
            self.fired[case] += 1
            self._errors += 1
            raise ERRORS[self._errors % len(ERRORS)](f"made to fail in {'.'.join(case)}")

    def _fused(self, kind: type[Part], name: str) -> Any:
        original, case = getattr(kind, name), (kind.__name__, name)

        def check(part: Part) -> None:
            if case in self.armed and any(part in platform.parts for platform in self.platforms):
                self.blow(case)

        if isinstance(original, property):

            def read(part: Part) -> Any:
                check(part)
                return original.fget(part)  # type: ignore[misc]

            return property(read)

        @wraps(original)
        def called(part: Part, *args: Any, **more: Any) -> Any:
            check(part)
            return original(part, *args, **more)

        return called

    def _wrapped(self, sort: str, do: Callable[..., Any], is_ours: Callable[[], bool]) -> Callable[..., Any]:
        case = (sort, place_of(do))
        if is_ours():
            self.seen.add(case)

        def called(*args: Any) -> Any:
            if case in self.armed and is_ours():
                self.blow(case)
            return do(*args)

        inner: Any = do
        while isinstance(inner, partial):
            inner = inner.func
        called.__qualname__ = called.__name__ = case[1]
        return called
