"""The DyKnow Federation Agent: exports on request, and takes what others export (thesis 9.3.3).

Queries are answered by `dyknow.agents.exchange.stream_queries`. Times are the node clock, but for valid and available
times.
"""

from collections.abc import Iterable
from dataclasses import asdict

from dyknow import US_PER_S, Policy
from dyknow.agents.actions import FEDERATION, INFORMED, QUERIED, Action, Offer, Role
from dyknow.agents.admission.limits import STREAMS_PER_PEER
from dyknow.agents.exchange.gateway import Gateway, stream_policy
from dyknow.agents.exchange.label_agreements import LabelAgreements
from dyknow.agents.part import Followed, Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.tasks.life import TaskLife
from dyknow.agents.tasks.requests import CREATE_MULTICAST, STOP_MULTICAST
from dyknow.agents.tasks.task import Task
from dyknow.federation import keys
from dyknow.federation.members.imports import ImportRecord
from dyknow.federation.members.liveness import Departure, PlatformAppeared, PlatformGone, PlatformReturned
from dyknow.federation.members.offers import DefinitionsChanged, LabelAppeared, LabelGone
from dyknow.federation.messages import contents
from dyknow.federation.messages.acts import Act
from dyknow.federation.sharing.exports import ContractEnded, EndReason, ExportEvent
from dyknow.federation.transport import Asked, DeclareQueryable
from dyknow.model.errors import DyknowError, Refused

IMPORTS_A_PAGE = 200


