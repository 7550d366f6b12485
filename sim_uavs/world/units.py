"""What the simulated world is made of: units, each with a clock of its own, and conversations with them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from agents.config import PlatformConfig
from agents.platform import Platform
from federation.messages.acts import Act
from federation.messages.contents import Content
from runtime.mailbox import Mailbox
from sim_uavs.dynamics.vehicles import SimulatedVehicle, TrueState


class DriftingClock:
    """A node's clock: UTC at its start, `offset_us` off, and from then on `drift_ppm` too fast; never set back."""

    def __init__(self, now_us: int, offset_us: int = 0, drift_ppm: float = 0.0) -> None:
        self._since_us, self._offset_us, self._ppb = now_us, offset_us, round(drift_ppm * 1000)

    def node_us(self, now_us: int) -> int:
        """What it shows at an instant of the world."""
        if not self._ppb:
            return now_us + self._offset_us
        return now_us + self._offset_us + (now_us - self._since_us) * self._ppb // 1_000_000_000

    def world_us(self, node_us: int) -> int:
        """The first instant of the world at which it shows that."""
        if not self._ppb:
            return node_us - self._offset_us
        elapsed_us = node_us - self._offset_us - self._since_us
        found = self._since_us + elapsed_us * 1_000_000_000 // (1_000_000_000 + self._ppb) - 2
        while self.node_us(found) < node_us:
            found += 1
        return found


@dataclass(slots=True)
class WorldNode:
    """One unit: its process, while it runs, and its vehicle, which flies whatever becomes of the process.

    Attributes:
        lives: all platforms that have run under this name, the present one last.
        halted: why a process of it ended by itself.
        notes: what its processes reported to the user.
        told: what its specification produced.
    """

    config: PlatformConfig
    vehicle: SimulatedVehicle | None
    clock: DriftingClock
    platform: Platform | None = None
    frozen: bool = False
    offset_us: int = 0
    drift_ppm: float = 0.0
    lives: list[Platform] = field(default_factory=list)
    halted: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    told: list[Mapping[str, Any]] = field(default_factory=list)
    truth: list[TrueState] = field(default_factory=list)
    due_us: int | None = None
    asked_us: int | None = None
    mailbox: Mailbox | None = None


@dataclass(slots=True)
class WorldDialogue:
    """A conversation: its replies as (world time, act, content), or why there was none."""

    by: str
    to: str
    conversation: str = ""
    replies: list[tuple[int, Act, Content | None]] = field(default_factory=list)
    silence: str | None = None

    def contents(self, kind: type[Any]) -> list[Any]:
        """The contents of one kind, in order."""
        return [content for _, _, content in self.replies if isinstance(content, kind)]
