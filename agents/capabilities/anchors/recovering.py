"""Wanted objects that are to be looked at again while it is open which they are (`want ... recover=yes`), on the platform's own vehicle.

The vehicle flies as in a mission of the platform itself: its pilot's hands and giving way go first, floor, ceiling,
fence and range hold, and a vehicle that a mission has is not taken from it. Halts, plans, looks and conclusions are
reported to the requester, logged, and the state of the task; questions are as those of a mission. Node clock.
"""

from collections.abc import Callable, Iterator
from typing import Final

from dyknow import NO_VALUE, Label, Policy, Sample
from dyknow.agents.capabilities.anchors.borrowed import BorrowedVehicle
from dyknow.agents.capabilities.anchors.described import described
from dyknow.agents.capabilities.anchors.looking_again import LIMITS, LookingAgain
from dyknow.agents.capabilities.anchors.viewpoints import Viewpoint
from dyknow.agents.capabilities.attention.camera_attention import CameraAttention
from dyknow.agents.capabilities.attention.following import Following
from dyknow.agents.capabilities.attention.wanting import WantedTask, Wanting
from dyknow.agents.capabilities.cameras.cameras import VIEW
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.capabilities.missions.command_run import VehicleCommand
from dyknow.agents.capabilities.missions.leading import MissionLeading
from dyknow.agents.capabilities.missions.performing import Performing
from dyknow.agents.effects import SearchOver, Tell
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.specification.object_queries import LONGEST_REASON, ObjectQueries
from dyknow.anchoring.links.objects import LinkEvent
from dyknow.federation.messages.contents import MissionEntry, MissionQuestion, ObjectEvent, Progress
from dyknow.kpl.linking.streams import LinkStream
from dyknow.kpl.running.ports import Undo
from dyknow.model.errors import Refused
from dyknow.navigation.vehicle import GoToOrder
from dyknow.planning.contingent.sensing_problems import SensingProblem
from dyknow.planning.contingent.sent_problems import plan_of, problem_record

PERIOD_US: Final = 200_000
STALE_US: Final = 1_000_000
OVERLAP: Final = 0.9
"""Of the width of a view, the distance of two places of a search."""
USUAL_VIEW_M: Final = 30.0
RELEASED_US: Final = 3_000_000
"""Within this time after a symbol was taken from an object its recovery begins, or does not."""


