"""`(follow object: car3)`: the vehicle flies after an object that the platform sees, by guided orders through its pilot.

The pilot's hands come first: a pilot that takes the vehicle over, and any other order to it, ends the task. Giving way
comes next: nothing is sent until it is over. A mission is never interrupted. The vehicle comes as near as floor,
ceiling, range and fence allow. While the object is not seen it is followed where it is expected.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from difflib import get_close_matches
from math import hypot

from dyknow.agents.actions import Offer
from dyknow.agents.capabilities.attention.camera_attention import CameraAttention
from dyknow.agents.capabilities.attention.requests import FOLLOW
from dyknow.agents.capabilities.attention.standoff import CREDIBLE_US, Leaps, Whereabouts, expected, goal
from dyknow.agents.capabilities.flight.errand import Errand
from dyknow.agents.capabilities.flight.flight import FLIGHT, FlightAgent
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.tasks.life import TaskLife
from dyknow.agents.tasks.task import Task
from dyknow.anchoring.attention.watched import WatchedObject
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import Done, Follow, Progress
from dyknow.federation.messages.descriptions import ConditionEntry
from dyknow.model.errors import Refused, did_you_mean
from dyknow.navigation.vehicle import Command, GoToOrder, HoldOrder, Order

PERIOD_US = 200_000
ORDERED_US = 1_500_000
"""The vehicle is sent elsewhere at most so often: an order is seen in its target a second later."""
MOVED_M = 3.0
SPEED_M_S = 12.0
AGAIN_US = 3_000_000
"""After a pause the object may be unknown for so long: it has just been given its symbol again."""
_NAMES = 8
"""How many are listed, the nearest, where there is no object of the one that was given."""
_NEARER = (1.0, 0.75, 0.5, 0.25)
"""Shares of the way that are tried where the whole way is forbidden."""


@dataclass(slots=True)
class _Task:
    """The followed object, the request, and the order that stands for it.

    Attributes:
        paused: the other use of the vehicle; empty: it follows.
        until_us: until then the object may be unknown.
    """

    act: Act
    symbol: str
    conversation: str
    standoff_m: float
    altitude_m: float
    order: Order
    errand: Errand | None
    ordered_us: int
    is_seen: bool
    is_taken: bool = False
    forbidden: str = ""
    paused: str = ""
    until_us: int = 0
    leaps: Leaps = field(default_factory=Leaps)


class Following(Part):
    """One object at a time. Times of the pilot are federation time.

    Args:
        attention: turns the camera to the object, and knows where it is.
        flight: awaits the outcome of single orders.
        emit: takes commands to the vehicle.
        offer: called when the condition changes.
    """

    offers = (Offer(FLIGHT, (FOLLOW,)),)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._frame, self._agent, self._clock = ports.config.rig.frame, ports.agent, ports.clock
        self._directory = ports.directory
        self._attention, self._flight, self._pilot = parts[CameraAttention], parts[FlightAgent], parts[Pilot.of]
        self._tasks = parts[TaskLife]
        self._emit, self._note, self._offer = ports.emit, ports.note, ports.offer
        self._task: _Task | None = None
        self._due_us = 0
        self._shown: ConditionEntry | None = None

    def conditions(self) -> Iterable[ConditionEntry]:
        return () if self._shown is None else (self._shown,)

    # -- asked and ended ---------------------------------------------------------------------------------------

    def on_follow(self, act: Act, content: Follow, now_us: int) -> None:
        """`(follow object: car3 standoff_m: 20)`: until it is cancelled, or the object is lost for good.

        Raises:
            Refused: there is no such object, another is followed, or a rule of the pilot's; nothing has changed then.
        """
        conversation = self._tasks.check_free(act.conversation_id, act.sender.unit)
        if self._task is not None:
            raise Refused(
                f"the vehicle follows {self._task.symbol}: cancel {self._task.conversation} first", "following"
            )
        federation_us = self._clock.federation_us(now_us)
        fix, symbol = self._pilot.fix, content.object
        forbidden = self._pilot.refusal(HoldOrder())
        if forbidden is not None or fix is None:
            raise Refused(forbidden or "the vehicle's position is not known", "forbidden")
        followed = self._find(symbol, federation_us)
        altitude_m = self._pilot.bounds.within(fix.altitude_m, self._pilot.limits)
        order = self._wanted(followed, content.standoff_m, altitude_m)
        commands = self._pilot.order(order)
        self._flight.supersede(now_us)
        self._send(commands)
        self._task = _Task(
            act, symbol, conversation, content.standoff_m, altitude_m, order, self._pilot.errand, federation_us,
            followed.is_anchored,
        )  # fmt: skip
        self._due_us = federation_us + PERIOD_US
        self._attention.begin(conversation, symbol)
        self._tasks.add(Task(conversation, act.sender.unit, Follow.head, self._take_down, since_us=now_us))
        self._agent.answer(act, Performative.AGREE, None, now_us)
        self._show(f"follows {symbol}", now_us)

    def _find(self, symbol: str, federation_us: int) -> WatchedObject:
        for each in self._read(symbol, federation_us):
            if each.interest == "followed" and expected(each.places) is not None:
                return each
        known = get_close_matches(symbol, self._attention.seen.names(), _NAMES, cutoff=0.0)
        remedy = did_you_mean(symbol, known) or " No object is known here."
        raise Refused(f"no object is called {symbol!r} here.{remedy} dyknow objects lists them.", "unknown-object")

    def _read(self, symbol: str, federation_us: int) -> list[WatchedObject]:
        return self._attention.seen.read(federation_us, (symbol,))

    def _take_down(self, now_us: int) -> tuple[str, ...]:
        """Stop, if the vehicle still flies for this task."""
        task, self._task = self._task, None
        if task is not None:
            self._attention.end(task.conversation)
            if self._pilot.standing is task.order and self._pilot.diversion is None:
                try:
                    self._send(self._pilot.order(HoldOrder()))
                except Refused as refused:
                    self._note(f"does not hold after following {task.symbol}: {refused.reason}")
            self._show("", now_us)
        return ()

    def _fail(self, task: _Task, reason: str, now_us: int) -> None:
        """The task ends here, and its delegator is notified."""
        self._note(f"follows {task.symbol} no longer: {reason}")
        self._agent.end(task.conversation, task.act.sender.unit, reason, now_us)
        self._tasks.cancel(task.conversation, now_us)
        self._show(f"followed {task.symbol}: {reason}"[:200], now_us)

    def _show(self, text: str, now_us: int) -> None:
        self._shown = ConditionEntry(text=text, since_us=now_us) if text else None
        self._offer(now_us)

    def _tell(self, task: _Task, text: str, now_us: int) -> None:
        self._note(text)
        self._show(text[:200], now_us)
        unit = task.act.sender.unit
        if self._directory.is_present(unit):
            message = Progress(step=text[:200], unit=self._agent.unit)
            self._agent.tell(unit, message, now_us, conversation=task.conversation)

    # -- paused ------------------------------------------------------------------------------------------------

    @property
    def symbol(self) -> str:
        """The followed object; empty: none."""
        return "" if self._task is None else self._task.symbol

    def pause(self, reason: str, now_us: int) -> None:
        """The vehicle is needed for something else: nothing is sent until `go_on`."""
        task = self._task
        if task is not None and not task.paused:
            task.paused = reason
            self._tell(task, f"{task.symbol} is not followed meanwhile: {reason}", now_us)

    def go_on(self, overtaken: str, now_us: int) -> None:
        """Resume following when the vehicle is free; `overtaken`: its pilot or a user has it, which ends the task."""
        task, federation_us = self._task, self._clock.federation_us(now_us)
        if task is None or not task.paused:
            return
        task.paused, order = "", HoldOrder()
        try:
            commands = [] if overtaken else self._pilot.order(order)
        except Refused as refused:
            overtaken = refused.reason
        if overtaken:
            self._fail(task, overtaken, now_us)
            return
        task.order, task.errand, task.ordered_us = order, self._pilot.errand, federation_us - ORDERED_US
        task.until_us, task.leaps, self._due_us = federation_us + AGAIN_US, Leaps(), federation_us + PERIOD_US
        self._send(commands)
        self._tell(task, f"{task.symbol} is followed again", now_us)

    # -- following ---------------------------------------------------------------------------------------------

    @property
    def deadline_us(self) -> int | None:
        return None if self._task is None else self._clock.wall_us(self._due_us)

    def on_time(self, now_us: int) -> None:
        task, federation_us = self._task, self._clock.federation_us(now_us)
        if task is None or federation_us < self._due_us:
            return
        self._due_us = federation_us + PERIOD_US
        if task.paused:
            return
        reason = self._overtaken(task)
        if reason:
            self._fail(task, reason, now_us)
            return
        if not task.is_taken and task.errand is not None and task.errand.is_taken:
            task.is_taken = True
            message = Done(text=f"follows {task.symbol}: {task.errand.words}")
            self._agent.answer(task.act, Performative.INFORM, message, now_us)
        objects = self._read(task.symbol, federation_us)
        followed = next((each for each in objects if each.interest == "followed"), None)
        place = None if followed is None else expected(followed.places)
        if followed is None or place is None:
            if federation_us < task.until_us:
                return
            self._fail(task, f"{task.symbol} is not known any longer: it was forgotten", now_us)
            return
        self._on_seen(task, followed, now_us)
        if task.leaps.is_credible(federation_us, place):
            self._fly(task, followed, federation_us, now_us)
        elif task.leaps.since_us is not None and federation_us - task.leaps.since_us >= CREDIBLE_US:
            self._fail(task, f"{task.symbol} leapt to where no object can be so soon", now_us)

    def _overtaken(self, task: _Task) -> str:
        """Why the vehicle flies for this task no longer, in words; giving way ends an order, and not the task."""
        if self._pilot.diversion is not None:
            task.errand = None
        errand = task.errand or self._pilot.errand
        if self._pilot.standing is not task.order:
            is_known = errand is not None and errand.is_over and errand.order == task.order
            return errand.reason if errand is not None and is_known else "overtaken by a newer order"
        if task.errand is not None and task.errand.has_failed and not task.is_taken:
            return task.errand.reason
        return self._pilot.refusal(HoldOrder()) or ""

    def _on_seen(self, task: _Task, followed: WatchedObject, now_us: int) -> None:
        if followed.is_anchored != task.is_seen:
            task.is_seen = followed.is_anchored
            text = "is seen again" if task.is_seen else "is not seen: the vehicle flies where it is expected"
            self._tell(task, f"{task.symbol} {text}", now_us)

    def _fly(self, task: _Task, followed: WatchedObject, federation_us: int, now_us: int) -> None:
        """Send the vehicle elsewhere if that is worth an order, and nothing else has it now."""
        if self._pilot.diversion is not None or federation_us - task.ordered_us < ORDERED_US:
            return
        try:
            order = self._wanted(followed, task.standoff_m, task.altitude_m)
            if isinstance(task.order, GoToOrder) and self._apart_m(order, task.order) < MOVED_M:
                return
            commands = self._pilot.order(order)
        except Refused as refused:
            if refused.reason.partition(" m ")[2] != task.forbidden:
                task.forbidden = refused.reason.partition(" m ")[2]
                self._tell(task, f"{task.symbol} is not followed farther: {refused.reason}", now_us)
            return
        task.forbidden, task.order, task.errand, task.ordered_us = "", order, self._pilot.errand, federation_us
        self._send(commands)

    def _wanted(self, followed: WatchedObject, standoff_m: float, altitude_m: float) -> GoToOrder:
        """The order that brings the vehicle to the object, or as near as it may come.

        Raises:
            Refused: it may not come nearer, for the rule that forbids it.
        """
        fix, place = self._pilot.fix, expected(followed.places)
        if fix is None or place is None:
            raise Refused("the vehicle's position is not known", "forbidden")
        north_m, east_m, _ = self._frame.to_ned(fix.latitude_deg, fix.longitude_deg, fix.altitude_m)
        own = Whereabouts(east_m, north_m)
        there = goal(own, place, standoff_m)
        reason: str | None = None
        for share in _NEARER:
            x_m, y_m = own.x_m + share * (there.x_m - own.x_m), own.y_m + share * (there.y_m - own.y_m)
            latitude_deg, longitude_deg, _ = self._frame.from_ned(y_m, x_m, 0.0)
            order = GoToOrder(latitude_deg, longitude_deg, altitude_m, SPEED_M_S)
            refusal = self._pilot.refusal(order)
            if refusal is None:
                return order
            reason = reason or refusal
        raise Refused(reason or "", "forbidden")

    def _apart_m(self, one: GoToOrder, other: GoToOrder) -> float:
        (north_m, east_m, _), (far_m, wide_m, _) = (self._frame.to_ned(*each[:3]) for each in (one, other))
        return hypot(north_m - far_m, east_m - wide_m, one.altitude_m - other.altitude_m)

    def _send(self, commands: Iterable[Command]) -> None:
        for command in commands:
            self._emit(command)
