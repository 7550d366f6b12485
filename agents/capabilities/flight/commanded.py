"""A vehicle that is commanded: its reports tell what becomes of its orders, and the claims tell which commander has it.

The pilot part gives the orders; this module gives none. A change of mode that was not ordered counts as the pilot's hands:
the platform sends nothing from then on, AUTO included, until a user asks for it. A target that another station gives is no
hands: the route or mission waits, and giving way continues.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from dyknow.agents.capabilities.flight import arbiter
from dyknow.agents.capabilities.flight.arbiter import ENDINGS, CommandClaims, MissionClaim, in_words
from dyknow.agents.capabilities.flight.errand import TEXT_WITHIN_US, Errand, OrderProgress
from dyknow.agents.capabilities.flight.heard_vehicle import HeardVehicle, InterruptedMission
from dyknow.navigation import vehicle
from dyknow.navigation.cruise import CruiseReport
from dyknow.navigation.mission_plans import MissionPlanReport

REPLACED_US, MOST_REPLACED = 2_000_000, 8
"""How late a vehicle may report the target of an order that another one has replaced, and of how many."""
FORGETS_US = 3_500_000
"""After so long a silence home has to be reported again; the feed asks for it after 3 s."""
RETRY_US = 2_000_000
ATTEMPTS = 4
"""How often a leg of the plan is ordered that the vehicle did not answer."""
RESUMES_US = 6_000_000
"""Time after a mission was resumed within which the vehicle's mode shows it."""