class FederationAgent(Part):
    """One platform's side of the DyKnow federation service: its contracts, and the streams announced to it."""

    offers = (
        Offer(
            FEDERATION,
            (
                CREATE_MULTICAST,
                STOP_MULTICAST,
                Action(contents.ImportList, "on_import_list", QUERIED, Role.OBSERVER),
                Action(contents.Stream, "on_stream", INFORMED),
                Action(contents.EndStream, "on_end_stream", INFORMED),
            ),
        ),
    )
    takes = {keys.HistoryKey: "on_asked"}  # noqa: RUF012  (a declaration)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._clock = ports.clock
        self._unit, self._agent, self._directory = ports.unit, ports.agent, ports.directory
        self._agreements = parts[LabelAgreements]
        self._gateway, self._tasks, self._emit = parts[Gateway.of], parts[TaskLife], ports.emit
        self._exporter, self._exports = parts[Gateway.of].exporter, parts[Gateway.of].exporter.exports

    # -- exports -----------------------------------------------------------------------------------------------

    def on_create_multicast(self, act: Act, content: contents.CreateMulticast, now_us: int) -> None:
        """`(create-multicast ...)`: export until cancelled, until `to`, or until the last receiver is gone.

        Raises:
            UnknownLabel, Refused, PolicyError
        """
        for label in content.semantic_labels:
            if self._agreements.offer_of(label) is not None:
                raise Refused(f"{label} is offered at a cost here: call for it", "offered")
        self.set_up(act, content, contents.CreateMulticast.head, now_us)
        self._agent.done(act, now_us)

    def set_up(self, act: Act, content: contents.CreateMulticast, name: str, now_us: int) -> None:
        """Export as a task of that name, which is of the conversation of `act`.

        Raises:
            UnknownLabel, Refused, PolicyError: nothing is set up then.
        """
        owner = self._tasks.check_free(act.conversation_id, act.sender.unit)
        sender = act.sender.unit
        share_of = self._agent.acts.share_of
        wanted, (requester, shares) = self._tasks.all(), share_of(sender)
        held = sum(len(each.contracts) for each in wanted if share_of(each.initiator).owner == requester)
        most = STREAMS_PER_PEER * shares
        if held + len(content.semantic_labels) > most:
            text = f"this platform exports {held} streams for {requester}; {most} are the most"
            raise Refused(text, "too-many-subscriptions")
        contracts = self.export(content, owner, now_us)
        entry = self._directory.entry(sender)
        is_part = entry is not None and entry.kind == "uav"
        task = Task(owner, sender, name, lambda _at_us: (), since_us=now_us, is_part=is_part)
        task.contracts.update(zip(contracts, dict.fromkeys(content.semantic_labels), strict=True))
        all_of_it = tuple(contracts)

        def take_down(at_us: int) -> tuple[str, ...]:
            self.end_exports(all_of_it, at_us)
            return ()

        task.take_down = take_down
        self._tasks.add(task)

    def on_stop_multicast(self, act: Act, content: contents.StopMulticast, now_us: int) -> None:
        """`(stop-multicast ...)`: end what `create-multicast` set up; the task ends with its last stream.

        Raises:
            Refused: there is no such export that the requester may end.
        """
        labels = set(content.semantic_labels)

        def fits(task: Task) -> bool:
            return not labels.isdisjoint(task.contracts.values()) and content.task in {None, task.conversation}

        for task in self._tasks.endable(act, f"an export of {', '.join(sorted(labels))}", fits):
            for contract in [contract for contract, label in task.contracts.items() if label in labels]:
                self._stop(contract, now_us, content.to_units)
                if not self._exports.has(contract):
                    del task.contracts[contract]
            if not task.contracts:
                self._tasks.end(task, act.sender.unit, now_us)
        self._agent.done(act, now_us)

    def export(self, content: contents.CreateMulticast, owner: str, now_us: int) -> list[str]:
        """Export the labels to the units, for `owner`, and notify each receiver; returns the contracts.

        Raises:
            UnknownLabel, Refused, PolicyError: nothing is set up then.
        """
        policy = stream_policy(content.sample_period_s, content.delay_s, content.from_us, content.to_us)
        labels = tuple(dict.fromkeys(content.semantic_labels))
        receivers = self._agreements.receiving([unit for unit in content.to_units if unit != self._unit], labels)
        contracts = [f"{owner}.{label}.{policy.content_hash()}" for label in labels]
        try:
            for label, contract in zip(labels, contracts, strict=True):
                self._gateway.create_stream_multicast(label, policy, receivers, contract)
        except DyknowError:
            for contract in contracts:  # no receiver has been notified yet
                self._exporter.on_events(self._exports.stop(contract, now_us))
            raise
        announced = contents.Stream(
            owner=self._unit, semantic_labels=labels, policy=str(policy), hash=policy.content_hash()
        )
        for unit in receivers:
            self._agent.tell(unit, announced, now_us)
        return contracts

    def end_exports(self, contracts: Iterable[str], now_us: int) -> None:
        """These contracts are needed no more."""
        for contract in contracts:
            self._stop(contract, now_us)

    def _stop(self, contract: str, now_us: int, receivers: Iterable[str] | None = None) -> None:
        self._on_exports(self._exports.stop(contract, now_us, receivers), now_us)

    def _on_exports(self, events: Iterable[ExportEvent], now_us: int) -> None:
        """Notify the receivers whom no other contract brings the stream; a task that has run out is over."""
        for contract in self._exporter.on_events(events):
            if contract.why is not EndReason.STOPPED:
                self._run_out(contract, now_us)
            ended = contents.EndStream(
                owner=self._unit,
                semantic_labels=(contract.label,),
                hash=contract.policy_hash,
                reason=contract.why,
            )
            still = self._exports.receivers(contract.label, contract.policy_hash)
            for unit in contract.receivers:
                if unit not in still and self._directory.is_present(unit):
                    self._agent.tell(unit, ended, now_us)

    def _run_out(self, contract: ContractEnded, now_us: int) -> None:
        """One stream of a task is over without having been cancelled: the task is, when its last one is."""
        task = self._tasks.get(contract.contract.removesuffix(f".{contract.label}.{contract.policy_hash}"))
        if task is not None:
            self._end_without_contract(task, contract.contract, contract.why, now_us)

    # -- peers, time, recovery ---------------------------------------------------------------------------------

    def start(self, _now_us: int) -> None:
        self._emit(DeclareQueryable(keys.history_expr(self._unit)))

    def on_asked(self, event: Asked, _now_us: int) -> Followed:
        """A receiver asks for samples that it lost."""
        key = keys.parse_key(event.key)
        if isinstance(key, keys.HistoryKey):
            for effect in self._exports.on_asked(event, key.label):
                self._emit(effect)
        return None

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """Receivers come and go: their streams continue for as long as a cut may last."""
        match change:
            case PlatformAppeared():
                self._on_exports(self._exports.receiver_appeared(change.unit, change.boot, now_us), now_us)
            case PlatformReturned():
                self._exports.receiver_back(change.unit)
            case PlatformGone() if change.why is Departure.RESTARTED:
                self._on_exports(self._exports.receiver_restarted(change.unit, now_us), now_us)
            case PlatformGone():
                self._exports.receiver_gone(change.unit, now_us, change.boot)
            case DefinitionsChanged() | LabelAppeared() | LabelGone() if change.unit == self._unit:
                self._end_refused(None, now_us)
            case DefinitionsChanged():
                self._end_refused(change.unit, now_us)

    def _end_refused(self, unit: str | None, now_us: int) -> None:
        """End the streams that a unit, or any, may have no longer: it is not meant, or means something else."""
        for task in self._tasks.all():
            for contract, label in list(task.contracts.items()):
                having = self._exports.receivers(label, contract.rpartition(".")[2])
                reasons = {each: self._agreements.refusal(each, label) for each in having if unit in {each, None}}
                refused = {each: str(why) for each, why in reasons.items() if why is not None}
                if refused:
                    self._stop(contract, now_us, refused)
                    self._end_without_contract(task, contract, next(iter(refused.values())), now_us)

    def _end_without_contract(self, task: Task, contract: str, why: str, now_us: int) -> None:
        """The stream of a task may be over; the task is, when its last one is."""
        if contract not in task.contracts or self._exports.has(contract):
            return
        del task.contracts[contract]
        if not task.contracts:
            self._tasks.forget(task.conversation)
            self._agent.end(task.conversation, task.initiator, why, now_us)

    @property
    def is_owing(self) -> bool:
        return self._exporter.pending

    @property
    def deadline_us(self) -> int | None:
        return 0 if self._exporter.pending else self._exports.deadline_us

    def on_time(self, now_us: int) -> Followed:
        """Put the samples that wait, and end contracts whose time is over."""
        ended = self._exports.on_time(now_us)
        self._on_exports(ended, now_us)
        self._exporter.flush()
        return None if ended else ()

    # -- imports -----------------------------------------------------------------------------------------------

    def on_stream(self, act: Act, content: contents.Stream, now_us: int) -> None:
        """A platform announces a stream of its own to us.

        Raises:
            Refused: it is not its own, or not what its hash says. PolicyError, TextError
        """
        if content.owner != act.sender.unit:
            raise Refused(f"{act.sender.unit} announces a stream of {content.owner}", "not-its-stream")
        policy = Policy.parse(content.policy)
        if policy.content_hash() != content.hash:
            raise Refused(
                f"the hash of {content.policy!r} is {policy.content_hash()}, not {content.hash}", "wrong-hash"
            )
        for label in content.semantic_labels:
            self._gateway.importer.expect(content.owner, label, content.hash, policy, now_us)

    def on_end_stream(self, act: Act, content: contents.EndStream, _now_us: int) -> None:
        """A platform ends a stream of its own; raises Refused if it is another's."""
        if content.owner != act.sender.unit:
            raise Refused(f"{act.sender.unit} ends a stream of {content.owner}", "not-its-stream")
        for label in content.semantic_labels:
            self._gateway.importer.end(content.owner, label, content.hash)

    def on_import_list(self, act: Act, _content: contents.Content, now_us: int) -> None:
        """`(import-list)`: which streams come in, and what became of their samples: gaps show here."""
        records = self._gateway.importer.imports.streams.values()
        imports = [
            contents.ImportCounts(
                owner=stream.owner,
                semantic_label=stream.label,
                hash=stream.policy_hash,
                missing=stream.missing,
                every=record.every,
                delay_s=self._delay_s(record),
                **asdict(stream.account),
            )
            for record in records
            for stream in (record.stream,)
        ]
        self._agent.answer_pages(
            act,
            imports,
            IMPORTS_A_PAGE,
            lambda page, more: contents.ImportList(imports=page, more=more),
            now_us,
        )

    def _delay_s(self, record: ImportRecord) -> float | None:
        """From the valid time of the newest sample to its arrival."""
        if record.valid_us is None:
            return None
        return max(0, self._clock.federation_us(record.heard_us) - record.valid_us) / US_PER_S
