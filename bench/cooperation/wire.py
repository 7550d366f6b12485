"""Pictures of several members, and what passes between them: late, lost, or not at all."""

from collections.abc import Iterable, Mapping
from heapq import heappop, heappush
from itertools import count
from typing import Final

from numpy.random import Generator

from bench.cooperation.areas import PERCEPT_SD_M
from dyknow import NO_VALUE, Field, Sample, Sort
from dyknow.agents.capabilities.cooperation.remote_percepts import RemotePercepts
from dyknow.anchoring.cooperation.picture import GlobalPicture
from dyknow.anchoring.cooperation.reports import IdentityClaim, TrackReport
from dyknow.anchoring.cooperation.sharing import TRACKS_US, SharingLevel
from dyknow.anchoring.links.structures import Percept

PERCEPT: Final = Sort(
    "camera-percept",
    tuple(Field(*each) for each in (("symbol", "text"), ("x_m", "m"), ("y_m", "m"), ("sd_m", "m"), ("end", "bool"))),
)
LOSS: Final = 0.02
DELAY_US: Final = (10_000, 250_000)
CLAIMS_US: Final = 1_000_000
REPORTS_US: Final = 200_000
GONE_US: Final = 2_500_000
"""A member that is cut off is known to be gone after so long."""


class Wire:
    """Brings reports and claims of each member to all pictures.

    Args:
        pictures: by member.
        level: what is shared; percepts are linked by the caller.
    """

    def __init__(self, pictures: Mapping[str, GlobalPicture], rng: Generator, level: SharingLevel = "states") -> None:
        self.pictures, self._rng = pictures, rng
        self._period_us = REPORTS_US if level == "percepts" else TRACKS_US[level]
        self._queue: list[tuple[int, int, str, TrackReport | IdentityClaim]] = []
        self._order = count()
        self._cut: dict[str, int] = {}
        self._claimed: dict[tuple[str, str], tuple[IdentityClaim | None, int]] = {}
        for unit, picture in pictures.items():
            for other in pictures:
                if other != unit:
                    picture.arrive(other, 0)

    def cut(self, unit: str, now_us: int) -> None:
        """Nothing passes to or from a member."""
        self._cut[unit] = now_us

    def heal(self, unit: str, now_us: int) -> None:
        """It is back."""
        del self._cut[unit]
        self._claimed.clear()
        for other, picture in self.pictures.items():
            for each in (unit,) if other != unit else self.pictures:
                picture.arrive(each, now_us)

    def step(self, reports: Mapping[str, Iterable[TrackReport]], now_us: int) -> None:
        """One look of all members."""
        for unit, each in reports.items():
            self._send(unit, each, now_us)
        while self._queue and self._queue[0][0] <= now_us:
            _, _, to, sent = heappop(self._queue)
            if to not in self._cut and sent.unit not in self._cut:
                self._bring(to, sent, now_us)
        for unit, picture in self.pictures.items():
            for other, since_us in self._cut.items():
                if now_us - since_us > GONE_US:
                    for gone in (other,) if unit != other else self.pictures:
                        picture.depart(gone, now_us)
            picture.on_time(now_us)
            self._send(unit, self._new_claims(unit, now_us), now_us)

    def _bring(self, to: str, sent: TrackReport | IdentityClaim, now_us: int) -> None:
        if isinstance(sent, TrackReport):
            self.pictures[to].report(sent, now_us)
        else:
            self.pictures[to].claim(sent, now_us)

    def _send(self, unit: str, each: Iterable[TrackReport | IdentityClaim], now_us: int) -> None:
        for one in each:
            for to in self.pictures:
                if to == unit:
                    if isinstance(one, TrackReport):
                        self.pictures[to].report(one, now_us)
                elif self._period_us and (isinstance(one, IdentityClaim) or self._is_due(one)):
                    at_us = now_us + int(self._rng.integers(*DELAY_US))
                    heappush(self._queue, (at_us, next(self._order), to, one))

    def _is_due(self, report: TrackReport) -> bool:
        return report.has_ended or (report.state.valid_us % self._period_us == 0 and self._rng.random() >= LOSS)

    def _new_claims(self, unit: str, now_us: int) -> list[IdentityClaim]:
        """What is new, and each again after a while."""
        new: list[IdentityClaim] = []
        for claim in self.pictures[unit].claims():
            key = unit, claim.symbol
            known, told_us = self._claimed.get(key, (None, 0))
            if known != claim or now_us - told_us >= CLAIMS_US:
                self._claimed[key] = claim, now_us
                new.append(claim)
        return new


class PerceptWire:
    """Brings the percepts of a member that links nothing to one that does, which makes tracks of them."""

    def __init__(self, unit: str, rng: Generator) -> None:
        self._linked, self._rng = RemotePercepts(unit, PERCEPT), rng
        self._queue: list[tuple[int, int, Sample]] = []
        self._order = count()

    def step(self, percepts: Iterable[Percept], now_us: int) -> list[TrackReport]:
        """One look: what is seen in it, and the tracks as far as percepts have come."""
        for each in percepts:
            if self._rng.random() >= LOSS:
                place = (NO_VALUE, NO_VALUE) if each.state is None else (each.state.x_m, each.state.y_m)
                sample = Sample(now_us, now_us, (each.symbol, *place, PERCEPT_SD_M, each.state is None))
                heappush(self._queue, (now_us + int(self._rng.integers(*DELAY_US)), next(self._order), sample))
        while self._queue and self._queue[0][0] <= now_us:
            self._linked.take(heappop(self._queue)[-1])
        return self._linked.reports(now_us)
