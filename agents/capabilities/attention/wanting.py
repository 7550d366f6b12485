"""`(want symbol: suspect type: cars description: "...")`: an object that is described is looked for until that is cancelled.

An object that comes into view and fits the description is given the symbol, with or without a camera turned to it
(`attend`). The requester is notified when it is found, tracked, lost and found again, at most once a second.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple, Protocol

from dyknow import Label
from dyknow.agents.actions import Offer, Role
from dyknow.agents.capabilities.attention.requests import WANT
from dyknow.agents.exchange.label_agreements import LabelAgreements
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.specification.specification_part import SPECIFICATION
from dyknow.agents.tasks.life import TaskLife
from dyknow.agents.tasks.task import Task
from dyknow.anchoring.links.objects import LinkEvent
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import Progress, WantObject
from dyknow.federation.messages.descriptions import in_one_line
from dyknow.kpl import parse_formula
from dyknow.kpl.introspection.link_reasons import because
from dyknow.kpl.linking.streams import LinkStream
from dyknow.kpl.linking.wants import check_want
from dyknow.kpl.syntax.specification import WantDeclaration
from dyknow.model.errors import Refused, SortError, TextError, did_you_mean
from dyknow.model.members import member_name

MOST_OF_ONE: Final = 4
"""Objects that one member may have looked for."""
EVERY_US: Final = 1_000_000
LONGEST_TEXT: Final = 400
STATES: Final = {"find": "found", "track": "tracked", "reacquire": "found again", "lost": "lost: looked for"}
"""Words for the requester and the list of tasks, by event."""


@dataclass(slots=True)
class _Search:
    """The search of one task.

    Attributes:
        text: for the requester, not sent yet.
        due_us: when the next may be sent.
    """

    task: Task
    symbol: str
    text: str = ""
    due_us: int = 0


class WantedTask(NamedTuple):
    """An object that is looked for, for which task, and by what act's content; `on_event` takes what becomes of it."""

    task: Task
    content: WantObject
    want: WantDeclaration
    on_event: Callable[[LinkEvent], None]


class AnchorRecoveries(Protocol):
    """The interface to the part that looks again while it is open which object is the wanted one."""

    def begin(self, wanted: WantedTask, now_us: int) -> Callable[[int], None]: ...
    def on_event(self, conversation: str, event: LinkEvent) -> None: ...


class Wanting(Part):
    """The objects that others have looked for. Node clock.

    Attributes:
        recoveries: None: this platform has no vehicle with a camera.
    """

    offers = (Offer(SPECIFICATION, (WANT,)),)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._agent, self._directory, self._agreements = ports.agent, ports.directory, parts[LabelAgreements]
        self._tasks, self._instance = parts[TaskLife], ports.instance()
        self._role_of = ports.role_of
        self._searches: dict[str, _Search] = {}
        self.recoveries: AnchorRecoveries | None = None

    def on_want(self, act: Act, content: WantObject, now_us: int) -> None:
        """Look for it until the task is cancelled.

        Raises:
            Refused: `too-many`; `unknown-type`: nothing links such objects; `text`: the description, or the symbol, is
                wrong; `taken`; the requester may not see such objects.
        """
        conversation, sender = self._tasks.check_free(act.conversation_id, act.sender.unit), act.sender.unit
        share_of = self._agent.acts.share_of
        owner, shares = share_of(sender)
        held = [each.symbol for each in self._searches.values() if share_of(each.task.initiator).owner == owner]
        if len(held) >= MOST_OF_ONE * shares:
            text = f"{sender} has {len(held)} objects looked for here already, {', '.join(held[:16])}: cancel one (dyknow tasks)"
            raise Refused(text, "too-many")
        stream = self._stream(content.type)
        self._agreements.check_stream(sender, stream)
        want = self._declared(content, stream)
        task = Task(
            conversation, sender, WantObject.head, lambda _at_us: (), state=f"looks for {want.symbol}", since_us=now_us
        )
        self._searches[conversation] = _Search(task, want.symbol)
        try:
            forget = self._begin(WantedTask(task, content, want, partial(self._on_event, conversation)), now_us)
        except Refused:
            del self._searches[conversation]
            raise

        def take_down(at_us: int) -> tuple[str, ...]:
            self._searches.pop(conversation, None)
            forget(at_us)
            return ()

        task.take_down = take_down
        self._tasks.add(task)
        self._agent.answer(act, Performative.AGREE, None, now_us)

    def _begin(self, wanted: WantedTask, now_us: int) -> Callable[[int], None]:
        """Look for it; returns a function that ends that. Raises Refused."""
        if wanted.content.recover == "no":
            undo = self._instance.parts.want(wanted.want, wanted.on_event)
            return lambda _at_us: undo()
        if self.recoveries is None:
            raise Refused("this platform has no vehicle with a camera, to look again with", "no-vehicle")
        if self._role_of(wanted.task.initiator) is not Role.COMMAND_CENTRE:
            raise Refused("recover flies the vehicle, which only a command centre may ask for", "role")
        return self.recoveries.begin(wanted, now_us)

    def _stream(self, type_: str) -> Label:
        """The stream of objects of a type: its label, or the sort of its objects where that is of one stream."""
        network = self._instance.network
        linked = [label for label in network.labels() if isinstance(network.process(label), LinkStream)]
        of_sort = [label for label in linked if network.generator(label).sort.name == type_]
        named = [label for label in linked if str(label) == type_] or of_sort
        if len(named) != 1:
            known = [str(each) for each in of_sort or linked]
            remedy = did_you_mean(type_, known[:32]) or " Its specification has no strmgen NAME = link(...)."
            raise Refused(f"no objects of type {type_!r} are linked here.{remedy}", "unknown-type")
        return named[0]

    def _declared(self, content: WantObject, stream: Label) -> WantDeclaration:
        symbol, text = content.symbol, content.description
        try:
            if member_name(symbol).isdecimal() or self._instance.parts.objects.is_other(symbol):
                raise Refused(f"{symbol} is a unit: give what is wanted the name of no unit", "taken")
            want = WantDeclaration(symbol, stream, parse_formula(text, frozenset({symbol})))
            check_want(want, self._instance.current_symbols(), text)
        except SortError as wrong:
            raise Refused(f"symbol: {wrong}; a symbol is a name, as suspect", "text") from None
        except TextError as wrong:
            raise Refused(f"description: {wrong}", "text") from None
        return want

    def _on_event(self, conversation: str, event: LinkEvent) -> None:
        search = self._searches[conversation]
        if self.recoveries is not None:
            self.recoveries.on_event(conversation, event)
        search.task.state = f"{search.symbol} is {STATES[event.kind]}"
        shown = f" by {event.source}" if event.source else ""
        search.text = f"{search.symbol} is {STATES[event.kind]}{shown}: {in_one_line(because(event.reason))}"

    # -- telling -----------------------------------------------------------------------------------------------

    @property
    def deadline_us(self) -> int | None:
        return min((each.due_us for each in self._searches.values() if each.text), default=None)

    def on_time(self, now_us: int) -> None:
        for search in self._searches.values():
            if search.text and now_us >= search.due_us:
                text, search.text, search.due_us = search.text[:LONGEST_TEXT], "", now_us + EVERY_US
                unit = search.task.initiator
                if self._directory.is_present(unit):
                    progress = Progress(step=text, unit=self._agent.unit)
                    self._agent.tell(unit, progress, now_us, conversation=search.task.conversation)
