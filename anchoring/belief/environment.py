"""The environment model: observations in, beliefs about what exists out.

A value that is stepped: `observe` takes one observation, `observe_scan` several of one time, `predict_to` time alone. A step
predicts all instances, associates, updates, and decides what is created, confirmed and deleted.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import exp, inf, log, prod

import numpy as np

from dyknow import US_PER_S
from dyknow.anchoring.belief.arrays import Flags, Floats, Indices
from dyknow.anchoring.belief.association.pairs import FAINTEST, Pairs, all_pairs, gated_pairs
from dyknow.anchoring.belief.association.scans import EXACT_INSTANCES, NEGLIGIBLE, associate
from dyknow.anchoring.belief.association.single import (
    MOST_DETECTION,
    OtherSources,
    by_event,
    by_share,
)
from dyknow.anchoring.belief.description import EVENT, POSITION, WorldModel, WorldSensor
from dyknow.anchoring.belief.instances import InstanceTable
from dyknow.anchoring.belief.observations import TYPE, EncodedLook, LookEncoder, WorldObservation
from dyknow.anchoring.belief.relations import RelationBeliefs
from dyknow.anchoring.belief.reports import (
    CREATED,
    DELETED,
    LATE,
    LIMITED,
    OF_RELATIONS,
    UNEXPLAINED,
    UNKNOWN,
    BelievedInstance,
    LifeEvent,
    UpdateReport,
)
from dyknow.anchoring.belief.sensing import detection, trusted

_ACTIVE = 1e-12
"""Less probable observations do not change beliefs about attributes."""
_NEGLIGIBLE_EXACT = 1e-12
"""Pairs so much less likely than both without it are left out where sums are exact otherwise."""
_LEAST, _MOST = 1e-6, 1.0 - 1e-6
_NO_INDICES = np.zeros(0, dtype=np.intp)


class EnvironmentModel:
    """The environment model: all instances and beliefs.

    Args:
        valid_us: when the initial beliefs hold; None: at the first step.
        exact_instances: in scans, parts with cycles of up to this number of instances, or of observations, are summed
            exactly; 0: none, and pairs are left out sooner.
        prefix: of the names of new instances.

    Attributes:
        table: the instances.
        valid_us: of all beliefs.
        counts: counts of observations and instances that were left out or limited, by reason.
    """

    def __init__(
        self,
        model: WorldModel,
        valid_us: int | None = None,
        *,
        exact_instances: int = EXACT_INSTANCES,
        prefix: str = "i",
    ) -> None:
        self.model, self.valid_us = model, valid_us
        self.table, self.counts = InstanceTable(model, prefix), Counter[str]()
        self._exact, self._negligible = exact_instances, _NEGLIGIBLE_EXACT if exact_instances else NEGLIGIBLE
        self._relations = RelationBeliefs(model.relations)
        self._types = model.types.belief
        self._encoder = LookEncoder(
            model.types,
            self.table.gaussian,
            {each.name: self.table.categorical[each.name] for each in model.categorical},
        )

    @property
    def deadline_us(self) -> float:
        """When an instance will be deleted if nothing is observed; infinite if none will."""
        return float(self.table.deletions_us(self.valid_us or 0).min(initial=np.inf))

    def predict_to(self, valid_us: int) -> UpdateReport:
        """Let time pass without an observation; instances that ended on the way are in the report, each at its time."""
        return self._late(valid_us) or self._report(valid_us, [*self._predict(valid_us)])

    def observe(self, observation: WorldObservation) -> UpdateReport:
        """Take in the single observation of a time, by the reading of the model."""
        sensor = self._sensor(observation.sensor)
        if sensor.is_frame:
            return self.observe_scan([observation], valid_us=observation.valid_us, sensor=sensor)
        if late := self._late(observation.valid_us):
            return late
        events = [*self._predict(observation.valid_us)]
        look = self._encoder.look(observation.valid_us, sensor, [observation])
        return self._single(look, events)

    def observe_scan(
        self,
        observations: Sequence[WorldObservation],
        *,
        valid_us: int | None = None,
        sensor: WorldSensor | None = None,
    ) -> UpdateReport:
        """Take in all observations of one sensor at one time.

        Args:
            observations: may be none, if the other arguments say whose look it was.
            valid_us: of the look; None: of the observations.
            sensor: as it looks now; None: as the model says.
        """
        sensor = self._sensor(observations[0].sensor) if sensor is None else sensor
        valid_us = observations[0].valid_us if valid_us is None else valid_us
        if late := self._late(valid_us):
            return late
        events = [*self._predict(valid_us)]
        most = self.model.limits.scan
        if len(observations) > most:
            events.append(
                self._told(valid_us, LIMITED, f"{len(observations)} observations in a scan, {most} are taken")
            )
            observations = observations[:most]
        return self._scan(self._encoder.look(valid_us, sensor, observations), events)

    def on_look(self, valid_us: int, sensor: str, observations: Sequence[WorldObservation]) -> UpdateReport:
        """Take in one look: one observation by the reading of the model, others as a scan; no sensor: time passes."""
        if not sensor:
            return self.predict_to(valid_us)
        if len(observations) == 1:
            return self.observe(observations[0])
        return self.observe_scan(observations, valid_us=valid_us, sensor=self._sensor(sensor))

    def _sensor(self, name: str) -> WorldSensor:
        """As far as it is trusted."""
        sensor = self.model.sensors[name]
        return trusted(sensor, sensor.trust)

    def most_certain(self, most: int) -> list[int]:
        """Places of the instances that exist most probably, in the order of the table."""
        if len(self.table) <= most:
            return list(range(len(self.table)))
        return sorted(np.argpartition(-self.table.existence, most)[:most].tolist())

    def query(
        self, *, type_: str | None = None, attribute: str | None = None, min_existence: float = 0.0
    ) -> list[BelievedInstance]:
        """Instances that exist with at least this probability, are probably of a type, and have an attribute."""
        found = []
        for row in np.flatnonzero(self.table.existence >= min_existence).tolist():
            view = self.instance(row)
            if type_ is not None and max(view.type, key=view.type.__getitem__) != type_:
                continue
            if attribute is None or attribute in view.gaussian or attribute in view.categorical:
                found.append(view)
        return found

    def instance(self, row: int) -> BelievedInstance:
        """The one at a place of the table."""
        return self.table.view(row, self._relations.of(self.table.names[row], self.valid_us or 0))

    def restrict_types(self, possible: Flags) -> None:
        """Make only these types (T,) possible; a type that becomes possible again gets its prior share."""
        types, beliefs = self.model.types, self.table.categorical[TYPE]
        before, prior = beliefs.attribute.prior, self._types.prior * possible
        if not prior.sum() > 0.0:
            prior = self._types.prior
        prior /= prior.sum()
        returned = np.where(before > 0.0, 0.0, prior)
        shares = beliefs.shares * (prior > 0.0) * (1.0 - returned.sum())
        remaining = shares.sum(axis=1, keepdims=True)
        shares = np.where(remaining > 0.0, shares / np.maximum(remaining, FAINTEST) * (1.0 - returned.sum()), prior)
        beliefs.shares = np.where(remaining > 0.0, shares + returned, prior)
        beliefs.attribute = replace(beliefs.attribute, prior=prior)
        self.model = replace(self.model, types=replace(types, belief=beliefs.attribute))
        self._encoder.types = self.model.types

    def remove(self, which: Flags) -> list[LifeEvent]:
        """Delete instances (N,) now."""
        return self._existing(self._delete(which, np.full(len(self.table), self.valid_us or 0), self.table.existence))

    def revise(self, relations: Mapping[tuple[str, str, str], float]) -> list[LifeEvent]:
        """Believe these relations, (name, instance, other), with these probabilities."""
        now_us = self.valid_us or 0
        return self._existing(
            event for key, value in relations.items() for event in self._relations.revise(*key, value, now_us)
        )

    def relations(self) -> Mapping[tuple[str, str, str], float]:
        """All relations that instances have: (name, instance, other) -> probability."""
        return self._relations.every(self.valid_us or 0)

    def _late(self, valid_us: int) -> UpdateReport | None:
        if self.valid_us is None or valid_us >= self.valid_us:
            return None
        because = f"observed at {valid_us} us, beliefs hold at {self.valid_us} us"
        return self._report(self.valid_us, [self._told(self.valid_us, LATE, because)])

    def _report(self, valid_us: int, events: Sequence[LifeEvent]) -> UpdateReport:
        """Of a step in which nothing was observed."""
        none = np.zeros(0)
        return UpdateReport(
            valid_us, self.table.names, self.table.existence, _NO_INDICES, _NO_INDICES, none, none, none, tuple(events)
        )

    def _told(self, valid_us: int, kind: str, because: str) -> LifeEvent:
        self.counts[kind] += 1
        return LifeEvent(valid_us, kind, because=because)

    def _predict(self, valid_us: int) -> Iterator[LifeEvent]:
        """Predict everything, and delete what time has ended."""
        before_us = valid_us if self.valid_us is None else self.valid_us
        self.valid_us = valid_us
        if valid_us <= before_us:
            return
        ended: list[LifeEvent] = []
        if self.model.lifetime_s < inf and len(self.table):
            ends_us = self.table.deletions_us(before_us)
            if (ends_us <= valid_us).any():
                ended = [*self._delete(ends_us <= valid_us, ends_us)]
        self.table.predict((valid_us - before_us) / US_PER_S)
        ended += [*self._relations.predict(valid_us), *self.table.decide(valid_us)]
        yield from self._existing(sorted(ended, key=lambda each: each.valid_us))

    def _existing(self, events: Iterable[LifeEvent]) -> list[LifeEvent]:
        """Events, those of relations with the existence that their instances had."""
        found = [*events]
        if not any(each.kind in OF_RELATIONS for each in found):
            return found
        now_us = self.valid_us or 0
        known = {
            name: (now_us, float(value)) for name, value in zip(self.table.names, self.table.existence, strict=True)
        }
        known |= {each.instance: (each.valid_us, each.existence) for each in found if each.kind == DELETED}
        for n, each in enumerate(found):
            if each.kind in OF_RELATIONS and each.instance in known:
                at_us, value = known[each.instance]
                later = exp((at_us - each.valid_us) / US_PER_S / self.model.lifetime_s)
                found[n] = each._replace(existence=min(1.0, float(value) * later))
        return found

    def _delete(self, which: Flags, at_us: Floats, existence: Floats | None = None) -> Iterator[LifeEvent]:
        """Remove instances, each at its time."""
        least = self.model.thresholds.delete
        gone = [
            (self.table.names[row], int(at_us[row]), least if existence is None else float(existence[row]))
            for row in np.flatnonzero(which).tolist()
        ]
        self.table.keep(~which)
        for name, gone_us, value in gone:
            yield LifeEvent(gone_us, DELETED, name, value)
            yield from self._relations.forget(name, gone_us)

    def _single(self, look: EncodedLook, events: list[LifeEvent]) -> UpdateReport:
        """By one of the readings."""
        table, sensor = self.table, look.sensor
        pairs = all_pairs(table, look)
        likelihood = pairs.log_likelihood + self._of_relations(look, pairs.rows, pairs.cols)
        log_other = float(self._prior_of_relations(look)[0])
        others = OtherSources(
            sensor.births, float(look.log_birth[0]) + log_other, sensor.clutter, float(look.log_clutter[0]) + log_other
        )
        by = by_event if self.model.reading == EVENT else by_share
        found = by(table.existence, likelihood, *self._detection(sensor), others)
        if found is None:
            events.append(self._told(look.valid_us, UNEXPLAINED, "no instance, birth or clutter explains it"))
            return self._report(look.valid_us, events)
        table.existence = np.minimum(found.existence, 1.0)
        births, clutter = np.array([found.birth]), np.array([found.clutter])
        names = table.names
        events += self._learn(look, pairs, found.weights, births)
        return UpdateReport(
            look.valid_us,
            names,
            found.existence,
            pairs.rows,
            pairs.cols,
            found.instances,
            births,
            clutter,
            tuple(events),
        )

    def _scan(self, look: EncodedLook, events: list[LifeEvent]) -> UpdateReport:
        """With mutual exclusion."""
        table, sensor = self.table, look.sensor
        log_other = self._prior_of_relations(look)
        births = sensor.births * np.exp(look.log_birth + log_other)
        clutter = sensor.clutter * np.exp(look.log_clutter + log_other)
        other = births + clutter
        hit, _ = self._detection(sensor)
        seen = table.existence * np.minimum(hit, MOST_DETECTION)
        odds, most = seen / (1.0 - seen), self.model.limits.pairs
        faintest = max(float(other.min(initial=1.0)), FAINTEST)
        pairs = gated_pairs(table, look, odds, faintest, most, self._negligible)
        rows, cols = pairs.rows, pairs.cols
        if pairs.is_limited:
            events.append(self._told(look.valid_us, LIMITED, f"more than {most} pairs in a scan"))
        psi = _ratios(np.log(odds[rows]) + pairs.log_likelihood + self._of_relations(look, rows, cols), cols, other)
        found = associate(rows, cols, psi, len(table), look.size, exact_instances=self._exact)
        silent = np.maximum(table.existence - seen, 0.0) / (1.0 - seen)
        existence = np.bincount(rows, found.pairs, len(table)) + found.none * silent
        table.existence = np.minimum(existence, 1.0)
        weights = found.pairs / np.maximum(existence, FAINTEST)[rows]
        new = found.unclaimed * np.divide(births, other, out=np.zeros(look.size), where=other > 0.0)
        unexplained = (other <= 0.0) & (np.bincount(cols, found.pairs, look.size) <= 0.0)
        if unexplained.any():
            events += [
                self._told(look.valid_us, UNEXPLAINED, f"observation {col}") for col in np.flatnonzero(unexplained)
            ]
        names = table.names
        events += self._learn(look, pairs, weights, new)
        return UpdateReport(
            look.valid_us, names, existence, rows, cols, found.pairs, new, found.unclaimed - new, tuple(events),
            is_scan=True, is_exact=found.is_exact and not pairs.is_limited,
        )  # fmt: skip

    def _detection(self, sensor: WorldSensor) -> tuple[Floats, Floats]:
        position = self.table.gaussian.get(POSITION)
        if position is None or sensor.view_m is None:
            count = len(self.table)
            return np.full(count, sensor.detects), np.full(count, sensor.false_alarm)
        return detection(sensor, position.mean[:, :2], position.covariance[:, :2, :2])

    def _of_relations(self, look: EncodedLook, rows: Indices, cols: Indices) -> Floats:
        """(E,) log likelihood of the relations that were reported."""
        found = np.zeros(len(rows))
        if self.model.relations and any(look.relations):
            places = self.table.rows()
            for col, reported in enumerate(look.relations):
                which = np.flatnonzero(cols == col)
                for each in (one for one in reported if one.other in places):
                    likelihood = self._relations.likelihood(each, places, look.valid_us)
                    with np.errstate(divide="ignore"):  # an instance without this attribute cannot give the report
                        found[which] += np.log(likelihood[rows[which]])
        return found

    def _prior_of_relations(self, look: EncodedLook) -> Floats:
        """(M,) log likelihood of the relations that were reported, of something that is not known yet."""
        if not any(look.relations):
            return np.zeros(look.size)
        known = set(self.table.names)
        of_new = [
            prod(self._relations.of_new(each) for each in reported if each.other in known)
            for reported in look.relations
        ]
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(np.array(of_new)), np.float64)

    def _learn(self, look: EncodedLook, pairs: Pairs, weights: Floats, new: Floats) -> list[LifeEvent]:
        """Update what was observed with these weights (E,), bear what is new (M,), and decide."""
        table, active = self.table, np.flatnonzero(weights > _ACTIVE)
        rows, cols, weights = pairs.rows[active], pairs.cols[active], weights[active]
        for name, measured in pairs.measured.items():
            if measured.which is None:
                table.gaussian[name].update(rows, weights, measured.innovations.chosen(active))
            else:
                of_active, of_measured = np.intersect1d(active, measured.which, return_indices=True)[1:]
                table.gaussian[name].update(
                    rows[of_active], weights[of_active], measured.innovations.chosen(of_measured)
                )
        for name, likely in look.categorical.items():
            table.categorical[name].update(rows, cols, weights, likely.likelihood)
        known, before = set(table.names), len(table)
        born, events = self._bear(look, new)
        if self.model.relations and any(look.relations):
            unknown = {each.other for reported in look.relations for each in reported} - known
            events += [self._told(look.valid_us, UNKNOWN, f"no instance {each}") for each in sorted(unknown)]
            of_born = zip(range(before, before + len(born)), born.tolist(), np.ones(len(born)).tolist(), strict=True)
            of_known = zip(rows.tolist(), cols.tolist(), weights.tolist(), strict=True)
            events += self._relations.update(
                (
                    (table.names[row], weight, each)
                    for row, col, weight in (*of_known, *of_born)
                    for each in look.relations[col]
                    if each.other in known
                ),
                look.valid_us,
            )
        events += table.decide(look.valid_us)
        ended = table.existence < self.model.thresholds.delete
        if ended.any():
            events += self._delete(ended, np.full(len(table), look.valid_us), table.existence)
        return self._existing(events)

    def _bear(self, look: EncodedLook, new: Floats) -> tuple[Indices, list[LifeEvent]]:
        """Make tentative instances of observations that are probably new; returns these, and the events."""
        cols = np.flatnonzero(new > self.model.thresholds.create)
        events: list[LifeEvent] = []
        room = self.model.limits.instances - len(self.table)
        if len(cols) > room:
            cols = np.sort(cols[np.argsort(-new[cols], kind="stable")[: max(0, room)]])
            because = f"there are {self.model.limits.instances} instances, as many as are allowed"
            events.append(self._told(look.valid_us, LIMITED, because))
        if not len(cols):
            return cols, events
        first = len(self.table)
        names = self.table.bear(look, cols, np.clip(new[cols], _LEAST, _MOST))
        events += [self.table.event(look.valid_us, CREATED, first + place) for place in range(len(names))]
        return cols, events


def _ratios(log_pairs: Floats, cols: Indices, other: Floats) -> Floats:
    """(E,) weights of pairs next to those of births and clutter (M,); where these are 0, the likeliest pair has 1e100."""
    with np.errstate(divide="ignore"):
        log_other = np.log(other)
    likeliest = np.full(len(other), -inf)
    np.maximum.at(likeliest, cols, log_pairs)
    log_other = np.where(
        np.isfinite(log_other), log_other, np.where(np.isfinite(likeliest), likeliest, 0.0) + log(FAINTEST)
    )
    return np.exp(np.minimum(log_pairs - log_other[cols], -2.5 * log(FAINTEST)))
