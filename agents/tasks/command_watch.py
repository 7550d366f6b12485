"""The commander of the vehicle, where that is not the delegate, and platforms that were refused: shown, and an alarm.

After a task was delegated to one platform its vehicles may obey another one, as is due: the alarm `commander` opens with the
first successor that is obeyed, and closes when the delegate is obeyed again, or no platform is; the delegator hears it as progress
of its task. `refused-commander` opens with a request that a platform has no right to make, and closes after a minute
without another attempt. Of one platform there is one alarm, however much it sends. While a platform has only just appeared, another one may not
know yet that it is no successor any longer: such attempts are shown, and are no alarm. Times are the node clock.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

from dyknow.agents.part import Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.tasks.authority import Authority, TaskEvidence
from dyknow.federation.members.liveness import PlatformAppeared
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import Progress
from dyknow.federation.messages.descriptions import ConditionEntry
from dyknow.model.errors import Refused
from dyknow.reasoning import AlarmEvent

COMMANDER: Final = "commander"
REFUSED: Final = "refused-commander"
REVOKED: Final = "revoked-delegator"
ABOUT_COMMANDERS: Final = frozenset({COMMANDER, REFUSED, REVOKED})
"""Alarms for users alone: the platform that they are about has no such monitor."""
TURNS: Final = frozenset({"succession", "led-by"})
"""Refusals out of turn."""
CODES: Final = frozenset({"role", "unproven", *TURNS})
"""Refusals for the sender, not for the content."""
SETTLED_US: Final = 5_000_000
"""How long after a platform has appeared all know the order."""
QUIET_US: Final = 60_000_000
REVOKED_US: Final = 600_000_000
"""How long it is shown what ended with a revocation."""
MOST: Final = 8
"""Platforms whose attempts are remembered."""
SHOWN: Final = 2
_TEXT: Final = 200


@dataclass(slots=True)
class Attempts:
    """A platform's requests without the right to them: the first, how often, since when, and their alarm, if any."""

    what: str
    alarm: str
    since_us: int
    last_us: int
    count: int = 1

    @property
    def how(self) -> str:
        """How often, in words that change seldom."""
        if self.count == 1:
            return "once"
        return f"{max(2, 10 ** (len(str(self.count)) - 1))} times or more"


class EndedByRevocation(NamedTuple):
    """Tasks ended by the revocation of the member that delegated them, and the alarm about it."""

    shown: ConditionEntry
    alarm: str
    until_us: int


@dataclass(frozen=True, slots=True)
class Commanded:
    """A platform that is not the delegate leads the vehicle in a task."""

    task: str
    leader: str
    alarm: str


