"""The pilot: flies the platform's plan and carries out orders, within the rules for commanding aircraft.

A platform commands its vehicle only when it was given control, and only while the vehicle is armed, airborne, in a
guided mode and heard (`dyknow.agents.capabilities.flight.arbiter`); within floor, ceiling and range, and inside the autopilot's own fence. In
AUTO it only leaves the mission to give way, if it may, and continues it. Every refusal names the rule that made it. The
activity interrupted by giving way is commanded once and then forgotten; after a takeover, AUTO included, nothing is
sent until a user asks for it. The life of an order is in `dyknow.agents.capabilities.flight.errand`.
"""

from dataclasses import dataclass
from typing import Final

from dyknow import Sample, earlier
from dyknow.agents.capabilities.flight.arbiter import (
    ANY_MODE,
    ENDINGS,
    HEARD_WITHIN_US,
    CommandClaims,
    Commander,
    MissionClaim,
    in_words,
)
from dyknow.agents.capabilities.flight.commanded import REPLACED_US, CommandedVehicle
from dyknow.agents.capabilities.flight.errand import Errand, OrderProgress
from dyknow.agents.capabilities.flight.heard_vehicle import FORBIDDEN, InterruptedMission
from dyknow.agents.places import Fix
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.model.errors import Refused
from dyknow.navigation import vehicle
from dyknow.navigation.geodesy import LocalFrame, distance_m

_SAME_PLACE_M: Final = 5.0


