"""The ports of a platform to its parts, and the registry of parts that were built.

A part is built by its class, called with both. A shared object that is no part (a gateway, the pilot) has a class
method `of` with the same two. Each is made when it is first asked for, once.
"""

from collections.abc import Callable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol, TypeAlias, TypeVar

from dyknow import Label, Network, Policy
from dyknow.agents.actions import ROLES, Role
from dyknow.agents.audit_log import AuditLog
from dyknow.agents.config import PlatformConfig
from dyknow.agents.containment import Containment
from dyknow.agents.effects import Effect
from dyknow.agents.interface import InterfaceAgent
from dyknow.agents.part import Part, PeerChange
from dyknow.federation.members.clock import Offset
from dyknow.federation.members.directory import DirectoryFacilitator
from dyknow.federation.members.imports import Imports
from dyknow.federation.members.member import Member, MemberAgents
from dyknow.federation.members.offers import Service
from dyknow.federation.members.offsets import ClockOffsets
from dyknow.federation.messages.descriptions import ConditionEntry, LabelEntry
from dyknow.federation.shares import ActLimits, MemberShare
from dyknow.federation.sharing.exports import Exports
from dyknow.federation.sharing.translation import LabelConversion, Translation
from dyknow.federation.transport import Reopen, WireEffect
from dyknow.kpl import Instance
from dyknow.model.errors import UnitError
from dyknow.navigation.geodesy import LocalFrame
from dyknow.reasoning import AlarmEvent

T = TypeVar("T")
Needs: TypeAlias = Mapping[str, AbstractSet[tuple[str, int, int]]]
"""By unit: semantic label, period and delay of each stream that is needed of it."""


class PartsAbove(Protocol):
    """The services of parts for parts that are built before them."""

    def offer(self, at_us: int) -> None:
        """Tell the directory that labels or conditions of a part have changed, at a time (node clock)."""

    def offered(self) -> Sequence[Service]:
        """The services of all parts, as a description lists them."""

    def handling(self) -> Sequence[Part]:
        """The parts whose actions can be asked for."""

    def instance(self) -> Instance:
        """The specification as it runs."""

    def source(self) -> Callable[[str, str], tuple[Label, LabelConversion]]:
        """(semantic label, unit) -> the local label of that stream, declared if need be, and how its values become semantic."""

    def declared(self) -> Callable[[str, str], Label]:
        """(unit, label as text) -> the stream of the instance that the unit may ask for."""

    def monitored(self) -> Callable[[], Needs]:
        """The streams of others that monitors need."""


def _no_call(semantic: str, _label: Label, _policy: Policy) -> Callable[[], None]:
    raise UnitError(f"this platform calls for no streams, and so not for {semantic}; write the unit that has it")