class _Recovery:
    """The ports of one wanted object. See `RecoveryPorts`."""

    def __init__(self, part: "RecoveringAnchors", wanted: WantedTask) -> None:
        self._part, self._wanted = part, wanted
        self._undo: Undo | None = None
        self._only: str | None = None

        def on_performed(number: int, failure: str, at_us: int) -> None:
            self.looking.on_moved(number, failure, part.federation_us(at_us), at_us)

        self._vehicle = BorrowedVehicle(
            part.performing, part.leading, part.following, f"anchor-{wanted.want.symbol}", part.unit, on_performed
        )
        self._attends = False
        self._released_us: int | None = None
        content = wanted.content
        self.looking = LookingAgain(
            content.symbol,
            str(wanted.want.stream),
            described(wanted.want.description, content.symbol),
            self,
            part.federation_us(wanted.task.since_us),
            is_cautious=content.recover == "cautious",
            within_m=content.within_m,
            standoff_m=content.standoff_m,
        )
        self._declare("")
        self._held = part.instance.network.connect(wanted.want.stream, Policy(), lambda _sample: None)

    @property
    def symbol(self) -> str:
        return self._wanted.want.symbol

    @property
    def stream(self) -> Label:
        return self._wanted.want.stream

    @property
    def conversation(self) -> str:
        return self._wanted.task.conversation

    def step(self, now_us: int) -> None:
        """Take the present percepts, and do the due steps."""
        part, process = self._part, self._part.process(self._wanted)
        if process is None:
            return
        if self._undo is None:
            try:
                self._declare(self._only or "")
            except Refused:
                return
        self.looking.step(process.linkage, part.federation_us(now_us), now_us)
        self._let_follow(now_us)
        self._wanted.task.state = self.looking.state[:200]

    def _let_follow(self, now_us: int) -> None:
        """The object under the symbol is followed again once it is decided, or nothing is done to decide it."""
        if self._released_us is None or self.looking.recovery is not None:
            return
        if self.looking.anchored or self._part.federation_us(now_us) >= self._released_us + RELEASED_US:
            self._released_us = None
            self._part.following.go_on("", now_us)

    def on_event(self, event: LinkEvent, now_us: int) -> None:
        """Take an event of the object that has the symbol."""
        federation_us = self._part.federation_us(now_us)
        if event.kind == "lost":
            self.looking.on_lost(federation_us)
        elif event.kind == "reacquire":
            self.looking.on_reacquired(federation_us)

    def end(self, now_us: int) -> None:
        """End the recovery: the object is no longer wanted."""
        self.looking.end(now_us)
        if self._undo is not None:
            self._undo()
        self._held.cancel()

    def _declare(self, only: str) -> None:
        wanted = self._wanted
        self._undo = self._part.instance.parts.want(wanted.want, wanted.on_event, only)

    # -- ports -------------------------------------------------------------------------------------------------

    def anchor(self, symbol: str | None, now_us: int) -> str:
        """Give an object the symbol, or take it from that which has it; why that failed."""
        if symbol is None and self._part.following.symbol == self.symbol:
            self._released_us = self._part.federation_us(now_us)
            self._part.following.pause(f"it is open which object {self.symbol} is", now_us)
        undo, self._undo, self._only = self._undo, None, symbol
        if undo is not None:
            undo()
        try:
            self._declare(symbol or "")
        except Refused as refused:
            return "" if symbol is None else refused.reason
        return ""

    def fly(self, number: int, place: Viewpoint, why: str, now_us: int) -> str:
        """Fly there, at the height it has; why that cannot be."""
        part = self._part
        height_m = part.height_m
        if height_m is None or not part.performing.is_airborne():
            return "the vehicle does not fly" if height_m is not None else "its height is not known"
        refused = self._vehicle.take(f"anchor {self.symbol} is recovered", now_us)
        if refused:
            return refused
        latitude_deg, longitude_deg, _ = part.frame.from_ned(place.y_m, place.x_m, 0.0)
        commands = (VehicleCommand("goto", (latitude_deg, longitude_deg, height_m)),)
        self._vehicle.fly(number, why, commands, now_us)
        return ""

    def stare(self, place: Viewpoint, symbol: str) -> None:
        """Turn the camera there."""
        if not self._attends:
            self._attends = True
            self._part.attention.begin(self.conversation)
        self._part.attention.stare(self.conversation, place.x_m, place.y_m, symbol)

    def leave(self, now_us: int) -> None:
        """Neither camera nor vehicle are needed any longer."""
        if self._attends:
            self._attends = False
            self._part.attention.end(self.conversation)
        self._vehicle.end(self.looking.state, now_us)
        self._part.leading.end_search(self)

    def plan(self, number: int, problem: SensingProblem) -> None:
        """Have a plan made in a process of its own."""
        looking = self.looking

        def on_over(event: SearchOver, at_us: int) -> None:
            plan = None if event.plan is None else plan_of(event.plan)
            looking.on_planned(number, plan, event.reason, self._part.federation_us(at_us), at_us)

        self._part.leading.searches.look(self, problem_record(problem), LIMITS.plan_us, on_over)

    def say(self, kind: str, text: str, now_us: int) -> None:
        """Tell the requester, the log, and followers of this process."""
        self._part.say(self._wanted, kind, text, now_us)

    def own(self) -> Viewpoint | None:
        """Where the vehicle is."""
        return self._part.own

    def view_m(self) -> float:
        """How far apart places are whose views leave nothing out between them."""
        return self._part.view_m

    def shows(self, x_m: float, y_m: float, since_us: int) -> bool:
        """Whether images that are newer show this place."""
        return self._part.shows(x_m, y_m, since_us)

    def forbidden(self, place: Viewpoint) -> str:
        """Why the vehicle may not fly there."""
        return self._part.forbidden(place)

    @property
    def waits(self) -> str:
        return self._vehicle.waits

    # -- as a mission is listed ----------------------------------------------------------------------------------

    def entry(self) -> MissionEntry:
        """Its state, for the list of missions."""
        looking, question = self.looking, None
        recovery = looking.recovery
        if looking.question and recovery is not None and recovery.deadline_us is not None:
            question = MissionQuestion(
                number=looking.questions, text=looking.asked[:1000], options=tuple(each[:200] for each in looking.question),
                default="", until_us=recovery.deadline_us,
            )  # fmt: skip
        phase = (
            f"waits for {recovery.phase.value}" if recovery is not None else "anchored" if looking.anchored else "looks"
        )
        return MissionEntry(
            mission=f"anchor-{self.symbol}"[:64], conversation=self.conversation, phase=phase, since_us=looking.since_us,
            why=looking.state[:1000], replans=max(0, looking.plans - 1), question=question,
            actions=tuple(f"{kind}: {text}"[:1000] for _, kind, text in looking.history),
        )  # fmt: skip

    def answer(self, number: int, answer: str, by: str, now_us: int) -> None:
        """The answer to its question; raises Refused: it is not open, or that is no answer."""
        looking = self.looking
        if not looking.question or number != looking.questions:
            raise Refused(f"question {number} is not open", "no-question")
        if answer not in looking.question:
            raise Refused(f"expected one of {', '.join(looking.question)}, got {answer!r}", "no-answer")
        self.say("answered", f"{by}: {answer}", now_us)
        looking.answer(answer, self._part.federation_us(now_us), now_us)


