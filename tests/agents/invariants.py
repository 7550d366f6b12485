"""What holds of every platform after every test, whatever the test did to it."""

from dyknow.agents.platform import Platform
from dyknow.agents.specification.specification_part import OWNER
from dyknow.federation import keys
from dyknow.federation.members.member import Member
from dyknow.federation.messages.protocols import Phase
from dyknow.federation.messages.receipts import RECEIPT_AGENT
from tests.box import Box


def check(wire: Box) -> None:
    """Assert the invariants of every platform of the wire."""
    for process in (node.process for node in wire.running.values()):
        _nothing_is_open_beyond_its_time(process.member, wire.now_us)
        _whoever_waits_has_a_conversation(process.member)
        _subscriptions_are_what_is_imported(wire, process.member)
        assert process.deadline_us > wire.now_us, "what is due was done"
    for platform in (node.platform for node in wire.running.values() if node.platform):
        _subscriptions_in_the_instance_have_a_reason(platform)
        _monitors_have_owners(platform)
        _the_account_is_what_crossed(wire, platform)
        if not platform.config.control:
            assert wire.vehicle(platform.unit).commands == [], "without control nothing is commanded"


def _nothing_is_open_beyond_its_time(member: Member, now_us: int) -> None:
    for found in member.acts.conversations.conversations():
        assert found.due_us is None or found.due_us >= now_us, f"{found.opening} is open beyond its reply-by"
        assert found.phase is not Phase.ASKED or found.due_us is not None


def _whoever_waits_has_a_conversation(member: Member) -> None:
    ours = {found.opening.conversation_id for found in member.acts.conversations.conversations() if found.ours}
    assert set(member.acts._pending) <= ours


def _subscriptions_are_what_is_imported(wire: Box, member: Member) -> None:
    imported = {keys.stream_expr(label, policy) for _, label, policy in member.imports.streams}
    listened = {expr for expr in wire.wire.session(member.unit).subscriptions if expr.startswith("x/")}
    assert listened == imported


def _subscriptions_in_the_instance_have_a_reason(platform: Platform) -> None:
    """Exports and monitors subscribe locally, and nothing is left over when they end."""
    assert len(platform.built.gateway.exporter._subscriptions) == len(platform.built.gateway.exporter.exports.streams())
    taps = platform.built.monitors._taps
    used = {
        id(tap)
        for named in platform.built.monitors.named.values()
        for fed in (named, *named.instances.values())
        for tap, _ in fed.taps
    }
    assert {id(tap) for tap in taps.values()} == used


def _monitors_have_owners(platform: Platform) -> None:
    asked = {task.conversation for task in platform.built.tasks.all()} | set(platform.built.tasks.coordinated)
    for name, named in platform.built.monitors.named.items():
        assert named.owners, f"nobody wants {name}"
        assert named.owners <= asked | {OWNER}, f"{name} is kept for a task that is not there"


def _the_account_is_what_crossed(wire: Box, platform: Platform) -> None:
    """Every act that left is accounted for, and every act that arrived."""
    left = {(act.boot, act.seq) for act in wire.acts(sender=platform.unit) if act.boot == platform.config.boot}
    noted = [e for e in platform.ports.agent.audit_log.entries if e.direction == "out" and e.act is not None]
    if platform.ports.agent.audit_log._number <= (platform.ports.agent.audit_log.entries.maxlen or 0):
        assert {(e.act.boot, e.act.seq) for e in noted if e.act is not None} == left
        assert sum(n for (way, _), n in platform.ports.agent.audit_log.counts.items() if way == "out") == len(noted)
        arrived = sum(n for (way, _), n in platform.ports.agent.audit_log.counts.items() if way == "in")
        assert arrived == sum(e.direction == "in" for e in platform.ports.agent.audit_log.entries)
    assert not any(
        isinstance(key := keys.parse_key(crossed.put.key), keys.ActKey)
        and key.agent != RECEIPT_AGENT
        and key.sender != platform.unit
        for crossed in wire.wire.log
        if crossed.sender == platform.unit
    ), "nobody speaks for another"
