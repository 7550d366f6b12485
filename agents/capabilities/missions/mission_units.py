"""The vehicles of a mission as its leader sees them: the platform's own one, and those of others, by acts."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from dyknow.agents.capabilities.missions.command_run import VehicleCommand
from dyknow.agents.capabilities.missions.performing import Performing
from dyknow.agents.interface import InterfaceAgent
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import (
    CommandEntry,
    Content,
    JoinMission,
    PerformCommands,
    Performed,
    Reason,
    VehicleNews,
)
from dyknow.model.errors import Refused

P = Performative
JOIN_US: Final = 3_000_000
AGAIN_US: Final = 3_000_000
"""After this long a platform that was lost, or refused, gets another request, and so does a vehicle that could not take part."""
OnPerformed = Callable[[int, str, int], None]
"""Takes the number of a step, why it failed (empty: it is done), and when."""


@dataclass(eq=False)
class OwnUnit:
    """The platform's own vehicle."""

    performing: Performing
    on_performed: OnPerformed
    waits: str = ""
    lost: str = ""
    is_ready: bool = False
    _step: int | None = None
    _again: tuple[str, str, int] | None = None

    def join(self, mission: str, unit: str, now_us: int) -> None:
        """Give it to the mission."""

        def tell(waits: str, _at_us: int) -> None:
            self.waits = waits

        try:
            self.performing.join(mission, unit, tell, now_us)
            self.is_ready, self.lost, self._again = True, "", None
        except Refused as refused:
            self.lost, self._again = refused.reason, (mission, unit, now_us + AGAIN_US)

    def perform(self, step: int, action: str, commands: tuple[VehicleCommand, ...], now_us: int) -> None:
        self._step = step

        def answer(why: str, at_us: int) -> None:
            if self._step == step:
                self.on_performed(step, why, at_us)

        self.performing.perform(action, commands, answer, now_us)

    def on_time(self, now_us: int) -> None:
        """Give it to the mission once that is possible: as it flies home, it is not."""
        if self._again is not None and now_us >= self._again[2]:
            self.join(*self._again[:2], now_us)

    def abort(self, step: int, now_us: int) -> None:
        if self._step == step:
            self.hold("loiter", now_us)

    def hold(self, how: str, _now_us: int) -> None:
        self._step = None
        self.performing.stop(how)

    def leave(self, now_us: int) -> None:
        if self.is_ready:
            self.performing.leave(now_us)
        self.is_ready, self._again = False, None


@dataclass(eq=False)
class OtherUnit:
    """The vehicle of another platform: it is requested to take part, and to do one action after another."""

    platform: str
    agent: InterfaceAgent
    on_performed: OnPerformed
    mission: str
    chain: tuple[str, ...]
    evidence: bytes = b""
    waits: str = ""
    lost: str = ""
    is_ready: bool = False
    _joined: str = ""
    _again_us: int | None = None
    _step: int | None = None

    def join(self, now_us: int) -> None:
        """Ask it to take part; the chain shows from whom that comes."""

        def on_reply(act: Act, content: Content | None, at_us: int) -> None:
            if isinstance(content, Performed):
                self._take_performed(content, at_us)
            elif isinstance(content, VehicleNews):
                self.waits = content.waits
            elif act.performative in {P.AGREE, P.INFORM}:
                self.is_ready, self.lost = True, ""
            else:
                self._lose(content.text if isinstance(content, Reason) else str(act.performative), at_us)

        self._again_us = None
        self._joined = self.agent.delegate(
            self.platform, JoinMission(mission=self.mission, chain=self.chain), now_us, on_reply=on_reply,
            on_silence=self._lose, reply_within_us=JOIN_US, evidence=self.evidence,
        )  # fmt: skip

    def _lose(self, why: str, now_us: int) -> None:
        self.is_ready, self.lost, self._again_us = False, f"platform {self.platform}: {why}", now_us + AGAIN_US
        self._take_performed(Performed(step=self._step or 0, failure=self.lost), now_us)

    def on_time(self, now_us: int) -> None:
        """Ask again, where it was lost."""
        if self._again_us is not None and now_us >= self._again_us:
            self.join(now_us)

    def _take_performed(self, content: Performed, now_us: int) -> None:
        """Take the result of a step."""
        if self._step is not None and content.step == self._step:
            self._step = None
            self.on_performed(content.step, content.failure, now_us)

    def perform(self, step: int, action: str, commands: tuple[VehicleCommand, ...], now_us: int) -> None:
        entries = tuple(CommandEntry(name=one.name, numbers=one.numbers) for one in commands)
        content = PerformCommands(mission=self.mission, step=step, action=action, commands=entries)

        def fail(why: str, at_us: int) -> None:
            self._take_performed(Performed(step=step, failure=f"platform {self.platform}: {why}"), at_us)

        def on_reply(act: Act, content: Content | None, at_us: int) -> None:
            if act.performative not in {P.AGREE, P.INFORM}:
                fail(content.text if isinstance(content, Reason) else str(act.performative), at_us)

        self._step = step
        self.agent.delegate(self.platform, content, now_us, on_reply=on_reply, on_silence=fail)

    def abort(self, step: int, now_us: int) -> None:
        if self._step == step:
            self.hold("loiter", now_us)

    def hold(self, how: str, now_us: int) -> None:
        self._step = None
        if self.is_ready:
            entries = (CommandEntry(name="land" if how == "land" else "hold"),)
            content = PerformCommands(mission=self.mission, step=0, action=f"{how}s", commands=entries)
            self.agent.delegate(self.platform, content, now_us)

    def leave(self, now_us: int) -> None:
        if self._joined:
            self.agent.cancel(self.platform, self._joined, now_us)
        self._joined, self.is_ready, self._again_us = "", False, None