class RecoveringAnchors(Part):
    """See the module.

    Args:
        attention: turns the camera.
        leading: has plans made, lists missions and takes answers to their questions.
        wanting: takes the wanted objects, and hands on those to be recovered.
        following: is paused while the vehicle looks again.
        queries: lists what happened to objects.
    """

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self.unit, self._rig, self._agent, self._clock = ports.unit, ports.config.rig, ports.agent, ports.clock
        self._directory = ports.directory
        self.attention, self.performing = parts[CameraAttention], parts[Performing]
        self.leading, self._pilot = parts[MissionLeading], parts[Pilot.of]
        self.following = parts[Following]
        self.instance, self._emit, self._note = ports.instance(), ports.emit, ports.note
        self.frame = ports.config.rig.frame
        self._recoveries: dict[str, _Recovery] = {}
        self._view: Sample | None = None
        self._due_us = 0
        self._now_us = 0
        consumer = ports.translation.to_semantic(VIEW).into(self._on_view)
        ports.network.connect(ports.translation.local_label(VIEW, ports.unit), Policy(), consumer)
        parts[Wanting].recoveries = self
        parts[ObjectQueries].histories.append(self.events)

    def _on_view(self, sample: Sample) -> None:
        if sample.value is not NO_VALUE:
            self._view = sample

    # -- asked and ended ---------------------------------------------------------------------------------------

    def begin(self, wanted: WantedTask, now_us: int) -> Callable[[int], None]:
        """Look for it, and again while it is open which object it is; returns a function that ends that.

        Raises:
            Refused: the platform may not command its vehicle; the description is not one of properties.
        """
        if not self._pilot.control:
            raise Refused("this platform was not given control of its vehicle (join with --control)", "forbidden")
        found = _Recovery(self, wanted)
        self._recoveries[found.conversation] = found
        self.leading.listed[f"anchor-{found.symbol}"] = found
        self._due_us = now_us

        def end(at_us: int) -> None:
            self._recoveries.pop(found.conversation, None)
            self.leading.listed.pop(f"anchor-{found.symbol}", None)
            found.end(at_us)

        return end

    def on_event(self, conversation: str, event: LinkEvent) -> None:
        """Pass an event of a wanted object on to its recovery."""
        if conversation in self._recoveries:
            self._recoveries[conversation].on_event(event, self._now_us)

    def events(self, symbol: str | None) -> Iterator[tuple[Label, ObjectEvent]]:
        """The steps for one wanted object, or for all, each with the stream that it is of."""
        for each in self._recoveries.values():
            if symbol in {None, each.symbol}:
                for at_us, kind, text in each.looking.history:
                    event = ObjectEvent(
                        at_us=at_us, event=kind.replace(" ", "-"), target=each.symbol, because=text[:LONGEST_REASON]
                    )
                    yield each.stream, event

    # -- time --------------------------------------------------------------------------------------------------

    @property
    def deadline_us(self) -> int | None:
        return self._due_us if self._recoveries else None

    def on_time(self, now_us: int) -> None:
        if not self._recoveries or now_us < self._due_us:
            return
        self._due_us, self._now_us = now_us + PERIOD_US, now_us
        for each in list(self._recoveries.values()):
            each.step(now_us)

    # -- what recoveries need ------------------------------------------------------------------------------------

    def federation_us(self, now_us: int) -> int:
        return self._clock.federation_us(now_us)

    def process(self, wanted: WantedTask) -> LinkStream | None:
        """The maker of the wanted object's stream; None: the specification has none any longer."""
        network, label = self.instance.network, wanted.want.stream
        found = network.process(label) if network.has(label) else None
        return found if isinstance(found, LinkStream) else None

    @property
    def own(self) -> Viewpoint | None:
        """Where the vehicle is."""
        fix = self._pilot.fix
        if fix is None:
            return None
        north_m, east_m, _ = self.frame.to_ned(fix.latitude_deg, fix.longitude_deg, fix.altitude_m)
        return Viewpoint(float(east_m), float(north_m))

    @property
    def height_m(self) -> float | None:
        """Of the vehicle above its home, or the nearest that it may have."""
        fix, bounds = self._pilot.fix, self._pilot.bounds
        if fix is None or bounds.home_altitude_m is None:
            return None
        return bounds.within(fix.altitude_m, self._pilot.limits) - bounds.home_altitude_m

    @property
    def view_m(self) -> float:
        """The lesser extent of the widest camera's view straight below it, and a little less."""
        widest = max(self._rig.cameras.values(), key=lambda each: each.width_px / each.focal_px, default=None)
        if widest is None or self.height_m is None:
            return USUAL_VIEW_M
        return OVERLAP * self.height_m * min(widest.width_px, widest.height_px) / widest.focal_px

    def shows(self, x_m: float, y_m: float, since_us: int) -> bool:
        """Whether the newest image shows this place; an image that is stale or older than that time does not."""
        view, now_us = self._view, self.federation_us(self._now_us)
        if view is None or view.valid_us < max(since_us, now_us - STALE_US):
            return False
        corners = list(zip(view.value[0::2], view.value[1::2], strict=True))
        sides = [
            (bx - ax) * (y_m - ay) - (by - ay) * (x_m - ax)
            for (ax, ay), (bx, by) in zip(corners, [*corners[1:], corners[0]], strict=True)
        ]
        return all(side >= 0.0 for side in sides) or all(side <= 0.0 for side in sides)

    def forbidden(self, place: Viewpoint) -> str:
        """The bound that the vehicle would break there."""
        pilot, height_m = self._pilot, self.height_m
        home_m = pilot.bounds.home_altitude_m
        if height_m is None or home_m is None:
            return "the vehicle's height is not known"
        latitude_deg, longitude_deg, _ = self.frame.from_ned(place.y_m, place.x_m, 0.0)
        return (
            pilot.bounds.outside(GoToOrder(latitude_deg, longitude_deg, home_m + height_m), pilot.limits, pilot.fix)
            or ""
        )

    def say(self, wanted: WantedTask, kind: str, text: str, now_us: int) -> None:
        """Tell the requester, the log, and followers of this process."""
        symbol, unit = wanted.want.symbol, wanted.task.initiator
        self._emit(Tell({"event": "anchor", "symbol": symbol, "what": kind, "text": text, "at_us": now_us}))
        self._note(f"anchor {symbol}: {kind}: {text}"[:400])
        if self._directory.is_present(unit):
            progress = Progress(step=f"{kind}: {text}"[:1000], unit=self.unit)
            self._agent.tell(unit, progress, now_us, conversation=wanted.task.conversation)
