"""Notices that this session is deaf, or that a peer is deaf to it, and says when to open a new one.

A one-way silent link can last for days without Zenoh noticing. Every heartbeat lists whom its sender hears; from
these lists each node sees where a pair should hear each other and does not. One side of a pair acts first, so that
the two do not reopen in step:

* most of those we hear, hear a peer that we have not heard for 4 s. If that is so of most peers, our session is the
  broken one: now. Else the greater unit of the pair goes first, after 5 s, and the lesser after 6 s if that did not help;
* most of those we hear do not hear us, for 4 s; if others do, after 7 s;
* a peer is heard again, but its withdrawn token is not announced again for 2 s: we gave up the link to it and have a
  new one, which it has added to the old, as Zenoh does when both sides dial and only one lease was over. So it
  declares nothing again, and on that link questions, acts and samples go astray for good. A peer whose token is missing
  is not listed as heard: where it is missing at most others as well, the peer acts, and we do not;
* this process was suspended for the length of a lease, so that the others have closed their links to it, and 3 s
  after it resumes most links are not back: the peer does not hear us, we do not hear it, or its token is missing;
* we no longer hear any peer: after 4 s if there are tokens of peers, else after 6 s.

One peer's word against that of the others is no reason: it is shown (`contradicted`). That its token is missing is a
reason of one peer alone: each platform waits as long as its name says, so that not all act at once, and not again over
that peer for ten minutes.

Reopening that does not help is repeated with growing intervals: it disturbs peers that hear each other. While this
process is late itself, on a busy machine, it reopens nothing: a new session would add load, and messages that seem
missing may be waiting in its own queue.
"""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple, TypeVar
from zlib import crc32

from dyknow.federation.members.liveness import PLATFORMS, SUSPECT_US, Peer

Noted = TypeVar("Noted", str, tuple[str, str])

MOST_US = 4_000_000
FIRST_US = 5_000_000
SECOND_US = 6_000_000
BACKUP_US = 7_000_000
ASTRAY_US, ASTRAY_SPREAD_US = 2_000_000, 4_000_000
ASTRAY_AGAIN_US = 600_000_000
SHOWN_US = 10_000_000
"""A single peer's contradiction of the others is shown when it has lasted for so long."""
CONTRADICTED = 8
STOOD_US = 1_300_000
"""So much later than planned is a look after a halt of a lease, 2 s, less the pause between two heartbeats."""
LATE_US = 300_000
CALM_US = 3_000_000
"""A node that was late judges again when it has been on time for so long."""
ALONE_US = 6_000_000
ALONE_FOR_US = 300_000_000
PERIOD_US = 500_000
LOST_US = 60_000_000
"""A peer that was last heard longer ago is not counted as lost."""
QUIET_US = 30_000_000
BETWEEN_US = 6_000_000
BETWEEN_MOST_US = 60_000_000
PATIENT = 3


class Contradicted(NamedTuple):
    """A statement about hearing by `unit` alone, against the others, and since when."""

    unit: str
    text: str
    since_us: int


