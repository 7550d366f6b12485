"""The platform's own vehicle in a mission that this platform, or another one, leads.

`(join-mission ...)` gives the vehicle to a mission, if its leader is permitted to command it; `(perform-commands ...)` has it do
something, and `(performed ...)` tells when the vehicle shows that it is done, or why not. While the vehicle is in its pilot's hands
nothing is sent, and the leader is informed that it waits. A vehicle whose leader is gone holds. Times are the node clock.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

from dyknow.agents.actions import Action, Offer, Role
from dyknow.agents.admission.mission_permits import Permits
from dyknow.agents.capabilities.flight.arbiter import Commander
from dyknow.agents.capabilities.flight.flight import FLIGHT, FlightAgent
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.capabilities.missions.command_run import CommandRun, VehicleCommand
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.tasks.authority import Authority, TaskEvidence
from dyknow.agents.tasks.command_watch import CommandWatch
from dyknow.agents.tasks.life import TaskLife
from dyknow.agents.tasks.task import Task
from dyknow.federation.messages.acts import Act
from dyknow.federation.messages.contents import (
    CommandEntry,
    JoinMission,
    PerformCommands,
    Performed,
    PermitMission,
    VehicleNews,
)
from dyknow.federation.messages.descriptions import ConditionEntry
from dyknow.model.errors import Refused
from dyknow.navigation.vehicle import Command, HoldOrder
from dyknow.planning.domains.model import COMMANDS

PERIOD_US: Final = 200_000
LONGEST_WAIT_S: Final = 3600.0
Answer = Callable[[str, int], None]
"""Takes why commands failed (empty: they are done), and when."""


@dataclass(slots=True)
class _Joined:
    """The mission that has the vehicle: its leader's incarnation, its delegator, and its action."""

    mission: str
    leader: str
    boot: int
    conversation: str
    tell: Callable[[str, int], None]
    word: TaskEvidence | None = None
    waits: str = ""
    run: CommandRun | None = None
    action: str = ""
    answer: Answer | None = None


