"""The Directory Facilitator's agent: the platforms, what they offer, and this platform's own coming and going (9.3.2).

Times are the node clock.
"""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Final

from dyknow.agents.actions import FEDERATION, QUERIED, SUBSCRIBED, Action, Offer, Role
from dyknow.agents.admission.message_log import AUDIT_LOG
from dyknow.agents.directory.peer_conditions import PeerConditions
from dyknow.agents.effects import Halt, Impaired, LeaveRequested
from dyknow.agents.part import ClockCompared, Followed, Part, PeerChange, Within
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.subscribers import Subscribers
from dyknow.agents.tasks.authority import Authority
from dyknow.agents.tasks.life import TaskLife
from dyknow.agents.tasks.requests import MEMBERSHIP
from dyknow.agents.tasks.revocation import end_revoked
from dyknow.federation import keys
from dyknow.federation.members import liveness
from dyknow.federation.members.offers import LabelAppeared, LabelGone, Service, ServiceAppeared, ServiceGone, Visibility
from dyknow.federation.members.replicas import PlatformRefused
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.contents import (
    MAX_LIST,
    Content,
    Directory,
    DirectoryEvent,
    Leave,
    Rejoin,
    Search,
    SearchResult,
)
from dyknow.federation.messages.descriptions import ConditionEntry
from dyknow.federation.transport import (
    Answered,
    Arrived,
    Asked,
    AskEnded,
    CertificateEnds,
    DeclareQueryable,
    LinkClosed,
    RosterKept,
    RosterRead,
    TokenChanged,
)
from dyknow.model.errors import DecodeError
from dyknow.model.instants import US_PER_S

MOST_QUERIED = 2
"""How many older platforms are queried for the platforms that they miss, which this one cannot know yet."""
JOINING_US = 5_000_000
"""How long after its start a platform may still be refused."""
NOTED = 64
"""Conflicts with others that are noted, each once."""
IMPAIRED, MAX_TEXT = 8, 200
"""Conditions of the process that are listed, and characters of each."""
DIRECTORY: Final = Service("directory", "directory", Visibility.PUBLIC)
_PLATFORM: Final[Mapping[type, str]] = {
    liveness.PlatformAppeared: "platform-appeared",
    liveness.PlatformSuspected: "platform-suspected",
    liveness.PlatformReturned: "platform-returned",
    liveness.PlatformGone: "platform-gone",
}


