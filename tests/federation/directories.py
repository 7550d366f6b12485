"""Members in the fake world that offer something and do nothing: what their directories say of each other."""

from collections.abc import Iterable, Sequence
from itertools import count

from dyknow.federation import keys
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.members.directory import DirectoryEvent, DirectoryFacilitator
from dyknow.federation.members.member import Member
from dyknow.federation.members.offers import Service, Visibility
from dyknow.federation.messages.acts import Act
from dyknow.federation.messages.descriptions import ConditionEntry, LabelEntry
from dyknow.federation.transport import Ask, Reopen, WireEffect, WireEvent
from dyknow.sim_uavs.world.sessions import SessionLink
from dyknow.sim_uavs.world.units import DriftingClock, WorldNode
from tests.box import Box

FEDERATION = Service("dyknow-federation", "federation", Visibility.PROTECTED)
ALARMS = Service("alarms", "alarms", Visibility.PUBLIC)
POSITION = LabelEntry(label="heli-position", sort="position", type_hash="0a1b2c3d", period_us=100_000)
ALTITUDE = LabelEntry(label="heli-altitude", sort="altitude", type_hash="1a1b2c3d", period_us=100_000)


class Listener:
    """A member that notes what happens in its directory, in order, with the time."""

    def __init__(
        self, unit: str, boot: int, zid: str, now_us: int, services: Sequence[Service], labels: Sequence[LabelEntry]
    ) -> None:
        self.events: list[tuple[int, DirectoryEvent]] = []
        self._effects: list[WireEffect] = []
        self.member = Member(
            unit,
            boot,
            now_us,
            self,
            lambda *_: None,
            self._effects.append,
            kind="uav",
            zid=zid,
            clock=FederationClock(),
        )
        self.member.directory.declare(services, labels, now_us)

    @property
    def deadline_us(self) -> int:
        return self.member.deadline_us

    def start(self, now_us: int) -> list[WireEffect]:
        self.member.start(now_us)
        return self._done()

    def on_event(self, event: WireEvent, now_us: int) -> list[WireEffect]:
        self.member.on_event(event, now_us)
        return self._done()

    def on_time(self, now_us: int) -> list[WireEffect]:
        self.member.on_time(now_us)
        return self._done()

    def _done(self) -> list[WireEffect]:
        effects = self._effects[:]
        self._effects.clear()
        return effects

    def on_peer(self, change: DirectoryEvent, now_us: int) -> None:
        self.events.append((now_us, change))
        self.member.follow(change, now_us)

    def on_clock(self, unit: str, now_us: int) -> None:
        """Nothing follows."""

    def on_request(self, act: Act, now_us: int) -> None:
        raise AssertionError(f"nobody asks: {act}")

    def on_lost(self, opening: Act, now_us: int) -> None:
        raise AssertionError(f"nobody asked: {opening}")


class Directories(Box):
    """A federation of such members; the first of them is in its 1000th life, the next in its 1001st."""

    def __init__(self, seed: int = 0, link: SessionLink | None = None) -> None:
        super().__init__(seed, link=link)
        self._boots = count(1_000)

    def enter(
        self, unit: str, services: Iterable[Service] = (FEDERATION,), labels: Iterable[LabelEntry] = (POSITION,)
    ) -> Listener:
        boot = next(self._boots)

        def make(zid: str, now_us: int) -> Listener:
            return Listener(unit, boot, zid, now_us, tuple(services), tuple(labels))

        self._join(WorldNode(unit, make, None, DriftingClock(self.now_us), FederationClock()))
        return self.listener(unit)

    def declare(
        self,
        unit: str,
        services: Iterable[Service],
        labels: Iterable[LabelEntry],
        conditions: Iterable[ConditionEntry] = (),
    ) -> None:
        self.speak(
            unit,
            lambda member, now_us: member.take(
                member.directory.declare(services, labels, now_us, conditions=conditions), now_us
            ),
        )

    def vanish(self, unit: str) -> None:
        """The process is gone, and none of its connections is reset: the leases run."""
        for direction in self.wire.session(unit).outgoing:
            direction.is_cut = True
        self.kill(unit)

    @property
    def units(self) -> set[str]:
        """Those that run, or stand still."""
        return {unit for unit, node in self.nodes.items() if node.process is not None}

    def listener(self, unit: str) -> Listener:
        process = self.nodes[unit].process
        assert isinstance(process, Listener)
        return process

    def directory(self, unit: str) -> DirectoryFacilitator:
        return self.member(unit).directory

    def token(self, unit: str) -> keys.PlatformToken:
        """The token of a platform, as it declares it."""
        directory = self.directory(unit)
        return keys.PlatformToken(directory.zid, unit, "uav", directory.version)

    def present(self, unit: str) -> set[str]:
        return {entry.unit for entry in self.directory(unit).entries()} - {unit}

    def seen(self, unit: str, *kinds: type) -> list[DirectoryEvent]:
        return [event for _, event in self.listener(unit).events if isinstance(event, kinds)]

    def when(self, unit: str, kind: type, about: str) -> int:
        """When `unit` was last told such an event about `about`."""
        events = self.listener(unit).events
        return max(at_us for at_us, event in events if isinstance(event, kind) and event.unit == about)

    def reopened(self, unit: str) -> list[int]:
        """When a unit opened a new session."""
        return [at_us for at_us, by, effect in self.wire.noted if by == unit and isinstance(effect, Reopen)]

    def asks(self, unit: str) -> int:
        """How often a unit has asked another one what it is."""
        return sum(by == unit and isinstance(e, Ask) and e.key.endswith("/df") for _, by, e in self.wire.noted)


def three() -> Directories:
    """Platforms 0, 1, 2 that have found each other."""
    found = Directories()
    for unit in ("0", "1", "2"):
        found.enter(unit)
    found.run(2)
    return found
