"""Shares in limits, counted by the member of the roster behind a name, since a member may have several names."""

from dataclasses import dataclass
from typing import Final, NamedTuple

ACTS_PER_S = 20.0
ACTS_BURST = 40.0
COMMANDING: Final = 16
"""Shares of a command centre: several of its commands run at once, and its texts are long."""


class MemberShare(NamedTuple):
    """The member whose quota is used, and how many shares of it that member has."""

    owner: str
    shares: int


def own_share(unit: str) -> MemberShare:
    """Without a roster each name counts by itself."""
    return MemberShare(unit, 1)


@dataclass(slots=True)
class TokenBucket:
    """`rate_per_s` tokens a second, at most `burst` at once. Times are the node clock."""

    rate_per_s: float = ACTS_PER_S
    burst: float = ACTS_BURST
    _tokens: float = ACTS_BURST
    _at_us: int | None = None

    def take(self, now_us: int, cost: float = 1.0) -> bool:
        """Take `cost` tokens if there is one; missing ones are owed."""
        if self._at_us is not None:
            gained = max(0, now_us - self._at_us) * self.rate_per_s / 1e6
            self._tokens = min(self.burst, self._tokens + gained)
        self._at_us = now_us
        if self._tokens < 1.0:
            return False
        self._tokens -= cost
        return True


class ActLimits:
    """One bucket per peer; peers that were quiet for long are forgotten, so that names cost no memory."""

    def __init__(self, rate_per_s: float = ACTS_PER_S, burst: float = ACTS_BURST, peers: int = 256) -> None:
        self._buckets: dict[str, TokenBucket] = {}
        self._rate_per_s, self._burst, self._peers = rate_per_s, burst, peers

    def admit(self, peer: str, now_us: int, cost: float = 1.0) -> bool:
        """Whether `peer` may ask one thing more now, that costs so much."""
        bucket = self._buckets.pop(peer, None) or TokenBucket(self._rate_per_s, self._burst, self._burst)
        self._buckets[peer] = bucket
        if len(self._buckets) > self._peers:
            del self._buckets[next(iter(self._buckets))]
        return bucket.take(now_us, cost)
