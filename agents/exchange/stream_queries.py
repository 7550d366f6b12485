"""Queries for values of streams: latest, at a time, between two, or by number (thesis 5.3.2); here, or of all platforms
(9.3.3, 9.3.4).

Times are the node clock, but for valid and available times.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from dyknow import NO_VALUE, Label, NoValue, Sample, Sort, Value, as_json
from dyknow.agents.actions import FEDERATION, QUERIED, Action, Offer, Role
from dyknow.agents.admission.trusted import PlatformTrust
from dyknow.agents.exchange import readings
from dyknow.agents.exchange.dormant import DormantStreams, PendingQuery, StreamQuery
from dyknow.agents.exchange.gateway import PAGE, Gateway
from dyknow.agents.exchange.label_agreements import LabelAgreements
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.members.directory import DirectoryEntry
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import (
    MAX_LIST,
    Answers,
    Content,
    Missing,
    Query,
    QueryStream,
    Reading,
    Reason,
    Samples,
    StreamSamples,
)
from dyknow.federation.messages.rounds import Round
from dyknow.model.errors import DyknowError, ValueNotAvailable
from dyknow.model.values import LARGEST

GLOBAL_WITHIN_US = 1_500_000
LONGEST_VALUE = 1024


@dataclass(slots=True)
class Gathering:
    """A global query under way: the units whose answers are awaited, and the answers so far."""

    act: Act
    query: Query
    round: Round[str]
    answers: dict[str, list[Reading]] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)


class StreamQueries(Part):
    """Answers queries from the histories of streams; a query on a dormant stream activates it.

    Args:
        declared: (unit, label as text) -> the stream of the instance that the unit may query; raises DyKnowError.
    """

    offers = (
        Offer(
            FEDERATION,
            (Action(Query, "on_query", QUERIED, Role.OBSERVER), Action(QueryStream, "on_query_stream", QUERIED)),
        ),
    )
    answers = (Samples, StreamSamples, Answers)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._agreements, self._declared, self._trust = parts[LabelAgreements], ports.declared(), parts[PlatformTrust]
        self._unit, self._clock, self._agent, self._directory = ports.unit, ports.clock, ports.agent, ports.directory
        self._gateway = parts[Gateway.of]
        self._dormant = DormantStreams(ports.clock, parts[Gateway.of])

    @property
    def deadline_us(self) -> int | None:
        return self._dormant.deadline_us

    def on_time(self, now_us: int) -> None:
        self._dormant.on_time(now_us)

    def on_query(self, act: Act, query: Query, now_us: int) -> None:
        """`(query ...)`: answered here; a global one when all answered, or the time is over.

        Raises:
            UnknownLabel, Refused, ValueNotAvailable
        """
        self._agreements.check(act.sender.unit, query.semantic_label)
        if query.scope == "global":
            self._ask_everybody(act, query, now_us)
            return
        self._answer(act, query, query.semantic_label, now_us)

    def on_query_stream(self, act: Act, query: QueryStream, now_us: int) -> None:
        """`(query-stream stream: "speed[self]")`: the same of a stream by its own label, whether exported or not.

        Raises:
            TextError, UnknownLabel, Refused, ValueNotAvailable
        """
        self._answer(act, query, self._declared(act.sender.unit, query.stream), now_us)

    def _answer(self, act: Act, query: StreamQuery, label: str | Label, now_us: int) -> None:
        try:
            self._respond(act, query, now_us)
        except ValueNotAvailable:
            waiting = PendingQuery(
                lambda at_us: self._respond(act, query, at_us),
                lambda why, at_us: self._agent.answer(act, Performative.FAILURE, Reason(text=why), at_us),
                self._agent.acts.share_of(act.sender.unit),
            )
            if not self._dormant.activate(query, label, waiting, now_us):
                raise

    def _respond(self, act: Act, query: StreamQuery, now_us: int) -> None:
        label = query.semantic_label if isinstance(query, Query) else self._declared(act.sender.unit, query.stream)

        def page(found: tuple[Reading, ...], more: bool) -> Content:
            if isinstance(query, Query):
                return Samples(unit=self._unit, semantic_label=query.semantic_label, samples=found, more=more)
            return StreamSamples(unit=self._unit, stream=query.stream, samples=found, more=more)

        self._agent.answer_pages(act, self._local(query, label, now_us), PAGE, page, now_us)

    def _local(self, query: StreamQuery, label: str | Label, now_us: int) -> list[Reading]:
        gateway, federation_us = self._gateway, self._clock.federation_us(now_us)
        sort = gateway.sort(label)
        if query.op == "latest":
            found = [gateway.latest(label)]
        elif query.op == "at":
            found = [gateway.at(label, query.at_us or 0, federation_us)]
        elif query.op == "nth":
            found = [gateway.nth_latest(label, query.n or 0)]
        elif query.op == "last":
            found = gateway.last(label, query.n or 0)
        elif query.op == "slice":
            found = gateway.slice(label, query.i or 0, query.j or 0)
        else:
            found = gateway.between(label, query.from_us or 0, query.to_us or 0, federation_us)
        return [_reading(sort, sample) for sample in found]

    def _ask_everybody(self, act: Act, query: Query, now_us: int) -> None:
        local = query.model_copy(update={"scope": "local", "select": None, "merge": None})
        offering = self._directory.search(service=FEDERATION.service)
        among = [entry for entry in offering if entry.unit != self._unit]
        kept = {entry.unit for entry in among if not _may_have(entry, query.semantic_label, act.sender.unit)}
        others = [entry.unit for entry in among if entry.unit not in kept]
        gathering = Gathering(act, query, Round(others))
        gathering.missing.update(
            dict.fromkeys(kept, f"{query.semantic_label} is exported to others, not to {act.sender.unit}")
        )
        self._ask_here(gathering, local, now_us)
        for unit in others:
            self._ask_one(gathering, unit, local, now_us)
        self._conclude(gathering, now_us)

    def _ask_here(self, gathering: Gathering, query: Query, now_us: int) -> None:
        def on_sample(at_us: int) -> None:
            gathering.answers[self._unit] = self._local(query, query.semantic_label, at_us)
            self._answered(gathering, self._unit, "", at_us)

        on_silence = partial(self._answered, gathering, self._unit)
        try:
            gathering.answers[self._unit] = self._local(query, query.semantic_label, now_us)
        except ValueNotAvailable as absent:
            waiting = PendingQuery(on_sample, on_silence, self._agent.acts.share_of(gathering.act.sender.unit))
            if self._dormant.activate(query, query.semantic_label, waiting, now_us):
                gathering.round.ask(self._unit)
            else:
                gathering.missing[self._unit] = str(absent)
        except DyknowError as refused:
            gathering.missing[self._unit] = str(refused)

    def _ask_one(self, gathering: Gathering, unit: str, query: Query, now_us: int) -> None:
        def on_reply(reply: Act, answer: Content | None, at_us: int) -> None:
            if unit not in gathering.round.awaited:
                return
            if isinstance(answer, Samples) and reply.performative is Performative.INFORM:
                gathering.answers.setdefault(unit, []).extend(answer.samples)
                if not answer.more:
                    self._answered(gathering, unit, "", at_us)
            else:
                why = answer.text if isinstance(answer, Reason) else str(reply.performative)
                self._answered(gathering, unit, why, at_us)

        self._agent.delegate(
            unit,
            query,
            now_us,
            performative=Performative.QUERY_REF,
            on_reply=on_reply,
            on_silence=partial(self._answered, gathering, unit),
            reply_within_us=GLOBAL_WITHIN_US,
        )

    def _answered(self, gathering: Gathering, unit: str, missing: str, now_us: int) -> None:
        if gathering.round.answered(unit):
            gathering.missing.update({unit: missing} if missing else {})
            self._conclude(gathering, now_us)

    def _conclude(self, gathering: Gathering, now_us: int) -> None:
        """When no answer is pending, send all readings in pages, an act each; the last names the missing platforms."""
        if gathering.round.awaited:
            return
        query = gathering.query
        merged = merged_reading(
            query, [(reading, self._trust.of(unit)) for unit, found in gathering.answers.items() for reading in found]
        )
        missing = tuple(Missing(unit=unit, reason=reason[:200]) for unit, reason in gathering.missing.items())
        pages = _answer_pages(query.semantic_label, gathering.answers)
        for page in pages[:-1]:
            content = Answers(semantic_label=query.semantic_label, answers=page, more=True)
            self._agent.answer(gathering.act, Performative.INFORM, content, now_us)
        content = Answers(
            semantic_label=query.semantic_label, answers=pages[-1], missing=missing[:MAX_LIST], merged=merged
        )
        self._agent.answer(gathering.act, Performative.INFORM, content, now_us)


def _may_have(entry: DirectoryEntry, label: str, unit: str) -> bool:
    """Whether a platform exports the label to `unit`, for whom this one would ask."""
    receivers = next((each.receivers for each in entry.labels if each.label == label), ())
    return not receivers or unit in receivers


def _reading(sort: Sort, sample: Sample) -> Reading:
    if sample.value is NO_VALUE:
        return Reading(valid_us=sample.valid_us, available_us=sample.available_us, value=NO_VALUE)
    rows = sample.quality.covariance
    stated: dict[str, Any] | None = None
    if len(rows) == len(sort.fields) and all(0.0 <= row[at] <= LARGEST for at, row in enumerate(rows)):
        stated = {field.name: rows[at][at] for at, field in enumerate(sort.fields)}
    return Reading(
        valid_us=sample.valid_us,
        available_us=sample.available_us,
        value={name: _carried(each) for name, each in sort.as_record(sample.value).items()},
        variance=stated,
        **({} if sample.quality.prediction is None else sample.quality.prediction._asdict()),
    )


def _carried(value: Value) -> bool | float | NoValue | str:
    """A value as an act can carry it: sets and records of a sort that is not declared as JSON text."""
    if isinstance(value, bool | int | float | NoValue):
        return value
    text = value if isinstance(value, str) else json.dumps(as_json(value), ensure_ascii=False)
    return text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE - 3]}..."


def _answer_pages(label: str, answers: dict[str, list[Reading]]) -> list[tuple[Samples, ...]]:
    """The answers of each platform, at most PAGE readings a page; `more` is set for one that continues on the next."""
    pages: list[list[Samples]] = [[]]
    room = PAGE
    for unit, found in answers.items():
        at = 0
        while at < len(found) or at == 0:
            if room == 0:
                pages.append([])
                room = PAGE
            part = tuple(found[at : at + room])
            at += max(1, len(part))
            room -= max(1, len(part))
            pages[-1].append(Samples(unit=unit, semantic_label=label, samples=part, more=at < len(found)))
    return [tuple(page) for page in pages]


def merged_reading(query: Query, found: Sequence[tuple[Reading, float]]) -> Reading | None:
    """The one reading that the query asks for, by `select` or `merge`, of readings with how far each is trusted."""
    if query.select == "newest":
        return readings.select_newest(found)
    if query.select == "best":
        return readings.select_best(found)
    if query.merge == "mean":
        return readings.merge_mean(found)
    if query.merge == "inverse-variance":
        return readings.merge_inverse_variance(found)
    return None
