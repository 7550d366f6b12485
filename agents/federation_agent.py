"""The DyKnow Federation Agent: exports on request, and answers queries, its own or everybody's (thesis 9.3.3).

Times are the node clock, but for valid and available times.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from agents import readings
from agents.context import Context
from agents.gateway import PAGE, stream_policy
from agents.limits import STREAMS_PER_PEER
from agents.roused import Rousing
from agents.services import FEDERATION
from agents.tasks import Task
from dyknow import NO_VALUE, Policy, Sample
from dyknow.errors import DyknowError, Refused, ValueNotAvailable
from federation.acts import Act, Performative
from federation.contents import (
    MAX_LIST,
    Answers,
    Content,
    CreateMulticast,
    Done,
    EndStream,
    Missing,
    Query,
    Reading,
    Reason,
    Samples,
    Stream,
)
from federation.exports import ContractEnded, Why

GLOBAL_WITHIN_US = 1_500_000


@dataclass(slots=True)
class Gathering:
    """A global query under way: who still owes an answer, and what came."""

    act: Act
    query: Query
    waiting: set[str]
    answers: dict[str, list[Reading]] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)


class FederationAgent:
    """One platform's side of the DyKnow federation service."""

    def __init__(self, context: Context) -> None:
        self._c = context
        self.rousing = Rousing(context, self._respond)

    # -- exports -----------------------------------------------------------------------------------------------

    def on_create_multicast(self, act: Act, content: CreateMulticast, now_us: int) -> None:
        """`(create-multicast ...)`: export until cancelled, until `to`, or until the last receiver is gone.

        Raises:
            UnknownLabel, Refused, PolicyError
        """
        owner = self._c.tasks.check_free(act.conversation_id)
        asker = act.sender.unit
        held = sum(task.streams for task in self._c.tasks.of(asker))
        if held + len(content.semantic_labels) > STREAMS_PER_PEER:
            raise Refused(f"this platform exports {held} streams for {asker}; {STREAMS_PER_PEER} are the most")
        contracts = self.export(content, owner, now_us)
        entry = self._c.directory.entry(asker)
        self._c.tasks.add(
            Task(
                owner,
                asker,
                "create-multicast",
                lambda at_us: self.end_exports(contracts, at_us),
                since_us=now_us,
                is_part=entry is not None and entry.kind == "uav",
                streams=len(contracts),
            )
        )
        self._c.desk.answer(act, Performative.AGREE, None, now_us)
        self._c.desk.answer(act, Performative.INFORM, Done(), now_us)

    def export(self, content: CreateMulticast, owner: str, now_us: int) -> list[str]:
        """Export the labels to the units, for `owner`, and tell each receiver; returns the contracts.

        Raises:
            UnknownLabel, Refused, PolicyError: nothing is set up then.
        """
        policy = stream_policy(content.sample_period_s, content.delay_s, content.from_us, content.to_us)
        labels = tuple(dict.fromkeys(content.semantic_labels))
        receivers = [unit for unit in content.to_units if unit != self._c.unit]
        contracts = [f"{owner}.{label}.{policy.content_hash()}" for label in labels]
        try:
            for label, contract in zip(labels, contracts, strict=True):
                self._c.gateway.create_stream_multicast(label, policy, receivers, contract)
        except DyknowError:
            self.end_exports(contracts, now_us, is_told=False)
            raise
        told = Stream(owner=self._c.unit, semantic_labels=labels, policy=str(policy), hash=policy.content_hash())
        for unit in receivers:
            self._c.desk.tell(unit, told, now_us)
        return contracts

    def end_exports(self, contracts: Iterable[str], now_us: int, *, is_told: bool = True) -> None:
        """These contracts are needed no more; their receivers know nothing of them yet if that is not `is_told`."""
        exporter = self._c.gateway.exporter
        for contract in contracts:
            ended = exporter.on_events(exporter.exports.stop(contract, now_us))
            if is_told:
                self.on_contracts_ended(ended, now_us)

    def on_contracts_ended(self, ended: Iterable[ContractEnded], now_us: int) -> None:
        """Tell the receivers that no other contract brings the stream, and who asked for what is over by itself."""
        for contract in ended:
            if contract.why is not Why.STOPPED:
                self._run_out(contract, now_us)
            told = EndStream(
                owner=self._c.unit,
                semantic_labels=(contract.label,),
                hash=contract.policy_hash,
                reason=contract.why,
            )
            still = self._c.gateway.exporter.exports.receivers(contract.label, contract.policy_hash)
            for unit in contract.receivers:
                if unit not in still and self._c.directory.is_present(unit):
                    self._c.desk.tell(unit, told, now_us)

    def is_taken_over(self, conversation: str) -> bool:
        """Whether somebody else has asked, too, for all streams that were asked for in a conversation."""
        return self._c.gateway.exporter.exports.is_shared(f"{conversation}.")

    def _run_out(self, contract: ContractEnded, now_us: int) -> None:
        """One stream of a task is over without having been cancelled: the task is, when its last one is."""
        task = self._c.tasks.get(contract.contract.removesuffix(f".{contract.label}.{contract.policy_hash}"))
        if task is None or task.name != "create-multicast":
            return
        task.streams -= 1
        if task.streams <= 0:
            self._c.tasks.forget(task.conversation)
            self._c.desk.end(task.conversation, task.initiator, contract.why, now_us)

    # -- imports -----------------------------------------------------------------------------------------------

    def on_stream(self, act: Act, content: Stream, now_us: int) -> None:
        """A platform announces a stream of its own to us.

        Raises:
            Refused: it is not its own, or not what its hash says. PolicyError, TextError
        """
        if content.owner != act.sender.unit:
            raise Refused(f"{act.sender.unit} announces a stream of {content.owner}")
        policy = Policy.parse(content.policy)
        if policy.content_hash() != content.hash:
            raise Refused(f"the hash of {content.policy!r} is {policy.content_hash()}, not {content.hash}")
        for label in content.semantic_labels:
            self._c.gateway.importer.expect(content.owner, label, content.hash, policy, now_us)

    def on_end_stream(self, act: Act, content: EndStream, _now_us: int) -> None:
        """A platform ends a stream of its own; raises Refused if it is another's."""
        if content.owner != act.sender.unit:
            raise Refused(f"{act.sender.unit} ends a stream of {content.owner}")
        for label in content.semantic_labels:
            self._c.gateway.importer.end(content.owner, label, content.hash)

    # -- queries -----------------------------------------------------------------------------------------------

    def on_query(self, act: Act, query: Query, now_us: int) -> None:
        """`(query ...)`: answered here; a global one when all answered, or the time is over.

        Raises:
            UnknownLabel, Refused, ValueNotAvailable
        """
        if query.scope == "global":
            self._ask_everybody(act, query, now_us)
            return
        try:
            self._respond(act, query, now_us)
        except ValueNotAvailable:
            if not self.rousing.rouse(act, query, now_us):
                raise

    def _respond(self, act: Act, query: Query, now_us: int) -> None:
        for page in self._pages(query, self._local(query, now_us)):
            self._c.desk.answer(act, Performative.INFORM, page, now_us)

    def _local(self, query: Query, now_us: int) -> list[Reading]:
        gateway, federation_us = self._c.gateway, self._c.clock.federation_us(now_us)
        label = query.semantic_label
        if query.op == "latest":
            found = [gateway.latest(label)]
        elif query.op == "at":
            found = [gateway.at(label, query.at_us or 0, federation_us)]
        else:
            found = gateway.between(label, query.from_us or 0, query.to_us or 0, federation_us)
        return [self._reading(label, sample) for sample in found]

    def _reading(self, label: str, sample: Sample) -> Reading:
        sort = self._c.gateway.ontology[label].sort
        if sample.value is NO_VALUE:
            return Reading(valid_us=sample.valid_us, available_us=sample.available_us, value=NO_VALUE)
        variance = self._c.gateway.variance(label, sample)
        stated: dict[str, Any] | None = None
        if variance is not None:
            stated = dict(zip((f.name for f in sort.fields), variance, strict=True))
        return Reading(
            valid_us=sample.valid_us,
            available_us=sample.available_us,
            value=sort.as_record(sample.value),
            variance=stated,
        )

    def _pages(self, query: Query, found: list[Reading]) -> list[Samples]:
        pages = [found[at : at + PAGE] for at in range(0, len(found), PAGE)] or [[]]
        return [
            Samples(
                unit=self._c.unit, semantic_label=query.semantic_label, samples=tuple(page), more=page is not pages[-1]
            )
            for page in pages
        ]

    def _ask_everybody(self, act: Act, query: Query, now_us: int) -> None:
        local = query.model_copy(update={"scope": "local", "select": None, "merge": None})
        offering = self._c.directory.search(service=FEDERATION.service.service)
        others = [entry.unit for entry in offering if entry.unit != self._c.unit]
        gathering = Gathering(act, query, set(others))
        try:
            gathering.answers[self._c.unit] = self._local(query, now_us)
        except (Refused, ValueNotAvailable, DyknowError) as refused:
            gathering.missing[self._c.unit] = str(refused)
        for unit in others:
            self._ask_one(gathering, unit, local, now_us)
        self._conclude(gathering, now_us)

    def _ask_one(self, gathering: Gathering, unit: str, query: Query, now_us: int) -> None:
        def on_reply(reply: Act, said: Content | None, at_us: int) -> None:
            if isinstance(said, Samples) and reply.performative is Performative.INFORM:
                gathering.answers.setdefault(unit, []).extend(said.samples)
                if said.more:
                    return
            else:
                gathering.missing[unit] = said.text if isinstance(said, Reason) else str(reply.performative)
            gathering.waiting.discard(unit)
            self._conclude(gathering, at_us)

        def on_silence(why: str, at_us: int) -> None:
            gathering.missing[unit] = why
            gathering.waiting.discard(unit)
            self._conclude(gathering, at_us)

        self._c.desk.delegate(
            unit,
            query,
            now_us,
            performative=Performative.QUERY_REF,
            on_reply=on_reply,
            on_silence=on_silence,
            reply_within_us=GLOBAL_WITHIN_US,
        )

    def _conclude(self, gathering: Gathering, now_us: int) -> None:
        """When nobody owes an answer: everything that came, a page of readings an act; the last names who is missing."""
        if gathering.waiting:
            return
        query = gathering.query
        merged = merged_reading(query, [reading for found in gathering.answers.values() for reading in found])
        missing = tuple(Missing(unit=unit, reason=reason[:200]) for unit, reason in gathering.missing.items())
        pages = _answer_pages(query.semantic_label, gathering.answers)
        for page in pages[:-1]:
            content = Answers(semantic_label=query.semantic_label, answers=page, more=True)
            self._c.desk.answer(gathering.act, Performative.INFORM, content, now_us)
        content = Answers(
            semantic_label=query.semantic_label, answers=pages[-1], missing=missing[:MAX_LIST], merged=merged
        )
        self._c.desk.answer(gathering.act, Performative.INFORM, content, now_us)


def _answer_pages(label: str, answers: dict[str, list[Reading]]) -> list[tuple[Samples, ...]]:
    """What each platform said, at most PAGE readings to a page; a platform continued on the next says `more`."""
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


def merged_reading(query: Query, found: list[Reading]) -> Reading | None:
    """The one reading that the query asks for, by `select` or `merge`."""
    if query.select == "newest":
        return readings.select_newest(found)
    if query.select == "best":
        return readings.select_best(found)
    if query.merge == "mean":
        return readings.merge_mean(found)
    if query.merge == "inverse-variance":
        return readings.merge_inverse_variance(found)
    return None
