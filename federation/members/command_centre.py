"""A member that asks and delegates, and offers nothing; a value that is stepped like a platform."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol, TypeAlias

from dyknow.federation import keys
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.members.correspondence import FOREIGN, REPLY_WITHIN_US, Direction
from dyknow.federation.members.directory import DirectoryEntry, DirectoryEvent, unit_order
from dyknow.federation.members.imports import ImportName
from dyknow.federation.members.liveness import PeerState
from dyknow.federation.members.member import Member
from dyknow.federation.members.participants import Participants
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.codec import StreamSample
from dyknow.federation.messages.contents import Content, EndStream, Progress, Reason, Stream, TaskOver, read
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.federation.messages.protocols import OPENING
from dyknow.federation.security.trust import Trust
from dyknow.federation.transport import TokenChanged, WireEffect, WireEvent
from dyknow.model.errors import ContentError

STANDING = 256
"""Conversations whose later news are taken: a task outlives its delegate."""
PATIENT_US = 2_000_000
OnSample: TypeAlias = Callable[[ImportName, StreamSample, int], None]
"""Takes the stream's owner, semantic label and policy hash, a sample, and its arrival (node clock)."""


@dataclass(frozen=True, slots=True)
class PlatformView:
    """A platform as it is listed: `state` is alive, suspect, gone or refused; `entry` None if it was never heard.

    Attributes:
        gone_us: since when it is gone, on the node clock, as those say that miss it.
    """

    unit: str
    kind: str
    state: str
    entry: DirectoryEntry | None
    gone_us: int | None = None

    @property
    def labels(self) -> tuple[str, ...]:
        """The semantic labels it offers."""
        return () if self.entry is None else tuple(label.label for label in self.entry.labels)

    @property
    def services(self) -> tuple[str, ...]:
        """The services it offers."""
        return () if self.entry is None else tuple(service.service for service in self.entry.services)


class Steppable(Protocol):
    """A job of a member over time in conversations of its own, such as a call. Times are the node clock."""

    @property
    def deadline_us(self) -> int | None: ...
    def begin(self, now_us: int) -> None: ...
    def on_time(self, now_us: int) -> None: ...
    def end(self, now_us: int) -> None: ...


