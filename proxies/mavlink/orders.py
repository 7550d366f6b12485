"""Orders become MAVLink commands, and their acknowledgements become results. No socket and no clock.

An order can be expressed in several ways; an autopilot that does not understand one (UNSUPPORTED) gets the next, and
from then on that one only. A way is sent until it is acknowledged, at most `ATTEMPTS` times; DENIED and FAILED are
final. Each repetition looks at the vehicle's mode first: a vehicle that is no longer guided was taken over, and is left
alone. An order that changes the mode is repeated only after a heartbeat has shown that nothing has changed it
meanwhile.

COMMAND_ACK names a command and not an order, so each sending is remembered, and an acknowledgement answers the oldest
that is not answered: one of an order that a newer one replaced does not end the newer one.
"""

from collections import deque
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.model.errors import Refused
from dyknow.navigation import vehicle
from dyknow.proxies.mavlink.reports import VehicleReports
from dyknow.proxies.mavlink.ways import OURSELVES, Target, Way, let_out_m, ways_of

RETRY_US = 500_000
ATTEMPTS = 4
ANSWERS_WITHIN_US = 3_000_000
"""An acknowledgement that takes longer than this is lost."""
_TWICE_WITHIN_US = 300_000
"""PX4 acknowledges a change of mode twice, so soon after each other."""
_PATIENCE_US = 10_000_000
_MODE_PATIENCE_US = 4_500_000
_PURPOSES = {
    vehicle.Arm: "arming",
    vehicle.PointMountOrder: "mount",
    vehicle.LookAtOrder: "mount",
    vehicle.GripOrder: "gripper",
    vehicle.LineOrder: "winch",
}
"""The purpose of an order: a newer one for the same purpose takes the place of an older one."""
_REFUSALS = {
    mavlink.MAV_RESULT_TEMPORARILY_REJECTED: "temporarily rejected",
    mavlink.MAV_RESULT_DENIED: "denied",
    mavlink.MAV_RESULT_UNSUPPORTED: "unsupported",
    mavlink.MAV_RESULT_FAILED: "failed",
}


@dataclass(slots=True)
class _Sending:
    """An order that is being sent: in which of its ways, how often so far, and in which mode the vehicle was."""

    command: vehicle.Command
    ways: list[Way]
    target: Target
    known: VehicleReports
    next_us: int
    give_up_us: int
    mode: str
    sent: int = 0
    heartbeats: int = 0
    word: str = vehicle.NO_ANSWER
    way: Way = field(init=False)

    def __post_init__(self) -> None:
        self.way = self.ways[0]

    @property
    def is_shown(self) -> bool:
        """Whether the vehicle is in the mode that was ordered, whatever became of the acknowledgement."""
        wanted = self.known.mode in vehicle.MODES_OF.get(type(self.command.order), ())
        return wanted and self.known.mode != self.mode

    @property
    def is_taken_over(self) -> bool:
        """Whether the vehicle has left the mode in which the order was given, for one that takes no positions."""
        return self.known.mode != self.mode and not self.known.guided


class OrderOutcome(NamedTuple):
    """The outcome of a step: messages to send, results to report."""

    send: list[Any]
    results: list[vehicle.CommandResult]

    def tell(self, sending: _Sending, accepted: bool, reason: str) -> None:
        self.results.append(vehicle.CommandResult(0, sending.command.number, accepted, reason))


