"""Percepts of a platform that links nothing itself, linked here: the objects are its tracks."""

from dyknow import Sample, Sort
from dyknow.anchoring.cooperation.reports import TrackReport
from dyknow.anchoring.links.states import ObjectState
from dyknow.anchoring.links.structures import LinkOutcome, ObjectLinkage
from dyknow.anchoring.percepts.records import PerceptRecords
from dyknow.anchoring.ready import VISION, WORLD, ready_specification

LATE_US = 400_000
"""How long the percepts of an image are waited for."""
MOST_PERCEPTS, MOST_TICKS = 256, 64


class RemotePercepts:
    """Links the percepts of one platform. Times are federation time."""

    def __init__(self, unit: str, sort: Sort) -> None:
        self._unit = unit
        self._reader = PerceptRecords(VISION, sort, None)
        self._linkage = ObjectLinkage(ready_specification())
        self._ticks: dict[int, dict[str, Sample]] = {}
        self._latest_us = 0
        self._last: dict[str, ObjectState] = {}

    def take(self, sample: Sample) -> bool:
        """Take a percept; False: it came too late, or there are too many."""
        if sample.valid_us <= self._latest_us or not isinstance(sample.value, tuple):
            return False
        if sample.valid_us not in self._ticks and len(self._ticks) >= MOST_TICKS:
            return False
        tick = self._ticks.setdefault(sample.valid_us, {})
        if len(tick) >= MOST_PERCEPTS:
            return False
        tick[str(sample.value[0])] = sample
        return True

    def reports(self, now_us: int) -> list[TrackReport]:
        """Its tracks, as far as all percepts have come."""
        found: list[TrackReport] = []
        for valid_us in sorted(each for each in self._ticks if each <= now_us - LATE_US):
            percepts = [self._reader.percept(sample) for sample in self._ticks.pop(valid_us).values()]
            if valid_us > self._latest_us:
                self._latest_us = valid_us
                known = {each.symbol: each for each in percepts if each is not None}
                found += self._made(self._linkage.on_percepts(valid_us, known.values()))
        return found

    def _made(self, outcome: LinkOutcome) -> list[TrackReport]:
        linkage = self._linkage
        made = [
            TrackReport(self._unit, each.symbol, each.state, is_anchored=linkage.anchored(each.symbol))
            for each in outcome.states
            if each.type == WORLD
        ]
        self._last |= {each.symbol: each.state for each in made}
        for event in outcome.events:
            state = self._last.pop(event.target, None) if event.kind == "forgotten" else None
            if state is not None:
                made.append(TrackReport(self._unit, event.target, state, has_ended=True))
        return made
