"""One platform of a federation as a value: events in, effects out (thesis, figure 9.2 and 9.3).

It dispatches events, time, changes of peers and alarms to its parts, and knows none of them. Nothing here reads a
clock or a socket: `on_event` and `on_time` are given the node clock and return what is to be done. Federation time,
which streams and monitors live in, follows from the node clock by the federation's clock.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, TypeVar

from dyknow.agents.actions import Role
from dyknow.agents.config import PlatformConfig
from dyknow.agents.containment import Containment, place_of, sender_of
from dyknow.agents.deadlines import PartDeadlines
from dyknow.agents.effects import Effect, Event, Note
from dyknow.agents.part import NOT_MINE, Followed, Handler, Part, PeerChange, overrides
from dyknow.agents.parts import PlatformParts
from dyknow.agents.ports import Ports
from dyknow.federation import keys
from dyknow.federation.members.member import Member
from dyknow.federation.members.offers import Service
from dyknow.federation.messages.descriptions import MAX_CONDITIONS, ConditionEntry, LabelEntry
from dyknow.federation.transport import AnswerEnd, Arrived, Asked, Conflated, HandlerFailed
from dyknow.model.errors import DecodeError
from dyknow.reasoning import AlarmEvent

T = TypeVar("T", bound=Part)
E = TypeVar("E")


class Platform:
    """The agents, the proxies and the local instance of one platform.

    Effects are returned by the step that caused them, but for samples of exported streams: those of one batch of
    events are put together by the `on_time` that `deadline_us` asks for at once.

    Attributes:
        ports, built: the ports of the parts, and the parts by class, for observers from outside.
        deadlines: when its parts have work next.
        refused: number of messages dropped before they reached a part, by reason.
        containment: contains and counts the errors of parts.
    """

    def __init__(self, config: PlatformConfig, now_us: int) -> None:
        self.config, self.unit, self.clock = config, config.unit, config.clock
        self.refused: Counter[str] = Counter()
        self._out: list[Effect] = []
        self._now_us = now_us
        self._event: Event | None = None
        self.containment = Containment(
            self._note, lambda: self._now_us, self._cause, self._may_silence, is_on=config.contained
        )
        self.built = PlatformParts(config)
        self.ports = Ports(
            config,
            now_us,
            emit=self._out.append,
            note=self._note,
            refuse=self._refuse,
            on_peer=self._on_peer,
            on_alarm=self._on_alarm,
            services=self._services,
            labels=self._labels,
            conditions=self._conditions,
            now_us=lambda: self._now_us,
            contain=self.containment,
            above=self.built,
        )
        self._network = self.ports.network
        self.parts = self.built.build(self.ports)
        self.containment.owner_of = lambda unit: self.ports.share_of(unit).owner
        self._with_peers, self._with_alarms = self._having("on_peer"), self._having("on_alarm")
        self._flushed, self._owing = self._having("flush"), self._having("is_owing")
        self._finishing = tuple(dict.fromkeys((*self._flushed, *self._owing)))
        self._keeping_acts = tuple(part for part in self.parts if part.keeps_acts)
        self._heeding = tuple(part for part in self.parts if part.heeds_samples)
        self.deadlines = PartDeadlines(self._having("deadline_us"), self.containment)
        self._unstarted: list[Part] = []
        self._arrivals: dict[str, Handler] = {
            chunk: getattr(part, method) for part in self.parts for chunk, method in part.arrivals.items()
        }
        self._handlers = self._by_event()

    def _having(self, name: str) -> tuple[Part, ...]:
        """The parts that do something there; the others are never called."""
        return tuple(part for part in self.parts if overrides(part, name))

    def _by_event(self) -> dict[type, Handler]:
        handlers: dict[type, list[Handler]] = {}
        for part in self.parts:
            for kind, method in part.takes.items():
                handlers.setdefault(kind, []).append(getattr(part, method))
        own: dict[type, Handler] = {
            Asked: self._on_asked,
            Conflated: self._on_conflated,
            HandlerFailed: self._on_failed,
        }
        return {
            kind: each[0] if len(each) == 1 else partial(self._first, each) for kind, each in handlers.items()
        } | own

    @property
    def member(self) -> Member:
        """How it takes part in the federation."""
        return self.ports.member

    def part(self, kind: type[T]) -> T:
        """The part of that class.

        Raises:
            LookupError: this platform has none.
        """
        for part in self.parts:
            if isinstance(part, kind):
                return part
        raise LookupError(f"platform {self.unit} has no {kind.__name__}")

    # -- steps -------------------------------------------------------------------------------------------------

    def start(self, now_us: int) -> list[Effect]:
        """Come into the federation."""
        self._now_us = now_us
        self._start(self.parts)
        return self.settle()

    def _start(self, parts: Sequence[Part]) -> None:
        """Start parts; a part that raises is started again when its pause ends."""
        step, is_stepped, now_us = self.containment.step, self.containment.is_stepped, self._now_us
        self._unstarted = [part for part in parts if not is_stepped(part) or not step(part, part.start, now_us)]

    def on_event(self, event: Event, now_us: int) -> list[Effect]:
        """Take one event; `now_us` is the node clock."""
        self._now_us, self._event = now_us, event
        self._network.now_us = self.clock.federation_us(now_us)
        take: Handler = _nothing
        try:
            if isinstance(event, Arrived):
                take = self._arrivals.get(event.key.partition("/")[0], _no_key)
            else:
                take = self._handlers.get(type(event), _nothing)
            followed = take(event, now_us)
            if followed:
                self._hasten(followed)
        except DecodeError as wrong:
            self.refused[wrong.reason] += 1
            self._end_question(event)
            return self._effects()
        except Exception as wrong:  # noqa: BLE001  (contained)
            self.containment.caught(place_of(take), wrong)
            followed = None
        if followed is None or self.containment.is_news:
            return self.settle()
        if self._out:
            self.deadlines.hasten(self._keeping_acts)
        if not followed:
            return self._effects() if self._out else []
        return self._finish() if self.is_owing else []

    def on_time(self, now_us: int) -> list[Effect]:
        """Let time pass: the parts that are due are stepped. Call at `deadline_us`; more often is harmless."""
        self._now_us, self._event = now_us, None
        self._network.now_us = self.clock.federation_us(now_us)
        if self._unstarted:
            self._start(self._unstarted)
        for part in self.deadlines.due(now_us):
            if self.containment.is_stepped(part):
                sent = len(self._out)
                self._hasten(self.containment.timed(part, now_us))
                if len(self._out) > sent:
                    self.deadlines.hasten(self._keeping_acts)
        if self.containment.on_time(now_us):
            self.containment.call(self.ports.offer, now_us, otherwise=None)
            self.deadlines.forget()
        return self._finish()

    def _hasten(self, followed: Followed) -> None:
        self.deadlines.hasten(followed)
        if followed:
            self.deadlines.hasten(self._heeding)

    @property
    def deadline_us(self) -> int:
        """When `on_time` has work next (node clock), or a little earlier."""
        due_us, told_us = self.deadlines.earliest_us(self._now_us), self.containment.deadline_us
        return due_us if told_us is None or told_us >= due_us else max(told_us, self._now_us)

    @property
    def is_owing(self) -> bool:
        """Whether there are effects to return, or samples to put."""
        try:
            for part in self._owing:
                if part.is_owing:
                    return True
        except Exception as wrong:  # noqa: BLE001  (contained)
            self.containment.caught(f"{type(part).__name__}.is_owing", wrong)
            return True
        return bool(self._out)

    def settle(self) -> list[Effect]:
        """End a step that may have changed anything, also one that was taken by hand; returns its effects."""
        self.deadlines.forget()
        return self._finish()

    def _finish(self) -> list[Effect]:
        for part in self._flushed:
            if self.containment.is_stepped(part):
                self.containment.step(part, part.flush)
        self.deadlines.hasten(None if self.containment.is_news else self._finishing)
        self.containment.is_news = False
        return self._effects()

    def _effects(self) -> list[Effect]:
        effects = self._out[:]
        self._out.clear()
        return effects

    # -- what parts bring about --------------------------------------------------------------------------------

    def _on_peer(self, change: PeerChange, now_us: int) -> None:
        """Tell each part, whatever the others do."""
        self.deadlines.forget()
        for part in self._with_peers:
            self.containment.call(part.on_peer, change, now_us, otherwise=None)

    def _on_alarm(self, event: AlarmEvent) -> None:
        self.deadlines.forget()
        for part in self._with_alarms:
            self.containment.call(part.on_alarm, event, self._now_us, otherwise=None)

    def _cause(self) -> str:
        """The unit that sent the present event; empty: none did, or it is not known."""
        key = getattr(self._event, "key", None)
        return sender_of(keys.parse_key(key)) if isinstance(key, str) else ""

    def _may_silence(self, unit: str) -> bool:
        return self.config.trust is not None and self.ports.role_of(unit) < Role.COMMAND_CENTRE

    def _services(self) -> Sequence[Service]:
        return tuple({offer.service.service: offer.service for part in self.parts for offer in part.offers}.values())

    def _labels(self) -> Sequence[LabelEntry]:
        """The semantic labels of all parts: of two of one name, that of the later part."""
        return tuple({entry.label: entry for part in self.parts for entry in self._declared_by(part.labels)}.values())

    def _conditions(self) -> Sequence[ConditionEntry]:
        """The conditions for the description, impairments first, as many as it has room for."""
        found = [entry for part in self.parts for entry in self._declared_by(part.conditions)]
        return (*self.containment.conditions(), *found)[:MAX_CONDITIONS]

    def _declared_by(self, say: Callable[[], Iterable[E]]) -> tuple[E, ...]:
        """The labels or conditions of a part, empty if it raises."""
        try:
            return tuple(say())
        except Exception as wrong:  # noqa: BLE001  (contained)
            self.containment.caught(place_of(say), wrong)
            return ()

    def _note(self, text: str) -> None:
        self._out.append(Note(self._now_us, text))

    def _refuse(self, reason: str) -> None:
        self.refused[reason] += 1

    # -- events that no part takes -----------------------------------------------------------------------------

    def _on_asked(self, event: Asked, now_us: int) -> Followed:
        """A question on a queryable of ours goes to the part that takes that kind of key."""
        key: Any = keys.parse_key(event.key)
        handler = self._handlers.get(type(key))
        if handler is None or key[0] != self.unit:
            raise DecodeError("key")
        return self._first((handler,), event, now_us)

    def _end_question(self, event: Event) -> None:
        """A question that could not be taken ends: its requester does not wait."""
        if isinstance(event, Asked):
            self._out.append(AnswerEnd(event.ask))

    def _on_conflated(self, event: Conflated, _now_us: int) -> Followed:
        self.refused["conflated"] += event.lost
        return ()

    def _first(self, handlers: Sequence[Handler], event: Event, now_us: int) -> Followed:
        """Pass an event to the parts in turn until one takes it as its own."""
        for handler in handlers:
            try:
                followed = handler(event, now_us)
            except DecodeError:
                raise
            except Exception as wrong:  # noqa: BLE001  (contained)
                self.containment.caught(place_of(handler), wrong)
                continue
            if followed is not NOT_MINE:
                return followed
        self._end_question(event)
        return ()

    def _on_failed(self, event: HandlerFailed, _now_us: int) -> Followed:
        self._out.append(Note(event.at_us, f"{event.where}: {event.error}"))
        return None


def _no_key(_event: Arrived, _now_us: int) -> Followed:
    raise DecodeError("key")


def _nothing(_event: Event, _now_us: int) -> Followed:
    return None
