"""Declarations of a specification beyond its platform's own instance: exports, imports, monitors over other units.

An exported stream is a generator under the label that this platform has for the semantic label, so that a client that asks
for it, queries it or monitors it finds it where every other stream is found. An imported stream is asked for like the
inputs of monitors are (thesis 9.4.1).
"""

from collections.abc import Iterable, Mapping
from functools import lru_cache, partial
from typing import Any, Final

from dyknow import Label, Policy, Sample
from dyknow.agents.effects import Fed, FedTogether, HostCame, HostEvent, HostLeft, HostMessage, Specify, Tell, Waited
from dyknow.agents.exchange.export_proxy import ExportProxy
from dyknow.agents.exchange.import_proxy import ImportProxy
from dyknow.agents.exchange.imported import ImportDemand, Imported, converting
from dyknow.agents.exchange.label_agreements import LabelAgreements, Restriction, stream_offer
from dyknow.agents.exchange.local_instance import LocalInstance
from dyknow.agents.exchange.subscription_keeper import SubscriptionKeeper
from dyknow.agents.hosts.host_desk import HostDesk
from dyknow.agents.monitoring.monitor_plans import MonitorPlan, PlanBook, declared_profile
from dyknow.agents.monitoring.monitors import UnitMonitors
from dyknow.agents.monitoring.unit_monitoring import UnitMonitoring
from dyknow.agents.monitoring.unit_streams import UnitStreams
from dyknow.agents.part import Followed, Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.specification.options import RunOptions
from dyknow.federation.members.liveness import Departure, PlatformAppeared, PlatformGone
from dyknow.federation.members.offers import Service
from dyknow.federation.messages.descriptions import LabelEntry
from dyknow.kpl import Hooks, Instance, Specification, parse_specification, print_declaration
from dyknow.kpl.checking.needs import domains_of
from dyknow.kpl.checking.symbols import OF_A_PLATFORM
from dyknow.kpl.checking.warnings import run_warnings
from dyknow.kpl.introspection.governor import Governor
from dyknow.kpl.introspection.graph import maker_of, origins_of
from dyknow.kpl.introspection.records import FaultLog, alarm_record, found_record, producer_record, sample_record
from dyknow.kpl.running.asking import features_of
from dyknow.kpl.running.formula_states import PREDICTED
from dyknow.kpl.running.ports import Undo, nothing
from dyknow.kpl.syntax.specification import CALLED, Export, Import, MonitorDeclaration, StreamTerm
from dyknow.model.errors import Refused, SourceText, TextError, TextErrors, Unmade
from dyknow.model.semantic_labels import SemanticLabel
from dyknow.network.process import Input
from dyknow.network.refinement import RefinementProcess
from dyknow.reasoning import AlarmEvent
from dyknow.reasoning.features.derivation import FeatureInput
from dyknow.reasoning.formulas.tree import Formula, split_growing

SPECIFICATION: Final = Service("specification", "gateway")
OWNER = "specification"
PERIOD_US = 100_000
MAX_DELAY_US = 1_000_000
LONGEST_NAME = 64  # of a monitor, which other platforms see


@lru_cache(maxsize=4)
def read(text: str, named: tuple[tuple[str, str], ...] = ()) -> Specification:
    """Parse a specification and the files it names; it is read before it is handed over, so that the node need not.

    Raises:
        TextError: something is wrong with it.
    """
    texts = dict(named)

    def read_file(path: str) -> str:
        if path not in texts:
            raise FileNotFoundError("it does not come with the specification")
        return texts[path]

    return parse_specification(text, read_file)


