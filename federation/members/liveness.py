"""Presence of platforms: tokens and heartbeats together (neither alone is a failure detector).

A transport's token is withdrawn within milliseconds of a crash, and may stay for ten seconds behind a cut; a heartbeat of our
own, at 5 Hz, at 2 Hz among twenty members or more, is never wrong for longer than 2.5 s. A platform appears with its first heartbeat, is suspected when its
token is withdrawn or after 1 s of silence, and is gone 0.5 s after that or after 2.5 s of silence, unless it returns:
by its token, or by heartbeats that cannot all have been under way when the token was withdrawn.

A later life of a platform has a greater boot number, so stragglers of an earlier one are known; a lesser number counts
as a new life (its clock was set back) only when the one that is known is silent.
"""

from collections import deque
from collections.abc import Callable, Sequence
from enum import Enum, StrEnum
from typing import NamedTuple, TypeAlias

from dyknow.federation.messages.codec import Heartbeat

SUSPECT_US = 1_000_000
GONE_US = 2_500_000
TOKEN_GONE_US = 500_000
BEATS_TO_RETURN = 2
STALL_US = 500_000
BACKLOG_US = 500_000
"""For so long after a halt heartbeats may come that were under way: they are no evidence about the links."""
LINKS_END_US, LINKING_US = 1_300_000, 4_000_000
"""After a halt so long others have ended their links to us; within so long they are made again, if the peer is there."""
PLATFORMS = 1024
NAMES = 64
"""Names of one member of a roster: its own, and those of its commands, `cc-1`."""
REMEMBERED_US = 600_000_000
DUPLICATES = 8


class PeerState(Enum):
    """The state of a platform, as it is known here. ANNOUNCED: not both a heartbeat and of what kind it is."""

    ANNOUNCED = "announced"
    ALIVE = "alive"
    SUSPECT = "suspect"
    GONE = "gone"


class PlatformAppeared(NamedTuple):
    """A platform, or a new incarnation of it, is there."""

    unit: str
    boot: int
    kind: str


class PlatformSuspected(NamedTuple):
    """A platform may be gone; `why` is a phrase."""

    unit: str
    boot: int
    why: str


class PlatformReturned(NamedTuple):
    """A suspected platform is there after all: the same incarnation, nothing of it was taken down."""

    unit: str
    boot: int


class Departure(StrEnum):
    """Why a platform has gone, as it is shown."""

    LEFT = "left"
    RESTARTED = "restarted"
    WITHDRAWN = "token withdrawn"
    REVOKED = "revoked"
    SILENT = "no heartbeat for 2.5 s"


class PlatformGone(NamedTuple):
    """A platform has gone; if it is seen again it appears again."""

    unit: str
    boot: int
    why: Departure


class NameConflict(NamedTuple):
    """Another platform has our own unit name."""

    unit: str
    boot: int


LivenessEvent: TypeAlias = PlatformAppeared | PlatformSuspected | PlatformReturned | PlatformGone | NameConflict
_ALIVE, _GONE = PeerState.ALIVE, PeerState.GONE  # a look-up in the class costs more than the comparison
_NOTHING: Sequence[LivenessEvent] = ()


class Peer:
    """This platform's knowledge of the life of another.

    `described` is the version of its description that is had; `untold_us`: since when it has no token, if it had one.
    """

    __slots__ = (
        "beats",
        "boot",
        "described",
        "heard_us",
        "hears",
        "kind",
        "left",
        "seq",
        "since_us",
        "state",
        "token_gone_us",
        "tokens",
        "unit",
        "untold_us",
        "version",
    )

    def __init__(self, unit: str, now_us: int) -> None:
        self.unit = unit
        self.state = PeerState.ANNOUNCED
        self.boot, self.seq, self.version, self.kind = 0, -1, 0, ""
        self.described = 0
        self.heard_us, self.since_us = 0, now_us
        self.hears: Sequence[str] = ()
        self.tokens: dict[str, int] = {}
        self.token_gone_us: int | None = None
        self.untold_us: int | None = None
        self.beats = 0
        self.left = False

    @property
    def present(self) -> bool:
        return self.state is PeerState.ALIVE or self.state is PeerState.SUSPECT

    @property
    def due_us(self) -> int:
        """When silence changes the state, if nothing comes before."""
        due_us = self.heard_us + (SUSPECT_US if self.state is PeerState.ALIVE else GONE_US)
        return due_us if self.token_gone_us is None else min(due_us, self.token_gone_us + TOKEN_GONE_US)