@dataclass(eq=False)
class Ports:
    """The platform as its parts see it.

    Attributes:
        emit: takes an effect; note: words for users; refuse: counts dropped messages, by reason.
       on_peer, on_alarm: tell all parts of a change of a peer, of an alarm.
        services, labels, conditions: those of all parts.
        now_us: the node clock of the present step.
        contain: the fate of an exception of a part.
        above: the services of parts for others that are built before them.
        origins: further origins of places on the ground, as the home of a vehicle, once it is known.
        moved: called after each estimate of where the vehicle is, with the node clock.
        annotators: add to an alarm of a monitor of this platform before all parts get it.
        call: calls for a stream that its specification declares: semantic label, label here, policy; returns how to end it.
    """

    config: PlatformConfig
    started_us: int
    emit: Callable[[Effect], None]
    note: Callable[[str], None]
    refuse: Callable[[str], None]
    on_peer: Callable[[PeerChange, int], None]
    on_alarm: Callable[[AlarmEvent], None]
    services: Callable[[], Sequence[Service]]
    labels: Callable[[], Sequence[LabelEntry]]
    conditions: Callable[[], Sequence[ConditionEntry]]
    now_us: Callable[[], int]
    contain: Containment
    above: PartsAbove
    origins: list[Callable[[], LocalFrame | None]] = field(default_factory=list)
    moved: list[Callable[[int], None]] = field(default_factory=list)
    annotators: list[Callable[[AlarmEvent], AlarmEvent]] = field(default_factory=list)
    call: Callable[[str, Label, Policy], Callable[[], None]] = _no_call

    def __post_init__(self) -> None:
        config = self.config
        self.unit, self.boot, self.clock = config.unit, config.boot, config.clock
        self.ontology = config.ontology.copy()  # a specification adds to it
        self.network = Network()
        self.network.instant.contain = self.contain.stream_out_us
        above = self.above
        self.offer, self.offered, self.handling = above.offer, above.offered, above.handling
        self.instance, self.source = above.instance, above.source
        self.declared, self.monitored = above.declared, above.monitored

    @cached_property
    def agent(self) -> InterfaceAgent:
        config, audit_log = self.config, AuditLog()

        def emit(effect: WireEffect) -> None:
            if isinstance(effect, Reopen):
                self.note(f"opens a new session: {effect.why}")
            self.emit(effect)

        def member(agents: MemberAgents) -> Member:
            return Member(
                self.unit, self.boot, self.started_us, agents, audit_log.enter, emit,
                kind="uav", zid=config.zid, clock=self.clock, trust=config.trust, tails=self.exports.tails,
            )  # fmt: skip

        return InterfaceAgent(member, audit_log, self.on_peer, self.contain)

    @property
    def member(self) -> Member:
        return self.agent.member

    @property
    def directory(self) -> DirectoryFacilitator:
        return self.member.directory

    @cached_property
    def limits(self) -> ActLimits:
        return ActLimits(rate_per_s=self.config.acts_per_s, burst=self.config.acts_burst)

    def role_of(self, peer: str) -> Role:
        """Without a roster everybody may command; with one, a unit that is no member, or no longer, may nothing."""
        trust = self.config.trust
        if trust is None:
            return Role.COMMAND_CENTRE
        member = trust.roster.member(peer)
        return Role.REVOKED if member is None or member.revoked else ROLES[member.role]

    @property
    def share_of(self) -> Callable[[str], MemberShare]:
        """The member whose quota a unit uses, and how many shares of it that member has."""
        return self.agent.acts.share_of

    @property
    def offsets(self) -> ClockOffsets:
        return self.member.offsets

    @property
    def offset_of(self) -> Callable[[str], Offset | None]:
        return self.offsets.last

    @cached_property
    def translation(self) -> Translation:
        own = self.config.translation
        return Translation(self.ontology) if own is None else own.over(self.ontology)

    @property
    def stopwatch(self) -> Callable[[], int] | None:
        """Federation time within a step; None: time is simulated."""
        return self.config.stopwatch

    @property
    def imports(self) -> Imports:
        return self.member.imports

    @cached_property
    def exports(self) -> Exports:
        return Exports(self.unit, self.boot, self.clock.wall_us)

    def on_moved(self, at_us: int) -> None:
        """An estimate of where the vehicle is was made (node clock)."""
        for each in self.moved:
            self.contain.call(each, at_us, otherwise=None)

    def on_own_alarm(self, event: AlarmEvent) -> None:
        """A monitor of this platform has raised an alarm, or ended it."""
        for annotated in self.annotators:
            event = self.contain.call(annotated, event, otherwise=event)
        self.on_alarm(event)

    def origin(self) -> LocalFrame | None:
        """The origin of places on the ground: that of cameras, or the first of `origins` that is known."""
        return self.camera_frame or next(filter(None, (origin() for origin in self.origins)), None)

    @property
    def camera_frame(self) -> LocalFrame | None:
        return None if self.config.cameras is None else self.config.cameras.frame


class PartRegistry:
    """The parts built so far: `parts[TaskLife]` is the part of that class."""

    def __init__(self) -> None:
        self.ports: Ports
        self._made: dict[object, object] = {}

    def __getitem__(self, make: Callable[[Ports, "PartRegistry"], T]) -> T:
        """The product of `make`, made now if it was not before."""
        found = self._made.get(make)
        if found is None:
            found = self._made[make] = make(self.ports, self)
        return found  # type: ignore[return-value]
