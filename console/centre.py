"""The command centre as a participant of the federation: it listens, asks and delegates, and offers nothing.

A value that is stepped like a platform: wire events in, wire effects out, time (the node clock) an argument.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from itertools import count
from typing import Any, TypeAlias

from console.dialogue import Dialogue, Keyring, Seen, is_paged
from dyknow.errors import ContentError, DecodeError
from federation import keys
from federation.acts import Act, AgentName, Performative
from federation.clock import FederationClock, Offset
from federation.codec import (
    Signature,
    WireSample,
    decode_act,
    decode_description,
    decode_heartbeat,
    decode_recovered,
    decode_samples,
    encode_act,
)
from federation.contents import Cancel, Content, Reason, Stream, read
from federation.conversations import Conversations
from federation.directory import Directory, Kind, unit_order
from federation.liveness import PlatformAppeared, PlatformGone, PlatformReturned, State
from federation.offsets import ClockOffsets
from federation.protocols import OPENING, Incoming, PeerLost, Reply, TimedOut, Undelivered
from federation.receipts import RECEIPT_AGENT, decode_receipt
from federation.streams import ImportStream
from federation.transport import (
    Answered,
    AnswerEnd,
    Arrived,
    Asked,
    AskEnded,
    Subscribe,
    TokenChanged,
    WireEffect,
    WireEvent,
)
from federation.trust import Verifier

P = Performative
KIND: Kind = "command-centre"
AGENT = "interface"
ONTOLOGY = "dyknow"


OnSample: TypeAlias = Callable[[str, str, WireSample, int], None]
"""Told (owner, semantic label, sample, arrival on the node clock)."""


class CommandCentre:
    """See the module. `unit` is its own name in the federation."""

    def __init__(
        self,
        unit: str,
        federation: str,
        now_us: int,
        *,
        zid: str = "",
        keyring: Keyring | None = None,
        clock: FederationClock | None = None,
    ) -> None:
        self.unit, self.boot, self.federation = unit, now_us // 1000, federation
        self.refused: Counter[str] = Counter()
        self.dialogues: dict[str, Dialogue] = {}
        self.on_sample: OnSample = lambda _owner, _label, _sample, _at_us: None
        self.changed_us = now_us
        self._zid, self._keyring = zid, keyring
        self._verifier = Verifier(keyring.roster, federation, now_us) if keyring else None
        self._questions = count(1)
        self._clock_known = clock is not None
        self.clock = clock or FederationClock()
        self.directory = self._new_directory(now_us)
        self.offsets = ClockOffsets(self.boot, self._questions)
        self.conversations = Conversations(
            unit, self.boot, lambda act: encode_act(act, keyring.signer if keyring else None)
        )
        self._tokens: dict[str, dict[str, str]] = {}
        self._imports: dict[tuple[str, str, str], ImportStream] = {}
        self._recovering: dict[int, ImportStream] = {}

    def _new_directory(self, now_us: int) -> Directory:
        roster = self._keyring.roster.fingerprint if self._keyring else None
        return Directory(
            self.unit,
            self.boot,
            KIND,
            now_us,
            zid=self._zid,
            questions=self._questions,
            clock=self.clock,
            roster=roster,
        )

    # Saying

    def start(self, now_us: int) -> list[WireEffect]:
        """Come into the federation."""
        inboxes = [Subscribe(keys.inbox(self.unit)), Subscribe(keys.BROADCAST)]
        return [*inboxes, *self._told(self.directory.start(now_us), now_us)]

    def leave(self, now_us: int) -> list[WireEffect]:
        """Go out of it again: conversations that still stand are left to the platforms."""
        return self._told(self.directory.leave(now_us), now_us)

    def say(
        self,
        unit: str,
        performative: Performative,
        content: Content,
        now_us: int,
        *,
        within_us: int = 2_000_000,
        standing: bool = False,
    ) -> tuple[Dialogue, list[WireEffect]]:
        """Open a conversation with the Interface Agent of `unit`; raises Refused or ContentError."""
        act = Act(
            performative,
            AgentName(AGENT, self.unit),
            AgentName(AGENT, unit),
            content.expr(),
            ontology=ONTOLOGY,
            reply_by_us=now_us + within_us,
        )
        paged = is_paged(content)
        said, outcome = self.conversations.send(act, now_us, standing=standing or paged)
        dialogue = Dialogue(said.conversation_id or "", unit, paged=paged)
        self.dialogues[dialogue.conversation] = dialogue
        return dialogue, self._told(outcome, now_us)

    def cancel(
        self, unit: str, conversation: str, now_us: int, *, within_us: int = 2_000_000
    ) -> tuple[Dialogue, list[WireEffect]]:
        """End what was delegated to `unit` in `conversation`, by this command centre or by another."""
        act = Act(
            P.CANCEL,
            AgentName(AGENT, self.unit),
            AgentName(AGENT, unit),
            Cancel().expr(),
            conversation_id=conversation,
            ontology=ONTOLOGY,
            reply_by_us=now_us + within_us,
        )
        dialogue = self.dialogues[conversation] = Dialogue(conversation, unit)
        return dialogue, self._told(self.conversations.send(act, now_us)[1], now_us)

    # Stepping

    def on_event(self, event: WireEvent, now_us: int) -> list[WireEffect]:
        """Take one event of the wire; whatever does not belong here is counted in `refused`."""
        try:
            effects = self._on_event(event, now_us)
        except DecodeError as error:
            self.refused[error.reason] += 1
            effects = []
        return [*effects, *self._told(self.conversations.flush(), now_us)]

    def _on_event(self, event: WireEvent, now_us: int) -> list[WireEffect]:
        match event:
            case Arrived():
                return self._on_arrived(event)
            case TokenChanged():
                return self._on_token(event)
            case Asked():
                parsed = keys.parse_key(event.key)
                if isinstance(parsed, keys.ClockKey):
                    return [*self.offsets.on_asked(event, now_us)]
                if isinstance(parsed, keys.DescribeKey):
                    return self._told(self.directory.on_asked(event), now_us)
                return [AnswerEnd(event.ask)]
            case Answered():
                return self._on_answered(event)
            case AskEnded():
                self.offsets.on_ask_ended(event)
                self.directory.on_ask_ended(event)
                if (stream := self._recovering.pop(event.question, None)) is not None:
                    stream.on_ask_ended(event.question, event.at_us)
            case _:
                self.refused[type(event).__name__] += 1
        return []

    @property
    def deadline_us(self) -> int:
        due = [self.directory.deadline_us, self.conversations.deadline_us, self.offsets.deadline_us]
        due += [stream.deadline_us for stream in self._imports.values()]
        return min(at_us for at_us in due if at_us is not None)

    def on_time(self, now_us: int) -> list[WireEffect]:
        """Beat, retransmit, recover: whatever is due."""
        effects = self._told(self.directory.on_time(now_us), now_us)
        effects += self._told(self.conversations.on_time(now_us), now_us)
        effects += self.offsets.on_time(now_us)
        for stream in self._imports.values():
            for ask in stream.on_time(now_us):
                self._recovering[ask.question] = stream
                effects.append(ask)
        return effects

    # Hearing

    def _on_arrived(self, event: Arrived) -> list[WireEffect]:
        key = keys.parse_key(event.key)
        if isinstance(key, keys.ActKey):
            return self._on_act_key(event, key)
        if isinstance(key, keys.HeartbeatKey):
            beat = decode_heartbeat(event.payload)
            if beat.unit != key.unit or beat.unit == self.unit:
                return []
            for label, policy_hash, tail in beat.tails:
                if (stream := self._imports.get((beat.unit, label, policy_hash))) is not None:
                    stream.on_tail(beat.boot, tail, event.at_us)
            return self._told(self.directory.on_heartbeat(beat, event.at_us), event.at_us)
        if isinstance(key, keys.AnnouncementKey):
            if self._learns_clock(event):
                return self._told(self.directory.start(event.at_us), event.at_us)
            return self._told(self.directory.on_announced(key.unit, event.payload, event.at_us), event.at_us)
        if isinstance(key, keys.StreamKey):
            self._on_samples(key, event)
            return []
        self.refused["unexpected key"] += 1
        return []

    def _on_samples(self, key: keys.StreamKey, event: Arrived) -> None:
        stream = self._imports.get((key.owner, key.label, key.policy_hash))
        if stream is None:
            return
        boot, samples = decode_samples(event.payload)
        for sample in stream.on_samples(boot, samples, event.at_us):
            self.on_sample(key.owner, key.label, sample, event.at_us)

    def _on_act_key(self, event: Arrived, key: keys.ActKey) -> list[WireEffect]:
        if key.agent == RECEIPT_AGENT:
            self.conversations.on_receipt(key.sender, decode_receipt(event.payload))
            return []
        act, signature, body = decode_act(event.payload)
        if act.key != event.key or act.sender.unit == self.unit:
            self.refused["sender and key differ"] += 1
            return []
        why = self._disbelief(act, signature, body, event.at_us)
        if why is not None:
            self.refused[why] += 1
            return []
        return self._told(self.conversations.on_act(act, event.at_us), event.at_us)

    def _disbelief(self, act: Act, signature: Signature | None, body: bytes, at_us: int) -> str | None:
        """Why an act is not believed to be its sender's, or None."""
        if self._verifier is None:
            return None
        offset = self.offsets.of(act.sender.unit)
        why = self._verifier.check(act, signature, body, at_us, offset_us=offset.offset_us if offset else 0)
        return None if why == "replayed" else why

    def _on_token(self, event: TokenChanged) -> list[WireEffect]:
        token = keys.parse_key(event.key)
        if isinstance(token, keys.PlatformToken) and token.unit != self.unit:
            self.changed_us = event.at_us
            sessions = self._tokens.setdefault(token.unit, {})
            if event.alive:
                sessions[event.key] = token.kind
            else:
                sessions.pop(event.key, None)
        if token is None:
            return []
        return self._told(self.directory.on_token(token, event.alive, event.at_us), event.at_us)

    def _on_answered(self, event: Answered) -> list[WireEffect]:
        if self.offsets.on_answered(event):
            return []
        if (stream := self._recovering.get(event.question)) is not None:
            for sample in stream.on_recovered(decode_recovered(event.payload), event.at_us):
                self.on_sample(stream.owner, stream.label, sample, event.at_us)
            return []
        if self._learns_clock(event):
            return self._told(self.directory.start(event.at_us), event.at_us)
        return self._told(self.directory.on_answered(event), event.at_us)

    def _learns_clock(self, event: Answered | Arrived) -> bool:
        """The first platform's description tells which clock the federation runs by; whether ours was another."""
        self.changed_us = event.at_us
        if self._clock_known:
            return False
        found, key = decode_description(event.payload), keys.parse_key(event.key)
        if found.kind == KIND or not isinstance(key, keys.DescribeKey | keys.AnnouncementKey) or key.unit != found.unit:
            return False
        self._clock_known = True
        if self.clock.agrees(found.clock_epoch_us, found.clock_speed):
            return False
        self.clock = FederationClock(found.clock_epoch_us, found.clock_speed)
        self.directory = self._new_directory(event.at_us)
        return True

    # What steps return

    def _told(self, outcomes: Iterable[Any], now_us: int) -> list[WireEffect]:
        """The effects among `outcomes`; the events are taken note of."""
        effects: list[WireEffect] = []
        for outcome in outcomes:
            match outcome:
                case Reply():
                    self._note(outcome.conversation, outcome.act, over=outcome.closed)
                case TimedOut() | PeerLost():
                    why = outcome.why if isinstance(outcome, TimedOut) else f"platform {outcome.peer} is gone"
                    self._fail(outcome.conversation, why)
                case Incoming():
                    effects += self._incoming(outcome.act, now_us)
                case Undelivered():
                    self.refused["undelivered"] += 1
                case PlatformAppeared():
                    self.changed_us = now_us
                    self.offsets.on_appeared(outcome.unit, outcome.boot, now_us)
                    effects += self._told(self.conversations.peer_appeared(outcome.unit, outcome.boot, now_us), now_us)
                case PlatformGone():
                    self.changed_us = now_us
                    self.offsets.on_gone(outcome.unit)
                    effects += self._told(self.conversations.peer_gone(outcome.unit), now_us)
                case PlatformReturned():
                    self.changed_us = now_us
                case _ if isinstance(outcome, WireEffect):
                    effects.append(outcome)
        return effects

    def _note(self, conversation: str, act: Act, *, over: bool) -> None:
        dialogue = self.dialogues.get(conversation)
        if dialogue is None:
            return
        try:
            content = read(act.content) if act.content is not None else None
        except ContentError:
            content = None
        dialogue.said.append((act, content))
        # The last page of an answer closes the question.
        if dialogue.paged and act.performative is P.INFORM and not getattr(content, "more", False):
            self.conversations.close(conversation, dialogue.unit)
            over = True
        dialogue.over = dialogue.over or over

    def _fail(self, conversation: str, why: str) -> None:
        if (dialogue := self.dialogues.get(conversation)) is not None:
            dialogue.failed, dialogue.over = why, True

    def _incoming(self, act: Act, now_us: int) -> list[WireEffect]:
        """An act that answers nothing of ours: streams that are announced are subscribed, requests are refused."""
        if act.performative in OPENING:
            reason = Reason(text="a command centre delegates; it carries nothing out")
            return self._told(self.conversations.answer(act, P.REFUSE, reason.expr(), now_us), now_us)
        if act.conversation_id in self.dialogues:
            # The answer to a cancel of what another command centre delegated.
            self._note(act.conversation_id or "", act, over=act.performative is not P.AGREE)
            return []
        try:
            content = read(act.content) if act.content is not None else None
        except ContentError:
            self.refused["not understood"] += 1
            return []
        return self._import(content) if isinstance(content, Stream) else []

    def _import(self, told: Stream) -> list[WireEffect]:
        effects: list[WireEffect] = []
        for label in told.semantic_labels:
            name = (told.owner, label, told.hash)
            if name not in self._imports:
                self._imports[name] = ImportStream(*name, self._questions)
                effects.append(Subscribe(keys.stream_expr(label, told.hash)))
        return effects

    # Look-ups

    def platforms(self, *, all_kinds: bool = False) -> list[Seen]:
        """Who is there: those that speak, those that only have a token, and those that others hear and we do not."""
        found: dict[str, Seen] = {}
        for entry in self.directory.entries():
            if entry.unit != self.unit:
                state = "refused" if entry.refusal else entry.state.value
                found[entry.unit] = Seen(entry.unit, entry.kind, state, entry)
        for unit, sessions in self._tokens.items():
            if sessions and unit not in found and not self._is_gone(unit):
                found[unit] = Seen(unit, next(iter(sessions.values())), State.SUSPECT.value, None)
        for entry in [seen.entry for seen in found.values() if seen.entry is not None]:
            for unit in entry.hears:
                if unit != self.unit and unit not in found and not self._is_gone(unit):
                    kind = KIND if unit.startswith("cc-") else "uav"
                    found[unit] = Seen(unit, kind, State.SUSPECT.value, None)
        chosen = [seen for seen in found.values() if all_kinds or seen.kind == "uav"]
        return sorted(chosen, key=lambda seen: unit_order(seen.unit))

    def _is_gone(self, unit: str) -> bool:
        entry = self.directory.entry(unit)
        return entry is not None and entry.state is State.GONE

    def settled(self, now_us: int, quiet_us: int) -> bool:
        """Somebody is there, everybody there is described, and nothing has changed for `quiet_us`."""
        there = self.platforms(all_kinds=True)
        described = all(seen.entry is not None and seen.entry.version for seen in there)
        return any(seen.kind == "uav" for seen in there) and described and now_us - self.changed_us >= quiet_us

    def offset(self, unit: str) -> Offset | None:
        """The clock of `unit` minus ours."""
        return self.offsets.of(unit)
