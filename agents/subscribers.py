"""Subscriptions to events of this platform: an agree now, an inform of each event until it is cancelled or lost."""

from collections.abc import Iterator
from typing import Final

from dyknow.agents.interface import InterfaceAgent
from dyknow.agents.tasks.life import TaskLife
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import Content
from dyknow.model.errors import Refused

OF_ONE: Final = 8
"""Subscriptions to one kind of event that a member may have."""


class Subscribers:
    """The subscriptions to one kind of event, by unit and conversation."""

    def __init__(self, agent: InterfaceAgent, tasks: TaskLife) -> None:
        self._agent, self._tasks = agent, tasks
        self._acts: dict[tuple[str, str], Act] = {}

    def __contains__(self, subscriber: object) -> bool:
        return subscriber in self._acts

    def __iter__(self) -> Iterator[tuple[str, str]]:
        return iter(self._acts)

    def __len__(self) -> int:
        return len(self._acts)

    def add(self, act: Act, now_us: int) -> None:
        """Agree to a subscription.

        Raises:
            ContentError: it has no conversation.
            Refused: that is about a task; `too-many-subscriptions`: the sender has enough.
        """
        share_of = self._agent.acts.share_of
        owner, shares = share_of(act.sender.unit)
        if sum(share_of(unit).owner == owner for unit, _ in self._acts) >= OF_ONE * shares:
            text = f"{owner} has {OF_ONE * shares} subscriptions of this kind: cancel some"
            raise Refused(text, "too-many-subscriptions")
        self._acts[act.sender.unit, self._tasks.check_free(act.conversation_id, act.sender.unit)] = act
        self._agent.answer(act, Performative.AGREE, None, now_us)

    def remove(self, act: Act) -> bool:
        """End the subscription that `act` cancels, or opened; whether there was one."""
        return self._acts.pop((act.sender.unit, act.conversation_id or ""), None) is not None

    def inform(self, content: Content, now_us: int) -> None:
        """Send an event to every subscriber."""
        for act in list(self._acts.values()):
            self._agent.answer(act, Performative.INFORM, content, now_us)