class CommandCentre:
    """See the module. Times are the node clock.

    Attributes:
        refused: acts that were not accepted, by reason; `member.refused` has the events.
        on_sample: takes the samples of all streams that were announced to it.
        on_refused: called with a member that speaks in a conversation that it takes no part in.
        followed: its delegated tasks, by conversation, whose later news are taken.
    """

    def __init__(
        self,
        unit: str,
        now_us: int,
        *,
        zid: str = "",
        trust: Trust | None = None,
        clock: FederationClock | None = None,
    ) -> None:
        self._effects: list[WireEffect] = []
        self.refused: Counter[str] = Counter()
        self.member = Member(
            unit, now_us // 1000, now_us, self, self._audit, self._effects.append, zid=zid, trust=trust, clock=clock
        )
        self.on_sample: OnSample = lambda _name, _sample, _at_us: None
        self.on_refused: Callable[[str], None] = lambda _unit: None
        self._participants = Participants(self._is_platform)
        self._calls: list[Steppable] = []
        self.followed: dict[str, Dialogue] = {}
        self._changed_us = now_us
        self._tokens: dict[str, dict[str, str]] = {}
        self._seen_us: dict[str, int] = {}

    @property
    def unit(self) -> str:
        return self.member.unit

    @property
    def clock(self) -> FederationClock:
        """The federation's, once a platform was met."""
        return self.member.clock

    # -- what it does ------------------------------------------------------------------------------------------

    def start(self, now_us: int) -> list[WireEffect]:
        """Come into the federation."""
        self.member.start(now_us)
        return self._done()

    def leave(self, now_us: int) -> list[WireEffect]:
        """Leave it: standing conversations are left to the platforms."""
        self.member.leave(now_us)
        return self._done()

    def decide(self, dialogue: Dialogue, performative: Performative, content: Content, now_us: int) -> list[WireEffect]:
        """Accept or reject what was proposed in a call of ours."""
        self.member.acts.decide(dialogue.unit, dialogue.conversation, performative, content, now_us)
        return self._done()

    def say(
        self,
        unit: str,
        performative: Performative,
        content: Content,
        now_us: int,
        *,
        within_us: int = REPLY_WITHIN_US,
        standing: bool = False,
    ) -> tuple[Dialogue, list[WireEffect]]:
        """Open a conversation with the Interface Agent of `unit`.

        Raises:
            Refused: too many are open.
            ContentError: the content cannot be encoded.
        """
        dialogue = Dialogue(unit, about=content)
        dialogue.conversation = self.member.acts.ask(
            unit,
            content,
            now_us,
            performative=performative,
            on_reply=dialogue.on_reply,
            on_silence=dialogue.on_silence,
            within_us=within_us,
            standing=standing,
        )
        self.follow(dialogue)
        return dialogue, self._done()

    def follow(self, dialogue: Dialogue, task: str = "") -> None:
        """Take later news of a delegated task, also of other platforms; `task`: its name, if it has another."""
        self._participants.permit(dialogue.about)
        self.followed[task or dialogue.conversation] = dialogue
        if len(self.followed) > STANDING:
            del self.followed[next(iter(self.followed))]

    def cancel(
        self, unit: str, conversation: str, now_us: int, *, within_us: int = REPLY_WITHIN_US
    ) -> tuple[Dialogue, list[WireEffect]]:
        """End a task of `unit`, delegated by this command centre or by another."""
        self.followed.pop(conversation, None)
        dialogue = Dialogue(unit, conversation)
        self.member.acts.cancel_task(
            unit,
            conversation,
            now_us,
            on_reply=dialogue.on_reply,
            on_silence=dialogue.on_silence,
            within_us=within_us,
        )
        return dialogue, self._done()

    def over(self, task: str, now_us: int) -> list[WireEffect]:
        """A task has ended: each platform knows it, so that its delegate begins it nowhere again. An observer may not say so."""
        trust = self.member.trust
        member = None if trust is None else trust.roster.member(self.unit)
        if trust is None or (member is not None and member.role == "command-centre"):
            for platform in self.platforms():
                self.member.acts.tell(platform.unit, TaskOver(task=task), now_us)
        return self._done()

    def begin(self, call: Steppable, now_us: int) -> list[WireEffect]:
        """Step a call of ours from now on, until it is over."""
        self._calls.append(call)
        call.begin(now_us)
        return self._done()

    def end(self, call: Steppable, now_us: int) -> list[WireEffect]:
        """The call is over."""
        self._calls.remove(call)
        call.end(now_us)
        return self._done()

    # -- stepping ----------------------------------------------------------------------------------------------

    def on_event(self, event: WireEvent, now_us: int) -> list[WireEffect]:
        """Take one event of the wire."""
        if isinstance(event, TokenChanged):
            self._on_token(event)
        self.member.on_event(event, now_us)
        return self._done()

    @property
    def deadline_us(self) -> int:
        due_us = (call.deadline_us for call in self._calls)
        return min([self.member.deadline_us, *(us for us in due_us if us is not None)])

    def on_time(self, now_us: int) -> list[WireEffect]:
        """Do what is due."""
        self.member.on_time(now_us)
        for call in self._calls:
            call.on_time(now_us)
        return self._done()

    def _done(self) -> list[WireEffect]:
        effects = self._effects[:]
        self._effects.clear()
        return effects

    def _on_token(self, event: TokenChanged) -> None:
        token = keys.parse_key(event.key)
        if isinstance(token, keys.PlatformToken) and token.unit != self.unit:
            self._changed_us = event.at_us
            sessions = self._tokens.setdefault(token.unit, {})
            if event.alive:
                sessions[event.key] = token.kind
            else:
                sessions.pop(event.key, None)

    # -- what the member reports -------------------------------------------------------------------------------

    def on_peer(self, change: DirectoryEvent, now_us: int) -> None:
        """The directory is not settled yet."""
        self._changed_us = now_us
        self.member.follow(change, now_us)

    def on_clock(self, unit: str, now_us: int) -> None:
        """The offset is looked up when it is listed."""

    def on_request(self, act: Act, now_us: int) -> None:
        """Refuse what is asked for; receive a stream that is announced."""
        if act.performative in OPENING:
            reason = Reason(text="a command centre delegates; it carries nothing out")
            self.member.acts.answer(act, Performative.REFUSE, reason, now_us)
            return
        try:
            content = None if act.content is None else read(act.content)
        except ContentError:
            self.refused["not understood"] += 1
            return
        if isinstance(content, Stream | EndStream):
            self._on_stream(act.sender.unit, content, now_us)
        elif self._takes_part(act, content) and isinstance(content, Progress):
            self._on_progress(act, content, now_us)

    def _on_stream(self, sender: str, content: Stream | EndStream, now_us: int) -> None:
        """A platform announces, or ends, a stream of its own."""
        if content.owner != sender:
            self.refused["not its stream"] += 1
            return
        for label in content.semantic_labels:
            name = (content.owner, label, content.hash)
            if isinstance(content, Stream):
                self.member.import_stream(name, partial(self._on_samples, name), now_us)
            else:
                self.member.end_import(name)

    def _takes_part(self, act: Act, content: Content | None) -> bool:
        """Whether the sender takes part in the task of that conversation; while its delegate is heard, others report of
        themselves alone. Acts about tasks that are no longer followed are left alone.
        """
        dialogue, sender = self.followed.get(act.conversation_id or ""), act.sender.unit
        if dialogue is None or sender == dialogue.unit:
            return dialogue is not None
        of_others = isinstance(content, Progress) and content.unit not in {None, sender} and not dialogue.over
        is_heard = not of_others and self._participants.includes(sender, dialogue.about)
        if not is_heard:
            self._refuse(sender)
        return is_heard

    def _is_platform(self, unit: str) -> bool:
        """Whether a unit is a platform: by the roster, or, where there is none, by its own description."""
        if self.member.trust is not None:
            member = self.member.trust.roster.member(unit)
            return member is not None and member.role == "uav" and not member.revoked
        entry = self.member.directory.entry(unit)
        return entry is not None and entry.kind == "uav"

    def _refuse(self, unit: str) -> None:
        self.refused[FOREIGN] += 1
        self.on_refused(unit)

    def _on_progress(self, act: Act, content: Progress, now_us: int) -> None:
        """A platform reports of a task that it takes part in; several that report the same do so once."""
        dialogue = self.followed[act.conversation_id or ""]
        is_answered = dialogue.over and dialogue.failed is None
        if is_answered or any(getattr(each, "step", None) == content.step for _, each in dialogue.said):
            return
        dialogue.on_reply(act, content, False, now_us)
        if dialogue.over:
            dialogue.failed = content.step

    def on_lost(self, opening: Act, now_us: int) -> None:
        """Nothing was promised."""

    def _audit(self, _at_us: int, _direction: Direction, peer: str, _act: Act | None, outcome: str) -> None:
        if outcome == FOREIGN:
            self._refuse(peer)
        elif outcome not in {"sent", "accepted"}:
            self.refused[outcome] += 1

    def _on_samples(self, name: ImportName, samples: Sequence[StreamSample], at_us: int) -> None:
        for sample in samples:
            self.on_sample(name, sample, at_us)

    # -- look-ups ----------------------------------------------------------------------------------------------

    def platforms(self, *, all_kinds: bool = False) -> list[PlatformView]:
        """The platforms: heard ones, ones that only have a token, and ones that only others hear."""
        views: dict[str, PlatformView] = {}
        for entry in self.member.directory.entries():
            if entry.unit != self.unit:
                state = "refused" if entry.refusal else entry.state.value
                views[entry.unit] = PlatformView(entry.unit, entry.kind, state, entry)
        unheard = {unit: next(iter(sessions.values())) for unit, sessions in self._tokens.items() if sessions}
        for view in list(views.values()):
            for unit in view.entry.hears if view.entry is not None else ():
                unheard.setdefault(unit, "command-centre" if unit.startswith("cc-") else "uav")
        for unit, kind in unheard.items():
            if unit != self.unit and unit not in views and not self._is_gone(unit):
                views[unit] = PlatformView(unit, kind, PeerState.SUSPECT.value, None)
        chosen = [view for view in views.values() if all_kinds or view.kind == "uav"]
        return sorted(chosen, key=lambda view: unit_order(view.unit))

    def _is_gone(self, unit: str) -> bool:
        entry = self.member.directory.entry(unit)
        return entry is not None and entry.state is PeerState.GONE

    def settled(self, now_us: int, quiet_us: int) -> bool:
        """Whether all platforms are described that there are, those included that one of them hears.

        Where they do not name each other (there is one, or none hears another yet), nothing has changed for `quiet_us`.
        In a federation with a roster the clock of each is known, too: its acts are not believed before that.
        `PATIENT_US` after a member was seen first all is known of it that comes of itself: if it keeps silent, it holds up no
        question from then on; nor do members that only others name, that long after there was any.
        """
        there = self.platforms(all_kinds=True)
        uavs = {view.unit: view.entry for view in there if view.kind == "uav"}
        if not uavs:
            self._seen_us = {}
            return False
        shown = {view.unit: view.unit if view.entry is not None or view.unit in self._tokens else "" for view in there}
        self._seen_us = {key: self._seen_us.get(key, now_us) for key in {"", *shown.values()}}
        new = [view for view in there if now_us < self._seen_us[shown[view.unit]] + PATIENT_US]
        if not new:
            return True
        if any(view.entry is None or not view.entry.version for view in new):
            return False
        is_signed = self.member.trust is not None
        if is_signed and any(view.kind == "uav" and self.member.offsets.of(view.unit) is None for view in new):
            return False
        is_mutual = all(entry is not None and uavs.keys() & {*entry.hears} for entry in uavs.values())
        return is_mutual or now_us - self._changed_us >= quiet_us