class Performing(Part):
    """See the module.

    Args:
        flight: awaits the outcome of single orders.
        role_of: the role of a unit.
        emit: takes commands to the vehicle.
        offer: called when its condition changes.
    """

    offers = (
        Offer(
            FLIGHT,
            (
                Action(PermitMission, "on_permit", role=Role.COMMAND_CENTRE),
                Action(JoinMission, "on_join"),
                Action(PerformCommands, "on_perform"),
            ),
        ),
    )
    answers = (VehicleNews, Performed)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._agent, self._clock, self._flight = ports.unit, ports.agent, ports.clock, parts[FlightAgent]
        self._pilot = parts[Pilot.of]
        self._tasks, self._emit, self._note, self._offer = parts[TaskLife], ports.emit, ports.note, ports.offer
        self._authority, self.permits = parts[Authority], Permits(ports.unit, ports.role_of, parts[Authority])
        self._watch = parts[CommandWatch]
        parts[Authority].on_over.append(self._on_over)
        parts[Authority].held.append(
            lambda: [] if self._joined is None or self._joined.word is None else [self._joined.word]
        )
        self._joined: _Joined | None = None
        self._due_us = 0
        self._is_released = False
        self._shown: ConditionEntry | None = None

    def conditions(self) -> Iterable[ConditionEntry]:
        return () if self._shown is None else (self._shown,)

    def is_airborne(self) -> bool | None:
        """Whether the vehicle says that it flies."""
        status = self._pilot.status
        return None if status is None else status.airborne

    @property
    def mission(self) -> str:
        """The mission that has the vehicle; empty: none."""
        return "" if self._joined is None else self._joined.mission

    @property
    def leader(self) -> str:
        """The platform that leads it; empty: none does."""
        return "" if self._joined is None else self._joined.leader

    @property
    def leader_boot(self) -> int:
        """Which life of it."""
        return 0 if self._joined is None else self._joined.boot

    @property
    def waits(self) -> str:
        """Why it takes no commands of that mission now."""
        return self._pilot.mission.waits

    # -- joined ------------------------------------------------------------------------------------------------

    def on_permit(self, act: Act, content: PermitMission, now_us: int) -> None:
        """`(permit-mission ...)`: let platforms lead a mission with this vehicle."""
        permit = self._authority.delegated(act, content)
        self._authority.permitted_again(permit)
        self.permits.permit(permit, now_us)
        self._pilot.awaited.expect(content.mission)
        self._agent.done(act, now_us)

    def on_join(self, act: Act, content: JoinMission, now_us: int) -> None:
        """`(join-mission ...)`: until it is cancelled.

        Raises:
            Refused: the sender may not command the vehicle, another mission has it, or its pilot does.
        """
        sender, conversation = act.sender.unit, self._tasks.check_free(act.conversation_id, act.sender.unit)
        self.permits.show(act, content.mission, now_us)
        self.permits.check(content.mission, sender, act.boot, now_us)
        self.permits.check_chain(content.chain, sender)

        def tell(waits: str, at_us: int) -> None:
            self._agent.tell(sender, VehicleNews(waits=waits), at_us, conversation=conversation)

        self.join(content.mission, sender, tell, now_us, conversation, act.boot)
        task = Task(conversation, sender, JoinMission.head, self._left, since_us=now_us, is_part=True)
        self._tasks.add(task)
        self._agent.done(act, now_us)

    def join(
        self,
        mission: str,
        leader: str,
        tell: Callable[[str, int], None],
        now_us: int,
        conversation: str = "",
        boot: int = 0,
        word: TaskEvidence | None = None,
    ) -> None:
        """Give the vehicle to a mission; `tell` takes why it waits; `word` delegated it, where that is no permit.

        Raises:
            Refused: another mission has it, it may not be commanded, or its pilot has it.
        """
        if self._joined is not None:
            raise Refused(f"the vehicle takes part in mission {self._joined.mission}", "mission")
        self._pilot.begin_mission(mission)
        self._flight.supersede(now_us)
        word = word or self.permits.of(mission, now_us)
        self._joined = _Joined(mission, leader, boot, conversation, tell, word)
        self._watch.obeys(word, leader, now_us)
        self._show(now_us)

    def leave(self, now_us: int, *, is_over: bool = True) -> None:
        """The mission releases the vehicle, which holds if it flies for it; if not over, it may join again."""
        joined, self._joined = self._joined, None
        if joined is None:
            return
        if joined.run is not None and not joined.run.is_over:
            self.stop("loiter")
        self._pilot.end_mission(is_over=is_over and not self._is_released)
        if is_over:
            self.permits.end(joined.mission)
        self._watch.obeys_none(now_us)
        self._show(now_us)

    def _left(self, now_us: int) -> tuple[str, ...]:
        self.leave(now_us)
        return ()

    def _on_over(self, mission: str, now_us: int) -> None:
        """A command centre, or its leader, has ended the mission: the vehicle holds."""
        joined = self._joined
        if joined is None or joined.mission != mission:
            return
        self._note(f"mission {mission} was ended; the vehicle holds")
        if joined.conversation:
            self._agent.end(joined.conversation, joined.leader, f"mission {mission} was ended", now_us)
            self._tasks.cancel(joined.conversation, now_us)
        self.leave(now_us)

    def on_lost(self, act: Act, now_us: int) -> bool:
        """The leader is gone: the vehicle holds, and is free."""
        joined = self._joined
        if joined is None or (joined.conversation or None, joined.leader) != (act.conversation_id, act.sender.unit):
            return False
        self._note(f"mission {joined.mission}: its leader {joined.leader} is gone; the vehicle holds")
        self._release(joined, now_us)
        return True

    def _release(self, joined: _Joined, now_us: int) -> None:
        """The vehicle holds, and is free for the next leader."""
        permit = self.permits.of(joined.mission, now_us)
        self._is_released = True
        try:
            self._tasks.cancel(joined.conversation, now_us)
        finally:
            self._is_released = False
        if permit is not None:
            self.permits.permit(permit, now_us)

    def _check_led(self, joined: _Joined, now_us: int) -> bool:
        """Whether its leader still may lead it: when one before that is back, the vehicle holds until that one asks for it."""
        if joined.word is None or not joined.conversation:
            return True
        try:
            self._authority.check_leads(joined.word, joined.leader, joined.boot, now_us)
        except Refused as refused:
            self._note(f"mission {joined.mission}: {refused.reason}; the vehicle holds")
            self._agent.end(joined.conversation, joined.leader, refused.reason, now_us)
            self._release(joined, now_us)
            return False
        return True

    # -- performed ---------------------------------------------------------------------------------------------

    def on_perform(self, act: Act, content: PerformCommands, now_us: int) -> None:
        """`(perform-commands ...)`: tells when they are done.

        Raises:
            Refused: the sender may not command it, it does not take part in that mission of the sender's, or it does not know a
                command.
        """
        joined = self._joined
        if (
            joined is None
            or not joined.conversation
            or (joined.mission, joined.leader)
            != (
                content.mission,
                act.sender.unit,
            )
        ):
            if not self._authority.has_ended(content.mission):
                self.permits.check(content.mission, act.sender.unit, act.boot, now_us)
            raise Refused(f"the vehicle takes no part in mission {content.mission} of {act.sender.unit}", "mission")
        if not self._check_led(joined, now_us):
            raise Refused(f"{joined.leader} leads mission {joined.mission} no longer", "succession")
        commands = checked(content.commands)

        def answer(why: str, at_us: int) -> None:
            performed = Performed(step=content.step, failure=why[:1000])
            self._agent.tell(act.sender.unit, performed, at_us, conversation=joined.conversation)

        self._agent.done(act, now_us)
        self.perform(content.action, commands, answer, now_us)

    def perform(self, action: str, commands: tuple[VehicleCommand, ...], answer: Answer, now_us: int) -> None:
        """Do these, for the mission that has the vehicle; commands under way are overtaken."""
        joined = self._joined
        if joined is None:
            answer("the vehicle takes no part in the mission", now_us)
            return
        self._end(joined, "overtaken by other commands", now_us)
        joined.run, joined.action, joined.answer = CommandRun(commands), action, answer
        self._pilot.mission.looks = any(one.name == "look-down" for one in commands)
        self._due_us = now_us
        self._show(now_us)

    def stop(self, how: str) -> None:
        """Brake, loiter or land, if the mission commands the vehicle and it flies."""
        joined, status = self._joined, self._pilot.status
        if joined is not None and joined.run is not None and not joined.run.is_over:
            joined.run.failure = "aborted"
        self._pilot.mission.looks = False
        if status is None or not status.airborne:
            return
        if how == "land" and joined is not None:
            joined.run, joined.answer = CommandRun((VehicleCommand("land"),)), None
            return
        if self._pilot.standing == HoldOrder():
            return
        try:
            self._send(self._pilot.order(HoldOrder(), Commander.MISSION))
        except Refused as refused:
            self._note(f"the vehicle does not hold: {refused.reason}")

    def _end(self, joined: _Joined, why: str, now_us: int) -> None:
        answer, joined.answer = joined.answer, None
        joined.run = None
        if answer is not None:
            answer(why, now_us)

    # -- time --------------------------------------------------------------------------------------------------

    @property
    def deadline_us(self) -> int | None:
        return None if self._joined is None else self._due_us

    def on_time(self, now_us: int) -> None:
        joined = self._joined
        if joined is None or now_us < self._due_us:
            return
        self._due_us = now_us + PERIOD_US
        if not self._check_led(joined, now_us):
            return
        self._look(joined, now_us)
        run = joined.run
        if run is None:
            return
        self._send(run.step(self._pilot, self._clock.federation_us(now_us)))
        if run.is_over:
            self._end(joined, run.failure, now_us)
            self._show(now_us)

    def _look(self, joined: _Joined, now_us: int) -> None:
        """Tell the leader when the vehicle begins to wait, and when it takes commands again."""
        waits = self._pilot.mission.waits
        if waits != joined.waits:
            joined.waits = waits
            self._note(f"mission {joined.mission} {f'waits: {waits}' if waits else 'continues'}")
            joined.tell(waits, now_us)
            self._show(now_us)

    def _show(self, now_us: int) -> None:
        joined, text = self._joined, ""
        if joined is not None:
            doing = f"waits: {joined.waits}" if joined.waits else joined.action if joined.run else "is idle"
            by = f", delegated by {joined.word.delegator}" if joined.word is not None else ""
            text = f"mission {joined.mission}, of platform {joined.leader}{by}: {doing}"[:200]
        if text != (self._shown.text if self._shown else ""):
            self._shown = ConditionEntry(text=text, since_us=now_us) if text else None
            self._offer(now_us)

    def _send(self, commands: Iterable[Command]) -> None:
        for command in commands:
            self._emit(command)


def checked(entries: Iterable[CommandEntry]) -> tuple[VehicleCommand, ...]:
    """Commands that came in an act; raises Refused: one is unknown, or its numbers are none of such a command."""
    found = []
    for one in entries:
        if COMMANDS.get(one.name) != len(one.numbers):
            known = ", ".join(f"{name}/{count}" for name, count in COMMANDS.items())
            raise Refused(
                f"no command {one.name} with {len(one.numbers)} numbers; there are {known}", "unknown-command"
            )
        if one.name == "goto" and not (abs(one.numbers[0]) <= 90 and abs(one.numbers[1]) <= 180):
            raise Refused(
                f"goto: expected degrees on earth, got {one.numbers[0]:g}, {one.numbers[1]:g}", "unknown-command"
            )
        if one.name == "wait" and not 0 <= one.numbers[0] <= LONGEST_WAIT_S:
            raise Refused(f"wait: expected 0 to {LONGEST_WAIT_S:g} s, got {one.numbers[0]:g}", "unknown-command")
        found.append(VehicleCommand(one.name, tuple(one.numbers)))
    return tuple(found)
