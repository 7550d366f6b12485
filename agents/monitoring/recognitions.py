"""Chronicles over a platform's live streams, recognised on request (thesis 8.2). Node clock."""

from itertools import count
from typing import NamedTuple

from dyknow import US_PER_S, Label, Predicted
from dyknow.agents.actions import COORDINATION, SUBSCRIBED, Action, Offer
from dyknow.agents.admission.admission import reason_of
from dyknow.agents.exchange.label_agreements import LabelAgreements
from dyknow.agents.monitoring.text_reading import TextReading
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.tasks.life import TaskLife
from dyknow.federation.members.deadlines import Deadlines
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import MAX_LIST, Content, Expected, Reason, Recognise, Recognised
from dyknow.kpl import parse_chronicles
from dyknow.kpl.checking.error_collector import shortened
from dyknow.kpl.running.chronicle_streams import MAX_DELAY_US
from dyknow.kpl.running.chronicle_watch import ChronicleWatch, PartialWatch
from dyknow.model.errors import ChronicleError, ContentError, DyknowError, Refused
from dyknow.model.instants import US_PER_MS
from dyknow.reasoning.chronicles import ChronicleInstance, Partial, Recogniser, RecognitionLimits
from dyknow.reasoning.chronicles.definition.model import ChronicleFile

TIMEOUT_S = 60.0
MOST, MOST_OF_ONE = 16, 2
"""Requests for chronicles: of all members, and of one."""
MOST_REPORTED = 10_000
LIMITS = RecognitionLimits(events=100_000, events_of_one_binding=1_000, waiting=10_000, found_at_once=1_000)


class Open(NamedTuple):
    """One watch, and its request; `partials` watches for partial instances."""

    act: Act
    watch: ChronicleWatch
    partials: PartialWatch | None


