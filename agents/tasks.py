"""The life of tasks that last, from the request to the tombstone: the only place where a task changes its state.

Every accepted request that lasts is a `Task`, by the conversation in which it was asked for. A task over many
platforms is a `CoordinatedTask` as well, on each participant, by the conversation in which it was delegated.

| state | entered by | left by |
|---|---|---|
| requested | an act arrives; its conversation is free (`check_free`) | agreed: running or coordinated; refused: nothing is kept |
| running | `add` | `cancel`: ended; `forget`: passed on or run out; requester lost: abandoned |
| coordinated by us | `coordinate`: delegated to us, or taken over | `step_down`: coordinated by another; `cancel`: ended |
| coordinated by another | `follow`: a coordinator asks for a monitor | `leave` with the last monitor; successor time over: `take_over` |
| abandoned | `on_lost`, or its requester had lost sight of us | asked for in another conversation: `forget`; else `cancel`: ended |
| taken over | `take_over`: the coordinator died, we are first | at once: coordinated by us, in the next generation |
| ended (tombstone) | `cancel` | `follow` by who ended it, or 1000 other tombstones |

While a subtask is abandoned its streams and monitors continue as they are: a cut costs no sample, and an alarm stays
the same alarm. Of two coordinators the one of the higher generation stays, then the unit that sorts first. Times are
the node clock.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Protocol

from agents.actions import Role
from agents.interface import InterfaceAgent
from agents.part import Part, PeerChange
from dyknow import earlier
from dyknow.model.errors import ContentError, Refused
from federation.members.deadlines import Deadlines
from federation.members.directory import DirectoryFacilitator, unit_order
from federation.members.liveness import PlatformAppeared
from federation.messages.acts import Act
from federation.messages.contents import CreateMulticast
from federation.messages.conversations import is_given_up, is_lost
from federation.sharing.exports import LINGER_US, Exports

TOMBSTONES = 1000
ABANDONED_US = 5_000_000
"""How long a subtask waits for another coordinator, or to be asked for once more."""
SUCCESSOR_STEP_US = 1_000_000
"""How much later each next participant takes over a task whose coordinator died."""


class TaskPlan(Protocol):
    """What a coordinated task knows of a monitor: its name, and the streams it needs of each platform."""

    @property
    def name(self) -> str: ...
    @property
    def labels(self) -> tuple[str, ...]: ...
    @property
    def period_us(self) -> int: ...
    @property
    def max_delay_us(self) -> int: ...


@dataclass(slots=True)
class Task:
    """One accepted request that lives until it is cancelled.

    Attributes:
        conversation: the conversation in which it was requested, and in which `cancel` ends it.
        initiator: the unit that requested it.
        name: the head of the request, e.g. `monitor-proximity`.
        take_down: undoes all that the task set up, at a time; returns the coordinated tasks that ended with it.
        state: what a user sees.
        is_part: whether it belongs to a larger task, which users see and cancel.
        contracts: the streams it has this platform export: semantic labels by contract.
        monitor: the name of the monitor it has this platform keep.
    """

    conversation: str
    initiator: str
    name: str
    take_down: Callable[[int], Iterable[str]]
    state: str = "running"
    since_us: int = 0
    is_part: bool = False
    contracts: dict[str, str] = field(default_factory=dict)
    monitor: str = ""


@dataclass(slots=True)
class CoordinatedTask:
    """A task over many platforms, as one participant knows it.

    Attributes:
        task: the conversation in which the delegator asked for it: its name everywhere.
        plans: what is monitored.
        leader: the coordinator; leader_boot: which life of it, since one that was restarted knows nothing of the task.
        members: the requests to each platform, as (unit, conversations); kept by the coordinator.
        former: the same, of a coordinator that stepped down: it goes when the task ends.
        own: by name, the act with which the coordinator requested a monitor of this platform.
        again_us: when the request to a platform that failed or was silent is repeated.
        successor_at_us: when this platform takes over if no other does.
    """

    task: str
    delegator: str
    plans: tuple[TaskPlan, ...]
    avoidance: bool
    leader: str
    generation: int
    leader_boot: int = 0
    members: dict[str, list[str]] = field(default_factory=dict)
    former: dict[str, list[str]] = field(default_factory=dict)
    own: dict[str, Act] = field(default_factory=dict)
    exports: list[str] = field(default_factory=list)
    again_us: dict[str, int] = field(default_factory=dict)
    successor_at_us: int | None = None

    @property
    def deadline_us(self) -> int | None:
        return earlier(self.successor_at_us, min(self.again_us.values(), default=None))


class TaskLife(Part):
    """The tasks of one platform in all their states; see the module.

    Args:
        exports: what this platform exports, for whom.
        role_of: what a unit may ask for.
    """

    def __init__(
        self,
        unit: str,
        boot: int,
        agent: InterfaceAgent,
        directory: DirectoryFacilitator,
        exports: Exports,
        role_of: Callable[[str], Role],
    ) -> None:
        self._unit, self._boot, self._agent = unit, boot, agent
        self._is_present, self._is_shared, self._role_of = directory.is_present, exports.is_shared, role_of
        self.coordinated: dict[str, CoordinatedTask] = {}
        self._tasks: dict[str, Task] = {}
        self._ended: dict[str, str] = {}
        self._due: Deadlines[str] = Deadlines()
        self._until_us: dict[str, int] = {}

    # -- requested, running ------------------------------------------------------------------------------------

    def check_free(self, conversation: str | None) -> str:
        """A lasting task needs a conversation of its own, in which it can be cancelled; returns it.

        Raises:
            ContentError: there is none.
            Refused: it is that of another task.
        """
        if not conversation:
            raise ContentError("what lasts needs a :conversation-id, in which it can be cancelled")
        if conversation in self._tasks:
            raise Refused(f"conversation {conversation} is about another task; open one of your own")
        return conversation

    def add(self, task: Task) -> None:
        """The request is agreed to: it runs."""
        self._tasks[task.conversation] = task

    def get(self, conversation: str) -> Task | None:
        return self._tasks.get(conversation)

    def all(self) -> list[Task]:
        return list(self._tasks.values())

    def of(self, initiator: str) -> list[Task]:
        """The tasks `initiator` asked for."""
        return [task for task in self._tasks.values() if task.initiator == initiator]

    def forget(self, conversation: str) -> None:
        """The task has run out, or was passed on: drop it without taking anything down."""
        self._tasks.pop(conversation, None)

    # -- coordinated -------------------------------------------------------------------------------------------

    def coordinate(self, led: CoordinatedTask, take_down: Callable[[int], Iterable[str]], now_us: int) -> None:
        """This platform coordinates a task from now on."""
        self.coordinated[led.task] = led
        self.add(Task(led.task, led.delegator, "monitor-proximity", take_down, since_us=now_us))

    def check_leader(self, task: str, asker: str, generation: int) -> None:
        """Whether `asker` may coordinate a task that may be coordinated by another, or ended.

        Raises:
            Refused: `cancelled`, or `led-by` with the coordinator that stays.
        """
        if self._ended.get(task, asker) != asker:
            raise Refused("cancelled: the task was cancelled here", "cancelled")
        led = self.coordinated.get(task)
        if led is None or led.leader == asker:
            return
        if (-generation, unit_order(asker)) > (-led.generation, unit_order(led.leader)):
            text = f"led by {led.leader} in generation {led.generation}"
            raise Refused(text, "led-by", leader=led.leader, generation=led.generation)

    def follow(self, act: Act, told: CoordinatedTask, plan: TaskPlan) -> None:
        """Take part in a task: from now on the sender is its coordinator; `told` has what it says of the task."""
        led = self.coordinated.setdefault(told.task, told)
        if led.leader == self._unit:
            self.step_down(led, told.leader)
        led.leader, led.generation, led.leader_boot = told.leader, told.generation, told.leader_boot
        led.successor_at_us, led.avoidance = None, told.avoidance
        self._ended.pop(told.task, None)
        if plan not in led.plans:
            led.plans = (*led.plans, plan)
        followed = led.own.get(plan.name)
        if followed is not None and followed.conversation_id is not None:
            self.forget(followed.conversation_id)
        led.own[plan.name] = act

    def step_down(self, led: CoordinatedTask, leader: str) -> None:
        """Another coordinates the task: stay a participant. What we had asked for goes with the task."""
        led.leader = leader
        for unit, conversations in led.members.items():
            led.former.setdefault(unit, []).extend(conversations)
        led.members.clear()
        led.again_us.clear()
        self.forget(led.task)

    def leave(self, task: str, name: str) -> CoordinatedTask | None:
        """The coordinator needs monitor `name` no more; returns the task if that was the last."""
        led = self.coordinated.get(task)
        if led is None or led.leader == self._unit:
            return None
        led.own.pop(name, None)
        led.plans = tuple(plan for plan in led.plans if plan.name != name)
        return None if led.plans else self.coordinated.pop(task)

    def on_leader_gone(self, led: CoordinatedTask, participants: Iterable[str], now_us: int) -> None:
        """The participant that sorts first takes over after a second, the next a second later, and so on."""
        rank = sorted([self._unit, *participants], key=unit_order).index(self._unit)
        led.successor_at_us = now_us + (1 + rank) * SUCCESSOR_STEP_US

    def take_over(self, led: CoordinatedTask) -> None:
        """The monitors stay as they are; the coordinator, and in which conversations they were asked for, change."""
        led.leader, led.generation, led.leader_boot = self._unit, led.generation + 1, self._boot
        for act in led.own.values():
            if act.conversation_id is not None:
                self.forget(act.conversation_id)
        led.own.clear()

    # -- ended -------------------------------------------------------------------------------------------------

    def cancel(self, conversation: str, now_us: int) -> tuple[str, ...] | None:
        """Take the task down; returns what ended: coordinated tasks by name, none if it had ended before.

        Returns None if there was no such task. Cancelling twice is harmless.
        """
        task = self._tasks.pop(conversation, None)
        if task is None:
            return () if conversation in self._ended else None
        self.bury(conversation, task.initiator)
        return tuple(task.take_down(now_us))

    def end_parts(self, now_us: int) -> None:
        """No coordinated task is left here: subtasks of platforms that are gone have no successor to wait for."""
        if self.coordinated:
            return
        for part in self.all():
            if part.is_part and not self._is_present(part.initiator):
                self.cancel(part.conversation, now_us)

    def endable(self, act: Act, what: str, fits: Callable[[Task], bool]) -> list[Task]:
        """The tasks that fit and that the sender may end: its own; else, if it may command, what users asked for.

        Raises:
            Refused: `unknown-task`: `what` is not set up here; `role`: another asked for it.
        """
        unit = act.sender.unit
        fitting = [task for task in self._tasks.values() if fits(task)]
        own = [task for task in fitting if task.initiator == unit]
        if own:
            return own
        if not fitting:
            raise Refused(f"{what} was not asked for here", "unknown-task")
        of_people = [task for task in fitting if not task.is_part]
        if of_people and self._role_of(unit) is Role.COMMAND_CENTRE:
            return of_people
        initiators = ", ".join(sorted({task.initiator for task in fitting}))
        remedy = "they, or a command centre, may end it" if of_people else "cancel the task that it is part of"
        raise Refused(f"{what} was asked for by {initiators}: {remedy}", "role")

    def end(self, task: Task, by: str, now_us: int) -> None:
        """Cancel a task on behalf of `by`, which does so in another conversation; its initiator is notified."""
        self._agent.end(task.conversation, task.initiator, f"cancelled by {by}", now_us)
        for name in self.cancel(task.conversation, now_us) or ():
            self.bury(name, by)

    def bury(self, name: str, by: str) -> None:
        """Put up a tombstone: what went by `name` ended on behalf of `by`, and no other sets it up again."""
        self._ended[name] = by
        if len(self._ended) > TOMBSTONES:
            del self._ended[next(iter(self._ended))]

    def on_cancel(self, act: Act, now_us: int) -> bool:
        """End the task of that conversation.

        Raises:
            Refused: `role`: another asked for it; `led-by`: it is cancelled at its coordinator.
        """
        unit, conversation = act.sender.unit, act.conversation_id or ""
        task = self.get(conversation)
        if task is not None and task.initiator == unit and is_lost(act):
            self._on_forgotten(task, now_us)
            return True
        if task is not None and task.initiator != unit:
            if self._role_of(unit) is not Role.COMMAND_CENTRE:
                raise Refused(
                    f"only {task.initiator}, who asked for it, or a command centre may end {conversation}", "role"
                )
            self._agent.end(conversation, task.initiator, f"cancelled by {unit}", now_us)
        led = self.coordinated.get(conversation)
        if led is not None and led.leader != self._unit:
            text = f"the task is led by {led.leader} now: cancel it there"
            raise Refused(text, "led-by", leader=led.leader, generation=led.generation)
        ended = self.cancel(conversation, now_us)
        if not is_given_up(act):
            for name in ended or ():
                self.bury(name, unit)
        return ended is not None

    # -- abandoned ---------------------------------------------------------------------------------------------

    def on_peer(self, change: PeerChange, _now_us: int) -> None:
        """A platform may have asked for an export before it was known what it is."""
        if isinstance(change, PlatformAppeared) and change.kind == "uav":
            for task in self.of(change.unit):
                task.is_part = task.is_part or task.name == CreateMulticast.head

    def on_lost(self, act: Act, now_us: int) -> bool:
        """Tasks of a command centre persist; an export for a platform waits as long as its receivers do."""
        conversation = act.conversation_id or ""
        task = self.get(conversation)
        if task is not None and task.is_part and task.name == CreateMulticast.head:
            self._until_us[conversation] = now_us + LINGER_US
            self._due.set(conversation, now_us + ABANDONED_US)
        return task is not None

    def _on_forgotten(self, task: Task, now_us: int) -> None:
        """Its requester had lost sight of this platform, and is back: it asks once more for what it still wants."""
        if task.is_part:
            self._until_us.pop(task.conversation, None)
            self._due.set(task.conversation, now_us + ABANDONED_US)

    @property
    def deadline_us(self) -> int | None:
        return self._due.next_us

    def on_time(self, now_us: int) -> None:
        """End what was not taken over. While the requester is away its monitors stay for its successor."""
        for conversation in self._due.pop_due(now_us):
            task = self.get(conversation)
            until_us = self._until_us.pop(conversation, now_us)
            if task is None:
                continue
            if not self._is_present(task.initiator):
                if task.name != CreateMulticast.head:
                    continue
                if now_us < until_us and not self._is_shared(f"{conversation}."):
                    self._due.set(conversation, min(until_us, now_us + ABANDONED_US))
                    self._until_us[conversation] = until_us
                    continue
            self.cancel(conversation, now_us)
