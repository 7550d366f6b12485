"""An area divided among the platforms that are there, by ask and tell: this platform is the leader (thesis 9.2.3).

It asks each for its maximum speed, battery and position by semantic label, divides the area in proportion to speed and battery, in
the order in which the platforms lie along it, and informs each of its piece; again whenever one comes or goes. When the
leader is gone, the first in the order of `dyknow.agents.tasks.authority` takes over. It leads until one before it is back in the same life,
and divides again. Its acts carry the one that delegated the division. Times are the node clock.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final

from dyknow.agents.actions import COORDINATION, Offer
from dyknow.agents.capabilities.areas.assignment import AreaAssignment
from dyknow.agents.capabilities.areas.requests import DIVIDE_AREA
from dyknow.agents.exchange.gateway import Gateway
from dyknow.agents.part import Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.tasks.authority import WAIT_US, Authority, TaskEvidence
from dyknow.agents.tasks.life import TaskLife
from dyknow.agents.tasks.task import Task
from dyknow.federation.members.directory import unit_order
from dyknow.federation.members.liveness import PeerState, PlatformAppeared, PlatformGone, PlatformReturned
from dyknow.federation.members.offers import LabelAppeared, LabelGone
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import AreaRing, AssignArea, Content, DivideArea, Progress, Query, Samples
from dyknow.federation.messages.contents.parts import next_generation
from dyknow.federation.messages.rounds import Round
from dyknow.model.errors import DyknowError, Refused
from dyknow.model.values import NO_VALUE
from dyknow.navigation.areas import Area, Piece

P = Performative
ASKED: Final = {
    "top-speed": ("speed_m_s",), "battery": ("fraction",), "heli-position": ("latitude_deg", "longitude_deg"),
}  # fmt: skip
"""Semantic labels, and the fields that must be numbers."""
ANSWER_US: Final = 1_000_000
AFTER_US: Final = 300_000
"""How long after a platform has come or gone the area is divided again: several may come at once."""
SPEED_M_S: Final = 10.0
SPEED_MOST_M_S: Final = 60.0
BATTERY: Final = 0.5
"""The assumption where a platform states nothing, and the greatest believed speed."""
BATTERY_LEAST: Final = 0.1
"""With less a platform gets no piece."""
SUCCESSOR_STEP_US: Final = 1_000_000
"""How much later each next platform takes over a division whose leader is gone."""
RENEWED_US: Final = 2_000_000
"""After that a successor divides once more: a platform that saw the leader longer has not followed it."""
MOST, MOST_OF_ONE = 8, 4
"""Divisions that one platform leads, in all and of one delegator that is no command centre: it leaves room for others."""


@dataclass(slots=True)
class PlatformAbility:
    """A platform's statements about itself: values by field, by semantic label."""

    unit: str
    values: dict[str, dict[str, Any]] = field(default_factory=dict)

    @property
    def weight(self) -> float:
        """How large its piece is next to those of others: speed times battery."""
        speed = min(max(self._number("top-speed", SPEED_M_S), 0.0), SPEED_MOST_M_S)
        battery = min(max(self._number("battery", BATTERY), 0.0), 1.0)
        return speed * battery if battery >= BATTERY_LEAST else 0.0

    @property
    def place(self) -> tuple[float, float] | None:
        """Where it is, latitude and longitude in degrees; None where it states no place on earth."""
        found = self.values.get("heli-position")
        if found is None or abs(found["latitude_deg"]) > 90 or abs(found["longitude_deg"]) > 360:
            return None
        return float(found["latitude_deg"]), float(found["longitude_deg"])

    def assumed(self) -> str:
        """The labels that it did not state."""
        return " and ".join(label for label in ("top-speed", "battery") if label not in self.values)

    def unbelieved(self) -> list[str]:
        """Values that it states and no vehicle can have, each with the value that is counted instead."""
        found = []
        speed, battery = self._number("top-speed", SPEED_M_S), self._number("battery", BATTERY)
        if not 0.0 <= speed <= SPEED_MOST_M_S:
            found.append(f"a top speed of {speed:g} m/s, counted as {min(max(speed, 0.0), SPEED_MOST_M_S):g}")
        if not 0.0 <= battery <= 1.0:
            found.append(f"a battery of {battery:.0%}, counted as {min(max(battery, 0.0), 1.0):.0%}")
        if "heli-position" in self.values and self.place is None:
            found.append("a position that is no place on earth")
        return found

    def _number(self, label: str, otherwise: float) -> float:
        value = self.values.get(label, {}).get(ASKED[label][0], otherwise)
        return float(value)


