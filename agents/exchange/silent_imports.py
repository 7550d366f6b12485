"""Imported streams without a sample: the cause, and what to do about it (policies, thesis 4.4).

A stream whose samples all lie off the grid of its receivers brings them none, as if its producer were silent. The
producer is queried for its newest sample; applying the policy to that sample shows the cause.
"""

from collections.abc import Iterable

from dyknow import Policy
from dyknow.agents.exchange.import_proxy import ImportProxy
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.members.imports import ImportName
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import Content, Query, Reading, Samples
from dyknow.federation.messages.descriptions import ConditionEntry
from dyknow.model.instants import print_duration

LOOK_US = 250_000
SILENT_US = 800_000
"""How long after its announcement, plus two periods, the first sample of a stream is waited for."""
MOST = 4
"""How many of them are shown at once as conditions of the platform."""


class SilentImports(Part):
    """Notes, once a stream, that all its samples are dropped by the policy; a condition while that is so."""

    heeds_samples = True

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._agent, self._importer, self._note, self._offer = ports.agent, parts[ImportProxy], ports.note, ports.offer
        self._directory = ports.directory
        self._causes: dict[ImportName, ConditionEntry] = {}
        self._asked: set[ImportName] = set()
        self._changes, self._look_us = -1, 0
        self._is_waiting = False

    def conditions(self) -> Iterable[ConditionEntry]:
        return tuple(self._causes.values())[:MOST]

    @property
    def deadline_us(self) -> int | None:
        is_changed = self._changes != self._importer.imports.changes
        return self._look_us if is_changed or self._is_waiting or self._causes or self._importer.has_news else None

    def on_time(self, now_us: int) -> None:
        """Ask about streams without a sample; forget those that come, and those that ended."""
        due_us = self.deadline_us
        if due_us is None or now_us < due_us:
            return
        self._look_us, self._changes = now_us + LOOK_US, self._importer.imports.changes
        if self._importer.has_news:
            self._importer.has_news = False
            self._offer(now_us)
        streams = self._importer.imports.streams
        silent = {name: one for name, one in streams.items() if not one.stream.account.received}
        self._asked &= silent.keys()
        if ended := self._causes.keys() - silent.keys():
            for name in ended:
                del self._causes[name]
            self._offer(now_us)
        self._is_waiting = False
        for name in silent.keys() - self._asked:
            policy = self._importer.policies.get(name)
            if policy is None or policy.sample_us is None:
                continue
            if self._directory.is_busy or now_us < silent[name].heard_us + SILENT_US + 2 * policy.sample_us:
                self._is_waiting = True
                continue
            self._asked.add(name)
            self._ask(name, policy, now_us)

    def _ask(self, name: ImportName, policy: Policy, now_us: int) -> None:
        owner, label, _ = name
        if self._importer.is_of_objects(label):
            policy = Policy(max_delay_us=policy.max_delay_us)  # states of objects lie on no grid

        def on_reply(reply: Act, content: Content | None, at_us: int) -> None:
            if reply.performative is Performative.INFORM and isinstance(content, Samples) and content.samples:
                cause = cause_in(content.samples[-1], policy)
                if cause and name in self._asked:
                    text = f"no sample of {label} comes from platform {owner}: {cause}"
                    self._causes[name] = ConditionEntry(text=text[:200], since_us=at_us)
                    self._note(text)
                    self._offer(at_us)

        query = Query(semantic_label=label)
        self._agent.delegate(owner, query, now_us, performative=Performative.QUERY_REF, on_reply=on_reply)


def cause_in(newest: Reading, policy: Policy) -> str:
    """Why a policy drops this sample, and the remedy; empty: it does not."""
    delay_us, period_us = newest.available_us - newest.valid_us, policy.sample_us or 1
    if policy.max_delay_us is not None and delay_us > policy.max_delay_us:
        late, most = print_duration(delay_us), print_duration(policy.max_delay_us)
        return f"the newest was {late} late, and max delay is {most}; import it with a longer one"
    off_us = (newest.valid_us - (policy.from_us or 0)) % period_us
    if off_us:
        grid, off = print_duration(period_us), print_duration(off_us)
        return f"the newest lies {off} off the grid of {grid}; export it with `from 0, sample every {grid}, use linear`"
    return ""
