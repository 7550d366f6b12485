"""The three pillars together: the world, the environment model and prior knowledge inform each other.

prior knowledge -> environment model   new instances are matched and completed; rules refuse or repair
environment model -> prior knowledge   what was of lasting interest is learnt back when it is gone
world -> environment model             observations
environment model -> world             requests: what to observe, to fill a gap or to confirm what is about to be deleted
"""

from collections.abc import Callable, Sequence
from itertools import chain, count
from typing import Final, NamedTuple

import numpy as np

from dyknow.anchoring.belief.arrays import Indices
from dyknow.anchoring.belief.description import POSITION, GaussianAttribute, WorldSensor
from dyknow.anchoring.belief.environment import EnvironmentModel
from dyknow.anchoring.belief.knowledge.matching import complete, fill, is_unknown, match
from dyknow.anchoring.belief.knowledge.memory import PriorKnowledge
from dyknow.anchoring.belief.knowledge.ontology import REFUSE, Area, ClassRule, KnownInstance, members
from dyknow.anchoring.belief.knowledge.rules import check, of_relations, repair
from dyknow.anchoring.belief.observations import TYPE, WorldObservation
from dyknow.anchoring.belief.reports import CONFIRMED, CREATED, DELETED, LifeEvent, UpdateReport

LOADED, UNLOADED, COMPLETED = "loaded", "unloaded", "completed"
MATCHED, REFUSED, REPAIRED, LEARNT = "matched", "refused", "repaired", "learnt"
EXISTENCE: Final = "existence"
_LIKELY = 0.5


class InformationRequest(NamedTuple):
    """A request of the environment model for an observation.

    Attributes:
        instance: its name.
        what: an attribute, or `existence`.
        sensor: which can observe it; empty: none can.
        because: the reason.
        place_m: where the instance is believed to be, if its position is.
        until_us: when the instance will be deleted otherwise; infinite: it will not be.
    """

    instance: str
    what: str
    sensor: str
    because: str
    place_m: tuple[float, float] | None
    until_us: float