class DeafnessWatchdog:
    """Steps over the peers twice a second; `on_time` returns why to reopen, or nothing.

    Attributes:
        contradicted: statements of single peers against the others, for 10 s or more.
    """

    def __init__(self, unit: str, now_us: int) -> None:
        self.unit = unit
        self._next_us = now_us + PERIOD_US
        self._late_us = now_us - CALM_US
        self._stood_us = 0
        self._mentioned_us: dict[str, int] = {}
        self._unlisted_us: dict[str, int] = {}
        self._settled: dict[str, Sequence[str]] = {}
        self._astray_us: dict[str, int] = {}
        self._alone_us: dict[tuple[str, str], int] = {}
        self.contradicted: tuple[Contradicted, ...] = ()
        self._opened_us = now_us
        self._reopened = 0
        self._trouble_us = now_us
        self._spread_us = crc32(unit.encode()) % 1_000_000
        self._astray_after_us = ASTRAY_US + crc32(unit.encode()) % ASTRAY_SPREAD_US

    @property
    def deadline_us(self) -> int:
        return self._next_us

    def excuse(self, now_us: int) -> None:
        """This process is known to be late: it judges no peer until it has been on time for a while."""
        self._late_us = now_us

    def on_time(self, peers: Mapping[str, Peer], now_us: int) -> str | None:
        """Why the session should be reopened now, or None."""
        if now_us < self._next_us:
            return None
        late_us, self._next_us = now_us - self._next_us, now_us + PERIOD_US
        if late_us >= LATE_US:
            self._late_us = now_us
            self._stood_us = max(self._stood_us, late_us + PERIOD_US)
        if now_us < self._late_us + CALM_US:
            self._forget()
            return None
        why = self._stood_still(peers, now_us) or self._why(peers, now_us)
        if why is None:
            if now_us >= self._trouble_us + QUIET_US:
                self._reopened = 0
            return None
        self._trouble_us = now_us
        if self._reopened and now_us < self._opened_us + self._between_us:
            return None
        self._reopened += 1
        self._opened_us = now_us
        self._forget()
        return why

    @property
    def _between_us(self) -> int:
        doubled: int = 2 ** min(8, max(0, self._reopened - PATIENT))
        return min(BETWEEN_MOST_US, BETWEEN_US * doubled)

    def _stood_still(self, peers: Mapping[str, Peer], now_us: int) -> str | None:
        """After a halt of the length of a lease, once: whether most links have not come back."""
        stood_us, self._stood_us = self._stood_us, 0
        if stood_us < STOOD_US + PERIOD_US:
            return None
        known = [
            peer for peer in peers.values() if peer.seq >= 0 and not peer.left and peer.heard_us > now_us - LOST_US
        ]
        lost = [peer for peer in known if not self._is_linked(peer, now_us)]
        if not lost or 2 * len(lost) <= len(known):
            return None
        return (
            f"this process stood still for {stood_us / 1e6:.1f} s, and {len(lost)} of {len(known)} links are not back"
        )

    def _is_linked(self, peer: Peer, now_us: int) -> bool:
        return peer.heard_us > now_us - SUSPECT_US and self.unit in peer.hears and peer.untold_us is None

    def _why(self, peers: Mapping[str, Peer], now_us: int) -> str | None:
        heard = {unit for unit, peer in peers.items() if peer.heard_us > now_us - SUSPECT_US and not peer.left}
        if not heard:
            self._forget()
            return self._alone(peers.values(), now_us)
        if self._is_settled(peers, heard):
            return None
        witnesses = Counter[str]()
        for unit in heard:
            witnesses.update(set(peers[unit].hears))
        deaf_us = self._deaf_us(peers, witnesses, heard, now_us)
        hearing_us = {unit for unit in heard if self.unit in peers[unit].hears}
        unlisted_us = self._note(self._unlisted_us, heard - hearing_us, now_us)
        for unit, silent_us in sorted(deaf_us.items()):
            if silent_us >= MOST_US and 2 * len(deaf_us) > len(heard) + len(deaf_us):
                return f"others hear {unit} and {len(deaf_us) - 1} more, this session does not"
            if silent_us >= (FIRST_US if self.unit > unit else SECOND_US):
                return f"others hear {unit}, this session does not"
        if astray := self._astray(peers, heard, now_us):
            return f"{astray} is heard, but knows this session as another"
        longest_us = BACKUP_US if hearing_us else MOST_US
        unheard = sorted(unit for unit, silent_us in unlisted_us.items() if silent_us >= longest_us)
        if 2 * len(unheard) > len(heard):
            more = f" and {len(unheard) - 1} more do" if unheard[1:] else " does"
            return f"{unheard[0]}{more} not hear this session"
        self._contradict(peers, witnesses, heard, unlisted_us, now_us)
        if not unlisted_us and not self._alone_us and self._mentioned_us.keys() <= heard:
            self._settled = {unit: peers[unit].hears for unit in heard}
        return None

    def _astray(self, peers: Mapping[str, Peer], heard: set[str], now_us: int) -> str | None:
        """A peer that is heard while its token has not come back, and over which no session was opened lately."""
        for unit in sorted(heard):
            since_us = _untold_for_us(peers[unit], now_us)
            others = heard - {unit}
            has_it = sum(unit in peers[other].hears for other in others)
            if (
                since_us >= self._astray_after_us
                and (2 * has_it > len(others) or not others)
                and now_us >= self._astray_us.get(unit, -ASTRAY_AGAIN_US) + ASTRAY_AGAIN_US
            ):
                self._astray_us.pop(unit, None)
                self._astray_us[unit] = now_us
                if len(self._astray_us) > PLATFORMS:
                    del self._astray_us[next(iter(self._astray_us))]
                return unit
        return None

    def _contradict(
        self,
        peers: Mapping[str, Peer],
        witnesses: Counter[str],
        heard: set[str],
        unlisted_us: Mapping[str, int],
        now_us: int,
    ) -> None:
        """Note which one among three or more says that it does not hear us, or that it hears a platform."""
        alone: dict[tuple[str, str], str] = {}
        deaf = {unit for unit, for_us in unlisted_us.items() if for_us >= MOST_US}  # newcomers hear us soon
        if len(deaf) == 1 and len(heard) > 1:
            (unit,) = deaf
            alone[unit, "deaf"] = f"{unit} says that it does not hear this platform, which others hear"
        if len(heard) > 1:
            once = {unit for unit, times in witnesses.items() if times == 1} - heard - {self.unit}
            for unit in sorted(heard) if once else ():
                if claimed := sorted(once.intersection(peers[unit].hears)):
                    more = f" and {len(claimed) - 1} more" if claimed[1:] else ""
                    alone[unit, "hears"] = f"{unit} alone says that it hears {claimed[0]}{more}"
        since_us = self._note(self._alone_us, set(alone), now_us)
        shown = [name for name in sorted(alone) if since_us[name] >= SHOWN_US][:CONTRADICTED]
        self.contradicted = tuple(Contradicted(name[0], alone[name], now_us - since_us[name]) for name in shown)

    def _is_settled(self, peers: Mapping[str, Peer], heard: set[str]) -> bool:
        """Whether all list, word for word, the peers of the last time when all heard all, and have their tokens."""
        settled = self._settled
        return settled.keys() == heard and all(
            peers[unit].hears is hears and peers[unit].untold_us is None for unit, hears in settled.items()
        )

    def _forget(self) -> None:
        self._mentioned_us.clear()
        self._unlisted_us.clear()
        self._settled.clear()
        self._alone_us.clear()
        self.contradicted = ()

    def _deaf_us(
        self, peers: Mapping[str, Peer], witnesses: Counter[str], heard: set[str], now_us: int
    ) -> dict[str, int]:
        """For each unit that most of those we hear, hear, and we do not: for how long. A name that one says is no unit."""
        mentioned = {
            unit for unit, times in witnesses.items() if 2 * times > len(heard) and (times > 1 or unit in peers)
        }
        mentioned.discard(self.unit)
        for_us = self._note(self._mentioned_us, mentioned, now_us)
        found: dict[str, int] = {}
        for unit in mentioned - heard:
            peer = peers.get(unit)
            if peer is not None and peer.left:
                continue
            silent_us = now_us - (peer.heard_us if peer is not None else 0)
            found[unit] = min(for_us[unit], silent_us, now_us - self._opened_us)
        return found

    def _note(self, since_us: dict[Noted, int], current: set[Noted], now_us: int) -> dict[Noted, int]:
        """Keep since when each of `current` has been among them; returns for how long."""
        for unit in since_us.keys() - current:
            del since_us[unit]
        return {unit: now_us - since_us.setdefault(unit, now_us) for unit in current}

    def _alone(self, peers: Collection[Peer], now_us: int) -> str | None:
        """No peer is heard; that is a reason if one was, lately, and did not say good-bye."""
        last_us = max((peer.heard_us for peer in peers if peer.seq >= 0 and not peer.left), default=None)
        if last_us is None or now_us > last_us + ALONE_FOR_US:
            return None
        silent_us = now_us - max(last_us, self._opened_us)
        patience_us = MOST_US if any(peer.tokens for peer in peers) else ALONE_US + self._spread_us
        return "no peer is heard" if silent_us >= patience_us else None


def _untold_for_us(peer: Peer, now_us: int) -> int:
    """How long a peer has been back, and heard, while its token is not."""
    return 0 if peer.untold_us is None else now_us - max(peer.untold_us, peer.since_us)
