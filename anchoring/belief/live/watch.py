"""An environment model that is fed by several sources: looks in, what has changed of the beliefs out.

Work is bounded: of one step at most `MOST_REPORTED` beliefs are reported, those that were observed or have begun first,
then those that were reported longest ago; each is reported again at least once in `RENEWED_US` while that is possible.
Beliefs that wait are counted.
"""

from collections import Counter, deque
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from dyknow import US_PER_S
from dyknow.anchoring.belief.arrays import Floats
from dyknow.anchoring.belief.cameras import CameraSensor
from dyknow.anchoring.belief.description import POSITION, WorldModel
from dyknow.anchoring.belief.environment import EnvironmentModel
from dyknow.anchoring.belief.knowledge.informed import (
    LEARNT,
    LOADED,
    MATCHED,
    REFUSED,
    REPAIRED,
    UNLOADED,
    InformedModel,
)
from dyknow.anchoring.belief.knowledge.memory import PriorKnowledge
from dyknow.anchoring.belief.knowledge.ontology import KnowledgeBundle
from dyknow.anchoring.belief.live.gathering import SourceLook
from dyknow.anchoring.belief.live.trust import TrustInSource
from dyknow.anchoring.belief.reports import (
    CONFIRMED,
    DELETED,
    LATE,
    LIMITED,
    TENTATIVE,
    UNEXPLAINED,
    UNKNOWN,
    BelievedInstance,
    LifeEvent,
    UpdateReport,
)
from dyknow.anchoring.belief.sensing import in_view, trusted

RENEWED_US: Final = US_PER_S
MOST_REPORTED: Final = 256
SEEN_US: Final = 5 * US_PER_S
"""How long the sources that observed an instance are named."""
EVENTS_KEPT: Final = 1_024
OBSERVED: Final = 0.5
"""An observation counts as one of an instance from this probability on."""
_COUNTED: Final = frozenset({LATE, LIMITED, UNEXPLAINED, UNKNOWN})
_TOUCHED: Final = 0.01
_TRUST_CHANGED: Final = 0.1
TRUST: Final = "trust"
_NOTABLE: Final = frozenset({CONFIRMED, MATCHED, REFUSED, REPAIRED, LEARNT, LOADED, UNLOADED})
_NEVER: Final = -(2**80), -1.0


class ObservingSource(NamedTuple):
    """One source.

    Attributes:
        name: as it is reported: of a platform, its unit.
        sensor: of the model.
        trust: declared.
    """

    name: str
    sensor: str
    trust: float = 1.0


class ReportedBelief(NamedTuple):
    """One instance as it is reported.

    Attributes:
        seen_by: names of the sources that observed it in the last seconds.
        ended: it is given up; nothing else of it is known any longer.
    """

    instance: BelievedInstance
    seen_by: tuple[str, ...] = ()
    ended: bool = False


