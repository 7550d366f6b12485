"""An order's life: sent, acknowledged, seen in the vehicle's own target and in its motion; or not, and why.

An acknowledgement says that the autopilot has understood, not that it flies. So an order is followed until the target
that the vehicle tells (POSITION_TARGET_GLOBAL_INT, where it tells one; for a mode its heartbeat) and its motion show it.

    progress      when                                                               becomes
    SENT          the autopilot accepts it                                           ACKNOWLEDGED
    SENT          the autopilot refuses it in every way of saying it                 REFUSED, for good
    SENT, ACKN.   target (where one is reported) and motion show it                  FLOWN
    SENT, ACKN.   2 s after it was sent they do not; later where it has to turn       UNSEEN
    FLOWN         its motion has not shown it for 2 s, and it is not there           UNSEEN
    UNSEEN        they show it after all                                             FLOWN
    any but REF.  the vehicle has another target than this one and the one before,
                  or is in another mode than ours                                    OVERTAKEN, for good

No clock and no messages here: how often an order is sent, and in which messages, is in `dyknow.proxies.mavlink.orders`.
Times are federation time.
"""

from dataclasses import dataclass
from enum import Enum
from math import cos, hypot, radians

from dyknow.agents.places import Fix
from dyknow.navigation.geodesy import distance_m
from dyknow.navigation.vehicle import (
    INTERRUPTIBLE_MODES,
    MODES_OF,
    NO_ANSWER,
    OVERTAKEN,
    SUPERSEDED,
    UNCONFIRMED,
    Command,
    CommandResult,
    GoToOrder,
    HoldOrder,
    InterruptOrder,
    Order,
    StatusReport,
    TargetReport,
    TextReport,
    stopping_distance_m,
)

SEEN_WITHIN_US = 2_000_000
BRAKES_M_S2, TURNS_US = 2.5, 1_000_000
"""How a vehicle brakes that has the target and flies away from it, and how much longer it takes to turn."""
MODE_WITHIN_US = 4_000_000
"""A mode is reported once a second, and an order that changes it is repeated only after it was."""
SETTLES_US = 1_000_000
"""How long a target from before an order may still arrive, and a vehicle without targets may yet report one."""
LEVEL_M, UPRIGHT_M = 3.0, 1.5
SLOPE = 5.0
"""A climb to a place farther than this multiple of its height is too flat to be seen within 2 s."""
STEEP = 0.25
"""A climb to a place nearer than this multiple of its height shows in its height alone."""
TEXT_WITHIN_US = 1_000_000
"""A text of the autopilot that comes so soon after an order is about that order."""
WORDS_US = 300_000
"""How long after an order a user waits for the words to a refusal."""
SAYS_S = 0.5
"""Delay of an order on its way to the vehicle, which flies on meanwhile."""
_M_PER_DEG = 111_194.9


class OrderProgress(Enum):
    """How far an order has come; see the module."""

    SENT = "sent"
    ACKNOWLEDGED = "acknowledged"
    FLOWN = "flown"
    REFUSED = "refused"
    OVERTAKEN = "overtaken"
    UNSEEN = "not seen"


_P = OrderProgress


