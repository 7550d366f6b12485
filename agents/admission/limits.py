"""How much one peer may ask of a platform: a token bucket per peer, and quotas."""

from dataclasses import dataclass
from typing import Any

from federation.messages.sexpr import Expr

ACTS_PER_S = 20.0
ACTS_BURST = 40.0
STREAMS_PER_PEER = 64
TEXT_PER_S, TEXT_BURST = 4096.0, 65_536.0
"""Characters of long texts that a peer may send: formulas take 8 us each to read."""
SHORT_TEXT = 200
"""Characters of a text that is not counted."""


@dataclass(slots=True)
class TokenBucket:
    """`rate_per_s` tokens a second, at most `burst` at once. Times are the node clock."""

    rate_per_s: float = ACTS_PER_S
    burst: float = ACTS_BURST
    _tokens: float = ACTS_BURST
    _at_us: int | None = None

    def take(self, now_us: int, cost: float = 1.0) -> bool:
        """Take `cost` tokens if there is one; what is lacking of them is owed."""
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


def text_in(value: Any) -> int:
    """Characters of the long texts in a content."""
    if isinstance(value, str):
        return len(value) if len(value) > SHORT_TEXT else 0
    if isinstance(value, Expr):
        value = value.arguments
    if isinstance(value, dict):
        return sum(map(text_in, value.values()))
    return sum(map(text_in, value)) if isinstance(value, tuple) else 0