class DirectoryAgent(Part):
    """Steps the platform's member by what arrives and by time, and answers questions about the directory.

    Args:
        offered, labels: the services and semantic labels this platform offers, as they are now.
        ontology: definitions of labels here; definitions that are not built in are announced.
        fed: the parts that imported samples may make due earlier.
        emit, note: take effects, and words for users.
        contain: lets it beat though something else of the member raises.
    """

    vital = keeps_acts = True
    offers = (
        Offer(
            DIRECTORY,
            (
                Action(Directory, "on_subscribe", SUBSCRIBED, Role.OBSERVER),
                Action(Search, "on_search", QUERIED, Role.OBSERVER),
            ),
        ),
        Offer(
            AUDIT_LOG,
            MEMBERSHIP,
        ),
    )
    answers = (DirectoryEvent, SearchResult)
    arrivals = {"hb": "on_heartbeat", "x": "on_samples"}  # noqa: RUF012  (declarations)
    takes = {  # noqa: RUF012
        LeaveRequested: "on_leave_requested",
        Answered: "on_answered",
        AskEnded: "on_ask_ended",
        **dict.fromkeys((keys.ClockKey, keys.DescribeKey), "on_asked"),
        TokenChanged: "on_token",
        Impaired: "on_impaired",
        RosterRead: "on_roster",
        RosterKept: "on_roster_kept",
        LinkClosed: "on_link_closed",
        CertificateEnds: "on_certificate_ends",
    }

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._contain, self._tasks, self._authority = ports.contain, parts[TaskLife], parts[Authority]
        self.facilitator, self._agent, self._offered = ports.member.directory, ports.agent, ports.offered
        self._labels = ports.labels
        self._conditions, self._ontology = ports.conditions, ports.ontology
        self._member, self._emit, self._note = ports.member, ports.emit, ports.note
        self._noted: set[str] = set()
        self._impaired: dict[str, int] = {}
        self._kept_roster: ConditionEntry | None = None
        self._peer_conditions = PeerConditions(ports.member)
        self._subscribers = Subscribers(ports.agent, parts[TaskLife])
        self._members: tuple[str, ...] | None = None
        self._missing: dict[str, int] = {}
        self._to_ask = MOST_QUERIED
        self._own: Followed = (self,)
        self._clocks: Followed = (Within(self, ports.member.offsets),)
        self._imports: Followed = (Within(self, ports.member.imports),)
        self._fed: Followed = (Within(self, ports.member.imports),)

    # -- our own entry -----------------------------------------------------------------------------------------

    def start(self, now_us: int) -> None:
        self._emit(DeclareQueryable(keys.clock(self._member.unit)))
        self.offer(now_us)
        self._member.start(now_us)

    def offer(self, now_us: int) -> None:
        """Tell the others which services and labels there are now, and in which condition we are."""
        offered, labels, conditions = self._offered(), self._labels(), self._conditions()
        own, tails = self._ontology.own(), self._member.tails()
        self._member.take(self.facilitator.declare(offered, labels, now_us, tails, conditions, own), now_us)

    def conditions(self) -> Sequence[ConditionEntry]:
        own = [ConditionEntry(text=text, since_us=at_us) for text, at_us in self._impaired.items()]
        own += [self._kept_roster] if self._kept_roster is not None else []
        return [*own, *self._peer_conditions.conditions()]

    def on_impaired(self, event: Impaired, now_us: int) -> Followed:
        """Note and show a failure of the process, which lasts for the rest of its life."""
        text = event.text[:MAX_TEXT]
        if text not in self._impaired and len(self._impaired) < IMPAIRED:
            self._impaired[text] = event.at_us
            self._note(text)
            self.offer(now_us)
        return None

    def on_roster(self, event: RosterRead, now_us: int) -> Followed:
        """The roster has changed: revoked members are out, and what goes by their word ends."""
        if self._kept_roster is not None:
            self._kept_roster = None
            self.offer(now_us)
        for unit, is_revoked in self._member.on_roster(event, now_us).items():
            whose = "this platform is revoked: no other is linked with it" if unit == self._member.unit else ""
            self._note(whose or f"{unit} is revoked: its link is closed, and nothing of it is kept")
            end_revoked(unit, is_revoked, self._authority, self._tasks, now_us)
        return None

    def on_roster_kept(self, event: RosterKept, now_us: int) -> Followed:
        """A revocation may be in the file that cannot be used."""
        text = f"the roster's file cannot be used, and the roster before it is kept: {event.why}"[:MAX_TEXT]
        self._note(text)
        self._kept_roster = ConditionEntry(text=text, since_us=event.at_us)
        self.offer(now_us)
        return None

    def on_link_closed(self, event: LinkClosed, _now_us: int) -> Followed:
        """A certificate came that the roster does not admit, or one too often."""
        name = event.name[:64]
        refused = f"a link was closed: the roster does not admit the certificate of {name}"
        self._note(f"links were closed: {name} has too many, the oldest ends" if event.surplus else refused)
        return None

    def on_certificate_ends(self, event: CertificateEnds, now_us: int) -> Followed:
        """Soon no platform is linked with this one."""
        ends = datetime.fromtimestamp(event.ends_us // US_PER_S, UTC).isoformat(" ", "minutes").removesuffix("+00:00")
        renewed = f"dyknow roster revoke {self._member.unit}, dyknow roster add {self._member.unit}"
        text = f"the certificate ends at {ends} UTC, and every link with it; make another one: {renewed}"
        return self.on_impaired(Impaired(event.at_us, text), now_us)

    def on_leave_requested(self, event: LeaveRequested, _now_us: int) -> Followed:
        """Unregister: streams that are set up continue while the process lives (thesis 9.3.4)."""
        self._member.leave(event.at_us)
        return None

    def on_leave(self, act: Act, _content: Leave, now_us: int) -> None:
        """`(leave)`: the answer goes before the good-bye, since a platform that has left is not listened to."""
        self._agent.done(act, now_us)
        self._member.leave(now_us)

    def on_rejoin(self, act: Act, _content: Rejoin, now_us: int) -> None:
        """`(rejoin)`"""
        self.rejoin(now_us)
        self._agent.done(act, now_us)

    def rejoin(self, now_us: int) -> None:
        """Come back into the federation."""
        self._member.take(self.facilitator.start(now_us, self._member.tails()), now_us)

    # -- what arrives ------------------------------------------------------------------------------------------

    def on_heartbeat(self, event: Arrived, now_us: int) -> Followed:
        follows = self._member.on_heartbeat(event, now_us)
        return self._imports if follows is None else None if follows else ()

    def on_samples(self, event: Arrived, _now_us: int) -> Followed:
        """Samples were put on the key of a stream; raises DecodeError for malformed ones."""
        if not self._member.imports.on_arrived(event):
            raise DecodeError("key")
        return self._fed

    def on_token(self, event: TokenChanged, now_us: int) -> Followed:
        self._member.dispatch(event, now_us)
        return None

    def on_asked(self, event: Asked, now_us: int) -> Followed:
        """Answer a peer that compares its clock, or its entry of this platform, with ours."""
        self._member.dispatch(event, now_us)
        return ()

    def on_answered(self, event: Answered, now_us: int) -> Followed:
        return None if self._member.on_answered(event, now_us) else self._clocks

    def on_ask_ended(self, event: AskEnded, _now_us: int) -> Followed:
        return self._own if self._member.on_ask_ended(event) else ()

    def _on_own(self, change: PeerChange, now_us: int) -> None:
        """React to changes that concern this platform itself: its name, its clock, its members."""
        match change:
            case liveness.NameConflict(unit, boot):
                self._conflict(boot, f"another platform is called {unit} already", "choose another --unit", now_us)
            case PlatformRefused(unit, boot, code, why):
                entry = self.facilitator.entry(unit)
                if code == "clock" and entry is not None and entry.kind == "uav":
                    self._conflict(boot, f"{unit} is in this federation and {why}", "join with the same clock", now_us)
                else:
                    self._note_once(f"{unit} cannot federate with this platform: {why}")
            case ServiceAppeared() | ServiceGone() if change.service.service == FEDERATION.service:
                self._members = None

    def _conflict(self, boot: int, why: str, remedy: str, now_us: int) -> None:
        """The other says it was first. Only a platform that joins believes it, and none does where acts are signed:

        descriptions and heartbeats are not, so that any participant could end one that flies.
        """
        is_joining = now_us < self._member.since_us + JOINING_US
        if is_joining and self._member.trust is None and boot < self.facilitator.boot:
            self._emit(Halt(f"{why}; {remedy}"))
        else:
            self._note_once(f"{why}: this platform stays and does not federate with that one")

    def _note_once(self, text: str) -> None:
        if text not in self._noted and len(self._noted) < NOTED:
            self._noted.add(text)
            self._note(text)

    # -- time --------------------------------------------------------------------------------------------------

    @property
    def deadline_us(self) -> int | None:
        return self._member.deadline_us

    def on_time(self, now_us: int) -> Followed:
        """Suspect silent peers, query missing entries, repeat unacknowledged acts, send the heartbeat."""
        acts = self._member.acts
        ended = acts.ended
        for step in self._member.steps:
            self._contain.step(self, step, now_us)
        if self._peer_conditions.look():
            for condition in self._peer_conditions.conditions():
                self._note_once(condition.text)
            self.offer(now_us)
            return None
        return () if acts.ended == ended else None

    # -- questions and subscriptions ---------------------------------------------------------------------------

    @property
    def members(self) -> tuple[str, ...]:
        """The platforms that offer the federation service, this one included."""
        if self._members is None:
            offering = self.facilitator.search(service=FEDERATION.service)
            self._members = tuple(entry.unit for entry in offering)
        return self._members

    def on_search(self, act: Act, content: Search, now_us: int) -> None:
        """`(search ...)`: platforms that provide a service or have a label; and which platforms are missing."""
        entries = self.facilitator.search(service=content.service, label=content.semantic_label)
        agents = tuple(str(AgentName("interface", entry.unit)) for entry in entries)[:MAX_LIST]
        found = SearchResult(
            agents=agents, missing_units=tuple(self._missing), missing_since=tuple(self._missing.values())
        )
        self._agent.answer(act, Performative.INFORM, found, now_us)

    def on_subscribe(self, act: Act, _content: Directory, now_us: int) -> None:
        """`(directory)`"""
        self._subscribers.add(act, now_us)

    def on_cancel(self, act: Act, _now_us: int) -> bool:
        return self._subscribers.remove(act)

    def on_lost(self, act: Act, _now_us: int) -> bool:
        return self._subscribers.remove(act)

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """Inform the subscribers, and remember which platform is missing."""
        self._on_own(change, now_us)
        if isinstance(change, ClockCompared):
            self._peer_conditions.on_clock(change.unit, now_us)
        elif isinstance(change, liveness.PlatformGone):
            self._peer_conditions.on_gone(change.unit)
        self._note_missing(change)
        if isinstance(change, ServiceAppeared) and change.service.service == DIRECTORY.service:
            self._ask_missing(change.unit, now_us)
        content = _content_of(change, now_us) if self._subscribers else None
        if content is not None:
            self._subscribers.inform(content, now_us)

    def _ask_missing(self, unit: str, now_us: int) -> None:
        """Learn from a platform that was here before which ones went before we came."""
        entry = self.facilitator.entry(unit)
        if self._to_ask == 0 or entry is None or entry.kind != "uav" or entry.boot >= self._member.boot:
            return
        self._to_ask -= 1

        def on_reply(act: Act, content: Content | None, at_us: int) -> None:
            if not isinstance(content, SearchResult):
                return
            for name, since_us in zip(content.missing_units, content.missing_since, strict=False):
                known = self.facilitator.entry(name)
                if known is None and name != self._member.unit and len(self._missing) < MAX_LIST:
                    self._missing.setdefault(name, at_us - max(0, act.created_us - since_us))

        def on_silence(_why: str, _at_us: int) -> None:
            self._to_ask += 1

        self._agent.delegate(
            unit, Search(), now_us, performative=Performative.QUERY_REF, on_reply=on_reply, on_silence=on_silence
        )

    def _note_missing(self, change: PeerChange) -> None:
        """A platform that timed out or crashed is missing until it returns, or says good-bye."""
        match change:
            case liveness.PlatformSuspected(unit) | liveness.PlatformGone(unit) if (
                change.why != liveness.Departure.LEFT
            ):
                entry = self.facilitator.entry(unit)
                if (
                    entry is not None
                    and entry.kind == "uav"
                    and (
                        isinstance(change, liveness.PlatformGone)
                        or entry.since_us >= entry.heard_us + liveness.SUSPECT_US
                    )
                ):
                    self._missing.setdefault(unit, entry.heard_us)
            case liveness.PlatformAppeared(unit) | liveness.PlatformReturned(unit) | liveness.PlatformGone(unit):
                self._missing.pop(unit, None)
        for unit in list(self._missing)[:-MAX_LIST]:
            del self._missing[unit]


def _content_of(change: PeerChange, now_us: int) -> DirectoryEvent | None:
    match change:
        case ServiceAppeared(unit, service):
            return DirectoryEvent(event="service-appeared", unit=unit, at_us=now_us, what=service.service)
        case ServiceGone(unit, service):
            return DirectoryEvent(event="service-gone", unit=unit, at_us=now_us, what=service.service)
        case LabelAppeared(unit, label):
            return DirectoryEvent(event="label-appeared", unit=unit, at_us=now_us, what=label.label)
        case LabelGone(unit, label):
            return DirectoryEvent(event="label-gone", unit=unit, at_us=now_us, what=label.label)
        case ClockCompared():
            return None
    event = _PLATFORM.get(type(change))
    return None if event is None else DirectoryEvent(event=event, unit=change.unit, at_us=now_us)