@dataclass(slots=True)
class CommandedVehicle(HeardVehicle):
    """One vehicle's commands. Times are federation time.

    Attributes:
        errand: the last order or leg of the plan, with its progress.
        standing: the order that replaces the plan, until another one, or its end.
        diversion: the present manoeuvre, and whether it is flown; None when the vehicle does not give way.
        mission: the mission that commands the vehicle, or waits.
        leg: which place of the route is flown to next.
        awaited: the missions that may join, and why they wait then.
    """

    errand: Errand | None = None
    standing: vehicle.Order | None = None
    diversion: Errand | None = None
    mission: MissionClaim = field(default_factory=MissionClaim)
    _item: int | None = None
    _resumed_us: int = -RESUMES_US
    _before: vehicle.Order | None = None
    _aside: vehicle.Order | InterruptedMission | None = None
    _has_diverted: bool = False
    _suspended: bool = False
    _rests: str = ""
    _takes_off: bool = False
    leg: int = 0
    awaited: arbiter.AwaitedMissions = field(default_factory=arbiter.AwaitedMissions)
    _goal: vehicle.Order | None = None
    _attempts: int = 0
    _again_us: int | None = None
    _replaced: deque[tuple[Errand, int]] = field(default_factory=lambda: deque(maxlen=MOST_REPLACED))
    _ground_number: int = 0
    _ground_us: int = 0
    _ground_text: str = ""

    def on_report(self, report: vehicle.Report, now_us: int) -> list[vehicle.Command]:
        """Take what the vehicle says of itself."""
        self._now_us = max(self._now_us, now_us)
        commands: list[vehicle.Command] = []
        match report:
            case vehicle.StatusReport():
                self._on_status(report, now_us)
            case vehicle.HomeReport():
                problem = self.bounds.on_home(report, flying=self.status is not None and self.status.airborne is True)
                if problem is not None:
                    self.note(problem)
            case vehicle.PositionReport() | vehicle.FenceReport() | vehicle.FailsafeReport() | CruiseReport():
                self._on_bounding(report)
            case vehicle.BatteryReport():
                self.battery = report
            case MissionPlanReport():
                self.loaded = report.items
            case vehicle.MissionReport():
                commands = self._on_mission(report)
            case vehicle.TargetReport():
                self._on_target(report, now_us)
            case vehicle.TextReport():
                self._on_text(report, now_us)
            case vehicle.WinchReport():
                self._on_handled(report)
            case vehicle.CommandResult():
                self._on_handled(report)
                self._on_result(report, now_us)
        return commands

    def _on_status(self, status: vehicle.StatusReport, now_us: int) -> None:
        if self.status is not None and now_us - self.heard_us > FORGETS_US:
            self.bounds.forget()
        before, self.status, self.heard_us = self.status, status, now_us
        explained = self._explains(before, status, now_us)
        self._judge(lambda errand: errand.on_status(status))
        if not status.armed:
            self._forget()
            self._suspended, self._rests, self._takes_off = False, "", False
            return
        current = self.diversion or self.errand
        is_changed = before is not None and before.mode != status.mode
        if is_changed and (current is None or current.is_over):
            self.targets.forget()
        self._takes_off = self._takes_off and not (is_changed and status.guided)
        if not (status.guided or explained):
            self.targets.forget()
            if self._is_taken_from_us(before, status):
                self.take_over(f"the vehicle was taken over: mode {status.mode}")

    def _explains(self, before: vehicle.StatusReport | None, status: vehicle.StatusReport, now_us: int) -> bool:
        """Whether a mode that takes no positions is one that was ordered, or not yet left as ordered."""
        if status.guided:
            return True
        ordered = self.errand is not None and self.errand.explains(status)
        takes_off = self._takes_off and status.mode in vehicle.MODES_OF[vehicle.TakeOffOrder]
        return self._flies_mission(before, status, now_us) or ordered or takes_off

    def _is_taken_from_us(self, before: vehicle.StatusReport | None, status: vehicle.StatusReport) -> bool:
        """Whether that ends something of ours; a mode that is no mission's, chosen in flight, is hands in any case."""
        if isinstance(self.standing, ENDINGS):
            return bool(self.mission.name) and status.mode not in vehicle.MODES_OF[type(self.standing)]
        on_plan = self._goal is not None and self.flying == "plan"
        ours = on_plan or self._aside is not None or self.flying in {"order", "diverted", "mission"}
        was_guided = before is not None and before.guided and before.airborne is True
        left_alone = vehicle.INTERRUPTIBLE_MODES if self.missions else vehicle.MISSION_MODES
        return ours or (self.control and was_guided and status.mode not in left_alone)

    def _flies_mission(self, before: vehicle.StatusReport | None, status: vehicle.StatusReport, now_us: int) -> bool:
        """Whether the vehicle flies its mission as before, or since an errand of ours resumed it."""
        if status.mode not in vehicle.MISSION_MODES:
            return False
        resumed, self._resumed_us = now_us - self._resumed_us <= RESUMES_US, -RESUMES_US
        return resumed or before is None or before.mode in vehicle.MISSION_MODES

    def _forget(self) -> None:
        """Forget all orders of this flight."""
        self.standing = self._before = self._aside = self._goal = self._again_us = None
        self.targets.forget()
        self._attempts = 0

    def take_over(self, reason: str) -> None:
        """Send nothing until a user asks for it; a mission waits."""
        if self.diversion is not None and not self.diversion.is_over:
            self.diversion.end(OrderProgress.OVERTAKEN, reason)
        self.mission.wait(reason)
        if not self._suspended:
            self.note(f"{reason}; nothing is sent until you ask for it (dyknow delegate resume, goto or hold)")
        self._forget()
        self._suspended = True

    def _on_target(self, target: vehicle.TargetReport, now_us: int) -> None:
        """A new target that is not ours is another station's: the vehicle returns to that, and nothing of ours overwrites it."""
        current = self.diversion or self.errand
        is_current = current is not None and current.is_ours(target)
        if not is_current and any(now_us < until_us and old.is_ours(target) for old, until_us in self._replaced):
            return  # of an order of ours that was replaced before the vehicle reported its target
        was_over = current is None or current.is_over
        is_news = self.targets.on_target(target, now_us, current)
        self._judge(lambda errand: errand.on_target(target, now_us))
        if is_news and self._aside is not None and self.diversion is not None:
            self._aside = self.others_target()
        is_over = current is None or current.is_over
        if self.diversion is not None or not is_over or (was_over and not is_news):
            return
        missions, self.standing = bool(self.mission.name and self.standing is not None), None
        if missions or (self.plan is not None and not self.mission.name):
            self.rest("another ground station has sent the vehicle elsewhere")

    def rest(self, reason: str) -> None:
        """Fly neither a mission nor the route until a user asks for it; giving way continues."""
        self.mission.wait(reason)
        if not self._rests:
            self.note(f"{reason}; the route or mission waits until you ask for it (dyknow delegate resume)")
        self.standing = self._goal = self._again_us = None
        self._rests = reason

    def _on_result(self, result: vehicle.CommandResult, now_us: int) -> None:
        if result.number == self._ground_number and not result.accepted:
            self.mission.refusal = f"autopilot: {result.reason}{self._ground_text}"
        errand, is_leg = self.errand, self._goal is not None and self.standing is None
        self._judge(lambda each: each.on_result(result))
        if result.accepted or errand is None or result.number != errand.command.number:
            return
        if errand.order == self.standing:
            self.standing = None
        elif is_leg and result.reason == vehicle.NO_ANSWER and self._attempts < ATTEMPTS:
            self._again_us = now_us + RETRY_US
        elif is_leg and errand.progress is OrderProgress.REFUSED:
            self.rest(f"the plan is not flown: {errand.reason}")

    def _on_text(self, text: vehicle.TextReport, now_us: int) -> None:
        """Give the autopilot's words as the reason of a refusal."""
        for errand in (self.errand, self.diversion):
            if errand is not None:
                errand.on_text(text, now_us)
        if self._ground_number and not self._ground_text and now_us - self._ground_us <= TEXT_WITHIN_US:
            self._ground_text = f": {text.text}"
            if self.mission.refusal:
                self.mission.refusal += self._ground_text

    def _on_mission(self, report: vehicle.MissionReport) -> list[vehicle.Command]:
        """A mission that was resumed elsewhere than where it was interrupted is sent to its item, once."""
        errand, wanted = self.errand, self._item
        if errand is None or not isinstance(errand.order, vehicle.ResumeMissionOrder) or not errand.is_taken:
            self._item = report.item
            return []
        self.errand, self._item = None, report.item
        order = vehicle.MissionItemOrder(wanted or 0)
        return [] if wanted in {None, report.item} or self.refusal(order) is not None else [self.numbered(order)]

    def _judge(self, look: Callable[[Errand], None]) -> None:
        """Let the orders under way judge a report, and note each progress that has a reason."""
        for errand in (self.errand, self.diversion):
            if errand is None or errand.is_over:
                continue
            before = errand.progress
            look(errand)
            if errand.progress is not before and errand.reason:
                self.note(f"{in_words(errand.order)}: {errand.progress.value}: {errand.reason}")

    # -- the rules ---------------------------------------------------------------------------------------------

    @property
    def avoidance_off(self) -> str | None:
        """Why the vehicle would not give way now, though the platform may command it: its mode, or its pilot."""
        status = self.status
        if not self.control or status is None or not (status.armed and status.airborne):
            return None
        if not (status.guided or self.may_interrupt):
            return f"mode {status.mode}"
        return "its pilot took over" if self._is_taken_over else None

    @property
    def _is_taken_over(self) -> bool:
        """Whether nothing is sent until a user asks for it."""
        return self._suspended and self.standing is None

    @property
    def kept_aside(self) -> vehicle.Order | InterruptedMission | None:
        """The activity that the vehicle interrupted to give way, and will resume; None: its plan, or unknown."""
        return self._aside

    @property
    def item(self) -> int | None:
        """The item of its mission that the vehicle flies, or is to fly when its mission is resumed; None: not reported."""
        return self._item

    @property
    def claims(self) -> CommandClaims:
        """The commanders that would have the vehicle now."""
        return CommandClaims(
            "route" if self._has_route else "",
            "" if self.standing is None else in_words(self.standing),
            "" if self.mission.waits else self.mission.name,
            "" if self.diversion is None else "the vehicle is giving way to another",
            (self.mission.waits or "its pilot took over") if self._is_taken_over else "",
        )

    @property
    def keeps_plan(self) -> bool:
        """Whether the vehicle is where its plan has it, also when that is over."""
        return self.plan is not None and not self._rests

    @property
    def _has_route(self) -> bool:
        flies = self.plan is not None and self.leg < len(self.plan.waypoints)
        return flies and not self._suspended and not self._rests and not self.mission.name

    @property
    def flying(self) -> str:
        """The vehicle's activity for this platform: a word of `arbiter.WORDS`, `watching` (no control) or `holding`."""
        return arbiter.WORDS.get(self.claims.commander, "holding") if self.control else "watching"