class WorldWatch:
    """Beliefs about everything that several sources observe.

    Args:
        model: the model of types, attributes and sensors.
        bundles: prior knowledge.
        sources: that observe.
        prefix: of the names of instances.

    Attributes:
        informed: the model with its knowledge.
        trust: in each source, now.
        recent: the last events, without routine ones.
        counts: counts of observations that were left out, or wait, by reason.
    """

    def __init__(
        self,
        model: WorldModel,
        bundles: Iterable[KnowledgeBundle],
        sources: Sequence[ObservingSource],
        *,
        prefix: str = "i",
    ) -> None:
        self._model, self._sources = model, tuple(sources)
        self.informed = InformedModel(
            EnvironmentModel(model, prefix=prefix), PriorKnowledge(model.types.names, bundles)
        )
        self._sensors = [CameraSensor(model, each.sensor) for each in sources]
        self.trust = [TrustInSource(each.trust * model.sensors[each.sensor].trust) for each in sources]
        self._trust_noted = [each.value for each in self.trust]
        self.recent: deque[LifeEvent] = deque(maxlen=EVENTS_KEPT)
        self._history: deque[LifeEvent] = deque(maxlen=EVENTS_KEPT)
        self._repaired = set[tuple[str, str]]()
        self.counts: Counter[str] = Counter()
        self._first_by: dict[str, int] = {}
        self._confirmed = set[str]()
        self._seen_us: dict[str, dict[int, int]] = {}
        self._last: dict[str, tuple[int, float]] = {}
        self._views: dict[int, Floats] = {}
        self._selected_us = -(2**80)
        self._task, self._area = "", self._model.area
        self.select(self._task)

    @property
    def environment(self) -> EnvironmentModel:
        return self.informed.environment

    def select(self, task: str) -> None:
        """Load the knowledge for a task, where the sources look."""
        self._task = task
        self._note(self.informed.select(self._area, task))

    def on_look(self, look: SourceLook) -> list[ReportedBelief]:
        """Take in one look; the beliefs to be reported."""
        source = self._sources[look.source]
        sensor = self._model.sensors[source.sensor]
        if look.view_m is not None:
            sensor = replace(sensor, view_m=look.view_m)
            self._on_view(look)
        aged = self.informed.predict_to(look.valid_us)
        if aged.valid_us != look.valid_us:
            self.counts["looks that came too late"] += 1
            return []
        seen, names = self._in_view(sensor.view_m), self.environment.table.names
        observations = self._sensors[look.source].of_percepts(look.valid_us, look.percepts)
        trust = self.trust[look.source]
        report = self.informed.on_scan(look.valid_us, trusted(sensor, trust.value * look.certainty), observations)
        hits = np.zeros(len(names))
        np.add.at(hits, report.rows, report.pairs)
        self.trust[look.source] = trust.after(look.valid_us, sensor, seen, hits, len(observations))
        self._judge(look.source, look.valid_us)
        self._on_observed(look, names, hits, report)
        touched = {names[row] for row in np.flatnonzero(hits > _TOUCHED).tolist()}
        return self._reported(report._replace(events=(*aged.events, *report.events)), touched)

    def on_time(self, valid_us: int) -> list[ReportedBelief]:
        """Let time pass."""
        if self.environment.valid_us is None or valid_us <= self.environment.valid_us:
            return []
        return self._reported(self.informed.predict_to(valid_us), set())

    def _note(self, events: Iterable[LifeEvent]) -> None:
        """Keep the events in the history, and the interesting ones apart, a repair by a rule once for each instance."""
        for each in events:
            if each.kind in _COUNTED:
                self.counts[each.kind] += 1
                continue
            if each.kind == REPAIRED:
                if (each.instance, each.what) in self._repaired:
                    continue
                self._repaired.add((each.instance, each.what))
            self._history.append(each)
            if each.kind in _NOTABLE or (each.kind == DELETED and each.instance in self._confirmed):
                self.recent.append(each)
            if each.kind == CONFIRMED:
                self._confirmed.add(each.instance)

    def explain(self, name: str) -> list[LifeEvent]:
        """The events of an instance that are kept."""
        return [each for each in self._history if each.instance == name]

    # View and trust

    def _in_view(self, view_m: Floats | None) -> Floats:
        """(N,) existence of confirmed instances, times the share of each in view."""
        table = self.environment.table
        position, existence = table.gaussian.get(POSITION), table.existence * table.confirmed
        if position is None or view_m is None:
            return existence
        return np.asarray(existence * in_view(view_m, position.mean[:, :2], position.covariance[:, :2, :2]))

    def _on_view(self, look: SourceLook) -> None:
        """Load and unload knowledge by where the sources look, now and then."""
        if look.view_m is None or not self.informed.knowledge.bundles:
            return
        self._views[look.source] = look.view_m
        if look.valid_us - self._selected_us < RENEWED_US:
            return
        self._selected_us = look.valid_us
        corners = np.concatenate([*self._views.values()])
        west, south = corners.min(axis=0).tolist()
        east, north = corners.max(axis=0).tolist()
        self._area = (west, south, east, north)
        self.select(self._task)

    def _on_observed(self, look: SourceLook, names: Sequence[str], hits: Floats, report: UpdateReport) -> None:
        self._first_by |= dict.fromkeys(report.created, look.source)
        for name in (*(names[row] for row in np.flatnonzero(hits > OBSERVED).tolist()), *report.created):
            self._seen_us.setdefault(name, {})[look.source] = look.valid_us

    def _judge(self, source: int, valid_us: int) -> None:
        """Note when a source is trusted otherwise than was reported last."""
        trust = self.trust[source]
        if abs(trust.value - self._trust_noted[source]) >= _TRUST_CHANGED:
            self._trust_noted[source] = trust.value
            because = f"{trust.value:.2f}: {trust.because}"
            event = LifeEvent(valid_us, TRUST, self._sources[source].name, trust.value, because=because)
            self.recent.append(event)
            self._history.append(event)

    def _reported(self, report: UpdateReport, touched: set[str]) -> list[ReportedBelief]:
        """The beliefs to be reported after a step."""
        self._note(report.events)
        now_us, environment = report.valid_us, self.environment
        touched |= {each.instance for each in report.events if each.instance}
        ended = [self._ended(each) for each in report.events if each.kind == DELETED]
        due: list[tuple[bool, int, int]] = []
        table = environment.table
        for row, (name, existence) in enumerate(zip(table.names, table.existence.tolist(), strict=True)):
            at_us, before = self._last.get(name, _NEVER)
            if name in touched or now_us - at_us >= RENEWED_US or abs(existence - before) > _TOUCHED:
                due.append((name not in touched, at_us, row))
        if len(due) > MOST_REPORTED:
            self.counts["beliefs that were reported later"] += len(due) - MOST_REPORTED
            due = sorted(due)[:MOST_REPORTED]
        found = []
        for _, _, row in due:
            instance = environment.instance(row)
            self._last[instance.name] = now_us, instance.existence
            known = self.informed.matched.get(instance.name, "")
            found.append(ReportedBelief(instance._replace(known=known), self._seen_by(instance.name, now_us)))
        return ended + found

    def _ended(self, event: LifeEvent) -> ReportedBelief:
        name = event.instance
        source = self._first_by.pop(name, None)
        self._seen_us.pop(name, None)
        self._last.pop(name, None)
        if source is not None and name not in self._confirmed:
            self.trust[source] = self.trust[source].disproved()
        self._confirmed.discard(name)
        self._repaired = {each for each in self._repaired if each[0] != name}
        return ReportedBelief(BelievedInstance(name, event.existence, TENTATIVE, {}, {}, {}, {}), ended=True)

    def _seen_by(self, name: str, now_us: int) -> tuple[str, ...]:
        seen = self._seen_us.get(name, {})
        found = {self._sources[source].name for source, at_us in seen.items() if now_us - at_us <= SEEN_US}
        return tuple(sorted(found))
