"""A camera, turned to the known objects with the greatest need, while a task has it so (thesis 8.5, 10.4)."""

from collections.abc import Iterable
from itertools import count
from math import hypot

from dyknow import Sample
from dyknow.agents.actions import Offer
from dyknow.agents.capabilities.attention.requests import ATTEND
from dyknow.agents.capabilities.attention.seen_objects import SeenObjects
from dyknow.agents.capabilities.cameras.cameras import Cameras
from dyknow.agents.capabilities.flight.flight import FLIGHT
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.effects import Reported
from dyknow.agents.part import NOT_MINE, Followed, Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.tasks.life import TaskLife
from dyknow.agents.tasks.task import Task
from dyknow.anchoring.attention.deciding import Attention, Gaze
from dyknow.anchoring.attention.ground import around, roads_near
from dyknow.anchoring.attention.view import TurnableCamera
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.federation.messages.acts import Act
from dyknow.federation.messages.contents import Attend
from dyknow.federation.messages.descriptions import ConditionEntry, LabelEntry
from dyknow.model.errors import Refused
from dyknow.navigation.cameras.pinhole import PanTilt
from dyknow.navigation.vehicle import (
    SUPERSEDED,
    UNCONFIRMED,
    Command,
    CommandResult,
    LookAtOrder,
    MountOrder,
    PointMountOrder,
)

ATTENTION = "camera-attention"
"""Semantic label."""
PERIOD_US = 200_000
REPEAT_US = 1_000_000
"""Period at which an unchanged order is repeated."""
MOVED_M = 1.0
SEARCHED_M = 150.0
"""How far around the camera ground is searched where no roads are known; the vehicle moves so far before it is others."""
_NUMBERS = 1 << 40
"""Orders to the mount are numbered from here, those to the vehicle from 1."""