class SpecificationPart(Part):
    """The specification of one platform.

    Args:
        keeper: brings the streams of other units.
        offer: tells the directory that the labels of this part have changed, at a time.
        now_us: the node clock of the present step.
        on_alarm: called with the alarms of its monitors.
        emit, note: take effects, and words for users.

    Attributes:
        instance: the running specification, which it can print.
        desk: the operating system processes that offer to make some of it.
        not_taken: the operator's last specification, if it was refused: a host may yet offer its missing prototypes.
    """

    takes = {  # noqa: RUF012  (a declaration)
        Specify: "on_specify", Fed: "on_fed", FedTogether: "on_fed_together", Waited: "on_waited",
        HostCame: "on_host", HostMessage: "on_host", HostLeft: "on_host",
    }  # fmt: skip

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._config, self._unit, self._clock = ports.config, ports.config.unit, ports.config.clock
        self._agent = ports.agent
        self._network, self._translation, self._source = ports.network, ports.translation, parts[LocalInstance].source
        self._monitors = parts[UnitMonitors.of]
        self._agreements, self._importer = parts[LabelAgreements], parts[ImportProxy]
        self._ontology = ports.translation.ontology
        self._plans, self._exporter, self._ports = parts[PlanBook.of], parts[ExportProxy.of], ports
        self._keeper, self._offer, self._now_us = parts[SubscriptionKeeper], ports.offer, ports.now_us
        self._emit, self._note = ports.emit, ports.note
        self._followed: Followed = (self, parts[UnitMonitoring], parts[LocalInstance])
        self._exported: dict[str, LabelEntry] = {}
        self._faults = FaultLog(ports.note)
        ontology = ports.config.ontology
        units = self._units = UnitStreams(
            ports.config.unit,
            ports.translation,
            parts[UnitMonitors.of],
            self._on_feature_input,
            lambda: self.instance.parts.objects,
        )
        self.instance = Instance(
            ports.network,
            unit=ports.config.unit,
            sorts=ontology.sorts(),
            semantic={label.name: label for label in ontology.definitions()},
            catalogue=ports.config.catalogue,
            hooks=Hooks(
                self._on_output,
                self._on_link,
                ports.on_alarm,
                lambda event: self._tell(found_record(event)),
                self._faults.on_fault,
                self._on_producer,
            ),
            federation=self,
            admission=ports.config.options[RunOptions].admit,
            features=units,
            is_unit=units.is_unit,
            roads=ports.config.roads,
            frame=None if ports.config.cameras is None else ports.config.rig.frame,
        )
        self.desk = HostDesk(self.instance, ports.config.clock, ports.note, ports.config.monotonic_offset_us)
        self._waited_us = 0
        self._governor: Governor | None = None
        self.not_taken: Specify | None = None
        self._given: Specification = ()
        self._met, self._absent = set[str](), set[str]()

    def on_specify(self, event: Specify, now_us: int) -> None:
        """The operator of this platform gives it a specification. Node clock."""
        self._specify(event, self._clock.federation_us(now_us))

    def on_fed(self, event: Fed, now_us: int) -> None:
        """A source that is fed from outside has a sample. Node clock."""
        now_us = self._clock.federation_us(now_us)
        self.instance.push(event.source, Sample(now_us, event.valid_us, event.value, event.quality))

    def on_fed_together(self, event: FedTogether, now_us: int) -> None:
        """Sources that are fed from outside have samples of one instant. Node clock."""
        with self.instance.network.instant.whole():
            for each in event.samples:
                self.on_fed(each, now_us)

    def _specify(self, given: Specify, now_us: int) -> None:
        """Become this specification; if it is wrong, report that and keep the previous one. Federation time."""
        self._faults.clear()
        self._govern(now_us)
        self.not_taken = None
        text, others = SourceText(given.text, given.file), set(self.instance.specification).difference(self._given)
        try:
            self.instance.change(read(text, given.named), now_us, text)
        except TextError as wrong:
            self.not_taken = given
            runs, awaits = bool(self.instance.specification), _awaited(wrong)
            record = {"file": text.file, "said": wrong.drawn(), "runs": runs, "awaits": awaits}
            self._tell({"event": "not-specified", **record})
            until = f" until a host offers {', '.join(awaits[:8])} (dyknow host MODULE --unit {self._unit})"
            before = "the previous one keeps running" if runs else "none runs"
            self._note(f"specification rejected{until if awaits else ''}; {before}:\n{wrong.drawn()}")
            return
        imports = [[each.semantic, each.unit] for each in self.instance.specification if isinstance(each, Import)]
        declarations, exports = len(self.instance.specification), sorted(self._exported)
        self._tell(
            {
                "event": "specified",
                "file": text.file,
                "declarations": declarations,
                "exports": exports,
                "imports": imports,
            }
        )
        self._given = self.instance.specification
        lost = [print_declaration(each) for each in others.difference(self._given)]
        if lost:
            self._note(
                f"{text.file or 'this specification'} replaces what other members had added: {'; '.join(sorted(lost)[:8])}"
            )
        for warning in self.warn(text, now_us):
            self._note(warning.drawn())
        for name, labels in self.instance.lacking.items():
            self._note(f"no host offers {name} yet; {', '.join(map(str, labels[:8]))} start when one does")

    def warn(self, text: str, now_us: int) -> list[TextError]:
        """Warnings for users about the running specification; `text` is its newest source. Federation time."""
        return run_warnings(self.instance.specification, self.instance.current_symbols(), text, now_us)

    def _govern(self, now_us: int) -> None:
        """A governor, if there is to be one: before the first specification, which may name what it tells."""
        limit_us = self._config.options[RunOptions].govern_us
        if self._governor is None and limit_us is not None:
            self._governor = Governor(self.instance, lambda: self._waited_us, now_us, limit_us)

    def on_waited(self, event: Waited, now_us: int) -> None:
        """How long this process has waited for something to do: the governor looks. Node clock."""
        self._waited_us = round(event.waited_us * self._clock.speed)
        federation_us = self._clock.federation_us(now_us)
        self._govern(federation_us)
        if self._governor is not None:
            self._governor.on_time(federation_us)

    def on_host(self, event: HostEvent, now_us: int) -> Followed:
        """A host came, sent something or left. Node clock."""
        before = len(self.desk.hosts)
        self.desk.on_event(event, now_us)
        if self.not_taken is not None and len(self.desk.hosts) > before:
            self._specify(self.not_taken, self._clock.federation_us(now_us))  # it may have waited for this host
        return self._followed

    def on_peer(self, change: PeerChange, now_us: int) -> None:  # noqa: ARG002  (as every part)
        """Note that a platform goes that the specification lives on, and that it is back."""
        match change:
            case PlatformGone(unit, _, why) if why is not Departure.RESTARTED and self._lives_on(unit):
                self._absent.add(unit)
                self._note(f"platform {unit} has left" if why is Departure.LEFT else f"platform {unit} is gone ({why})")
            case PlatformAppeared(unit, _, "uav"):
                if unit in self._absent:
                    self._note(f"platform {unit} is back")
                self._absent.discard(unit)
                self._met.add(unit)

    def _lives_on(self, unit: str) -> bool:
        """Whether the specification imports from the platform, or watches it."""
        if any(isinstance(each, Import) and each.unit == unit for each in self.instance.specification):
            return True
        return unit in self._met and any(
            OWNER in each.owners and each.plan.grows for each in self._monitors.named.values()
        )

    def labels(self) -> Iterable[LabelEntry]:
        """The semantic labels that are exported."""
        return tuple(self._exported.values())

    @property
    def is_owing(self) -> bool:
        return self.desk.is_owing

    @property
    def deadline_us(self) -> int | None:
        return self.desk.deadline_us

    def on_time(self, now_us: int) -> None:
        self.desk.on_time(now_us)

    def flush(self) -> None:
        """Messages for hosts travel together at the end of a step."""
        for effect in self.desk.flush():
            self._emit(effect)

    # Services of the federation for `Instance`

    def define(self, label: SemanticLabel) -> Undo:
        """A semantic label of our own; raises Refused if it means something else here."""
        if not self._agreements.define(label, self._now_us()):
            return nothing

        def undo() -> None:
            self._importer.forget(label.name)
            self._agreements.withdraw(label.name, self._now_us())

        return undo

    def export(self, declaration: Export, term: StreamTerm) -> Undo:
        """Offer a stream under a semantic label; raises Refused if a stream of the vehicle has it."""
        network, translation, semantic = self._network, self._translation, declaration.semantic
        local = translation.local_label(semantic, self._unit)
        entry = self._ontology[semantic]
        promised = stream_offer(declaration.cost, term.policy)
        restriction = Restriction(declaration.visibility, declaration.receivers, term.label, promised)
        self._agreements.restrict(semantic, restriction)
        if declaration.visibility != "private":
            self._exported[semantic] = LabelEntry(
                label=semantic,
                sort=entry.sort.name,
                type_hash=entry.type_hash,
                period_us=term.policy.sample_us or 0,
                receivers=declaration.receivers,
                cost=declaration.cost,
            )
        self._exporter.rank(semantic, term.policy.importance)
        if local == term.label and term.policy == Policy():
            self._offer(self._now_us())
            return partial(self._withdraw, semantic)
        if network.has(local):
            self._exported.pop(semantic, None)
            self._agreements.restrict(semantic, None)
            raise Refused(f"{semantic} is the stream {local} here already, made by another; export that one", "taken")
        unit = converting(entry.sort, translation.to_local(semantic))
        network.add_process(
            local, translation.local_sort(semantic), RefinementProcess(unit, [Input(term.label, term.policy)])
        )

        def undo() -> None:
            network.remove(local)
            self._withdraw(semantic)

        self._offer(self._now_us())
        return undo

    def import_(self, semantic: str, unit: str, term: StreamTerm) -> Undo:
        """Have a unit's stream under a label of our own; it is asked for while it has a subscriber here."""
        if unit == CALLED:
            return self._ports.call(semantic, term.label, term.policy)
        if unit == self._unit:
            raise Refused(f"import {semantic} from {unit}: that is this platform; use its stream itself", "own-stream")
        policy = term.policy
        delay_us = MAX_DELAY_US if policy.max_delay_us is None else policy.max_delay_us
        need = (semantic, policy.sample_us or PERIOD_US, delay_us)
        local, to_semantic = self._source(semantic, unit)
        network, tell = self._network, partial(self._need, unit, need)
        if local == term.label:
            return ImportDemand(network.generator(local), tell).stop
        entry = self._ontology[semantic]
        imported = Imported(converting(entry.sort, to_semantic), Input(local, policy), tell)
        network.add_process(term.label, entry.sort, imported)
        return partial(network.remove, term.label)

    def monitor(self, declaration: MonitorDeclaration, formula: Formula) -> tuple[Undo, bool]:
        """Know it by its name, for tasks; monitor pairs of units by the quickest way.

        Returns how to forget it, and whether the instance has to run it: the formula is not over derived features alone.
        """
        if len(declaration.name) > LONGEST_NAME:
            raise Refused(
                f"monitor: a name of at most {LONGEST_NAME} characters, got {len(declaration.name)}", "too-long"
            )
        features, others = features_of(self.instance, formula)
        split = split_growing(formula)
        if split is not None and split[1].base != OF_A_PLATFORM:
            split = None
        named = domains_of(formula if split is None else split[2])
        in_instance = not features or bool(others) or bool(named) or self._units.are_objects(formula)
        if features and declaration.policy.predict_us is not None:
            raise Refused(f"{min(features)} changes along no straight line: compare {PREDICTED}", "not-supported")
        if declaration.starts_avoidance and (in_instance or split is None):
            name, over = declaration.name, "xy_dist[self, other], z_dist[self, other], ..."
            text = f"{name} starts avoidance, so it is about pairs of platforms: write it as always forall other in "
            raise Refused(f"{text}units - {{self}} growing: ... of {over}", "not-supported")
        profile = declared_profile(declaration, sorted(features))
        if in_instance or split is None:
            plan = MonitorPlan(profile, formula, None, in_instance)
        else:
            plan = MonitorPlan(profile, split[2], split[0])
        forget = self._plans.declare(plan)
        try:
            self._monitors.create(plan, OWNER, self._network.now_us)
        except Refused:
            forget()
            raise
        self._keeper.wake(self._now_us())

        def undo() -> None:
            forget()
            self._monitors.remove(declaration.name, OWNER)

        return undo, in_instance

    def _withdraw(self, semantic: str) -> None:
        self._exporter.rank(semantic, 1.0)
        self._exported.pop(semantic, None)
        self._agreements.restrict(semantic, None)
        self._offer(self._now_us())

    def _on_feature_input(self, needed: FeatureInput, wanted: bool) -> None:
        """An input of a derived feature is needed of another unit, or no longer."""
        self._need(needed.unit, (needed.label, PERIOD_US, MAX_DELAY_US), wanted)

    def _need(self, unit: str, need: tuple[str, int, int], wanted: bool) -> None:
        self._keeper.need(unit, need, self._now_us(), wanted=wanted)

    def _tell(self, record: Mapping[str, Any]) -> None:
        self._emit(Tell(record))

    def _on_output(self, name: str, sample: Sample) -> None:
        origins = origins_of(self.instance, name, sample.valid_us)
        self._tell(sample_record(name, sample, origins, maker_of(self.instance, name, sample)))

    def _on_link(self, name: str, linked: bool) -> None:
        self._tell({"event": "stream", "stream": name, "linked": linked})

    def _on_producer(self, label: Label, producer: Label | None) -> None:
        self._tell(producer_record(label, producer, self._network.now_us))

    def on_alarm(self, event: AlarmEvent, _now_us: int) -> None:
        """An alarm of a monitor that the specification declares is reported with its other output."""
        named = self._monitors.named.get(event.monitor)
        if event.monitor not in self.instance.monitors and (named is None or OWNER not in named.owners):
            return
        self._tell(alarm_record(event))


def _awaited(wrong: TextError) -> list[str]:
    """The labels that a host might yet offer, if nothing else is wrong."""
    errors = wrong.errors if isinstance(wrong, TextErrors) else (wrong,)
    labels = [each.label for each in errors if isinstance(each, Unmade)]
    return list(dict.fromkeys(labels)) if len(labels) == len(errors) else []
