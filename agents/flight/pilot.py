"""The pilot: flies the platform's plan and carries out orders, within the rules for commanding aircraft.

A platform commands its vehicle only when it was given control, and only while the vehicle is armed, airborne, in a
guided mode and heard (`agents.flight.arbiter`); within floor, ceiling and range, and inside the autopilot's own fence. In
AUTO it only leaves the mission to give way, if it may, and continues it. Every refusal names the rule that made it. What
the vehicle was doing before it gave way is commanded once and then forgotten; after a takeover, AUTO included, nothing is
sent until a user asks for it. What becomes of an order is in `agents.flight.errand`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from agents.flight import arbiter
from agents.flight.arbiter import ENDINGS, HEARD_WITHIN_US, CommandClaims, Commander, MissionClaim, in_words
from agents.flight.errand import Errand, OrderProgress
from agents.flight.heard_vehicle import FORBIDDEN, HeardVehicle, InterruptedMission
from agents.flight.places import Fix, between
from dyknow import Sample, earlier
from dyknow.model.errors import Refused
from navigation import vehicle

FORGETS_US = 3_500_000
"""After so long a silence home has to be reported again; the feed asks for it after 3 s."""
RETRY_US = 2_000_000
ATTEMPTS = 4
"""How often a leg of the plan is ordered that the vehicle did not answer."""
RESUMES_US = 6_000_000
"""So long after a mission was resumed the vehicle's mode may show it."""