class CameraAttention(Part):
    """Decides where to look, five times a second, while there is a task; its decision and the reason are a stream.

    Args:
        cameras: where they are and look.
        pilot: whether the vehicle may be commanded; the mount is not its concern otherwise.
        emit: takes orders to the mount.
        offer: called when the condition changes.

    Attributes:
        seen: the objects.
        gaze: the present decision.
    """

    offers = (Offer(FLIGHT, (ATTEND,)),)
    takes = {Reported: "on_reported"}  # noqa: RUF012  (a declaration)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._rig, self._agent, self._clock, self._network = ports.config.rig, ports.agent, ports.clock, ports.network
        self._cameras, self._pilot, self._tasks = parts[Cameras], parts[Pilot.of], parts[TaskLife]
        self._emit = ports.emit
        self._note, self._offer, self._translation = ports.note, ports.offer, ports.translation
        self.seen, self._instance = SeenObjects(ports.instance()), ports.instance()
        self._searched: tuple[float, float, RoadNetwork | None] | None = None
        self.gaze: Gaze | None = None
        self._label = ports.translation.local_label(ATTENTION, ports.config.unit)
        self._to_local = ports.translation.to_local(ATTENTION)
        ports.network.add_source(self._label, ports.translation.local_sort(ATTENTION))
        self._attention: Attention | None = None
        self._followed: dict[str, str] = {}
        self._stared: dict[str, Gaze] = {}
        self._looked = PanTilt(0.0, 0.0)
        self._due_us = 0
        self._ordered: tuple[int, Gaze] | None = None
        self._numbers = count(_NUMBERS)
        self._refusal: ConditionEntry | None = None

    def labels(self) -> Iterable[LabelEntry]:
        return [self._translation.ontology.entry(ATTENTION)]

    def conditions(self) -> Iterable[ConditionEntry]:
        return () if self._refusal is None else (self._refusal,)

    # -- tasks -------------------------------------------------------------------------------------------------

    def on_attend(self, act: Act, _content: Attend, now_us: int) -> None:
        """`(attend)`: until it is cancelled.

        Raises:
            Refused: the platform may not command its vehicle.
        """
        owner = self._tasks.check_free(act.conversation_id, act.sender.unit)
        if not self._pilot.control:
            raise Refused("this platform was not given control of its vehicle (join with --control)", "forbidden")
        self.begin(owner)

        def take_down(_at_us: int) -> tuple[str, ...]:
            self.end(owner)
            return ()

        self._tasks.add(Task(owner, act.sender.unit, Attend.head, take_down, since_us=now_us))
        self._agent.done(act, now_us)

    def begin(self, task: str, followed: str = "") -> None:
        """Attend for that task, to that object before others."""
        self.seen.hold(task)
        self._followed[task] = followed

    def stare(self, task: str, x_m: float, y_m: float, symbol: str) -> None:
        """Look at one place for a task that attends, whatever else there is to see."""
        self._stared[task] = Gaze(x_m, y_m, symbol, "it is looked at again", 1.0)

    def end(self, task: str) -> None:
        """The task is over; with the last one the camera is turned back."""
        self.seen.release(task)
        self._stared.pop(task, None)
        if self._followed.pop(task, None) is not None and not self._followed:
            if self._attention is not None:
                self._order(PointMountOrder(*self._looked))
            self._attention = self._ordered = self.gaze = self._searched = None

    # -- deciding ----------------------------------------------------------------------------------------------

    @property
    def deadline_us(self) -> int | None:
        return self._clock.wall_us(self._due_us) if self._followed else None

    def on_time(self, now_us: int) -> None:
        federation_us = self._clock.federation_us(now_us)
        if not self._followed or federation_us < self._due_us:
            return
        self._due_us = federation_us + PERIOD_US
        if self._pilot.mission.looks:
            self._ordered = None
            return
        camera = self._camera(federation_us)
        if camera is None:
            return
        if self._attention is None:
            self._attention, self._looked = Attention(), camera.pose.mount
        if self._stared:
            self.gaze = next(iter(self._stared.values()))
            self._look(self.gaze, federation_us)
            return
        self._search(self._attention, camera)
        objects = self.seen.read(federation_us, {each for each in self._followed.values() if each})
        self.gaze = self._attention.decide(federation_us, camera, objects)
        if self.gaze is not None:
            self._look(self.gaze, federation_us)

    def _search(self, attention: Attention, camera: TurnableCamera) -> None:
        """Search the ground where the camera is now: roads where there are some, else a square."""
        north_m, east_m, _ = camera.pose.position_m.tolist()
        roads = self._instance.symbols.roads()
        before = self._searched
        if before is not None and before[2] is roads and hypot(east_m - before[0], north_m - before[1]) <= SEARCHED_M:
            return
        self._searched = east_m, north_m, roads
        near = [] if roads is None else roads_near(roads, self._rig.frame, east_m, north_m, camera.reach_m + SEARCHED_M)
        attention.search(near or around(east_m, north_m, SEARCHED_M))

    def _camera(self, federation_us: int) -> TurnableCamera | None:
        """The camera as it is now, or as it was known last; None: not lately."""
        perception = self._cameras.perception
        state = perception.state(federation_us)
        if state is None and perception.known_us is not None and federation_us - perception.known_us < REPEAT_US:
            state = perception.state(perception.known_us)
        intrinsics = next(iter(self._rig.cameras.values()), None)
        return None if state is None or intrinsics is None else TurnableCamera(intrinsics, state.pose)

    def _look(self, gaze: Gaze, federation_us: int) -> None:
        value = (gaze.symbol, gaze.x_m, gaze.y_m, gaze.because)
        self._network.push(self._label, self._to_local.sample(Sample(federation_us, federation_us, value)))
        if self._ordered is not None:
            at_us, before = self._ordered
            moved_m = max(abs(gaze.x_m - before.x_m), abs(gaze.y_m - before.y_m))
            if moved_m < MOVED_M and federation_us - at_us < REPEAT_US:
                return
        self._ordered = federation_us, gaze
        self._order(LookAtOrder(*self._rig.frame.from_ned(gaze.y_m, gaze.x_m, 0.0)))

    def _order(self, order: MountOrder) -> None:
        self._emit(Command(next(self._numbers), order))

    def on_reported(self, event: Reported, now_us: int) -> Followed:
        """The answers to orders to the mount are for this part alone; that it does not obey is a condition."""
        report = event.report
        if not isinstance(report, CommandResult) or report.number < _NUMBERS:
            return NOT_MINE
        refused = not report.accepted and report.reason not in {SUPERSEDED, UNCONFIRMED}
        if refused != (self._refusal is not None) and (refused or report.accepted):
            text = f"the camera's mount does not obey: {report.reason}"[:200]
            self._refusal = ConditionEntry(text=text, since_us=now_us) if refused else None
            self._note(text if refused else "the camera's mount obeys again")
            self._offer(now_us)
        return ()
