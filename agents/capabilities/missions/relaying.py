"""Missions on a platform without a vehicle, as a command post: it reads them, and delegates each on as a whole (thesis 9.4).

It goes to the first platform present that has a vehicle of the problem, which leads it, with the chain of those that
have delegated. Reports are forwarded; a cancel is passed on.
"""

from functools import partial
from typing import Final

from dyknow.agents.actions import COORDINATION, Action, Offer
from dyknow.agents.admission.mission_permits import Permits
from dyknow.agents.capabilities.missions.mission_texts import MissionTexts
from dyknow.agents.capabilities.missions.searches import MissionSearches
from dyknow.agents.effects import SearchOver
from dyknow.agents.part import Followed, Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.tasks.authority import Authority
from dyknow.agents.tasks.life import TaskLife
from dyknow.agents.tasks.task import Task
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import Content, Done, FlyMission, Progress, Reason
from dyknow.model.errors import Refused

P = Performative
MOST: Final = 4
AGREE_US: Final = 15_000_000
"""How long the platform that is to lead a mission may take to read it, and agree."""


class MissionRelay(Part):
    """See the module."""

    offers = (Offer(COORDINATION, (Action(FlyMission, "on_fly"),)),)
    takes = {SearchOver: "on_search_over"}  # noqa: RUF012  (a declaration)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._agent, self._directory = ports.unit, ports.agent, ports.directory
        self._tasks, self._note = parts[TaskLife], ports.note
        self._permits = Permits(ports.unit, ports.role_of, parts[Authority])
        self._relayed: dict[str, tuple[Act, str]] = {}
        self._reading: dict[tuple[str, str], FlyMission] = {}
        self._searches = MissionSearches(ports.emit)

    def on_fly(self, act: Act, content: FlyMission, now_us: int) -> None:
        """`(fly-mission ...)`: until it is over or cancelled.

        Raises:
            Refused: the sender may not, or texts of too many missions are read.
        """
        sender, conversation = act.sender.unit, self._tasks.check_free(act.conversation_id, act.sender.unit)
        self._permits.check(content.mission, sender, act.boot, now_us)
        self._permits.check_chain(content.chain, sender)
        name = sender, conversation
        if name in self._reading or len(self._reading) >= MOST:
            raise Refused(f"the texts of {MOST} missions are read already", "busy")
        self._reading[name] = content

        def on_read(texts: MissionTexts | Reason, at_us: int) -> None:
            del self._reading[name]
            wrong = texts if isinstance(texts, Reason) else self._relay(act, conversation, content, texts, at_us)
            if wrong is not None:
                self._agent.answer(act, P.REFUSE, wrong, at_us)

        self._searches.read(content, content, on_read)

    def on_search_over(self, event: SearchOver, now_us: int) -> Followed:
        """Texts were read."""
        self._searches.on_over(event, now_us)
        return None

    def on_cancel(self, act: Act, now_us: int) -> bool:  # noqa: ARG002  (as every part)
        """Cancel a mission while its texts are read."""
        content = self._reading.pop((act.sender.unit, act.conversation_id or ""), None)
        if content is not None:
            self._searches.end(content)
        return content is not None

    def _relay(
        self, act: Act, conversation: str, content: FlyMission, texts: MissionTexts, now_us: int
    ) -> Reason | None:
        """Delegate it on; return why that is not possible."""
        sender, wanted = act.sender.unit, list(dict.fromkeys(texts.platforms.values()))
        leader = next((each for each in wanted if each != self._unit and self._directory.is_present(each)), None)
        if leader is None:
            text = f"none of the platforms {', '.join(wanted)} is there to lead the mission"
            return Reason(text=text[:1000], code="no-unit")
        chain = (*(content.chain or (sender,)), self._unit)
        self._note(f"mission {content.mission}: delegated on, {' > '.join((*chain, leader))}")
        asked = self._agent.delegate(
            leader, content.model_copy(update={"chain": chain}), now_us, reply_within_us=AGREE_US,
            on_reply=partial(self._on_reply, conversation, leader), on_silence=partial(self._fail, conversation, leader),
        )  # fmt: skip
        self._relayed[conversation] = act, asked
        take_down = partial(self._taken_down, conversation, leader)
        self._tasks.add(Task(conversation, sender, FlyMission.head, take_down, since_us=now_us))
        return None

    def _on_reply(self, conversation: str, leader: str, reply: Act, content: Content | None, now_us: int) -> None:
        act, _ = self._relayed.get(conversation, (None, ""))
        if act is None:
            return
        if reply.performative is P.AGREE:
            self._agent.answer(act, P.AGREE, None, now_us)
            self._report(act, f"leads: platform {leader}", leader, now_us)
        elif isinstance(content, Progress):
            self._report(act, content.step, content.unit or leader, now_us)
        elif isinstance(content, Done):
            self._end(conversation, P.INFORM, content, now_us)
        else:
            why = content.text if isinstance(content, Reason) else str(reply.performative)
            performative = P.REFUSE if reply.performative is P.REFUSE else P.FAILURE
            code = content.code if isinstance(content, Reason) else None
            self._end(conversation, performative, Reason(text=f"platform {leader}: {why}"[:1000], code=code), now_us)

    def _report(self, act: Act, step: str, unit: str, now_us: int) -> None:
        if self._directory.is_present(act.sender.unit):
            progress = Progress(step=step[:1000], unit=unit)
            self._agent.tell(act.sender.unit, progress, now_us, conversation=act.conversation_id)

    def _fail(self, conversation: str, leader: str, why: str, now_us: int) -> None:
        self._end(conversation, P.FAILURE, Reason(text=f"platform {leader}: {why}"[:1000]), now_us)

    def _end(self, conversation: str, performative: Performative, content: Content, now_us: int) -> None:
        act, _ = self._relayed.pop(conversation, (None, ""))
        if act is not None:
            self._agent.answer(act, performative, content, now_us)
            self._tasks.cancel(conversation, now_us)

    def _taken_down(self, conversation: str, leader: str, now_us: int) -> tuple[str, ...]:
        """Cancel a mission at its leader when it is cancelled here."""
        _, asked = self._relayed.pop(conversation, (None, ""))
        if asked:
            self._agent.cancel(leader, asked, now_us)
        return ()

    def on_lost(self, act: Act, now_us: int) -> bool:  # noqa: ARG002  (as every part)
        """A delegator that is gone does not end its mission."""
        return any(each is act for each, _ in self._relayed.values())