@dataclass(slots=True)
class Errand:
    """One order under way.

    Attributes:
        start: where the vehicle was when the order was sent.
        before: its target then; None: none was known, and the first that is heard counts as that.
        from_mode: its mode then.
        tells_target: whether the vehicle has reported a target lately.
        reason: why it is refused, overtaken or not seen: the autopilot's word where it has one.
        in_target: the vehicle's own target, or its mode, is what was ordered.
    """

    command: Command
    sent_us: int
    start: Fix | None
    tells_target: bool = False
    before: TargetReport | None = None
    from_mode: str = ""
    progress: OrderProgress = _P.SENT
    reason: str = ""
    acknowledged: bool = False
    in_target: bool = False
    _acknowledges: bool = True
    _is_settled: bool = False
    _shown_us: int | None = None
    _has_left: bool = False
    _text: str = ""

    @property
    def order(self) -> Order:
        return self.command.order

    @property
    def is_over(self) -> bool:
        """Whether nothing more can come of it."""
        return self.progress is _P.REFUSED or self.progress is _P.OVERTAKEN

    @property
    def is_taken(self) -> bool:
        """Whether the vehicle has taken the order over: acknowledged, and its target, where it tells one."""
        known = self.acknowledged and not self.tells_target and not self._modes and self._is_settled
        return self.progress is _P.FLOWN or (not self.is_over and (self.in_target or known))

    @property
    def has_failed(self) -> bool:
        """Whether it was not taken over, as far as is known now."""
        return self.is_over or (self.progress is _P.UNSEEN and not self.is_taken)

    @property
    def words(self) -> str:
        """How it is known that the order is taken over."""
        if self.in_target:
            where = "the vehicle's mode" if self._modes else "the vehicle's target"
            return f"acknowledged, and seen in {where}" if self.acknowledged else f"seen in {where}"
        return "acknowledged" if self.acknowledged else "seen in the vehicle's motion"

    @property
    def deadline_us(self) -> int | None:
        """When time alone changes its progress; None: never."""
        if self.is_over or self.progress is _P.UNSEEN:
            return None
        if self.progress is _P.FLOWN:
            return None if self._modes or self._shown_us is None else self._shown_us + SEEN_WITHIN_US
        if not self._is_settled:
            return self.sent_us + SETTLES_US
        return self.sent_us + (MODE_WITHIN_US if self._modes else SEEN_WITHIN_US + self._turning_us)

    @property
    def _turning_us(self) -> int:
        """How much later the motion shows it of a vehicle that flew away from the place, and has taken it as its target."""
        place, start = self._place(), self.start
        if not self.in_target or self._stops or place is None or start is None:
            return 0
        north_m, east_m = _metres(start, place)
        away_m = hypot(north_m, east_m)
        recedes_m_s = -(start.north_m_s * north_m + start.east_m_s * east_m) / away_m if away_m > LEVEL_M else 0.0
        return TURNS_US + round(recedes_m_s / BRAKES_M_S2 * 1e6) if recedes_m_s > 0.0 else 0

    # -- evidence ----------------------------------------------------------------------------------------------

    def on_result(self, result: CommandResult) -> None:
        """The autopilot's answer, or that none came."""
        if self.is_over or result.number != self.command.number or result.reason == SUPERSEDED:
            return
        if result.accepted:
            self._acknowledges = result.reason != UNCONFIRMED
            self.acknowledged = self._acknowledges
            if self.acknowledged and self.progress is _P.SENT:
                self.progress = _P.ACKNOWLEDGED
        elif result.reason == NO_ANSWER:
            if not self.in_target and self.progress is not _P.FLOWN:
                self.progress, self.reason = _P.UNSEEN, NO_ANSWER
        elif result.reason == OVERTAKEN:
            self.end(_P.OVERTAKEN, OVERTAKEN)
        else:
            self.end(_P.REFUSED, f"autopilot: {result.reason}{self._why}")

    def on_target(self, target: TargetReport, now_us: int) -> None:
        """Where the vehicle says it is flying to."""
        if self.is_over or self._modes:
            return
        self.tells_target = True
        if self.is_ours(target):
            self.in_target = True
            return
        is_news = self.before is not None and not is_at(self.before, target)
        self.before = self.before or target
        if self.in_target or (is_news and self.acknowledged and now_us >= self.sent_us + SETTLES_US):
            self.end(_P.OVERTAKEN, "another ground station has given the vehicle another target")

    def on_status(self, status: StatusReport) -> None:
        """In which mode the vehicle is."""
        if self.is_over:
            return
        if self._modes:
            if status.mode in self._modes:
                self.in_target, self.progress, self.reason = True, _P.FLOWN, ""
            elif self.in_target and status.armed:
                self.end(_P.OVERTAKEN, f"the vehicle was taken over: mode {status.mode}")
            return
        if not status.armed:
            self.end(_P.OVERTAKEN, "the vehicle was disarmed")
        elif not status.guided and not self.explains(status):
            self.end(_P.OVERTAKEN, f"the vehicle was taken over: mode {status.mode}")
        self._has_left |= status.guided

    def explains(self, status: StatusReport) -> bool:
        """Whether the vehicle is in the mode that this order has not brought it out of yet."""
        if self.is_over or self._has_left or self.progress is _P.UNSEEN:
            return False
        if isinstance(self.order, InterruptOrder):
            return status.mode in INTERRUPTIBLE_MODES and not self.acknowledged
        leaves = self._modes or (isinstance(self.order, HoldOrder) and self.order.any_mode)
        return bool(leaves) and status.mode == self.from_mode

    def on_text(self, text: TextReport, now_us: int) -> None:
        """Take a text of the autopilot, before or after its refusal; the first text after the order counts."""
        if self._text or self.progress is _P.OVERTAKEN or now_us - self.sent_us > TEXT_WITHIN_US:
            return
        self._text = text.text
        if self.progress is _P.REFUSED:
            self.reason += self._why

    @property
    def _why(self) -> str:
        return f": {self._text}" if self._text else ""

    @property
    def words_due_us(self) -> int | None:
        """Until when a refusal waits for the autopilot's words; None: it has them, or nothing is refused."""
        return self.sent_us + WORDS_US if self.progress is _P.REFUSED and not self._text else None

    def on_fix(self, fix: Fix, now_us: int) -> None:
        """Where the vehicle is and how it moves."""
        if self.is_over or self._modes or not self._shows(fix):
            return
        self._shown_us = now_us
        confirmed = self.in_target or (not self.tells_target and (self.acknowledged or not self._acknowledges))
        if confirmed:
            self.progress, self.reason = _P.FLOWN, ""

    def on_time(self, now_us: int) -> None:
        self._is_settled |= now_us >= self.sent_us + SETTLES_US
        due_us = self.deadline_us
        if due_us is None or now_us < due_us:
            return
        self.progress, since_s = _P.UNSEEN, SEEN_WITHIN_US / 1e6
        if self._modes:
            self.reason = f"not seen in the vehicle's mode within {MODE_WITHIN_US / 1e6:.0f} s"
        elif not self.acknowledged and not self.in_target and self._acknowledges:
            self.reason = NO_ANSWER
        elif self.tells_target and not self.in_target:
            self.reason = f"acknowledged, but not seen in the vehicle's target within {since_s:.0f} s"
        else:
            self.reason = f"not seen in the vehicle's motion for {since_s:.0f} s"
        if self._text:
            self.reason += f"; the autopilot says: {self._text}"

    # -- what shows it -----------------------------------------------------------------------------------------

    def is_ours(self, target: TargetReport) -> bool:
        """Whether a target is that of this order.

        A vehicle that is to stop may have a target as far ahead as it needs for that.
        """
        place = self._place()
        if place is None:
            return False
        latitude_deg, longitude_deg, altitude_m = place
        away_m = distance_m(latitude_deg, longitude_deg, target.latitude_deg, target.longitude_deg)
        start = self.start if self._stops else None
        late_m = 0.0 if start is None else stopping_distance_m(start.speed_m_s) + SAYS_S * start.speed_m_s
        reach_m = LEVEL_M + late_m
        return away_m <= reach_m and abs(altitude_m - target.altitude_m) <= self._upright_m

    @property
    def _upright_m(self) -> float:
        """Allowed height error, metres: a vehicle stopped while it climbs or sinks continues to for a second."""
        climbs = self.start is not None and isinstance(self.order, HoldOrder)
        return UPRIGHT_M + (abs(self.start.down_m_s) if climbs and self.start is not None else 0.0)

    @property
    def _modes(self) -> frozenset[str]:
        return MODES_OF.get(type(self.order), frozenset())

    @property
    def _stops(self) -> bool:
        """Whether it is an order to stop, at whatever altitude."""
        start, order = self.start, self.order
        if not isinstance(order, GoToOrder | InterruptOrder) or start is None:
            return isinstance(order, HoldOrder)
        return distance_m(start.latitude_deg, start.longitude_deg, order.latitude_deg, order.longitude_deg) <= LEVEL_M

    def _place(self) -> tuple[float, float, float] | None:
        order, start = self.order, self.start
        if isinstance(order, GoToOrder | InterruptOrder):
            return order.latitude_deg, order.longitude_deg, order.altitude_m
        return None if start is None else (start.latitude_deg, start.longitude_deg, start.altitude_m)

    def _shows(self, fix: Fix) -> bool:
        """Whether the vehicle is there, or moves there: up or down, and slower or nearer."""
        place, start = self._place(), self.start
        if place is None or start is None:
            return False
        up_m = place[2] - fix.altitude_m
        rises = abs(up_m) <= self._upright_m or -fix.down_m_s * up_m > 0.3 * abs(up_m)
        if self._stops:
            return rises and fix.speed_m_s <= max(1.0, 0.8 * start.speed_m_s)
        north_m, east_m = _metres(fix, place)
        away_m = hypot(north_m, east_m)
        # On a steep path the horizontal part is short, and flown slowly: its speed proves nothing then.
        nears = (
            away_m <= max(LEVEL_M, STEEP * abs(up_m))
            or (fix.north_m_s * north_m + fix.east_m_s * east_m) > 0.5 * away_m
        )
        return nears and (rises or away_m > SLOPE * abs(up_m))

    def end(self, progress: OrderProgress, reason: str) -> None:
        """End the order with this progress and reason."""
        self.progress, self.reason = progress, reason


def _metres(fix: Fix, place: tuple[float, float, float]) -> tuple[float, float]:
    """North and east from where the vehicle is to a place."""
    east_per_deg = _M_PER_DEG * cos(radians(fix.latitude_deg))
    return (place[0] - fix.latitude_deg) * _M_PER_DEG, (place[1] - fix.longitude_deg) * east_per_deg


def is_at(target: TargetReport, other: TargetReport) -> bool:
    """Whether two targets are one place."""
    away_m = distance_m(target.latitude_deg, target.longitude_deg, other.latitude_deg, other.longitude_deg)
    return away_m <= LEVEL_M and abs(target.altitude_m - other.altitude_m) <= UPRIGHT_M
