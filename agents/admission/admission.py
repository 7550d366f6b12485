"""Which acts are let in: limits, services, visibility and roles, from the table of actions (thesis 9.3.2).

A public service answers any agent on any platform, a protected one only through the Interface Agent. A private function
is no service: only parts of the same platform call it, no act reaches it. Times are the node clock.
"""

from collections.abc import Callable, Iterable
from typing import Any, TypeAlias

from dyknow.agents.actions import Action, Role, ServiceTable
from dyknow.agents.admission.limits import TEXT_BURST, TEXT_PER_S, text_in
from dyknow.agents.containment import place_of
from dyknow.agents.part import ClockCompared, Followed, Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.tasks.command_watch import SHOWN, CommandWatch
from dyknow.federation import keys
from dyknow.federation.members.correspondence import INTERFACE, UNANSWERED
from dyknow.federation.members.offers import Service, Visibility
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import Done, Reason, read
from dyknow.federation.messages.descriptions import ConditionEntry
from dyknow.federation.messages.protocols import OPENING
from dyknow.federation.shares import COMMANDING, ActLimits
from dyknow.federation.transport import Arrived
from dyknow.model import errors

P = Performative
Handler: TypeAlias = Callable[[Act, Any, int], None]
LONGEST_REASON = 1000


class Denied(errors.Refused):
    """Refused at the door: the audit log counts it by its code."""


NOT_TAKEN = {
    P.PROXY: "an act that is passed on would have the authority of this platform, not that of its sender: ask the platforms "
    "themselves, or this one for all by (query ... scope: global)",
    P.REQUEST_WHENEVER: "a task is not repeated without a request for each time: declare a monitor, follow its alarms, or ask once "
    "by request-when",
}
"""Performatives that no service takes, and why."""


def reason_of(error: errors.DyknowError) -> Reason:
    """Why something was refused, failed or not understood, as it is answered."""
    text = str(error)[:LONGEST_REASON]
    if isinstance(error, errors.Refused):
        return Reason(text=text, code=error.code or None, leader=error.leader, generation=error.generation)
    return Reason(text=text, code="unknown-label" if isinstance(error, errors.UnknownLabel) else None)