@dataclass(slots=True)
class Pilot(HeardVehicle):
    """One vehicle's commands. Times are federation time.

    Attributes:
        errand: the last order or leg of the plan, and what has become of it.
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
    _moved: bool = False
    _suspended: bool = False
    _raised_to_m: float | None = None
    _lowered_to_m: float | None = None
    leg: int = 0
    awaited: arbiter.AwaitedMissions = field(default_factory=arbiter.AwaitedMissions)
    _goal: vehicle.Order | None = None
    _attempts: int = 0
    _again_us: int | None = None
    _ground_number: int = 0

    # -- what the vehicle says ---------------------------------------------------------------------------------

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
            case vehicle.PositionReport(altitude_m=float() as altitude_m, height_m=float() as height_m):
                self.bounds.on_height(altitude_m, height_m)
            case vehicle.FenceReport():
                self.bounds.fence = report
            case vehicle.MissionReport():
                commands = self._on_mission(report)
            case vehicle.TargetReport():
                self._on_target(report, now_us)
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
        self._judge(lambda errand: errand.on_status(status))
        if not status.armed:
            self._forget()
            self._suspended = False
        elif not status.guided and not self._flies_mission(before, status, now_us):
            self.target = None
            on_plan = self._goal is not None and self.flying == "plan"
            ours = on_plan or self._aside is not None or self.flying in {"order", "diverted", "mission"}
            is_ending = isinstance(self.standing, ENDINGS) and not (
                self.mission.name and status.mode not in vehicle.MODES_OF[type(self.standing)]
            )
            if ours and not is_ending:
                reason = f"the vehicle was taken over: mode {status.mode}"
                self.take_over(reason)

    def _flies_mission(self, before: vehicle.StatusReport | None, status: vehicle.StatusReport, now_us: int) -> bool:
        """Whether the vehicle flies its mission as before, or since an errand of ours resumed it."""
        if status.mode not in vehicle.MISSION_MODES:
            return False
        resumed, self._resumed_us = now_us - self._resumed_us <= RESUMES_US, -RESUMES_US
        return resumed or before is None or before.mode in vehicle.MISSION_MODES

    def _forget(self) -> None:
        """Nothing of this flight is left to be done."""
        self.standing = self._before = self._aside = self._goal = self._again_us = self.target = None
        self._raised_to_m = self._lowered_to_m = None
        self._moved, self._attempts = False, 0

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
        """A target that is not ours is another station's: it replaces what was remembered."""
        self.target_us = now_us
        current = self.diversion or self.errand
        self._judge(lambda errand: errand.on_target(target, now_us))
        if current is not None and (current.is_ours(target) or not current.is_over):
            return
        self.target = target
        if self._aside is not None and self.diversion is not None:
            self._aside, self._moved = None, False
        if current is not None and current is self.errand and current.progress is OrderProgress.OVERTAKEN:
            is_missions, self.standing = bool(self.mission.name and self.standing is not None), None
            if self._goal is not None or is_missions:
                self.take_over("another ground station has sent the vehicle elsewhere")
                self.target = target

    def _on_result(self, result: vehicle.CommandResult, now_us: int) -> None:
        if result.number == self._ground_number and not result.accepted:
            self.mission.refusal = f"autopilot: {result.reason}"
        errand, is_leg = self.errand, self._goal is not None and self.standing is None
        self._judge(lambda each: each.on_result(result))
        if result.accepted or errand is None or result.number != errand.command.number:
            return
        if errand.order == self.standing:
            self.standing = None
        elif is_leg and result.reason == vehicle.NO_ANSWER and self._attempts < ATTEMPTS:
            self._again_us = now_us + RETRY_US
        elif is_leg and errand.progress is OrderProgress.REFUSED:
            self.take_over(f"the plan is not flown: {errand.reason}")

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
        """Let orders under way look at what has come, and tell what has become of them."""
        for errand in (self.errand, self.diversion):
            if errand is None or errand.is_over:
                continue
            before = errand.progress
            look(errand)
            if errand.progress is not before and errand.reason:
                self.note(f"{in_words(errand.order)}: {errand.progress.value}: {errand.reason}")

    def on_estimate(self, sample: Sample) -> list[vehicle.Command]:
        """Take a fused estimate (see `navigation.PositionFilter`) and fly on."""
        fix = self.fix = Fix(sample.valid_us, *sample.value[:6])
        self._now_us = max(self._now_us, sample.valid_us)
        self._judge(lambda errand: errand.on_fix(fix, self.now_us))
        return self._fly(sample.valid_us)

    def on_time(self, now_us: int) -> None:
        self._now_us = max(self._now_us, now_us)
        self._judge(lambda errand: errand.on_time(now_us))

    @property
    def deadline_us(self) -> int | None:
        """When time alone changes something."""
        due_us = None if self.errand is None else self.errand.deadline_us
        return due_us if self.diversion is None else earlier(due_us, self.diversion.deadline_us)

    # -- the plan ----------------------------------------------------------------------------------------------

    def _fly(self, now_us: int) -> list[vehicle.Command]:
        if self._again_us is not None and now_us >= self._again_us:
            self._goal, self._again_us = None, None
        if self.plan is None or self.fix is None or now_us < self.plan.start_us:
            return []
        if self.claims.commander is not Commander.ROUTE:
            return []
        self.leg, wanted = self.plan.next_leg(self.leg, self.fix, self.clamped)
        if wanted is None or wanted == self._goal or self.refusal(wanted) is not None:
            return []
        same = self.errand is not None and self.errand.order == wanted
        self._goal, self._attempts = wanted, self._attempts + 1 if same else 1
        return [self._begin(wanted)]

    def clamped(self, order: vehicle.GoToOrder) -> vehicle.GoToOrder:
        """The order, above (or below) the other vehicle while a bound is given."""
        return between(order, self._raised_to_m, self._lowered_to_m)

    def _begin(self, order: vehicle.Order) -> vehicle.Command:
        self.errand = self._errand(order)
        if isinstance(order, vehicle.ResumeMissionOrder):
            self._resumed_us = self.now_us
        return self.errand.command

    def _errand(self, order: vehicle.Order) -> Errand:
        tells = self.now_us - self.target_us <= HEARD_WITHIN_US
        return Errand(self.numbered(order), self.now_us, self.fix, tells)

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

    # -- orders ------------------------------------------------------------------------------------------------

    def order(self, order: vehicle.Order, by: Commander = Commander.ORDER) -> list[vehicle.Command]:
        """Carry out an order: it replaces the route until `proceed`; raises Refused: the rule, or the commander."""
        self.check(order)
        self._claims_against(order, by).check(by)
        return self._replace(order)

    def command(self, order: vehicle.Order) -> list[vehicle.Command]:
        """Carry out a user's own order: a mission that has the vehicle waits until `proceed`; raises Refused, as `order`."""
        self.check(order)
        self._claims_against(order, Commander.ORDER)._replace(mission="").check(Commander.ORDER)
        self.mission.wait(reason := f"a user ordered {in_words(order)}")
        self.awaited.wait(reason)
        return self._replace(order)

    def _replace(self, order: vehicle.Order) -> list[vehicle.Command]:
        if self.standing is None:
            self._before = self.others_target()
        self.diversion = self._aside = None
        self.standing = order
        return [self._begin(order)]

    def _claims_against(self, order: vehicle.Order, by: Commander) -> CommandClaims:
        """A commander from which a user takes the vehicle by asking in person has no claim."""
        claims = self.claims._replace(hands="")
        if by is not Commander.ORDER:
            return claims._replace(hands=self.mission.waits or self.claims.hands)
        return claims._replace(avoidance="") if isinstance(order, ENDINGS) else claims

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
    def _has_route(self) -> bool:
        flies = self.plan is not None and self.leg < len(self.plan.waypoints)
        return flies and not self._suspended and not self.mission.name

    def begin_mission(self, name: str) -> None:
        """Have a mission command the vehicle from now on; raises Refused: without control, or in its pilot's hands."""
        status = self.status
        is_armed = status is not None and status.armed
        armed = vehicle.HoldOrder() if status is not None and status.airborne else vehicle.TakeOffOrder(0.0)
        self.check(armed if is_armed else vehicle.SetGuided())
        self.claims.check(Commander.MISSION)
        if self.mission.name and self.mission.name != name:
            raise Refused(f"mission {self.mission.name} has the vehicle", "mission")
        self.mission = self.awaited.joins(name)

    def end_mission(self, *, is_over: bool = True) -> None:
        """The mission gives the vehicle back; the last order stands."""
        self.awaited.leaves(self.mission, is_over=is_over)
        self.mission = MissionClaim()

    def prepare(self, order: vehicle.Order) -> list[vehicle.Command]:
        """Have the vehicle take off for the mission, or get ready for it; raises Refused, as `order`."""
        self.check(order)
        self._claims_against(order, Commander.MISSION).check(Commander.MISSION)
        command, self.errand, self.standing = self.numbered(order), None, None
        self._ground_number, self.mission.refusal = command.number, ""
        return [command]

    def proceed(self) -> list[vehicle.Command]:
        """End what was ordered: a mission that waits continues; else fly the plan on, or once to where the vehicle was sent.

        Raises:
            Refused: as any order is, or the vehicle is giving way, or there is nothing to fly; nothing has changed then.
        """
        if self.mission.waits:
            before = self.mission, self._suspended, self.standing
            self.mission, self._suspended, self.standing = MissionClaim(), False, None
            try:
                self.begin_mission(before[0].name)
            except Refused:
                self.mission, self._suspended, self.standing = before
                raise
            self.errand = None
            self.awaited.resume()
            return []
        self.check(vehicle.HoldOrder())
        if self.diversion is not None:
            raise Refused("the vehicle is giving way to another; it flies on by itself", "giving-way")
        if self.plan is None and self._before is None and self.awaited.resume():
            self.standing, self._suspended = None, False
            return []
        leg, wanted = self._interrupted()
        self.check(wanted)
        self.standing, self._before, self._suspended = None, None, False
        self.awaited.resume()
        if self.plan is not None:
            self.leg, self._goal, self._attempts, self._again_us = leg, wanted, 1, None
        return [self._begin(wanted)]

    def _interrupted(self) -> tuple[int, vehicle.Order]:
        """The leg of the plan, and its order; or the order that sends the vehicle where it was sent before."""
        if self.plan is None:
            if self._before is None:
                raise Refused("nothing was interrupted that could be resumed", "nothing-to-resume")
            return self.leg, self._before
        now_us, fix = self.now_us, self.fix
        if now_us < self.plan.start_us:
            raise Refused(f"the plan begins in {(self.plan.start_us - now_us) / 1e6:.1f} s", "plan-not-begun")
        if fix is None or now_us - fix.valid_us > HEARD_WITHIN_US:
            raise Refused("the vehicle's position is not known", FORBIDDEN)
        leg, wanted = self.plan.next_leg(self.leg, fix, self.clamped)
        if wanted is None:
            raise Refused("the plan is over", "plan-over")
        return leg, wanted

    def divert(self, altitude_m: float | None, place: tuple[float, float] | None = None) -> list[vehicle.Command]:
        """Avoid another vehicle: stop at `altitude_m` above mean sea level, at `place` (WGS-84 degrees); None: where it is."""
        order = self.stop(altitude_m, place)
        self.check(order)
        self.claims.check(Commander.AVOIDANCE)
        if self.diversion is None and self._aside is None:
            self._aside, self._moved = self._doing(), False
        if self.errand is not None and not self.errand.is_over:
            self.errand.end(OrderProgress.OVERTAKEN, "the vehicle gives way to another")
        self.diversion = self._errand(order)
        return [self.diversion.command]

    def _doing(self) -> vehicle.Order | InterruptedMission | None:
        """What the vehicle does, to return to it; the plan needs no memory."""
        target = self.others_target()
        if self.may_interrupt:
            return InterruptedMission(self._item, target)
        errand = self.errand
        taken = errand is not None and errand.order == self.standing and not errand.is_over
        return self.standing if taken else target if self.plan is None else None

    def resume(self, raised_to_m: float | None = None, lowered_to_m: float | None = None) -> list[vehicle.Command]:
        """Fly on as before the diversion, not below the one or above the other while they are given.

        What the vehicle was doing is commanded once, and forgotten when neither bound is given.
        """
        diversion, self.diversion, self._goal = self.diversion, None, None
        bounded = self._raised_to_m is not None or self._lowered_to_m is not None
        self._raised_to_m, self._lowered_to_m = raised_to_m, lowered_to_m
        self._moved |= diversion is not None and diversion.progress is not OrderProgress.REFUSED
        if diversion is not None and diversion.progress is OrderProgress.OVERTAKEN:
            self._aside = None
        aside, moved = self._aside, self._moved
        if raised_to_m is None and lowered_to_m is None:
            self._aside, self._moved = None, False
        if self._is_taken_over:
            return []
        if self.plan is not None and self.standing is None:
            if diversion is not None or bounded:
                self.leg = min(self.leg, len(self.plan.waypoints) - 1)  # who had arrived returns to where it was
            return [] if self.fix is None else self._fly(self.fix.valid_us)
        wanted = self._back_to(aside) if moved else None
        return [] if wanted is None or self.refusal(wanted) is not None else [self._begin(wanted)]

    def _back_to(self, aside: vehicle.Order | InterruptedMission | None) -> vehicle.Order | None:
        """What to order so that the vehicle does again what it did; the lower of two flies a mission with no target on."""
        if isinstance(aside, InterruptedMission):
            if self._raised_to_m is None and (self._lowered_to_m is None or aside.towards is None):
                self._item, self._aside, self._moved = aside.item, None, False
                return vehicle.ResumeMissionOrder()
            aside = aside.towards
        return self.clamped(aside) if isinstance(aside, vehicle.GoToOrder) else aside

    @property
    def flying(self) -> str:
        """What the vehicle is doing for us, in a word: `watching`, `diverted`, `mission`, `order`, `plan` or `holding`."""
        return arbiter.WORDS.get(self.claims.commander, "holding") if self.control else "watching"