class CommandWatch(Part):
    """See the module.

    Args:
        on_alarm: tells all parts of an alarm.
        offer: called when the conditions that `ls` shows change.
    """

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._agent, self._clock, self._directory = ports.unit, ports.agent, ports.clock, ports.directory
        self._on_alarm, self._note, self._offer = ports.on_alarm, ports.note, ports.offer
        self._commanded: Commanded | None = None
        self.refused: dict[str, Attempts] = {}
        self._revoked: dict[str, EndedByRevocation] = {}
        self._appeared_us = -SETTLED_US
        parts[Authority].on_revoked.append(self._on_revoked)

    def conditions(self) -> Iterable[ConditionEntry]:
        for unit, each in list(self.refused.items())[-SHOWN:]:
            text = f"refused to {unit}, {each.how}: {each.what}"
            yield ConditionEntry(text=text[:_TEXT], since_us=each.since_us)
        for ended in list(self._revoked.values())[-SHOWN:]:
            yield ended.shown

    def _on_revoked(self, unit: str, ended: tuple[str, ...], now_us: int) -> None:
        """Report that tasks and permits of a member have ended here, since that member is revoked."""
        text = f"{unit} is revoked, and its tasks and permits end: {', '.join(ended)}"
        self._note(text[: 2 * _TEXT])
        self._end_shown(unit, now_us)
        alarm = f"{REVOKED}/{self._unit}/{unit}/{now_us}"
        shown = ConditionEntry(text=text[:_TEXT], since_us=now_us)
        self._revoked[unit] = EndedByRevocation(shown, alarm, now_us + REVOKED_US)
        self._raise(alarm, "opened", REVOKED, unit, now_us, tasks=", ".join(ended)[:_TEXT])
        self._offer(now_us)

    def _end_shown(self, unit: str, now_us: int) -> None:
        ended = self._revoked.pop(unit, None)
        if ended is not None:
            self._raise(ended.alarm, "closed", REVOKED, unit, now_us)
            self._offer(now_us)

    # -- who is obeyed -----------------------------------------------------------------------------------------

    def obeys(self, word: TaskEvidence | None, leader: str, now_us: int) -> None:
        """The vehicle obeys `leader` from now on, by that word of a delegator; None: it has none."""
        is_delegate = word is None or leader in {word.delegate, word.delegator}
        had = self._commanded
        if had is not None and (is_delegate or (had.task, had.leader) != (word and word.task, leader)):
            self.obeys_none(now_us)
        if is_delegate or word is None or self._commanded is not None:
            return
        text = f"the vehicle obeys {leader} in {word.task}, and {word.delegator} delegated it to {word.delegate}"
        self._note(text)
        if word.delegator != self._unit and self._directory.is_present(word.delegator):
            progress = Progress(step=f"leads: {text}"[:1000], unit=self._unit)
            self._agent.tell(word.delegator, progress, now_us, conversation=word.task)
        alarm = f"{COMMANDER}/{self._unit}/{leader}/{now_us}"
        self._commanded = Commanded(word.task, leader, alarm)
        self._raise(alarm, "opened", COMMANDER, leader, now_us, task=word.task, delegate=word.delegate)

    def obeys_none(self, now_us: int) -> None:
        """No mission has the vehicle."""
        had, self._commanded = self._commanded, None
        if had is not None:
            self._raise(had.alarm, "closed", COMMANDER, had.leader, now_us)

    # -- who is not --------------------------------------------------------------------------------------------

    def refuse(self, act: Act, refused: Refused, now_us: int) -> None:
        """Note that what a platform asked for was refused for its sender."""
        sender = self._agent.acts.share_of(act.sender.unit).owner
        is_asked_at_another = refused.code == "led-by" and act.performative is Performative.CANCEL
        if refused.code not in CODES or is_asked_at_another or sender == self._unit:
            return
        head = "cancel" if act.content is None else act.content.head
        found = self.refused.get(sender)
        if found is not None:
            before, found.count, found.last_us = found.how, found.count + 1, now_us
            if found.how != before:
                self._offer(now_us)
        else:
            what = f"({head} ...): {refused.code}: {refused.reason}"
            if len(self.refused) >= MOST:
                self._forget(next(iter(self.refused)), now_us)
            found = self.refused[sender] = Attempts(what, "", now_us, now_us)
            self._note(f"refused to {sender}: {what}"[:400])
            self._offer(now_us)
        is_late = refused.code in TURNS and now_us - self._appeared_us < SETTLED_US
        if not found.alarm and not is_late:
            found.alarm = f"{REFUSED}/{self._unit}/{sender}/{now_us}"
            self._raise(found.alarm, "opened", REFUSED, sender, now_us, asked=head, code=refused.code)

    def _forget(self, unit: str, now_us: int) -> None:
        alarm = self.refused.pop(unit).alarm
        if alarm:
            self._raise(alarm, "closed", REFUSED, unit, now_us)
        self._offer(now_us)

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """Note when a platform has appeared."""
        if isinstance(change, PlatformAppeared):
            self._appeared_us = now_us

    @property
    def deadline_us(self) -> int | None:
        return min(
            [each.last_us + QUIET_US for each in self.refused.values()]
            + [each.until_us for each in self._revoked.values()],
            default=None,
        )

    def on_time(self, now_us: int) -> None:
        for unit in [unit for unit, each in self.refused.items() if each.last_us + QUIET_US <= now_us]:
            self._forget(unit, now_us)
        for unit in [unit for unit, each in self._revoked.items() if each.until_us <= now_us]:
            self._end_shown(unit, now_us)

    def _raise(
        self, alarm: str, event: Literal["opened", "closed"], monitor: str, about: str, now_us: int, **values: str
    ) -> None:
        at_us = self._clock.federation_us(now_us)
        self._on_alarm(AlarmEvent(alarm, event, monitor, (self._unit, about), at_us, at_us, values))
