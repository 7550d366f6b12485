"""Queries about the audit log of a platform, and subscriptions to it (thesis 9.3.2)."""

from typing import Final

from dyknow.agents.actions import QUERIED, SUBSCRIBED, Action, Offer, Role
from dyknow.agents.audit_log import AuditEntry
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.subscribers import Subscribers
from dyknow.agents.tasks.life import TaskLife
from dyknow.federation.members.offers import Service
from dyknow.federation.messages.acts import Act
from dyknow.federation.messages.contents import ActList, ActLog, Acts, Content
from dyknow.federation.messages.contents.parts import uncontrolled
from dyknow.federation.messages.sexpr import Expr

ACTS_A_PAGE = 25
LONGEST_ACT = 2000
LONGEST_OUTCOME = 400
AUDIT_LOG: Final = Service("account", "account")


class MessageLog(Part):
    """Answers what passed, and informs subscribers of every act as it passes."""

    offers = (
        Offer(
            AUDIT_LOG,
            (
                Action(Acts, "on_subscribe", SUBSCRIBED, Role.OBSERVER),
                Action(ActList, "on_act_list", QUERIED, Role.OBSERVER),
            ),
        ),
    )
    answers = (ActLog,)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._audit_log, self._agent = ports.agent.audit_log, ports.agent
        self._subscribers = Subscribers(ports.agent, parts[TaskLife])
        ports.agent.audit_log.subscribe(self._on_entry)

    def on_subscribe(self, act: Act, _content: Acts, now_us: int) -> None:
        """`(acts)`"""
        self._subscribers.add(act, now_us)

    def on_act_list(self, act: Act, _content: Content, now_us: int) -> None:
        """`(act-list)`"""
        acts = [_content_of(entry) for entry in self._audit_log.entries]
        self._agent.answer_pages(act, acts, ACTS_A_PAGE, lambda page, more: ActList(acts=page, more=more), now_us)

    def _on_entry(self, entry: AuditEntry) -> None:
        """Inform the subscribers, except of acts in the conversations in which they subscribed."""
        if not self._subscribers:
            return
        if entry.act is None or (entry.peer, entry.act.conversation_id) not in self._subscribers:
            self._subscribers.inform(_content_of(entry), entry.at_us)

    def on_cancel(self, act: Act, _now_us: int) -> bool:
        return self._subscribers.remove(act)

    def on_lost(self, act: Act, _now_us: int) -> bool:
        return self._subscribers.remove(act)


def _content_of(entry: AuditEntry) -> ActLog:
    """Content of an entry; a logged `act-list` is sent without its entries, or it would hold the log again."""
    act = entry.act
    if act is not None and act.content is not None and act.content.head == ActList.head:
        rest = {name: value for name, value in act.content.arguments.items() if name != "acts"}
        act = act._replace(content=Expr(ActList.head, rest))
    text = None if act is None else uncontrolled(str(act))
    if text is not None and len(text) > LONGEST_ACT:
        text = f"{text[: LONGEST_ACT - 3]}..."
    return ActLog(
        at_us=entry.at_us,
        direction=entry.direction,
        peer=entry.peer,
        outcome=entry.outcome[:LONGEST_OUTCOME],
        act=text,
    )