class Liveness:
    """The lives of all other platforms. Times are the node clock, as stamped where things arrived.

    `member_of` says which member of the roster a unit speaks for; None: it is none, and nothing is kept of it. Without a
    roster every name counts by itself.
    """

    def __init__(self, unit: str, boot: int, member_of: Callable[[str], str | None] = str) -> None:
        self.unit, self.boot, self._member_of = unit, boot, member_of
        self.peers: dict[str, Peer] = {}
        self.refused = 0
        self._check_us: int | None = None
        self._linking_until_us = 0
        self._duplicates: deque[int] = deque(maxlen=DUPLICATES)

    @property
    def deadline_us(self) -> int | None:
        return self._check_us

    def heard(self, now_us: int) -> list[str]:
        """The units that this platform hears, for its heartbeat; without units that are back without their token."""
        since_us = now_us - SUSPECT_US
        return [
            peer.unit
            for peer in self.peers.values()
            if peer.heard_us > since_us
            and peer.state is not _GONE
            and (peer.untold_us is None or peer.state is not _ALIVE)
        ]

    def on_heartbeat(
        self, unit: str, boot: int, seq: int, version: int, hears: Sequence[str], at_us: int
    ) -> Sequence[LivenessEvent]:
        """One heartbeat; a late or repeated one is ignored."""
        peer = self.peers.get(unit)
        if peer is None or peer.boot != boot:
            return self._first_beat(unit, boot, seq, version, hears, at_us)
        if seq <= peer.seq:
            return _NOTHING
        peer.seq, peer.version, peer.hears = seq, version, hears
        peer.heard_us = max(peer.heard_us, at_us)
        if peer.state is PeerState.ALIVE:
            return _NOTHING
        return self._beat_of_doubted(peer, at_us)

    def goes_on(self, beat: Heartbeat, at_us: int) -> bool:
        """Take the next heartbeat of a platform that is present, not suspected, and described; False, and not taken, if it
        is another.
        """
        unit, boot, seq, _, description, hears, _ = beat
        peer = self.peers.get(unit)
        if (
            peer is None
            or peer.state is not _ALIVE
            or peer.boot != boot
            or seq <= peer.seq
            or peer.described != description
            or not description
        ):
            return False
        peer.seq, peer.version, peer.hears = seq, description, hears
        peer.heard_us = max(peer.heard_us, at_us)
        return True

    def on_token(self, unit: str, zid: str, kind: str, alive: bool, at_us: int) -> Sequence[LivenessEvent]:
        """A platform token of a session of `unit` came or went."""
        peer = self.peers.get(unit)
        if unit == self.unit:
            return _NOTHING
        if not alive:
            if peer is None or peer.tokens.pop(zid, None) is None or peer.tokens:
                return _NOTHING
            return self._token_withdrawn(peer, at_us)
        if peer is None:
            peer = self._meet(unit, at_us)
        if peer is None or self._member_of(unit) is None:
            return _NOTHING
        peer.tokens[zid], peer.token_gone_us, peer.untold_us = at_us, None, None
        if peer.state is PeerState.SUSPECT and at_us < peer.heard_us + SUSPECT_US:
            return self._return(peer, at_us)
        return self.on_kind(unit, kind, at_us)

    def on_kind(self, unit: str, kind: str, at_us: int) -> Sequence[LivenessEvent]:
        """What kind of platform `unit` is; it does not appear before that is known."""
        peer = self.peers.get(unit)
        if peer is None:
            return _NOTHING
        peer.kind = kind
        if peer.state is PeerState.ANNOUNCED and peer.seq >= 0 and at_us < peer.heard_us + SUSPECT_US:
            return [self._appear(peer, at_us)]
        return _NOTHING

    def on_leaving(self, unit: str, boot: int, seq: int, at_us: int) -> Sequence[LivenessEvent]:
        """The platform says good-bye in its last heartbeat."""
        peer = self.peers.get(unit)
        if peer is None or peer.boot != boot or seq <= peer.seq or not peer.present:
            return _NOTHING
        peer.seq, peer.left = seq, True
        return [self._gone(peer, Departure.LEFT, at_us)]

    def on_revoked(self, unit: str, at_us: int) -> Sequence[LivenessEvent]:
        """The platform is no longer a member, or is another one by that name."""
        peer = self.peers.get(unit)
        if peer is None:
            return _NOTHING
        peer.tokens.clear()
        was_present, peer.left = peer.present, True
        return [self._gone(peer, Departure.REVOKED, at_us)] if was_present else _NOTHING

    def on_reopened(self) -> None:
        """Our session is a new one: tokens will be announced again, and their absence until then means nothing."""
        for peer in self.peers.values():
            peer.tokens.clear()
            peer.token_gone_us = peer.untold_us = None

    def on_time(self, now_us: int) -> list[LivenessEvent]:
        """Suspect peers that are silent, and declare them gone.

        A process that was suspended first takes in the messages of the meantime. While links are being made no peer is
        declared gone.
        """
        if self._check_us is None or now_us < self._check_us:
            return []
        if now_us > self._check_us + STALL_US:
            self._forgive(now_us)
        events: list[LivenessEvent] = []
        next_us: int | None = None
        for peer in list(self.peers.values()):
            if peer.state is _ALIVE and peer.token_gone_us is None:
                due_us = peer.heard_us + SUSPECT_US
            elif peer.present:
                due_us = peer.due_us
            else:
                continue
            if now_us >= due_us:
                events += self._judge(peer, now_us)
                if not peer.present:
                    continue
                due_us = peer.due_us
                if due_us <= now_us:
                    due_us = self._linking_until_us
            next_us = due_us if next_us is None or due_us < next_us else next_us
        self._check_us = next_us
        return events

    def _forgive(self, now_us: int) -> None:
        if self._check_us is not None and now_us > self._check_us + LINKS_END_US:
            self._linking_until_us = now_us + LINKING_US
        for peer in self.peers.values():
            if peer.present:
                peer.heard_us = max(peer.heard_us, now_us - SUSPECT_US // 2)
                if peer.token_gone_us is not None:
                    peer.token_gone_us = max(peer.token_gone_us, now_us - TOKEN_GONE_US // 2)

    def _judge(self, peer: Peer, now_us: int) -> list[LivenessEvent]:
        events: list[LivenessEvent] = []
        until_us = self._linking_until_us
        is_linking = now_us < until_us and peer.heard_us < until_us - LINKING_US + BACKLOG_US
        if peer.token_gone_us is not None and now_us >= peer.token_gone_us + TOKEN_GONE_US and not is_linking:
            return [self._gone(peer, Departure.WITHDRAWN, now_us)]
        silent_us = now_us - peer.heard_us
        if peer.state is PeerState.ALIVE and silent_us >= SUSPECT_US:
            peer.state, peer.since_us, peer.beats = PeerState.SUSPECT, now_us, 0
            events.append(PlatformSuspected(peer.unit, peer.boot, "no heartbeat for 1 s"))
        if silent_us >= GONE_US and not is_linking:
            events.append(self._gone(peer, Departure.SILENT, now_us))
        return events

    def _meet(self, unit: str, now_us: int) -> Peer | None:
        member = self._member_of(unit)
        if member is None or not self._has_name(unit, member) or not self._has_room(now_us):
            self.refused += 1
            return None
        peer = self.peers[unit] = Peer(unit, now_us)
        return peer

    def _has_name(self, unit: str, member: str) -> bool:
        """Whether a member may have one name more: of its absent names the one seen first gives way."""
        if unit == member:
            return True
        names = [peer for peer in self.peers.values() if peer.unit != member and self._member_of(peer.unit) == member]
        if len(names) < NAMES:
            return True
        absent = [peer for peer in names if not peer.present]
        if absent:
            del self.peers[min(absent, key=lambda peer: peer.since_us).unit]
        return bool(absent)

    def _has_room(self, now_us: int) -> bool:
        return len(self.peers) < PLATFORMS or self._make_room(now_us)

    def _make_room(self, now_us: int) -> bool:
        absent = [peer for peer in self.peers.values() if not peer.present]
        for peer in absent:
            if now_us >= peer.since_us + REMEMBERED_US:
                del self.peers[peer.unit]
        if len(self.peers) >= PLATFORMS and absent:
            self.peers.pop(min(absent, key=lambda peer: peer.since_us).unit, None)
        return len(self.peers) < PLATFORMS

    def _first_beat(
        self, unit: str, boot: int, seq: int, version: int, hears: Sequence[str], at_us: int
    ) -> Sequence[LivenessEvent]:
        if unit == self.unit:
            if boot == self.boot or boot in self._duplicates:
                return _NOTHING
            self._duplicates.append(boot)
            return [NameConflict(unit, boot)]
        peer = self.peers.get(unit) or self._meet(unit, at_us)
        if (
            peer is None
            or self._member_of(unit) is None
            or (boot < peer.boot and peer.present and at_us < peer.heard_us + SUSPECT_US)
        ):
            return _NOTHING
        events: list[LivenessEvent] = []
        if peer.present:
            events.append(self._gone(peer, Departure.RESTARTED, at_us))
        if peer.seq >= 0:
            peer.tokens = {zid: since_us for zid, since_us in peer.tokens.items() if since_us > peer.heard_us}
        peer.boot, peer.seq, peer.version, peer.hears, peer.heard_us = boot, seq, version, hears, at_us
        peer.left, peer.untold_us = False, None
        if peer.kind:
            events.append(self._appear(peer, at_us))
        else:
            peer.state = PeerState.ANNOUNCED
        return events

    def _appear(self, peer: Peer, at_us: int) -> PlatformAppeared:
        peer.state, peer.since_us, peer.token_gone_us, peer.left = PeerState.ALIVE, at_us, None, False
        self._wake(peer.due_us)
        return PlatformAppeared(peer.unit, peer.boot, peer.kind)

    def _beat_of_doubted(self, peer: Peer, at_us: int) -> Sequence[LivenessEvent]:
        """A heartbeat of a platform that is suspected or gone. One may have been under way when the token was withdrawn."""
        if self._member_of(peer.unit) is None:
            return _NOTHING
        if peer.state is PeerState.ANNOUNCED:
            return self.on_kind(peer.unit, peer.kind, at_us) if peer.kind else _NOTHING
        peer.beats += 1
        if peer.token_gone_us is not None and peer.beats < BEATS_TO_RETURN:
            return _NOTHING
        if peer.state is PeerState.GONE:
            return [self._appear(peer, at_us)]
        return self._return(peer, at_us)

    def _return(self, peer: Peer, at_us: int) -> Sequence[LivenessEvent]:
        peer.state, peer.since_us, peer.token_gone_us = PeerState.ALIVE, at_us, None
        self._wake(peer.due_us)
        return [PlatformReturned(peer.unit, peer.boot)]

    def _token_withdrawn(self, peer: Peer, at_us: int) -> Sequence[LivenessEvent]:
        peer.untold_us = at_us
        if not peer.present:
            return _NOTHING
        peer.token_gone_us, peer.beats = at_us, 0
        self._wake(peer.due_us)
        if peer.state is PeerState.SUSPECT:
            return _NOTHING
        peer.state, peer.since_us = PeerState.SUSPECT, at_us
        return [PlatformSuspected(peer.unit, peer.boot, "token withdrawn")]

    def _gone(self, peer: Peer, why: Departure, now_us: int) -> PlatformGone:
        peer.state, peer.since_us, peer.beats, peer.hears = PeerState.GONE, now_us, 0, ()
        return PlatformGone(peer.unit, peer.boot, why)

    def _wake(self, due_us: int) -> None:
        if self._check_us is None or due_us < self._check_us:
            self._check_us = due_us
