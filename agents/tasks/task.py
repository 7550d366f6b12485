"""State of a lasting task at one platform, and of a task over many platforms. Times are the node clock."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from dyknow import earlier
from dyknow.agents.tasks.authority import TaskEvidence
from dyknow.federation.messages.acts import Act
from dyknow.federation.messages.contents import MonitorProximity


class TaskPlan(Protocol):
    """A monitor of a coordinated task: its name, and the streams it needs of each platform."""

    @property
    def name(self) -> str: ...
    @property
    def labels(self) -> tuple[str, ...]: ...
    @property
    def starts_avoidance(self) -> bool: ...
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
        state: its state as shown to users.
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
        evidence: the act that delegated it. Its conversation is the name of the task everywhere.
        plans: its monitors.
        leader: the coordinator; leader_boot: which life of it, since one that was restarted knows nothing of the task.
        generation: how often the coordination has passed to a successor, counted from 1.
        members: the requests to each platform, as (unit, conversations); kept by the coordinator.
        former: the same, of a coordinator that stepped down: it goes when the task ends.
        own: by name, the act with which the coordinator requested a monitor of this platform.
        again_us: when the request to a platform that failed or was silent is repeated.
        renewed_us: when everything is, or was, repeated at another platform's word.
        successor_at_us: when this platform takes over if no other does.
    """

    evidence: TaskEvidence
    plans: tuple[TaskPlan, ...]
    leader: str
    generation: int
    leader_boot: int = 0
    members: dict[str, list[str]] = field(default_factory=dict)
    former: dict[str, list[str]] = field(default_factory=dict)
    own: dict[str, Act] = field(default_factory=dict)
    exports: list[str] = field(default_factory=list)
    again_us: dict[str, int] = field(default_factory=dict)
    renewed_us: int | None = None
    successor_at_us: int | None = None

    @property
    def task(self) -> str:
        return self.evidence.task

    @property
    def delegator(self) -> str:
        return self.evidence.delegator

    @property
    def delegate(self) -> str:
        """The platform it was delegated to, which coordinates it while it is there."""
        return self.evidence.delegate

    @property
    def avoidance(self) -> bool:
        """Whether platforms may give way for it."""
        content = self.evidence.content
        return not isinstance(content, MonitorProximity) or content.avoidance is not False

    @property
    def keeps_apart(self) -> bool:
        """Whether platforms are to give way: they may, and a monitor of it is one that starts avoidance."""
        return self.avoidance and any(plan.starts_avoidance for plan in self.plans)

    @property
    def deadline_us(self) -> int | None:
        return earlier(self.successor_at_us, min(self.again_us.values(), default=None))


class Claim(NamedTuple):
    """A platform that would coordinate a task, in which life and generation, and by whose word."""

    evidence: TaskEvidence
    unit: str
    boot: int
    generation: int


class EndedTask(NamedTuple):
    """A task whose monitors here were ended by a successor of its delegate, which may set them up again."""

    task: str
    delegator: str
    delegate: str
    by: str
    at_us: int
