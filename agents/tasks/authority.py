"""By whose word a platform acts: the delegator's signed act travels with each task, and its order of succession follows from it.

The delegate keeps the act as it arrived, and its requests to others for the task carry it; so do the requests of its
successors. A receiver verifies it once: it is of the delegator, whose role allows it, and names the task, its delegate
and the request. The order of succession is one for monitors, divisions, scans and missions: the delegate, then the
others by unit, or as a permit names them; a platform whose present life began after the delegation ranks after all that
were there. One is obeyed when all before it are gone here, and have been for half a second. A task that is over is not
begun again, unless its delegator permits it once more; a command centre ends any task at each platform, whatever
platform leads it. Times are the node clock.
"""

from collections.abc import Callable, Iterable
from hashlib import sha256
from typing import Final, NamedTuple, TypeAlias

from dyknow.agents.actions import COORDINATION, FEDERATION, INFORMED, REQUESTED, Action, Offer, Role
from dyknow.agents.part import Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.members.directory import DirectoryEntry, unit_order
from dyknow.federation.members.liveness import PeerState, PlatformAppeared, PlatformGone
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import (
    Content,
    DivideArea,
    MonitorProximity,
    PermitMission,
    Progress,
    TaskOver,
    When,
    read,
)
from dyknow.federation.messages.unpacking import MAX_EVIDENCE
from dyknow.model.errors import ContentError, Refused

WAIT_US: Final = 500_000
"""How long those before a successor must be gone here: honest ones wait a second or more, and may have seen it earlier."""
LIFE_US: Final = 500_000
"""A life that began so much after the delegation still counts as one that was there: clocks are compared so well."""
AHEAD_US: Final = 30_000_000
"""How far the delegator's clock may be ahead of ours."""
PERMIT_US: Final = 3_600_000_000
FLOWN_US: Final = 86_400_000_000
KEPT_US: Final = 30 * 86_400_000_000
"""Greatest age of the evidence of a permit, of a scan, and of tasks that move no vehicle. Tasks that are over are known
until a restart; evidence older than its task can be is refused even then."""
PROVEN: Final = 128
"""Pieces of evidence that are not verified again."""
OVER_OF_ONE, DELEGATORS = 256, 64
"""Tasks that are over, of one delegator, and delegators: a member cannot make those of others forgotten."""

Place: TypeAlias = tuple[int, int, tuple[int, int, str]]
"""In the order of succession: the first leads."""


class TaskEvidence(NamedTuple):
    """The act that delegated a task: by whom, to whom, what, and when by the delegator's clock; its bytes travel on."""

    task: str
    delegator: str
    delegate: str
    content: Content
    made_us: int
    payload: bytes = b""

    @property
    def flies(self) -> bool:
        """Whether vehicles are commanded for it, which only a command centre may ask for."""
        return isinstance(self.content, PermitMission) or (
            isinstance(self.content, DivideArea) and self.content.scan_m is not None
        )

    @property
    def stands_us(self) -> int:
        """How old it may be."""
        return PERMIT_US if isinstance(self.content, PermitMission) else FLOWN_US if self.flies else KEPT_US