@dataclass(slots=True)
class DividedArea:
    """One task: the area, its pieces, and the awaited answers."""

    evidence: TaskEvidence
    content: DivideArea
    area: Area
    generation: int = 0
    pieces: dict[str, Piece] = field(default_factory=dict)
    asked: dict[str, PlatformAbility] = field(default_factory=dict)
    round: Round[tuple[str, str]] = field(default_factory=Round)
    due_us: int | None = None
    renew_us: int | None = None

    @property
    def task(self) -> str:
        return self.evidence.task

    @property
    def delegator(self) -> str:
        return self.evidence.delegator

    def ask_at(self, due_us: int | None) -> None:
        """Ask then; answers that are awaited still count no longer."""
        self.round, self.due_us = Round(), due_us


class AreaDivision(Part):
    """See the module.

    Args:
        own: takes the piece of this platform.

    Attributes:
        areas: the areas that this platform divides, by task.
        succeeds_us: when it takes over the divisions of leaders that are gone, by task.
    """

    offers = (Offer(COORDINATION, (DIVIDE_AREA,)),)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._boot, self._agent, self._directory = ports.unit, ports.boot, ports.agent, ports.directory
        self._gateway = parts[Gateway.of]
        self._tasks, self._authority, self._own = parts[TaskLife], parts[Authority], parts[AreaAssignment]
        self._note = ports.note
        self.areas: dict[str, DividedArea] = {}
        self.succeeds_us: dict[str, int] = {}
        parts[AreaAssignment].on_led = self._on_led
        parts[Authority].on_over.append(self._on_over)
        parts[Authority].held.append(lambda: [divided.evidence for divided in self.areas.values()])

    def _check_room(self, delegator: str) -> None:
        owner = self._authority.owner
        of_one = sum(owner(each.delegator) == owner(delegator) for each in self.areas.values())
        if len(self.areas) >= MOST or (of_one >= MOST_OF_ONE and not self._authority.is_centre(delegator)):
            text = f"this platform divides {len(self.areas)} areas already, {of_one} of them for {delegator}"
            raise Refused(text, "too-many-tasks")

    def on_divide(self, act: Act, content: DivideArea, now_us: int) -> None:
        """`(divide-area ...)`: until it is cancelled.

        Raises:
            Refused: it is no area, it flies vehicles and the sender may not, or this platform leads as many as it may.
        """
        task = self._tasks.check_free(act.conversation_id, act.sender.unit)
        self._check_room(act.sender.unit)
        if not task.endswith(f".{self._unit}"):
            raise Refused(f"{task} does not name {self._unit} as the platform that it was delegated to", "unproven")
        divided = DividedArea(self._authority.delegated(act, content), content, _area(content.area))
        self.areas[task] = divided
        self._tasks.add(Task(task, act.sender.unit, DivideArea.head, partial(self._end, task), since_us=now_us))
        self._agent.answer(act, P.AGREE, None, now_us)
        self._ask(divided, now_us)

    def _end(self, task: str, now_us: int) -> tuple[str, ...]:
        divided = self.areas.pop(task)
        self._authority.end(divided.evidence, now_us, {**divided.asked, **divided.pieces})
        self._own.drop(task, now_us)
        return ()

    def _on_over(self, name: str, now_us: int) -> None:
        """A command centre has ended it at each platform."""
        task = self._tasks.get(name) if name in self.areas else None
        if task is not None:
            self._tasks.end(task, "a command centre", now_us)

    # -- ask ---------------------------------------------------------------------------------------------------

    def _participants(self, sensor: str | None) -> dict[str, frozenset[str]]:
        """The platforms that are there and have the sensor, this one included, with the labels that they offer."""
        there = {
            entry.unit: frozenset(label.label for label in entry.labels)
            for entry in self._directory.entries()
            if entry.kind == "uav" and entry.state is not PeerState.GONE and not entry.refusal
        }
        there.setdefault(self._unit, frozenset(self._gateway.offered()))
        units = sorted(there, key=unit_order)
        return {unit: there[unit] for unit in units if sensor is None or sensor in there[unit]}

    def _ask(self, divided: DividedArea, now_us: int) -> None:
        there = self._participants(divided.content.sensor)
        divided.asked = {unit: PlatformAbility(unit) for unit in there}
        questions = [(unit, label) for unit in there for label in ASKED if unit != self._unit and label in there[unit]]
        for label in ASKED if self._unit in there else ():
            self._look(divided.asked[self._unit], label)
        divided.round, divided.due_us = Round(questions), now_us + ANSWER_US
        for unit, label in questions:
            self._query(divided, divided.asked[unit], label, now_us)
        if not questions:
            self._divide(divided, now_us)

    def _look(self, ability: PlatformAbility, label: str) -> None:
        """The same of this platform."""
        try:
            value = self._gateway.latest(label).value
        except DyknowError:
            return
        if value is not NO_VALUE:
            names = [part.name for part in self._gateway.ontology[label].sort.fields]
            ability.values[label] = dict(zip(names, value, strict=True))

    def _query(self, divided: DividedArea, ability: PlatformAbility, label: str, now_us: int) -> None:
        asked = divided.round

        def answered(at_us: int) -> None:
            is_last = asked.answered((ability.unit, label)) and not asked.awaited
            if is_last and asked is divided.round:
                self._divide(divided, at_us)

        def on_reply(_act: Act, content: Content | None, at_us: int) -> None:
            if isinstance(content, Samples) and content.samples and content.samples[-1].value is not NO_VALUE:
                values = dict(content.samples[-1].value)
                if all(isinstance(values.get(name), int | float) for name in ASKED[label]):
                    ability.values[label] = values
            answered(at_us)

        self._agent.delegate(
            ability.unit,
            Query(semantic_label=label),
            now_us,
            performative=P.QUERY_REF,
            on_reply=on_reply,
            on_silence=lambda _why, at_us: answered(at_us),
            reply_within_us=ANSWER_US,
        )

    # -- divide and tell ---------------------------------------------------------------------------------------

    def _divide(self, divided: DividedArea, now_us: int) -> None:
        if divided.task not in self.areas:
            return
        divided.ask_at(None)
        able = [each for each in divided.asked.values() if each.weight > 0]
        before, divided.pieces = divided.pieces, {}
        divided.generation = next_generation(divided.generation)
        if able:
            along = {each.unit: divided.area.along_m(each.place) for each in able if each.place is not None}
            able.sort(key=lambda each: (each.unit not in along, along.get(each.unit, 0.0), unit_order(each.unit)))
            pieces = divided.area.divide([each.weight for each in able])
            divided.pieces = {each.unit: piece for each, piece in zip(able, pieces, strict=True)}
        for unit in {**before, **divided.asked}:
            piece = divided.pieces.get(unit, Piece((), 0.0, (0.0, 0.0)))
            self._inform(divided, unit, piece, piece.area_m2 / divided.area.area_m2, now_us)
        self._report(divided, now_us)

    def _inform(self, divided: DividedArea, unit: str, piece: Piece, share: float, now_us: int) -> None:
        content = AssignArea(
            task=divided.task,
            generation=divided.generation,
            rings=tuple(AreaRing(corners=tuple(map(_text, ring))) for ring in piece.rings),
            area_m2=piece.area_m2,
            share=min(1.0, share),
            middle=_text(piece.middle),
            units=tuple(divided.pieces),
        )
        if unit == self._unit:
            self._own.assign(unit, self._boot, content, divided.evidence, now_us)
        elif self._directory.is_present(unit):
            self._agent.tell(unit, content, now_us, evidence=divided.evidence.payload)

    def _report(self, divided: DividedArea, now_us: int) -> None:
        """Tell the delegator the share of each platform, what was assumed, and which have none."""
        whole = divided.area.area_m2
        parts = [f"{unit} {piece.area_m2 / whole:.0%}" for unit, piece in divided.pieces.items()]
        assumed = [
            f"{each.unit} does not say its {each.assumed()}" for each in divided.asked.values() if each.assumed()
        ]
        none = [f"{unit} gets none: its battery is low" for unit in divided.asked if unit not in divided.pieces]
        wrong = [f"{each.unit} states {what}" for each in divided.asked.values() for what in each.unbelieved()]
        divisions = f"{whole:.0f} m2 divided: {', '.join(parts) or 'no platform can watch it'}"
        text = "; ".join([divisions, *wrong, *none, *assumed])
        self._note(f"area: {text}")
        if self._directory.is_present(divided.delegator):
            self._agent.tell(divided.delegator, Progress(step=text[:1000]), now_us, conversation=divided.task)

    # -- again -------------------------------------------------------------------------------------------------

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """A platform came or went, or its abilities changed: divide again soon, or take over its divisions."""
        if isinstance(change, PlatformGone | PlatformAppeared):
            self._see_to_succession(now_us)
        for divided in self.areas.values():
            match change:
                case PlatformGone(unit=unit):
                    is_other = unit in divided.pieces or unit in divided.asked
                case PlatformAppeared(kind="uav") | PlatformReturned():
                    is_other = True
                case LabelAppeared(unit=unit, label=entry) | LabelGone(unit=unit, label=entry):
                    is_other = entry.label in {*ASKED, divided.content.sensor}
                case _:
                    is_other = False
            if is_other:
                divided.ask_at(now_us + AFTER_US)

    @property
    def deadline_us(self) -> int | None:
        times = [us for each in self.areas.values() for us in (each.due_us, each.renew_us)]
        due_us = [us for us in times if us is not None]
        return min((*due_us, *self.succeeds_us.values()), default=None)

    def on_time(self, now_us: int) -> None:
        for task in [task for task, due_us in self.succeeds_us.items() if now_us >= due_us]:
            del self.succeeds_us[task]
            self._take_over(task, now_us)
        for divided in list(self.areas.values()):
            if divided.renew_us is not None and now_us >= divided.renew_us:
                divided.renew_us = None
                divided.ask_at(now_us)
            if divided.due_us is not None and now_us >= divided.due_us:
                if divided.round.awaited:
                    self._divide(divided, now_us)  # with the answers so far
                else:
                    self._ask(divided, now_us)

    # -- succession --------------------------------------------------------------------------------------------

    def _see_to_succession(self, now_us: int) -> None:
        """Of divisions whose leaders are gone: take over in the order of units."""
        for task, piece in self._own.known.items():
            if piece.gone_us is None:
                self.succeeds_us.pop(task, None)
            elif task not in self.succeeds_us:
                rank = self._authority.turn(piece.evidence)
                self.succeeds_us[task] = now_us + WAIT_US + AFTER_US + rank * SUCCESSOR_STEP_US

    def _take_over(self, task: str, now_us: int) -> None:
        piece = self._own.known.get(task)
        if piece is None or piece.gone_us is None or task in self.areas:
            return
        content, delegator = piece.evidence.content, piece.evidence.delegator
        if self._authority.turn(piece.evidence):
            self.succeeds_us[task] = now_us + SUCCESSOR_STEP_US
            return
        if len(self.areas) >= MOST or self._tasks.get(task) is not None or not isinstance(content, DivideArea):
            self._note(f"area: {piece.leader}, the leader of {task}, is gone, and this platform cannot take over")
            return
        divided = DividedArea(piece.evidence, content, _area(content.area), piece.content.generation)
        divided.pieces = dict.fromkeys(piece.content.units, Piece((), 0.0, (0.0, 0.0)))
        divided.renew_us = now_us + RENEWED_US
        self.areas[task] = divided
        self._tasks.add(Task(task, delegator, DivideArea.head, partial(self._end, task), since_us=now_us))
        self._note(f"area: leads {task} of {delegator} from now on, since {piece.leader} is gone")
        self._ask(divided, now_us)

    def _on_led(self, task: str) -> None:
        """Stop leading a task that another platform leads by right."""
        self.succeeds_us.pop(task, None)
        if self.areas.pop(task, None) is not None:
            self._tasks.forget(task)
            self._note(f"area: no longer leads {task}")


def _area(corners: Sequence[str]) -> Area:
    return Area([(float(latitude), float(longitude)) for latitude, longitude in map(str.split, corners)])


def _text(place: tuple[float, float]) -> str:
    return f"{place[0]:.7f} {place[1]:.7f}"