class Recognitions(Part):
    """The chronicles that are being recognised on one platform, on request."""

    offers = (Offer(COORDINATION, (Action(Recognise, "on_recognise", SUBSCRIBED),)),)
    answers = (Expected, Recognised)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._agreements = parts[LabelAgreements]
        self._clock, self._agent, self._network, self._tasks = ports.clock, ports.agent, ports.network, parts[TaskLife]
        self._open: dict[str, Open] = {}
        self._parsing: dict[str, Act] = {}
        self._deadlines: Deadlines[str] = Deadlines()

    @property
    def deadline_us(self) -> int | None:
        return self._deadlines.next_us

    def on_recognise(self, act: Act, content: Recognise, now_us: int) -> None:
        """`(recognise ...)`: agree, inform of each instance as it is recognised until cancelled, or the time is over.

        Raises:
            TextError: the text is wrong, and where.
            Refused: it cannot be recognised, or too many chronicles are watched for.
        """
        conversation = self._tasks.check_free(act.conversation_id, act.sender.unit)
        if conversation in self._open or conversation in self._parsing:
            raise Refused(f"conversation {conversation} is about other chronicles; open one of your own", "other-task")
        self._check_room(act.sender.unit)

        def on_parsed(reading: TextReading[ChronicleFile], federation_us: int) -> None:
            if self._parsing.pop(conversation, None) is not act:
                return
            at_us = self._clock.wall_us(federation_us)
            try:
                self._watch(act, content, reading.result or _read(content.text), at_us)
            except ContentError as wrong:
                self._agent.answer(act, Performative.NOT_UNDERSTOOD, reason_of(wrong), at_us)
            except DyknowError as wrong:
                self._agent.answer(act, Performative.REFUSE, reason_of(wrong), at_us)

        reading = TextReading(content.text, _read, on_parsed)
        if reading.begin(self._network.calls):
            self._parsing[conversation] = act
        else:
            self._watch(act, content, _read(content.text), now_us)

    def _check_room(self, unit: str) -> None:
        share_of = self._agent.acts.share_of
        owner, shares = share_of(unit)
        senders = [each.act.sender.unit for each in self._open.values()]
        senders += [each.sender.unit for each in self._parsing.values()]
        of_one = sum(share_of(each).owner == owner for each in senders)
        if len(senders) >= MOST or of_one >= MOST_OF_ONE * shares:
            text = f"{len(senders)} watch for chronicles here, {of_one} of {owner}; wait for one to end"
            raise Refused(text, "too-many-checks")

    def _watch(self, act: Act, content: Recognise, found: ChronicleFile, now_us: int) -> None:
        """Agree, and watch for them from now on."""
        conversation = act.conversation_id or ""
        delay_us = MAX_DELAY_US if content.delay_s is None else round(content.delay_s * US_PER_S)
        network, numbers = self._network, count(1)

        def on_recognised(instance: ChronicleInstance, prediction: Predicted | None, _at_us: int) -> None:
            if next(numbers) <= MOST_REPORTED:
                self._inform(act, _recognised(instance, prediction))

        def on_fault(label: Label, text: str) -> None:
            self._inform(act, Reason(text=f"{label}: {text}"[:1000]))

        def refusal(label: Label) -> str:
            stream = network.behind(label)
            try:
                self._agreements.check_stream(act.sender.unit, label if stream is None else stream.label)
            except Refused as refused:
                return str(refused)
            return ""

        self._agent.answer(act, Performative.AGREE, None, now_us)
        watch = ChronicleWatch(network, found, delay_us, on_recognised, on_fault, LIMITS, refusal=refusal)
        expected = dict[str, Expected]()

        def on_partials(found: tuple[Partial, ...], _valid_us: int, _now_us: int) -> None:
            now = {repr(each): _expected(each) for each in found}
            gone = [expected.pop(name).model_copy(update={"over": True}) for name in expected.keys() - now.keys()]
            new = [each for name, each in now.items() if name not in expected]
            expected.update(now)
            for each in (*gone, *new):
                if next(numbers) <= MOST_REPORTED:
                    self._inform(act, each)

        partials = PartialWatch(network, watch, None, on_partials) if content.partial else None
        self._open[conversation] = Open(act, watch, partials)
        self._deadlines.set(conversation, now_us + round((content.timeout_s or TIMEOUT_S) * US_PER_S))

    def _inform(self, act: Act, content: Content) -> None:
        """At the time at which the streams are."""
        self._agent.answer(act, Performative.INFORM, content, self._clock.wall_us(self._network.now_us))

    def on_cancel(self, act: Act, now_us: int) -> bool:
        return self.on_lost(act, now_us)

    def on_lost(self, act: Act, _now_us: int) -> bool:
        """The requester no longer wants to know."""
        conversation = act.conversation_id or ""
        parsing = self._parsing.get(conversation)
        if parsing is not None and parsing.sender.unit == act.sender.unit:
            del self._parsing[conversation]
            return True
        watch = self._open.get(conversation)
        if watch is None or watch.act.sender.unit != act.sender.unit:
            return False
        self._drop(conversation)
        return True

    def on_time(self, now_us: int) -> None:
        """End what is over."""
        for conversation in self._deadlines.pop_due(now_us):
            self._agent.end(conversation, self._drop(conversation).act.sender.unit, "its time is over", now_us)

    def _drop(self, conversation: str) -> Open:
        found = self._open.pop(conversation)
        self._deadlines.set(conversation, None)
        if found.partials is not None:
            found.partials.cancel()
        found.watch.cancel()
        return found


def _read(text: str) -> ChronicleFile:
    """The chronicles of a text.

    Raises:
        TextError: it is wrong, and where.
        Refused: they cannot be recognised.
    """
    found = parse_chronicles(text)
    if not found.chronicles:
        raise Refused("text: expected at least one chronicle, got none", "text")
    try:
        Recogniser.of(found)
    except ChronicleError as wrong:
        raise Refused(str(wrong), "text") from None
    return found


def _recognised(instance: ChronicleInstance, prediction: Predicted | None) -> Recognised:
    return Recognised(
        chronicle=instance.chronicle,
        bindings=dict(instance.bindings),
        instants={name: at_ms * US_PER_MS for name, at_ms in instance.instants.items()},
        recognised_us=instance.recognised_ms * US_PER_MS,
        made_us=None if prediction is None else prediction.made_us,
    )


def _expected(partial: Partial) -> Expected:
    return Expected(
        chronicle=partial.chronicle,
        bindings=dict(partial.bindings),
        instants={name: at_ms * US_PER_MS for name, at_ms in partial.instants.items()},
        missing=tuple(map(shortened, partial.missing[:MAX_LIST])),
        until_us=None if partial.dies_ms is None else partial.dies_ms * US_PER_MS,
    )