class Admission(Part):
    """Admits acts and passes each to the part that handles it.

    Args:
        agent: speaks and listens.
        parts: all others of the platform: their actions, cancels and losses.
        limits: how much one member may ask.
        share_of: under which name it is counted.
        role_of: unit -> its role.
        refuse: counts messages that are dropped before they are decoded as acts.
        contain: contains errors that the part handling an act raises.
        watch: takes acts that are refused for their sender.
        offer: called when the conditions that `ls` shows change.

    Raises:
        UnitError: a part has no method that an action of it names.
        ContentError: two parts understand the same content.
    """

    vital = True
    arrivals = {"acl": "on_act"}  # noqa: RUF012  (a declaration)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        handling = ports.handling()
        self._interface, self._parts, self._limits = ports.agent, tuple(handling), ports.limits
        self._role_of = ports.role_of
        self._share_of, self._offer, self._refusals = ports.share_of, ports.offer, ports.agent.conversations.refusals
        self._texts = ActLimits(TEXT_PER_S, TEXT_BURST)
        self._contain, self._refuse, self._unit = ports.contain, ports.refuse, ports.agent.unit
        self._watch = parts[CommandWatch]
        self.table = ServiceTable(offer for part in handling for offer in part.offers)
        self._handlers: dict[str, Handler] = {
            action.head: _handler(part, action)
            for part in handling
            for offer in part.offers
            for action in offer.actions
        }

    # -- events ------------------------------------------------------------------------------------------------

    def on_act(self, event: Arrived, now_us: int) -> Followed:
        """Take bytes that arrived on an act key; raises DecodeError for any other key."""
        key = keys.parse_key(event.key)
        if not isinstance(key, keys.ActKey):
            raise errors.DecodeError("key")
        if key.sender == self._unit:
            self._refuse("our own name")
        elif self._interface.acts.on_arrived(event, key, now_us):
            self._admit_all(now_us)
        else:
            return ()
        return None

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        if not isinstance(change, ClockCompared):
            self._interface.member.follow(change, now_us)
        self._admit_all(now_us)

    @property
    def deadline_us(self) -> int | None:
        """At once, for a request whose condition has become true."""
        return 0 if self._interface.requests else self._refusals.deadline_us

    def on_time(self, now_us: int) -> None:
        self._refusals.on_time(now_us)
        self._admit_all(now_us)

    def conditions(self) -> Iterable[ConditionEntry]:
        """The members that are refused more than is answered."""
        return [ConditionEntry(text=each.text, since_us=each.since_us) for each in [*self._refusals.shown()][-SHOWN:]]

    def flush(self) -> None:
        """Acknowledge what no act of this step did."""
        self._interface.acts.flush()

    # -- admission ---------------------------------------------------------------------------------------------

    def _admit_all(self, now_us: int) -> None:
        """Admit what arrived, each noted with its outcome; end what was lost."""
        interface = self._interface
        while interface.requests or interface.lost:
            if interface.requests:
                act = interface.requests.pop(0)
                with interface.audit_log.on_arrival(now_us, act) as comes_to:
                    comes_to(self._consider(act, now_us))
            else:
                opening = interface.lost.pop(0)
                any(self._contain.call(part.on_lost, opening, now_us, otherwise=False) for part in self._parts)
        if self._refusals.is_news:
            self._refusals.is_news = False
            self._offer(now_us)

    def _consider(self, act: Act, now_us: int) -> str:
        """Do what the act asks for, or answer why not; returns the outcome in words."""
        try:
            self._admit(act, now_us)
        except errors.ContentError as wrong:
            is_said = self._answer(act, P.NOT_UNDERSTOOD, wrong, now_us)
            return f"not understood: {wrong}" if is_said else UNANSWERED
        except errors.ValueNotAvailable as wrong:
            self._answer(act, P.FAILURE, wrong, now_us)
        except errors.DyknowError as wrong:
            is_said = self._answer(act, P.REFUSE, wrong, now_us)
            if isinstance(wrong, errors.Refused):
                self._watch.refuse(act, wrong, now_us)
            if not is_said:
                return UNANSWERED
            return f"{wrong.code.replace('-', ' ') if isinstance(wrong, Denied) else 'refused'}: {wrong}"
        except Exception as wrong:  # noqa: BLE001  (contained)
            head = "cancel" if act.content is None else act.content.head
            self._contain.caught(f"({head} ...)", wrong, act.sender.unit, by_act=True)
            failed = errors.Refused(
                f"({head} ...) failed here: {type(wrong).__name__}; the platform continues", "failed"
            )
            self._answer(act, P.FAILURE, failed, now_us)
            return f"failed: {type(wrong).__name__}"
        return "accepted"

    def _answer(self, act: Act, performative: Performative, error: errors.DyknowError, now_us: int) -> bool:
        """Send a refusal; False if its sender is sent too many. Never answer a not-understood, or two agents could loop."""
        if act.performative not in OPENING and act.performative is not P.CANCEL:
            return True
        return self._interface.acts.refuse(act._replace(reply_to=None), performative, reason_of(error), now_us)

    def _admit(self, act: Act, now_us: int) -> None:
        """Check an act against limits, services and roles, and pass it to its part.

        Raises:
            Denied, ContentError, and the errors of the part that handles it.
        """
        sender = act.sender.unit
        if not self._contain.is_heard(sender):
            raise Denied(f"acts of {sender} made parts of {self._unit} fail: none is taken for a minute", "not-heard")
        owner, shares = self._share_of(sender)
        if not self._limits.admit(owner, now_us, 1 / shares):
            raise Denied(f"too many acts from {sender}; ask more slowly", "too-many-acts")
        if act.reply_to is not None and act.reply_to.unit != sender:
            raise Denied(f"answers go to {sender}, the requester, and to no other platform", "reply-to-another")
        if act.performative is P.CANCEL:
            self._cancel(act, now_us)
            return
        if act.performative in NOT_TAKEN:
            raise Denied(f"{act.performative} is not taken: {NOT_TAKEN[act.performative]}", "performative")
        if act.content is None:
            raise errors.ContentError("an act without content has no meaning")
        self._check_text(act, now_us)
        content = read(act.content)
        service, action = self.table.of(content.head, act.performative)
        self._check_door(act, service)
        self._check_role(sender, action)
        self._handlers[content.head](act, content, now_us)

    def _check_door(self, act: Act, service: Service) -> None:
        """The rules of thesis 9.3.2: whether an agent of another platform reaches the service in that way."""
        through_interface = act.receiver.agent == INTERFACE
        if not through_interface and act.receiver.agent != service.agent:
            raise errors.ContentError(f"{act.receiver.agent} does not understand this: ask {service.agent}")
        if service.visibility is Visibility.PROTECTED and not through_interface:
            text = f"{service.service} is protected on {self._unit}; ask {INTERFACE}@{self._unit}"
            raise Denied(text, Visibility.PROTECTED)

    def _check_text(self, act: Act, now_us: int) -> None:
        """Raise Denied if the sender has sent more text of late than is read here."""
        cost = text_in(act.content)
        if cost == 0:
            return
        sender = act.sender.unit
        share = COMMANDING if self._role_of(sender) is Role.COMMAND_CENTRE else 1
        if not self._texts.admit(self._share_of(sender).owner, now_us, cost / share):
            text = f"{sender} sends more than {share * TEXT_PER_S:.0f} characters a second; ask more slowly"
            raise Denied(text, "too-much-text")

    def _check_role(self, unit: str, action: Action) -> None:
        if self._role_of(unit) >= action.role:
            return
        if action.role is Role.COMMAND_CENTRE:
            raise Denied(f"only a command centre may ask for ({action.head} ...)", "role")
        raise Denied(f"an observer may ask and subscribe, but not for ({action.head} ...)", "role")

    def _cancel(self, act: Act, now_us: int) -> None:
        reason = Reason(text=f"no task {act.conversation_id} on this platform", code="unknown-task")
        for part in self._parts:
            try:
                is_ended = part.on_cancel(act, now_us)
            except errors.DyknowError:
                raise
            except Exception as wrong:  # noqa: BLE001  (contained)
                self._contain.caught(place_of(part.on_cancel), wrong, act.sender.unit)
                reason = Reason(text=f"(cancel) failed here: {type(wrong).__name__}", code="failed")
            else:
                if is_ended:
                    self._interface.answer(act, P.INFORM, Done(), now_us)
                    return
        self._interface.answer(act, P.FAILURE, reason, now_us)


def _handler(part: Part, action: Action) -> Handler:
    handler: Handler | None = getattr(part, action.handler, None)
    if handler is None:
        raise errors.UnitError(
            f"({action.head} ...): {type(part).__name__} has no method {action.handler} to handle it"
        )
    return handler