class Authority(Part):
    """See the module.

    Args:
        role_of: unit -> its role.

    Attributes:
        on_over: called with the name of a task that is over everywhere.
        on_revoked: called with a member that is revoked and the names of what ended here with its word.
        held: the evidence that each part goes by.
    """

    offers = (Offer(COORDINATION, (Action(TaskOver, "on_task_over", INFORMED | REQUESTED),)),)

    def __init__(self, ports: Ports, _parts: PartRegistry) -> None:
        self._unit, self._boot, self._agent, self._directory = ports.unit, ports.boot, ports.agent, ports.directory
        self._role_of = ports.role_of
        self._proven: dict[bytes, TaskEvidence] = {}
        self._over: dict[str, dict[str, None]] = {}
        self._ended_here: dict[str, None] = {}
        self._gone_us: dict[str, int] = {}
        self.on_over: list[Callable[[str, int], None]] = []
        self.on_revoked: list[Callable[[str, tuple[str, ...], int], None]] = []
        self.held: list[Callable[[], Iterable[TaskEvidence]]] = []

    # -- evidence ----------------------------------------------------------------------------------------------

    def delegated(self, act: Act, content: Content) -> TaskEvidence:
        """Evidence that `act` delegates a task to this platform, for its requests to others.

        Raises:
            Refused: `role`: it flies vehicles, and its sender is no command centre; it is too long to travel.
        """
        found = _evidence(act, content, act.original)
        self._check_role(found)
        if len(found.payload) > MAX_EVIDENCE:
            size = len(found.payload)
            raise Refused(f"request to pass on: expected at most {MAX_EVIDENCE} bytes, got {size}", "too-long")
        return found

    def proven(self, act: Act, task: str, kinds: tuple[type[Content], ...], now_us: int) -> TaskEvidence:
        """The verified evidence of a task that an act carries; the act's sender is not checked.

        Raises:
            Refused: `unproven`: there is none, or it is not about that; `role`; `cancelled`: the task is over here.
        """
        if not act.evidence:
            raise Refused(f"{act.sender.unit} shows no act of a delegator for {task}", "unproven")
        digest = sha256(act.evidence).digest()
        found = self._proven.get(digest) or self._read(act.evidence)
        if found.task != task or type(found.content) not in kinds:
            raise Refused(
                f"the evidence is about ({found.content.head} ...) as {found.task}, not about {task}", "unproven"
            )
        if self.is_over(found):
            raise Refused(f"cancelled: {task} is over here", "cancelled")
        old_us = now_us - found.made_us
        if not -AHEAD_US <= old_us <= found.stands_us:
            when = "from the future" if old_us < 0 else f"{old_us / 3.6e9:.0f} hours old: delegate it again"
            raise Refused(f"the evidence for {task} is {when}", "unproven")
        self._check_role(found)
        self._proven[digest] = found
        while len(self._proven) > PROVEN:
            del self._proven[next(iter(self._proven))]
        return found

    def _read(self, payload: bytes) -> TaskEvidence:
        act = self._agent.acts.evidence(payload)
        if act.evidence or act.performative not in {Performative.REQUEST, Performative.REQUEST_WHEN}:
            raise Refused(f"an act ({act.performative} ...) is no evidence for a task", "unproven")
        try:
            content = None if act.content is None else read(act.content)
            if isinstance(content, When):
                content = read(content.do)
        except ContentError as wrong:
            raise Refused(f"the evidence is not understood: {wrong}"[:400], "unproven") from None
        if content is None:
            raise Refused("the evidence has no content", "unproven")
        found = _evidence(act, content, payload)
        if isinstance(content, PermitMission):
            return found
        named = found.task.startswith(f"{found.delegator}-") and found.task.endswith(f".{found.delegate}")
        if not named or found.delegator == found.delegate:
            text = f"{found.task} is not a task that {found.delegator} has delegated to {found.delegate}"
            raise Refused(text, "unproven")
        return found

    def _check_role(self, found: TaskEvidence) -> None:
        least = Role.COMMAND_CENTRE if found.flies else Role.DELEGATE
        if self._role_of(found.delegator) < least:
            text = f"{found.delegator} may not delegate ({found.content.head} ...), which commands vehicles"
            raise Refused(text if found.flies else f"{found.delegator} may not delegate", "role")

    def is_centre(self, unit: str) -> bool:
        """Whether it is a command centre, which has greater quotas."""
        return self._role_of(unit) is Role.COMMAND_CENTRE

    def owner(self, unit: str) -> str:
        """The roster member behind a name: quotas are counted by member."""
        return self._agent.acts.share_of(unit).owner

    # -- the order of succession -------------------------------------------------------------------------------

    def check_leads(self, found: TaskEvidence, unit: str, boot: int, now_us: int) -> None:
        """Raise Refused if `unit`, in that life, may not lead the task here now: `succession`, with the one before it."""
        if unit == found.delegator and self.is_centre(unit):
            return
        if isinstance(found.content, PermitMission) and unit not in found.content.leaders:
            text = f"{unit} may not lead mission {found.task}: a command centre has not permitted it (permit-mission)"
            raise Refused(text, "role")
        own = self._place(found, unit, boot)
        for before, its_boot in self._candidates(found.content).items():
            if before != unit and self._place(found, before, its_boot) < own:
                text = f"{unit} may lead {found.task} only when {before} is gone, which is here"
                raise Refused(text, "succession", leader=before)
        for before, at_us in self._gone_us.items():
            if before != unit and now_us - at_us < WAIT_US and self._place(found, before, 0) < own:
                raise Refused(f"{unit} may lead {found.task} when {before} has been gone for longer", "succession")

    def turn(self, found: TaskEvidence) -> int:
        """How many that may lead the task before this platform are here."""
        own = self._place(found, self._unit, self._boot)
        there = self._candidates(found.content).items()
        return sum(self._place(found, unit, boot) < own for unit, boot in there if unit != self._unit)

    def _place(self, found: TaskEvidence, unit: str, boot: int) -> Place:
        late_us = self._life_us(unit, boot)
        late_us = 0 if late_us <= found.made_us - self._offset_us(found.delegator) + LIFE_US else late_us
        if not isinstance(found.content, PermitMission):
            return late_us, int(unit != found.delegate), unit_order(unit)
        leaders = found.content.leaders
        return late_us, leaders.index(unit) if unit in leaders else len(leaders), unit_order(unit)

    def _life_us(self, unit: str, boot: int) -> int:
        """When that life of a platform began; 1970, where its boots do not tell."""
        return boot * 1000 - self._offset_us(unit)

    def _offset_us(self, unit: str) -> int:
        found = None if unit == self._unit else self._agent.member.offsets.last(unit)
        return 0 if found is None else found.offset_us

    def _candidates(self, content: Content) -> dict[str, int]:
        """The platforms that are here and could lead such a task, with their lives."""

        def is_one(entry: DirectoryEntry) -> bool:
            if isinstance(content, PermitMission):
                return entry.unit in content.leaders and _offers(entry, "flight")
            if isinstance(content, MonitorProximity):
                return _offers(entry, FEDERATION.service)
            sensor = content.sensor if isinstance(content, DivideArea) else None
            labels = {label.label for label in entry.labels}
            return _offers(entry, COORDINATION.service) and (sensor is None or sensor in labels)

        there = [
            each
            for each in self._directory.entries()
            if each.kind == "uav" and each.state is not PeerState.GONE and not each.refusal
        ]
        return {each.unit: each.boot for each in there if is_one(each)}

    # -- over --------------------------------------------------------------------------------------------------

    def is_over(self, found: TaskEvidence) -> bool:
        """Whether the task has ended here."""
        return found.task in self._ended_here or found.task in self._over.get(found.delegator, ())

    def has_ended(self, task: str) -> bool:
        """Whether a task of that name, by whomever it was delegated, has ended here."""
        return task in self._ended_here or any(task in of_one for of_one in self._over.values())

    def permitted_again(self, found: TaskEvidence) -> None:
        """Forget that a task of that name is over: its delegator has permitted it once more."""
        self._ended_here.pop(found.task, None)
        self._over.get(found.delegator, {}).pop(found.task, None)

    def end(self, found: TaskEvidence, now_us: int, informed: Iterable[str] = ()) -> None:
        """A task is over, these platforms are notified; its evidence is worth nothing from now on."""
        for unit in informed:
            if unit != self._unit and self._directory.is_present(unit):
                self._agent.tell(unit, TaskOver(task=found.task), now_us, evidence=found.payload)
        of_one = self._over.setdefault(found.delegator, {})
        of_one[found.task] = None
        if len(of_one) > OVER_OF_ONE:
            del of_one[next(iter(of_one))]
        if len(self._over) > DELEGATORS:
            del self._over[next(iter(self._over))]

    def on_task_over(self, act: Act, content: TaskOver, now_us: int) -> None:
        """`(task-over ...)` of the platform that leads the task, or of a command centre, which needs no evidence.

        Raises:
            Refused: it does not, or shows no evidence.
        """
        if not act.evidence and self.is_centre(act.sender.unit):
            self._ended_here[content.task] = None
            if len(self._ended_here) > OVER_OF_ONE:
                del self._ended_here[next(iter(self._ended_here))]
            for over in self.on_over:
                over(content.task, now_us)
            if act.performative is Performative.REQUEST:
                self._agent.done(act, now_us)
            return
        found = self.proven(act, content.task, (DivideArea, PermitMission), now_us)
        self.check_leads(found, act.sender.unit, act.boot, now_us)
        self.end(found, now_us)
        if act.sender.unit != found.delegator and self._directory.is_present(found.delegator):
            news = Progress(step=f"the task was ended by {act.sender.unit}", unit=self._unit)
            self._agent.tell(found.delegator, news, now_us, conversation=found.task)
        for over in self.on_over:
            over(content.task, now_us)
        if act.performative is Performative.REQUEST:
            self._agent.done(act, now_us)

    def end_of(self, is_revoked: Callable[[str], bool], now_us: int) -> list[str]:
        """End all that goes by the word of delegators that are revoked; returns its names. No evidence counts as verified."""
        self._proven.clear()
        ended = {each.task: each for held in self.held for each in held() if is_revoked(each.delegator)}
        for task, found in ended.items():
            self.end(found, now_us)
            for over in self.on_over:
                over(task, now_us)
        return list(ended)

    # -- peers -------------------------------------------------------------------------------------------------

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """Note since when each platform is gone."""
        if isinstance(change, PlatformGone):
            self._gone_us[change.unit] = now_us
            for unit in [each for each, at_us in self._gone_us.items() if now_us - at_us > WAIT_US]:
                del self._gone_us[unit]
        elif isinstance(change, PlatformAppeared):
            self._gone_us.pop(change.unit, None)


def _evidence(act: Act, content: Content, payload: bytes) -> TaskEvidence:
    if isinstance(content, PermitMission):
        return TaskEvidence(content.mission, act.sender.unit, content.leaders[0], content, act.created_us, payload)
    return TaskEvidence(act.conversation_id or "", act.sender.unit, act.receiver.unit, content, act.created_us, payload)


def _offers(entry: DirectoryEntry, service: str) -> bool:
    return any(offer.service == service for offer in entry.services)