class Errands:
    """The orders under way to one vehicle. Time is that of the retries (wall time); results are stamped by the caller."""

    def __init__(self, ourselves: Target = OURSELVES) -> None:
        self._ourselves = ourselves
        self._open: dict[str, _Sending] = {}
        self._unanswered: dict[int, deque[tuple[int, int]]] = {}
        self._answered_us: dict[int, int] = {}
        self._foreign: set[tuple[str, int | None]] = set()

    def on_command(self, command: vehicle.Command, known: VehicleReports, target: Target, now_us: int) -> OrderOutcome:
        """Send an order; it takes the place of an older one that is still being sent."""
        outcome = OrderOutcome([], [])
        try:
            ways = ways_of(command.order, known, target)
        except Refused as refused:
            return OrderOutcome([], [vehicle.CommandResult(0, command.number, False, refused.reason)])
        purpose = _PURPOSES.get(type(command.order), "flight")
        replaced = self._open.pop(purpose, None)
        if replaced is not None:
            outcome.tell(replaced, accepted=False, reason=vehicle.SUPERSEDED)
        understood = [way for way in ways if way.name not in self._foreign]
        sending = _Sending(command, understood or ways[-1:], target, known, now_us, now_us, known.mode)
        self._open[purpose] = sending
        self._begin(purpose, sending, outcome, now_us)
        return outcome

    def _begin(self, purpose: str, sending: _Sending, outcome: OrderOutcome, now_us: int) -> None:
        """Send it in its present way for the first time."""
        sending.sent, way = 0, sending.way
        patience_us = _MODE_PATIENCE_US if way.changes_mode else ATTEMPTS * RETRY_US
        sending.give_up_us = now_us + patience_us
        if way.acknowledged is None:
            outcome.tell(sending, accepted=True, reason=vehicle.UNCONFIRMED)
        self._send(sending, outcome, now_us)
        self._open[purpose] = sending

    def _send(self, sending: _Sending, outcome: OrderOutcome, now_us: int) -> None:
        way = sending.way
        messages = list(way.messages)
        if sending.sent and way.again is not None:
            messages[0] = way.again
        if isinstance(sending.command.order, vehicle.LineOrder) and sending.known.winch is not None:
            messages[0].param3 = let_out_m(sending.command.order.line_m, sending.known)
        if sending.sent and hasattr(messages[0], "confirmation"):
            messages[0].confirmation = sending.sent
        outcome.send.extend(_with_escort(messages))
        if way.acknowledged is not None:
            self._unanswered.setdefault(way.acknowledged, deque()).append((sending.command.number, now_us))
        sending.sent += 1
        sending.next_us, sending.heartbeats = now_us + RETRY_US, sending.known.heartbeats

    def on_ack(self, acknowledged: Any, now_us: int) -> OrderOutcome:
        """COMMAND_ACK; "in progress" buys time, "temporarily rejected" may change, anything else is the answer."""
        outcome = OrderOutcome([], [])
        to = getattr(acknowledged, "target_system", 0), getattr(acknowledged, "target_component", 0)
        if any(given not in {0, own} for given, own in zip(to, self._ourselves, strict=True)):
            return outcome
        if self._is_said_twice(acknowledged, now_us):
            return outcome
        waiting = self._unanswered.get(acknowledged.command, deque())
        while waiting and now_us - waiting[0][1] > ANSWERS_WITHIN_US:
            waiting.popleft()
        if not waiting:
            return outcome
        number, _ = waiting.popleft()
        if acknowledged.result == mavlink.MAV_RESULT_IN_PROGRESS:
            waiting.appendleft((number, now_us + _PATIENCE_US - ANSWERS_WITHIN_US))
        for purpose, sending in list(self._open.items()):
            if sending.command.number == number and sending.way.acknowledged == acknowledged.command:
                self._answered(purpose, sending, acknowledged.result, outcome, now_us)
        return outcome

    def _is_said_twice(self, acknowledged: Any, now_us: int) -> bool:
        """Whether this is the second answer of a PX4 to the change of mode that it has just answered."""
        is_px4 = any(each.known.autopilot == mavlink.MAV_AUTOPILOT_PX4 for each in self._open.values())
        if acknowledged.command != mavlink.MAV_CMD_DO_SET_MODE or not is_px4:
            return False
        before_us = self._answered_us.pop(acknowledged.command, None)
        if before_us is not None and now_us - before_us <= _TWICE_WITHIN_US:
            return True
        self._answered_us[acknowledged.command] = now_us
        return False

    def _answered(self, purpose: str, sending: _Sending, result: int, outcome: OrderOutcome, now_us: int) -> None:
        way = sending.way
        if result == mavlink.MAV_RESULT_IN_PROGRESS:
            sending.next_us = sending.give_up_us = now_us + _PATIENCE_US
        elif result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED:
            sending.word = _REFUSALS[result]
        elif result == mavlink.MAV_RESULT_UNSUPPORTED and way.again is not None and sending.sent > 1:
            pass  # the repetition lacks the leave that this autopilot wants
        elif result == mavlink.MAV_RESULT_UNSUPPORTED and way is not sending.ways[-1]:
            self._foreign.add(way.name)
            sending.way = sending.ways[sending.ways.index(way) + 1]
            if sending.is_taken_over:
                self._close(purpose, outcome, accepted=False, reason=vehicle.OVERTAKEN)
            else:
                self._begin(purpose, sending, outcome, now_us)
        else:
            accepted = result == mavlink.MAV_RESULT_ACCEPTED
            reason = "" if accepted else _REFUSALS.get(result, f"result {result}")
            self._close(purpose, outcome, accepted=accepted, reason=reason)

    def on_time(self, now_us: int) -> OrderOutcome:
        outcome = OrderOutcome([], [])
        for purpose, sending in list(self._open.items()):
            if now_us < min(sending.next_us, sending.give_up_us):
                continue
            way = sending.way
            if sending.is_shown:
                self._close(purpose, outcome, accepted=True, reason="")
            elif way.acknowledged is None and sending.sent >= ATTEMPTS:
                del self._open[purpose]
            elif sending.is_taken_over and (purpose == "flight" or way.changes_mode):
                self._close(purpose, outcome, accepted=False, reason=vehicle.OVERTAKEN)
            elif now_us >= sending.give_up_us:
                self._close(purpose, outcome, accepted=False, reason=sending.word)
            elif sending.sent < ATTEMPTS and (not way.changes_mode or sending.known.heartbeats > sending.heartbeats):
                self._send(sending, outcome, now_us)
        return outcome

    def _close(self, purpose: str, outcome: OrderOutcome, *, accepted: bool, reason: str) -> None:
        outcome.tell(self._open.pop(purpose), accepted, reason)


def _with_escort(messages: list[Any]) -> list[Any]:
    """A parameter must arrive before the command that reads it, a speed after the command it belongs to."""
    parameters = [each for each in messages if each.get_type() == "PARAM_SET"]
    return parameters + [each for each in messages if each.get_type() != "PARAM_SET"]
