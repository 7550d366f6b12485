"""The graph of an instance: the maker and inputs of each stream, its rate, its delay, and dropped samples.

Figures come from data that is kept anyway, so that they cost nothing without a reader: rate and delay from the last
samples of a history, drops and gaps from the adapters.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from dyknow import Label, Network, PolicyAdapter, Sample
from dyknow.kpl.checking.specifications import LONGEST_CHAIN
from dyknow.kpl.introspection.declared import of_members, units_of_families
from dyknow.kpl.linking.streams import LinkStream
from dyknow.kpl.running.figures import SAMPLE_BYTES, rate_and_delay
from dyknow.kpl.running.formula_monitors import FormulaMonitor
from dyknow.kpl.running.instance import Instance
from dyknow.kpl.running.parts import inputs_taken
from dyknow.kpl.syntax.listing import print_specification
from dyknow.kpl.syntax.specification import Export, Import
from dyknow.network.mediation import Failover, Mediation, Relay
from dyknow.network.processes import OnDemand
from dyknow.network.prototypes import SourcePrototype, UnitPrototype
from dyknow.network.refinement import LATE_US, RefinementProcess
from dyknow.network.stream_proxy import StreamProxy
from dyknow.objects.object_streams import DomainStream, ObjectFeature, ObjectProcess
from dyknow.states.state_streams import StateStreamProcess
from dyknow.states.synchronization import Origin


@dataclass(frozen=True, slots=True)
class GraphNode:
    """A generator, a declared stream or a monitor.

    Attributes:
        kind: source, unit, state, select, merge, first of, stream, monitor, family, import, export, made outside.
        made_by: the source, the computational unit, or the platform it is imported from.
        running: whether it computes; None: it does so always.
        rate_hz: samples per second of available time; None: too few to say.
        delay_us: mean of available minus valid time.
        held: samples in its history; about `held_bytes` of memory.
        note: what else there is to say, e.g. why there is no state yet.
        states: of a monitor: the streams that its states are made of, in KPL.
        counted: of a monitor: states that lacked something or came in no good order, by reason; of chronicles: samples
            that were ignored.
    """

    name: str
    kind: str
    sort: str = ""
    made_by: str = ""
    running: bool | None = None
    rate_hz: float | None = None
    delay_us: float | None = None
    held: int = 0
    held_bytes: int = 0
    note: tuple[str, ...] = ()
    states: str = ""
    counted: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Edge:
    """A stream from a generator to its subscriber.

    Attributes:
        policy: as declared; `in_force` as it is now, if that differs.
        dropped: samples that did not come through, by reason.
        linked: whether there is a generator.
    """

    source: str
    target: str
    policy: str = ""
    in_force: str = ""
    stretched: int = 1
    importance: float = 1.0
    dropped: Mapping[str, int] = field(default_factory=dict)
    gaps: int = 0
    linked: bool = True


@dataclass(frozen=True, slots=True)
class Graph:
    """The network of one instance at one time."""

    nodes: tuple[GraphNode, ...]
    edges: tuple[Edge, ...]


def graph_of(instance: Instance) -> Graph:
    """The network as it is now."""
    network, made_by = instance.network, units_of_families(instance)
    fed_from = {label: source for source, labels in instance.parts.fed.items() for label in labels}
    nodes = [_generator_node(network, label, fed_from.get(label, "")) for label in network.labels()]
    edges = [
        edge
        for label in network.labels()
        for proxy, wanted in _inputs_of(network, label)
        for edge in [_edge(str(wanted), str(label), proxy)]
    ]
    generators = {node.name for node in nodes}
    for stream, proxy in instance.streams.items():
        name = _other_than(generators, "stream", stream)
        nodes.append(GraphNode(name, "stream"))
        edges.append(_edge(str(proxy.label), name, proxy))
    for declared, monitor in instance.monitors.items():
        name = _other_than(generators, "monitor", declared)
        nodes.append(_monitor_node(name, declared, monitor))
        edges += [_edge(str(proxy.label), name, proxy) for proxy in monitor.states.proxies]
    for path, chronicles in instance.chronicles.items():
        nodes.append(GraphNode(path, "chronicles", counted=chronicles.watch.ignored))
        edges += [_edge(str(proxy.label), path, proxy) for proxy in chronicles.watch.proxies.values()]
        edges += [Edge(path, str(label)) for label in chronicles.labels]
    for label, family in instance.families.members.items():
        members = ", ".join(map(_member, family.members)) or "none now"
        nodes.append(
            GraphNode(str(label), "family", made_by=made_by.get(str(label), ""), note=(f"members: {members}",))
        )
        edges.append(_edge(str(family.domain.label), str(label), family.proxy))
    for prototype, labels in instance.lacking.items():
        for label in labels:
            nodes.append(GraphNode(str(label), "unit", made_by=prototype, note=(f"no host offers {prototype} yet",)))
            edges += [Edge(str(source), str(label)) for source in instance.parts.inputs_of(label)]
    there = {(edge.source, edge.target) for edge in edges}
    edges += [Edge(*each) for each in of_members(instance, {node.name for node in nodes}) if each not in there]
    return _with_federation(instance, nodes, edges)


def _member(objects: Sequence[str]) -> str:
    return objects[0] if len(objects) == 1 else f"[{', '.join(objects)}]"


def _other_than(generators: Collection[str], kind: str, name: str) -> str:
    """Streams, monitors and exports may be called like a generator; the nodes of a graph have names of their own."""
    return f"{kind} {name}" if name in generators else name


def _with_federation(instance: Instance, nodes: list[GraphNode], edges: list[Edge]) -> Graph:
    """The graph with the streams that are imported and exported."""
    compiler = instance.compiler
    imported = {}
    for each in instance.specification:
        match each:
            case Export(semantic, term):
                name = _other_than({node.name for node in nodes}, "export", semantic)
                nodes.append(GraphNode(name, "export"))
                edges.append(Edge(str(compiler.label(term.label)), name, str(term.policy)))
            case Import(semantic, unit, term):
                label = str(compiler.label(term.label))
                imported[label] = GraphNode(label, "import", made_by=f"{semantic} from {unit}")
    there = {node.name for node in nodes}
    nodes = [*(node for label, node in imported.items() if label not in there), *nodes]
    return Graph(tuple(nodes), tuple(replace(e, linked=True) if e.source in imported else e for e in edges))


def origins_of(instance: Instance, name: str, valid_us: int) -> dict[str, Origin]:
    """How each value of the state was obtained that a declared stream has delivered, or that its sample was made from.

    By input; empty for a value that is not made from a state.
    """
    return _origins(instance.network, _process_of(instance, name), valid_us, LONGEST_CHAIN)


def _origins(network: Network, process: object, valid_us: int, left: int) -> dict[str, Origin]:
    if not isinstance(process, StateStreamProcess):
        if not isinstance(process, RefinementProcess) or not left:
            return {}
        makers = (network.process(each.label) for each in inputs_taken(process) if network.has(each.label))
        return next(filter(None, (_origins(network, each, valid_us, left - 1) for each in makers)), {})
    found = next((state for state in reversed(process.recent) if state.valid_us == valid_us), None)
    labels = (str(each.label) for each in process.inputs())
    return {} if found is None else dict(zip(labels, found.origins, strict=False))


def maker_of(instance: Instance, name: str, sample: Sample) -> Label | None:
    """The member from whose stream a sample of a declared stream is, if it is of a select or merge (3.3.4)."""
    process = _process_of(instance, name)
    return process.maker_of(sample) if isinstance(process, Relay) else None


def _process_of(instance: Instance, name: str) -> object:
    """The process of a declared stream, if there is one."""
    label = instance.streams[name].label if name in instance.streams else None
    return instance.network.process(label) if label is not None and instance.network.has(label) else None


def awaits_us(instance: Instance) -> int:
    """How long after its valid time a sample may still matter to a declared stream or a monitor that waits for others."""
    network, known = instance.network, dict[Label, int]()

    def behind(label: Label) -> int:
        if label not in known:
            process = network.process(label) if network.has(label) else None
            waits = isinstance(process, StateStreamProcess)  # for no sample later than the state is made
            own_us = process.max_delay_us if isinstance(process, StateStreamProcess) else 0
            if isinstance(process, RefinementProcess) and process.prototype.cost_us:
                own_us = LATE_US + process.prototype.cost_us
            inputs = inputs_taken(process)
            known[label] = own_us + max((behind(one.label) if waits else waited(one) for one in inputs), default=0)
        return known[label]

    def waited(proxy: StreamProxy) -> int:
        approximated = proxy.policy.approximation == "most recent"
        return (proxy.policy.max_delay_us or 0 if approximated else 0) + behind(proxy.label)

    monitors = (
        monitor.states.max_delay_us + max((behind(proxy.label) for proxy in monitor.states.proxies), default=0)
        for monitor in instance.monitors.values()
    )
    recognised = max((each.watch.delay_us for each in instance.chronicles.values()), default=0)
    return recognised + max((*map(waited, instance.streams.values()), *monitors), default=0)


def _generator_node(network: Network, label: Label, fed_from: str) -> GraphNode:
    generator = network.generator(label)
    process = network.process(label)
    rate_hz, delay_us = rate_and_delay(generator.history)
    held = generator.history.get_size()
    note: tuple[str, ...] = ()
    if isinstance(process, StateStreamProcess):
        note = tuple(map(str, process.awaited()))
    if isinstance(process, Failover) and process.running:
        note = process.told()
    if isinstance(process, RefinementProcess) and process.dropped:
        note = (f"{process.dropped} inputs dropped: the unit is slower than they come",)
    if isinstance(process, RefinementProcess) and process.adapter is not None:
        dropped = ", ".join(f"{count} {reason}" for reason, count in process.adapter.dropped.items() if count)
        note = (*note, f"its output with {process.adapter.policy}; dropped: {dropped or 'none'}")
    if isinstance(process, LinkStream):
        note = process.notes()
    return GraphNode(
        str(label),
        _kind(process),
        generator.sort.name,
        _made_by(process) or fed_from,
        process.running if isinstance(process, OnDemand) else None,
        rate_hz,
        delay_us,
        held,
        held * SAMPLE_BYTES,
        note,
    )


def _monitor_node(name: str, declared: str, monitor: FormulaMonitor) -> GraphNode:
    states, watched = monitor.states, monitor.monitor
    text = print_specification(states.declarations(declared))
    return GraphNode(
        name, "monitor", note=(watched.shows, *states.awaited()), states=text, counted=dict(watched.counted)
    )


def _made_by(process: object) -> str:
    """The prototype of a process, and its place unless it runs here."""
    prototype = getattr(process, "prototype", None)
    if not isinstance(prototype, UnitPrototype | SourcePrototype):
        return ""
    if isinstance(process, RefinementProcess) and process.is_apart:
        return f"{prototype.name} in a worker"
    return prototype.name if prototype.elsewhere is None else f"{prototype.name} at a host"


def _kind(process: object) -> str:
    match getattr(process, "prototype", None):
        case UnitPrototype():
            return "unit"
        case SourcePrototype():
            return "source"
    match process:
        case StateStreamProcess():
            return "state"
        case Failover():
            return "first of"
        case Mediation():
            return "select" if process.single else "merge"
        case DomainStream():
            return "objects"
        case ObjectFeature():
            return "object"
        case LinkStream():
            return "link"
        case None:
            return "source"
    return type(process).__name__.lower()


def _inputs_of(network: Network, label: Label) -> Iterator[tuple[StreamProxy | None, Label]]:
    process = network.process(label)
    if not isinstance(process, OnDemand):
        return
    if process.proxies:
        yield from ((proxy, proxy.label) for proxy in process.proxies)
    else:
        yield from ((None, each.label) for each in process.inputs())
    if isinstance(process, Mediation):
        yield from ((proxy, proxy.label) for proxy in process.members.values())
    if isinstance(process, ObjectProcess):
        yield from ((table.proxy, table.label) for table in process.tables)


def _edge(source: str, target: str, proxy: StreamProxy | None) -> Edge:
    if proxy is None:
        return Edge(source, target)
    adapter: PolicyAdapter = proxy.adapter
    declared, now = str(proxy.policy), str(adapter.policy)
    return Edge(
        source,
        target,
        declared,
        "" if now == declared else now,
        proxy.stretched,
        proxy.policy.importance,
        dict(adapter.dropped),
        adapter.gaps,
        proxy.linked,
    )
