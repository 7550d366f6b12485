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
| ended (tombstone) | `cancel` | `follow` by the member that ended it, or 1000 other tombstones |

While a subtask is abandoned its streams and monitors continue as they are: a cut costs no sample, and an alarm stays
the same alarm. A task is coordinated by its delegate, the platform it was delegated to, in generation 1, and after it by
successors in the next generations. Which platform may be one, and when, follows from the delegator's act and from those that are here
(`authority`); a participant follows the first of them. Times are the node clock.
"""

from collections.abc import Callable, Iterable

from dyknow.agents.actions import COORDINATION, QUERIED, Action, Offer, Role
from dyknow.agents.part import Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.tasks.authority import Authority
from dyknow.agents.tasks.task import Claim, CoordinatedTask, EndedTask, Task, TaskPlan
from dyknow.federation.members.deadlines import Deadlines
from dyknow.federation.members.liveness import PlatformAppeared
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.contents import (
    MAX_LIST,
    CreateMulticast,
    HandOver,
    MonitorProximity,
    Progress,
    TaskEntry,
    TaskList,
    Tasks,
)
from dyknow.federation.messages.contents.parts import next_generation
from dyknow.federation.messages.ends import is_given_up, is_lost
from dyknow.federation.sharing.exports import LINGER_US
from dyknow.model.errors import ContentError, Refused

TOMBSTONES = 1000
ABANDONED_US = 5_000_000
"""How long a subtask waits for another coordinator, or to be asked for once more."""
SUCCESSOR_STEP_US = 1_000_000
"""How much later each next participant takes over a task whose coordinator died."""
SUCCESSORS = 8
"""How many generations a claim may be ahead: each coordinator that dies unheard of is one."""
ENDED_LISTED_US = 600_000_000
"""How long a task that its delegator did not end is listed as ended."""
LISTED = 16
OF_ONE, OF_A_CENTRE = 16, 64
"""Tasks that a member, or a command centre, may have delegated to one platform at once."""
PARTS_OF_ONE = 512
"""Exports and monitors that one platform may have asked for, as parts of tasks."""


class TaskLife(Part):
    """The tasks of one platform in all their states; see the module.

    Args:
        exports: this platform's exports, with their receivers.
        role_of: unit -> its role.
        authority: which platform may coordinate a task.
    """

    offers = (Offer(COORDINATION, (Action(Tasks, "on_tasks", QUERIED, Role.OBSERVER),)),)
    answers = (TaskList,)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._boot, self._agent, self._directory = ports.unit, ports.boot, ports.agent, ports.directory
        self._is_present, self._is_shared = ports.directory.is_present, ports.exports.is_shared
        self._role_of = ports.role_of
        self._authority = parts[Authority]
        self.coordinated: dict[str, CoordinatedTask] = {}
        self._tasks: dict[str, Task] = {}
        self._ended: dict[str, str] = {}
        self._ended_by_others: dict[str, EndedTask] = {}
        self._due: Deadlines[str] = Deadlines()
        self._until_us: dict[str, int] = {}
        parts[Authority].on_over.append(self._on_over)
        parts[Authority].held.append(lambda: [led.evidence for led in self.coordinated.values()])

    # -- requested, running ------------------------------------------------------------------------------------

    def check_free(self, conversation: str | None, requester: str = "") -> str:
        """A lasting task needs a conversation of its own, in which it can be cancelled; returns it.

        Raises:
            ContentError: there is none.
            Refused: it is that of another task; `too-many-tasks`: `requester` has as many here as it may.
        """
        if not conversation:
            raise ContentError("a lasting task needs a :conversation-id, in which it can be cancelled")
        if conversation in self._tasks:
            raise Refused(f"conversation {conversation} is about another task; open one of your own", "other-task")
        owner, share_of = self._agent.acts.share_of(requester).owner, self._agent.acts.share_of
        of_one = [each for each in self._tasks.values() if share_of(each.initiator).owner == owner]
        parts, asked = (sum(each.is_part is kind for each in of_one) for kind in (True, False))
        most = OF_A_CENTRE if self._role_of(requester) is Role.COMMAND_CENTRE else OF_ONE
        if asked >= most or parts >= PARTS_OF_ONE:
            text = f"{asked} tasks of {requester} run here, and {parts} parts of others: cancel some (dyknow tasks)"
            raise Refused(text, "too-many-tasks")
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
        """Coordinate a task from now on."""
        self.coordinated[led.task] = led
        self.add(Task(led.task, led.delegator, "monitor-proximity", take_down, since_us=now_us))

    def check_claim(self, claim: Claim, now_us: int) -> None:
        """Whether that platform may set up monitors of a task here, as its coordinator.

        Raises:
            Refused: `cancelled`; `led-by` with the coordinator that stays; `succession`: it is another's turn.
        """
        task, unit = claim.evidence.task, claim.unit
        of_others = self._ended_by_others.get(task)
        is_bound = of_others is None or unit != of_others.delegate
        if is_bound and self._ended.get(task, unit) != unit:
            raise Refused("cancelled: the task was cancelled here", "cancelled")
        led = self.coordinated.get(task)
        try:
            self._check_turn(claim, 1 if led is None else led.generation, now_us)
        except Refused as refused:
            if led is None:
                raise
            text = f"coordinated by {led.leader} in generation {led.generation}: {refused.reason}"
            raise Refused(text, "led-by", leader=led.leader, generation=led.generation) from None

    def _check_turn(self, claim: Claim, generation: int, now_us: int) -> None:
        is_first = claim.unit == claim.evidence.delegate
        if not (is_first if claim.generation == 1 else 1 < claim.generation <= generation + SUCCESSORS):
            raise Refused(f"{claim.unit} does not coordinate it in generation {claim.generation}", "succession")
        self._authority.check_leads(claim.evidence, claim.unit, claim.boot, now_us)

    def is_led(self, led: CoordinatedTask) -> bool:
        """Whether its coordinator is there, in the life in which it coordinates."""
        entry = self._directory.entry(led.leader)
        is_there = entry is not None and entry.boot == led.leader_boot and self._is_present(led.leader)
        return led.leader == self._unit or is_there

    def follow(self, act: Act, shown: CoordinatedTask, plan: TaskPlan, now_us: int) -> None:
        """Take part in a task: from now on the sender is its coordinator; `shown` is the task by its evidence."""
        led = self.coordinated.setdefault(shown.task, shown)
        self.lead_by(led, shown.leader, shown.leader_boot, shown.generation, now_us)
        self._ended.pop(shown.task, None)
        self._ended_by_others.pop(shown.task, None)
        if plan not in led.plans:
            led.plans = (*led.plans, plan)
        followed = led.own.get(plan.name)
        if followed is not None and followed.conversation_id is not None:
            self.forget(followed.conversation_id)
        led.own[plan.name] = act

    def lead_by(self, led: CoordinatedTask, leader: str, boot: int, generation: int, now_us: int) -> None:
        """Set the coordinator of a task; if this platform was it, notify the participants."""
        if led.leader == self._unit != leader:
            message = HandOver(task=led.task, coordinator=leader, boot=boot, generation=generation)
            for unit in led.members.keys() | {leader}:
                self._agent.tell(unit, message, now_us)
            self.step_down(led, leader)
        led.leader, led.leader_boot, led.generation = leader, boot, generation
        led.successor_at_us = None

    def step_down(self, led: CoordinatedTask, leader: str) -> None:
        """Stay a participant of a task that another coordinates. Our earlier requests end with the task."""
        led.leader = leader
        for unit, conversations in led.members.items():
            led.former.setdefault(unit, []).extend(conversations)
        led.members.clear()
        led.again_us.clear()
        self.forget(led.task)

    def end_by(self, led: CoordinatedTask, by: str, now_us: int) -> None:
        """Note that the coordinator `by` ended the task here: notify the delegator; list it if `by` is not the delegate."""
        if by != led.delegate:
            self._ended_by_others[led.task] = EndedTask(led.task, led.delegator, led.delegate, by, now_us)
            if len(self._ended_by_others) > LISTED:
                del self._ended_by_others[next(iter(self._ended_by_others))]
        if led.delegator not in {"", by, self._unit} and self._is_present(led.delegator):
            message = Progress(step=f"monitoring ended by {by}", unit=self._unit)
            self._agent.tell(led.delegator, message, now_us, conversation=led.task)

    def leave(self, task: str, name: str) -> CoordinatedTask | None:
        """The coordinator needs monitor `name` no more; returns the task if that was the last."""
        led = self.coordinated.get(task)
        if led is None or led.leader == self._unit:
            return None
        led.own.pop(name, None)
        led.plans = tuple(plan for plan in led.plans if plan.name != name)
        return None if led.plans else self.coordinated.pop(task)

    def on_leader_gone(self, led: CoordinatedTask, now_us: int) -> None:
        """The participant that is first in the order takes over after a second; the next a second after that is gone, and so on."""
        led.successor_at_us = now_us + (1 + self._authority.turn(led.evidence)) * SUCCESSOR_STEP_US

    def succeeds(self, led: CoordinatedTask, now_us: int) -> bool:
        """Whether it is this platform's turn to take over; while one before it is here, it waits for that."""
        led.successor_at_us = None
        if self.is_led(led):
            return False
        if self._authority.turn(led.evidence):
            led.successor_at_us = now_us + SUCCESSOR_STEP_US
            return False
        return True

    def take_over(self, led: CoordinatedTask) -> None:
        """The monitors stay as they are; the coordinator, and in which conversations they were asked for, change."""
        led.leader, led.generation, led.leader_boot = self._unit, next_generation(led.generation), self._boot
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
        self.set_tombstone(conversation, task.initiator)
        return tuple(task.take_down(now_us))

    def end_parts(self, now_us: int) -> None:
        """No coordinated task is left here: subtasks of platforms that are gone have no successor to wait for."""
        if self.coordinated:
            return
        for part in self.all():
            if part.is_part and not self._is_present(part.initiator):
                self.cancel(part.conversation, now_us)

    def _on_over(self, name: str, now_us: int) -> None:
        """A command centre has ended monitors at each platform, whatever platform coordinates them."""
        led = self.coordinated.get(name)
        if led is None:
            return
        conversations = [led.task] if led.leader == self._unit else [act.conversation_id for act in led.own.values()]
        if led.leader != self._unit:
            del self.coordinated[name]
        for task in [self.get(each) for each in conversations if each is not None]:
            if task is not None:
                self.end(task, "a command centre", now_us)

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
            raise Refused(f"{what} is no task here; dyknow tasks lists them", "unknown-task")
        of_people = [task for task in fitting if not task.is_part]
        if of_people and self._role_of(unit) is Role.COMMAND_CENTRE:
            return of_people
        initiators = ", ".join(sorted({task.initiator for task in fitting}))
        remedy = "they, or a command centre, may end it" if of_people else "cancel the task that it is part of"
        raise Refused(f"{what} was requested by {initiators}: {remedy}", "role")

    def end(self, task: Task, by: str, now_us: int) -> None:
        """Cancel a task on behalf of `by`, which does so in another conversation; its initiator is notified."""
        self._agent.end(task.conversation, task.initiator, f"cancelled by {by}", now_us)
        for name in self.cancel(task.conversation, now_us) or ():
            self.set_tombstone(name, by)

    def set_tombstone(self, name: str, by: str) -> None:
        """Set a tombstone: task `name` ended on behalf of `by`, and no other platform sets it up again."""
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
                raise Refused(f"only its requester {task.initiator} or a command centre may end {conversation}", "role")
            self._agent.end(conversation, task.initiator, f"cancelled by {unit}", now_us)
        led = self.coordinated.get(conversation)
        if led is not None and led.leader != self._unit:
            text = f"the task is coordinated by {led.leader} now: cancel it there"
            raise Refused(text, "led-by", leader=led.leader, generation=led.generation)
        ended = self.cancel(conversation, now_us)
        if not is_given_up(act):
            for name in ended or ():
                self.set_tombstone(name, unit)
        return ended is not None

    def on_tasks(self, act: Act, _content: Tasks, now_us: int) -> None:
        """`(tasks)`: the tasks that users delegated, without their parts; and tasks that others ended here of late."""
        entries = [self._entry(task) for task in self._tasks.values() if not task.is_part]
        entries += [
            TaskEntry(
                conversation=ended.task,
                task=MonitorProximity.head,
                unit=self._unit,
                state=f"ended by {ended.by}",
                delegator=_speaker(ended.delegator),
                since_us=ended.at_us,
                ended_by=ended.by,
            )
            for ended in self._ended_by_others.values()
            if now_us < ended.at_us + ENDED_LISTED_US
        ]
        self._agent.answer(act, Performative.INFORM, TaskList(tasks=tuple(entries[:MAX_LIST])), now_us)

    def _entry(self, task: Task) -> TaskEntry:
        led = self.coordinated.get(task.conversation)
        alone = (task.monitor,) if task.monitor else ()
        return TaskEntry(
            conversation=task.conversation,
            task=task.name,
            unit=self._unit,
            state=task.state,
            delegator=_speaker(task.initiator),
            since_us=task.since_us,
            monitors=alone if led is None else tuple(plan.name for plan in led.plans),
            avoidance=None if led is None else led.avoidance,
        )

    # -- abandoned ---------------------------------------------------------------------------------------------

    def on_peer(self, change: PeerChange, _now_us: int) -> None:
        """A platform may have asked for an export before it was known what it is."""
        if isinstance(change, PlatformAppeared) and change.kind == "uav":
            for task in self.of(change.unit):
                task.is_part = task.is_part or task.name == CreateMulticast.head

    def on_lost(self, act: Act, now_us: int) -> bool:
        """Tasks of a command centre persist; an export for a platform waits as long as its receivers do."""
        task = self.get(conversation := act.conversation_id or "")
        if task is None or task.initiator != act.sender.unit:
            return False
        if task.is_part and task.name == CreateMulticast.head:
            self._until_us[conversation] = now_us + LINGER_US
            self._due.set(conversation, now_us + ABANDONED_US)
        return True

    def _on_forgotten(self, task: Task, now_us: int) -> None:
        """Await the requester of a part, which had lost this platform and is back, to repeat its request."""
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


def _speaker(unit: str) -> str | None:
    return str(AgentName("interface", unit)) if unit else None
