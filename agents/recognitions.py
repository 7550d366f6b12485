"""Chronicles over a platform's live streams, for somebody who wants to know now (thesis 8.2). Node clock."""

from itertools import count
from typing import NamedTuple

from agents.context import Context
from dyknow import US_PER_S, Label
from dyknow.errors import ChronicleError, Refused
from dyknow.instants import US_PER_MS
from federation.acts import Act, Performative
from federation.contents import Content, Reason, Recognise, Recognised
from federation.deadlines import Deadlines
from kpl import parse_chronicles
from kpl.chronicle_streams import MAX_DELAY_US, ChronicleWatch
from reasoning.chronicles import Instance, Limits, Recogniser

TIMEOUT_S = 60.0
MOST = 4
MOST_TOLD = 10_000
LIMITS = Limits(events=100_000, events_of_one_binding=1_000, waiting=10_000, found_at_once=1_000)


class Open(NamedTuple):
    """One watch, and for whom."""

    act: Act
    watch: ChronicleWatch


class Recognitions:
    """What is being watched for on one platform."""

    def __init__(self, context: Context) -> None:
        self._c = context
        self._open: dict[str, Open] = {}
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
        conversation = self._c.tasks.check_free(act.conversation_id)
        if conversation in self._open:
            raise Refused(f"conversation {conversation} is about other chronicles")
        if len(self._open) >= MOST:
            raise Refused(f"{MOST} watch for chronicles here already; wait for one to end")
        found = parse_chronicles(content.text)
        if not found.chronicles:
            raise Refused("there is no chronicle in the text")
        try:
            Recogniser.of(found)
        except ChronicleError as wrong:
            raise Refused(str(wrong)) from None
        delay_us = MAX_DELAY_US if content.delay_s is None else round(content.delay_s * US_PER_S)
        network, numbers = self._c.gateway.network, count(1)

        def on_recognised(instance: Instance, _at_us: int) -> None:
            if next(numbers) <= MOST_TOLD:
                self._inform(act, _said(instance))

        def on_fault(label: Label, said: str) -> None:
            self._inform(act, Reason(text=f"{label}: {said}"[:1000]))

        self._c.desk.answer(act, Performative.AGREE, None, now_us)
        self._open[conversation] = Open(act, ChronicleWatch(network, found, delay_us, on_recognised, on_fault, LIMITS))
        self._deadlines.set(conversation, now_us + round((content.timeout_s or TIMEOUT_S) * US_PER_S))

    def _inform(self, act: Act, said: Content) -> None:
        """At the time at which the streams are."""
        self._c.desk.answer(act, Performative.INFORM, said, self._c.clock.wall_us(self._c.gateway.network.now_us))

    def cancel(self, conversation: str, by: str) -> bool:
        """Whoever asked does not want to know any more; whether there was such a watch."""
        found = self._open.get(conversation)
        if found is None or found.act.sender.unit != by:
            return False
        self._drop(conversation)
        return True

    def on_time(self, now_us: int) -> None:
        """End what is over."""
        for conversation in self._deadlines.pop_due(now_us):
            self._c.desk.end(conversation, self._drop(conversation).act.sender.unit, "its time is over", now_us)

    def _drop(self, conversation: str) -> Open:
        found = self._open.pop(conversation)
        self._deadlines.set(conversation, None)
        found.watch.cancel()
        return found


def _said(instance: Instance) -> Recognised:
    return Recognised(
        chronicle=instance.chronicle,
        bindings=dict(instance.bindings),
        instants={name: at_ms * US_PER_MS for name, at_ms in instance.instants.items()},
        recognised_us=instance.recognised_ms * US_PER_MS,
    )
