"""What one platform knows of a task that lasts, and of one over many platforms. Times are the node clock."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from dyknow import earlier
from federation.messages.acts import Act


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
        generation: how often the coordination has passed to a successor, counted from 1.
        delegate: the platform it was delegated to, which coordinates it while it is there.
        is_stated: whether the delegate itself has described the task here.
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
    delegate: str = ""
    is_stated: bool = False
    members: dict[str, list[str]] = field(default_factory=dict)
    former: dict[str, list[str]] = field(default_factory=dict)
    own: dict[str, Act] = field(default_factory=dict)
    exports: list[str] = field(default_factory=list)
    again_us: dict[str, int] = field(default_factory=dict)
    successor_at_us: int | None = None

    @property
    def deadline_us(self) -> int | None:
        return earlier(self.successor_at_us, min(self.again_us.values(), default=None))


class Claim(NamedTuple):
    """What a platform that would coordinate a task says of itself and of the task."""

    task: str
    unit: str
    boot: int
    generation: int
    delegator: str
    delegate: str


class EndedTask(NamedTuple):
    """A task whose monitors here were ended by a successor of its delegate, which may set them up again."""

    task: str
    delegator: str
    delegate: str
    by: str
    at_us: int