class InformedModel:
    """An environment model and prior knowledge.

    Args:
        environment: with beliefs of its own from now on.
        knowledge: what to load; `select` does.
        match_above: gamma_m: the least probability with which an instance is a known one.

    Attributes:
        matched: instances that are known ones, and those names.
    """

    def __init__(self, environment: EnvironmentModel, knowledge: PriorKnowledge, *, match_above: float = 0.8) -> None:
        self.environment, self.knowledge = environment, knowledge
        self.matched: dict[str, str] = {}
        self._match_above = match_above
        self._lasting: dict[str, KnownInstance] = {}
        self._is_selected = False

    def select(self, area: Area | None, task: str) -> list[LifeEvent]:
        """Load the knowledge that is needed in an area for a task, and unload the rest."""
        loaded, unloaded = self.knowledge.select(area, task)
        if loaded or unloaded or not self._is_selected:
            self.environment.restrict_types(self.knowledge.possible())
        self._is_selected = True
        at_us = self.environment.valid_us or 0
        return [LifeEvent(at_us, LOADED, what=name) for name in loaded] + [
            LifeEvent(at_us, UNLOADED, what=name) for name in unloaded
        ]

    def on_look(self, valid_us: int, sensor: str, observations: Sequence[WorldObservation]) -> UpdateReport:
        """Take in one look, and let prior knowledge and beliefs inform each other."""
        return self._inform(lambda: self.environment.on_look(valid_us, sensor, observations))

    def on_scan(self, valid_us: int, sensor: WorldSensor, observations: Sequence[WorldObservation]) -> UpdateReport:
        """Take in all observations of one look of a sensor as it looks now."""
        return self._inform(lambda: self.environment.observe_scan(observations, valid_us=valid_us, sensor=sensor))

    def predict_to(self, valid_us: int) -> UpdateReport:
        """Let time pass."""
        return self._inform(lambda: self.environment.predict_to(valid_us))

    def requests(self) -> list[InformationRequest]:
        """The requested observations, the most urgent first."""
        table, found = self.environment.table, []
        ends_us = table.deletions_us(self.environment.valid_us or 0)
        confirm = self.environment.model.thresholds.confirm
        types = self.environment.model.types.names
        for row in np.flatnonzero(table.confirmed).tolist():
            until_us = float(ends_us[row])
            if table.existence[row] < confirm:
                because = f"existence is {table.existence[row]:.3f}, below {confirm:g}"
                found.append(self._request(row, EXISTENCE, because, until_us))
            type_ = types[int(table.categorical[TYPE].shares[row].argmax())]
            found += [
                self._request(row, name, f"each {type_} has {name}", until_us)
                for name in sorted(self.knowledge.has(type_))
                if is_unknown(table.beliefs()[name], row)
            ]
        return sorted(found, key=lambda each: (each.what != EXISTENCE, each.until_us))

    def _request(self, row: int, what: str, because: str, until_us: float) -> InformationRequest:
        model, table = self.environment.model, self.environment.table
        able = [each for each in model.sensors.values() if what == EXISTENCE or _observes(each, what)]
        sensor = max(able, key=lambda each: each.detects).name if able else ""
        position = table.gaussian.get(POSITION)
        place = None if position is None else (float(position.mean[row, 0]), float(position.mean[row, 1]))
        return InformationRequest(table.names[row], what, sensor, because, place, until_us)

    def _inform(self, step: Callable[[], UpdateReport]) -> UpdateReport:
        report = step()
        events = [*report.events]
        events += self._obey(report.valid_us)
        events += self._match(report.valid_us, report.events)
        events += self.environment.table.decide(report.valid_us)
        events += self._remember(report, events)
        return report._replace(events=tuple(events))

    def _obey(self, valid_us: int) -> list[LifeEvent]:
        """Rules, one after the other."""
        events: list[LifeEvent] = []
        for rule in self.knowledge.rules:
            types = members(self.knowledge.classes, rule.of_class, self.environment.model.types.names)
            if not len(types) or not len(self.environment.table):
                continue
            if rule.relation:
                events += self._obey_relation(rule, types, valid_us)
                continue
            table = self.environment.table
            checked = check(table, rule, types)
            refused = np.zeros(len(table), dtype=np.bool_)
            for row in np.flatnonzero(checked.violated > rule.tolerance).tolist():
                because = f"{rule.name}: violated with probability {checked.violated[row]:.3f}"
                if rule.action == REFUSE or not repair(table, rule, types, row, checked):
                    refused[row] = True
                    events.append(table.event(valid_us, REFUSED, row, rule.attribute, because))
                else:
                    events.append(table.event(valid_us, REPAIRED, row, rule.attribute, because))
            if refused.any():
                events += self.environment.remove(refused)
        return events

    def _obey_relation(self, rule: ClassRule, types: Indices, valid_us: int) -> list[LifeEvent]:
        names, table = self.environment.model.types.names, self.environment.table
        others = members(self.knowledge.classes, rule.other, names) if rule.other else None
        relations = self.environment.relations()
        revised = of_relations(table, rule, types, others, relations)
        if rule.action == REFUSE:
            revised = dict.fromkeys((key for key, value in revised.items() if value < relations[key]), 0.0)
        kind, rows = REFUSED if rule.action == REFUSE else REPAIRED, table.rows()
        events = [
            table.event(valid_us, kind, rows[key[1]], f"{key[0]} {key[2]}", f"{rule.name}: was {relations[key]:.3f}")
            for key in revised
        ]
        return events + self.environment.revise(revised)

    def _match(self, valid_us: int, events: Sequence[LifeEvent]) -> list[LifeEvent]:
        """Match known instances with created or confirmed ones; their unobserved attributes are completed."""
        table, found = self.environment.table, list[LifeEvent]()
        rows = table.rows()
        names = dict.fromkeys(each.instance for each in events if each.kind in {CREATED, CONFIRMED})
        for name in names:
            if name not in rows or name in self.matched:
                continue
            row = rows[name]
            free = [each for each in self.knowledge.known if each.name not in self.matched.values()]
            best = match(table, row, free)
            if best is not None and best[1] > self._match_above:
                self.matched[name] = best[0].name
                because = f"it is {best[0].name} with probability {best[1]:.3f}"
                found.append(table.event(valid_us, MATCHED, row, best[0].name, because))
                for what in complete(table, row, best[0]):
                    found.append(table.event(valid_us, COMPLETED, row, what, f"known of {best[0].name}"))
            shares = table.categorical[TYPE].shares[row]
            if shares.max() > _LIKELY:
                known = self.knowledge.of_class(self.environment.model.types.names[int(shares.argmax())])
                for what in fill(table, row, known.gaussian, known.categorical):
                    found.append(table.event(valid_us, COMPLETED, row, what, f"usual of each {known.name}"))
        return found

    def _remember(self, report: UpdateReport, events: Sequence[LifeEvent]) -> list[LifeEvent]:
        """Keep what was observed of lasting interest, and learn it when it is gone."""
        table, types = self.environment.table, self.environment.model.types.names
        rows = table.rows()
        seen = {report.names[row] for row in report.rows[report.pairs > _LIKELY].tolist()}
        for name in seen & rows.keys():
            row = rows[name]
            type_ = types[int(table.categorical[TYPE].shares[row].argmax())]
            if table.confirmed[row] and self.knowledge.is_lasting(type_):
                self._lasting[name] = self._memory(name, row)
        learnt = []
        for each in events:
            if each.kind == DELETED:
                known = self._lasting.pop(each.instance, None)
                self.matched.pop(each.instance, None)
                if known is not None:
                    self.knowledge.learn(known)
                    learnt.append(LifeEvent(each.valid_us, LEARNT, each.instance, each.existence, known.name))
        return learnt

    def _memory(self, name: str, row: int) -> KnownInstance:
        """The lasting part of an instance: its observed attributes that do not change with motion."""
        table = self.environment.table
        gaussian = {
            key: (each.mean[row].copy(), each.covariance[row].copy())
            for key, each in table.gaussian.items()
            if each.present[row] and not is_unknown(each, row) and _stays(each.attribute)
        }
        categorical = {
            key: each.shares[row].copy()
            for key, each in table.categorical.items()
            if each.present[row] and not is_unknown(each, row)
        }
        return KnownInstance(self._called(name), gaussian, categorical)

    def _called(self, name: str) -> str:
        """The name under which an instance is remembered; different from those of all other remembered instances."""
        if name in self.matched:
            return self.matched[name]
        if name in self._lasting:
            return self._lasting[name].name
        taken = {each.name for each in (*self.knowledge.known, *self._lasting.values())}
        return next(
            each for each in chain([f"known-{name}"], (f"known-{name}-{n}" for n in count(2))) if each not in taken
        )


def _stays(attribute: GaussianAttribute) -> bool:
    return attribute.order == 1


def _observes(sensor: WorldSensor, attribute: str) -> bool:
    return attribute in sensor.noise or attribute in sensor.confusion