@dataclass(slots=True)
class Pilot(CommandedVehicle):
    """One vehicle's commands. Times are federation time."""

    @classmethod
    def of(cls, ports: Ports, _parts: PartRegistry) -> "Pilot":
        """Build it from the ports and parts of a platform."""
        config = ports.config

        def clock() -> int:
            return ports.clock.federation_us(ports.now_us())

        pilot = cls(config.control, config.plan, config.limits, config.missions, clock, ports.note)
        ports.origins.append(pilot.origin)
        return pilot

    def origin(self) -> LocalFrame | None:
        """The home of the vehicle, once it is known, as the origin of places on the ground."""
        home = self.bounds.home
        return None if home is None else LocalFrame(home.latitude_deg, home.longitude_deg, home.altitude_m)

    def on_estimate(self, sample: Sample) -> list[vehicle.Command]:
        """Take a fused estimate (see `PositionFilter`) and fly on."""
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
        if self._goal is None and self.errand is None and self.targets.is_sent_away(self.fix):
            self.rest("another ground station has sent the vehicle elsewhere")
            return []
        self.leg, wanted = self.plan.next_leg(self.leg, self.fix)
        if wanted is None or wanted == self._goal or self.refusal(wanted) is not None:
            return []
        same = self.errand is not None and self.errand.order == wanted
        self._goal, self._attempts = wanted, self._attempts + 1 if same else 1
        return [self._begin(wanted)]

    def _begin(self, order: vehicle.Order) -> vehicle.Command:
        self.errand = self._errand(order)
        if isinstance(order, vehicle.ResumeMissionOrder):
            self._resumed_us = self.now_us
        return self.errand.command

    def _errand(self, order: vehicle.Order) -> Errand:
        if (replaced := self.diversion or self.errand) is not None:
            self._replaced.append((replaced, self.now_us + REPLACED_US))
        tells, mode = self.targets.tells(self.now_us), "" if self.status is None else self.status.mode
        before = self.targets.reported if tells else None
        return Errand(self.numbered(order), self.now_us, self.fix, tells, before, mode)

    # -- orders ------------------------------------------------------------------------------------------------

    def order(self, order: vehicle.Order, by: Commander = Commander.ORDER) -> list[vehicle.Command]:
        """Carry out an order: it replaces the route until `proceed`; raises Refused: the rule, or the commander."""
        self.check(order)
        self._claims_against(order, by).check(by)
        return self._replace(order)

    def command(self, order: vehicle.Order) -> list[vehicle.Command]:
        """Carry out a user's own order: a mission that has the vehicle waits until `proceed`; raises Refused, as `order`."""
        if isinstance(order, vehicle.HoldOrder) and self.status is not None and not self.status.guided:
            order = vehicle.HoldOrder(any_mode=True)
        self.check(order, in_person=True)
        self._claims_against(order, Commander.ORDER)._replace(mission="").check(Commander.ORDER)
        self.mission.wait(reason := f"a user ordered {in_words(order)}")
        self.awaited.wait(reason)
        return self._replace(order)

    def _replace(self, order: vehicle.Order) -> list[vehicle.Command]:
        if self.standing is None:
            self._before = self.others_target()
        elif isinstance(self.standing, vehicle.GoToOrder) and not isinstance(order, vehicle.GoToOrder):
            self._before = self.standing
        self.diversion = self._aside = None
        self.standing = order
        return [self._begin(order)]

    def _claims_against(self, order: vehicle.Order, by: Commander) -> CommandClaims:
        """A commander from which a user takes the vehicle by asking in person has no claim."""
        claims = self.claims._replace(hands="")
        if by is not Commander.ORDER:
            return claims._replace(hands=self.mission.waits or self.claims.hands)
        return claims._replace(avoidance="") if isinstance(order, ANY_MODE) else claims

    def begin_mission(self, name: str) -> None:
        """Have a mission command the vehicle from now on; raises Refused: without control, or in its pilot's hands."""
        status = self.status
        is_armed = status is not None and status.armed
        armed = vehicle.HoldOrder() if status is not None and status.airborne else vehicle.TakeOffOrder(0.0)
        self.check(armed if is_armed else vehicle.SetGuided())
        self.claims.check(Commander.MISSION)
        if self.mission.name and self.mission.name != name:
            raise Refused(f"mission {self.mission.name} has the vehicle: end it with dyknow mission abort", "mission")
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
        self._takes_off = isinstance(order, vehicle.TakeOffOrder)
        self._ground_number, self._ground_us, self._ground_text = command.number, self.now_us, ""
        self.mission.refusal = ""
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
            self.errand, self._rests = None, ""
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
        self.standing, self._before, self._suspended, self._rests = None, None, False, ""
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
            raise Refused(f"the plan begins in {(self.plan.start_us - now_us) / 1e6:.1f} s: ask then", "plan-not-begun")
        if fix is None or now_us - fix.valid_us > HEARD_WITHIN_US:
            raise Refused("the vehicle's position is not known", FORBIDDEN)
        leg, wanted = self.plan.next_leg(self.leg, fix)
        if wanted is None:
            raise Refused("the plan is over: order a place (dyknow delegate goto)", "plan-over")
        return leg, wanted

    @property
    def stated_m_s(self) -> float | None:
        """The speed with which the vehicle is sent on after giving way; None: none is stated then."""
        if self.may_interrupt or not self.control:
            return None
        if isinstance(self.standing, vehicle.GoToOrder):
            return self.standing.speed_m_s
        has_route = self.plan is not None and self.standing is None and self._has_route
        return self.plan.speed_m_s if has_route and self.plan is not None else None

    def divert(
        self, altitude_m: float | None, place: tuple[float, float] | None = None, speed_m_s: float | None = None
    ) -> list[vehicle.Command]:
        """Avoid another vehicle: stop at `altitude_m` above mean sea level, at `place` (WGS-84 degrees); None: where it is.

        `speed_m_s`: how fast; None: as fast as it flies by itself.
        """
        order = self.stop(altitude_m, place)
        before = None if self.diversion is None else self.diversion.order
        if speed_m_s is None and isinstance(before, vehicle.GoToOrder) and before.speed_m_s is not None:
            speed_m_s = self.stated_m_s  # autopilots keep a speed until they are given another one
        if isinstance(order, vehicle.GoToOrder):
            order = order._replace(speed_m_s=speed_m_s)
        self.check(order)
        self.claims.check(Commander.AVOIDANCE)
        if self.diversion is None and self._aside is None:
            self._aside = self._doing()
        if self.errand is not None and not self.errand.is_over:
            self.errand.end(OrderProgress.OVERTAKEN, "the vehicle gives way to another")
        self._has_diverted = self._aside_is_left(self.diversion)
        self.diversion = self._errand(order)
        return [self.diversion.command]

    def _aside_is_left(self, before: Errand | None) -> bool:
        """Whether an earlier manoeuvre of this encounter was flown, so that the vehicle is no longer where it was."""
        return before is not None and (
            self._has_diverted or before.progress not in {OrderProgress.REFUSED, OrderProgress.SENT}
        )

    def _doing(self) -> vehicle.Order | InterruptedMission | None:
        """The order or mission that the vehicle flies, to return to it; None: the plan, which needs no memory."""
        target, age_us = self.others_target(), self.targets.age_us(self.now_us)
        if target is not None and age_us > HEARD_WITHIN_US and not self.keeps_plan:
            self.note(f"its target was heard {age_us / 1e6:.0f} s ago, and is taken to be the same still")
        if self.may_interrupt and self.status is not None:
            if self.status.mode in vehicle.MISSION_MODES:
                return InterruptedMission(self._item, target)
            returns = self.status.mode in vehicle.MODES_OF[vehicle.ReturnHomeOrder]
            return vehicle.ReturnHomeOrder() if returns else vehicle.LandOrder()
        errand = self.errand
        taken = errand is not None and errand.order == self.standing and not errand.is_over
        return self.standing if taken else None if self.keeps_plan else target

    def resume(self) -> list[vehicle.Command]:
        """Resume the activity interrupted by the diversion: it is commanded once, and forgotten."""
        diversion, self.diversion, self._goal = self.diversion, None, None
        aside, self._aside = self._aside, None
        if diversion is not None and diversion.progress is OrderProgress.OVERTAKEN:
            aside = None
        if self._is_taken_over:
            return []
        if self.plan is not None and self.keeps_plan and self.standing is None and not isinstance(aside, ENDINGS):
            if diversion is not None:
                self.leg = min(self.leg, len(self.plan.waypoints) - 1)  # a vehicle that had arrived returns there
            return [] if self.fix is None else self._fly(self.fix.valid_us)
        if diversion is None or diversion.progress is OrderProgress.REFUSED:
            if diversion is not None and self._has_diverted:
                self.note("it stands where it made room: its autopilot has refused to fly the rest of that")
            return []
        if aside is None and not self._flies_elsewhere(diversion):
            self.note("it is not known where the vehicle was going: it holds")
        self._note_new_mission(aside)
        wanted = self._back_to(aside)
        return [] if wanted is None or self.refusal(wanted) is not None else [self._begin(wanted)]

    def _note_new_mission(self, aside: vehicle.Order | InterruptedMission | None) -> None:
        """A mission that was begun in the second before the vehicle made room is not known: heartbeats come once a second."""
        items = [each for each in self.loaded if each.item == self._item] if self.missions else []
        if not isinstance(aside, vehicle.GoToOrder) or aside == self.standing or not items:
            return
        latitude_deg, longitude_deg = items[0].latitude_deg, items[0].longitude_deg
        if latitude_deg is None or longitude_deg is None:
            return
        if distance_m(latitude_deg, longitude_deg, aside.latitude_deg, aside.longitude_deg) < _SAME_PLACE_M:
            self.note(
                f"it flies to the place of item {items[0].item} of its mission, and stands there: if the mission was begun "
                "right before it made room, begin it again"
            )

    def _flies_elsewhere(self, diversion: Errand) -> bool:
        """Whether another station has sent it away from its diversion: then it needs no way back."""
        return diversion.progress is OrderProgress.OVERTAKEN

    def _back_to(self, aside: vehicle.Order | InterruptedMission | None) -> vehicle.Order | None:
        """The order with which the vehicle resumes what it did before."""
        if isinstance(aside, InterruptedMission):
            self._item = aside.item
            return vehicle.ResumeMissionOrder()
        return aside
