"""A piece of a divided area is scanned: its vehicle flies lanes over it until all of it was in view for 5 s (thesis 7.1.1, 9.2.3).

Lanes follow from the cameras' field of view. The seen cells are a stream, `scanned-area`, which the platforms of a
division import of each other: when one is gone, and the area is divided again, the others fly over the unseen cells.
The vehicle is commanded as in a mission, after its pilot and giving way, on the evidence of a command centre's request.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from dyknow import NO_VALUE, US_PER_S, Label, Policy, Sample
from dyknow.agents.capabilities.areas.assignment import AreaAssignment, AssignedPiece
from dyknow.agents.capabilities.cameras.cameras import VIEW
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.capabilities.missions.command_run import VehicleCommand
from dyknow.agents.capabilities.missions.performing import Performing
from dyknow.agents.exchange.local_instance import LocalInstance
from dyknow.agents.exchange.partners import Partners
from dyknow.agents.exchange.subscription_keeper import SubscriptionKeeper
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.messages.contents import AreaRing, DivideArea
from dyknow.federation.messages.descriptions import ConditionEntry, LabelEntry
from dyknow.model.errors import Refused
from dyknow.navigation.scanning import Floats, ScanGrid, lawn_mower, swath_m, within
from dyknow.network.stream_proxy import StreamProxy

SCANNED: Final = "scanned-area"
PERIOD_US: Final = US_PER_S
ROUNDS: Final = 3
"""Of lanes over one piece: after that the rest counts as unseen."""
ENOUGH: Final = 0.002
"""A smaller part of a piece than this is not flown to again."""


@dataclass(slots=True)
class _Scan:
    """One task: its grid, the piece that is flown, and how that goes."""

    task: str
    grid: ScanGrid
    key: tuple[str, int]
    mine: np.ndarray
    height_m: float
    rounds: int = 0
    is_flying: bool = False
    is_over: bool = False
    failure: str = ""


class Scanning(Part):
    """One scan at a time, the one that was assigned last. Times are the node clock.

    Attributes:
        scan: the present one; None: none was assigned.
    """

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._rig, self._frame = ports.config.unit, ports.config.rig, ports.config.rig.frame
        self._clock = ports.clock
        self._network, self._translation, self._assignment = ports.network, ports.translation, parts[AreaAssignment]
        self._performing, self._pilot, self._note = parts[Performing], parts[Pilot.of], ports.note
        self._offer = ports.offer
        self._partners = Partners(ports.network, parts[LocalInstance], parts[SubscriptionKeeper], self._on_scanned)
        self._label: Label = ports.translation.local_label(SCANNED, ports.config.unit)
        self._view: Label = ports.translation.local_label(VIEW, ports.config.unit)
        self._looking: StreamProxy | None = None
        self._joined = ""
        self._shown, self._shown_us = "", 0
        self._due_us: int | None = None
        self.scan: _Scan | None = None
        parts[AreaAssignment].on_piece = self._on_piece

    def labels(self) -> Iterable[LabelEntry]:
        return [self._translation.ontology.entry(SCANNED, PERIOD_US)] if self._network.has(self._label) else ()

    def conditions(self) -> Iterable[ConditionEntry]:
        return (ConditionEntry(text=self._shown, since_us=self._shown_us),) if self._shown else ()

    # -- what is assigned --------------------------------------------------------------------------------------

    def _on_piece(self) -> None:
        self._due_us = 0

    @property
    def deadline_us(self) -> int | None:
        return self._due_us

    def on_time(self, now_us: int) -> None:
        """Begin what was assigned, fly on, and tell how much was seen."""
        if self._due_us is None or now_us < self._due_us:
            return
        wanted = self._wanted()
        if wanted is None:
            self._end(now_us)
            return
        federation_us = self._clock.federation_us(now_us)
        self._due_us = self._clock.wall_us((federation_us // PERIOD_US + 1) * PERIOD_US)
        self._take(wanted, now_us)
        if self.scan is not None:
            self._step(self.scan, wanted, now_us)
            self._tell(self.scan, federation_us, now_us)

    def _wanted(self) -> AssignedPiece | None:
        """The piece that is scanned: a scan gives way only when its own task ends."""
        pieces = {task: each for task, each in self._assignment.pieces.items() if each.evidence.flies}
        own = None if self.scan is None else pieces.get(self.scan.task)
        return own or next(reversed(pieces.values()), None)

    def _end(self, now_us: int) -> None:
        """The division was cancelled: the vehicle holds."""
        self._due_us = None
        self.scan = None
        self._leave(now_us)
        for unit in self._partners.units:
            self._partners.want(unit, {}, now_us)
        if self._looking is not None:
            self._looking.cancel()
            self._looking = None
        self._show("", now_us)

    def _take(self, piece: AssignedPiece, now_us: int) -> None:
        """Begin another piece, or the same in a newer division: seen cells of the area stay seen."""
        content, scan, asked = piece.content, self.scan, piece.evidence.content
        if not isinstance(asked, DivideArea):
            return
        key = piece.leader, content.generation
        if scan is not None and (scan.task, scan.key) == (content.task, key):
            return
        grid = scan.grid if scan is not None and scan.task == content.task else ScanGrid(self._metres(asked.area))
        mine = np.zeros(len(grid.cells), dtype=np.bool_)
        for ring in content.rings:
            mine |= within(self._ring(ring), grid.cells)
        self.scan = _Scan(content.task, grid, key, mine, asked.scan_m or 0.0)
        for unit in content.units:
            if unit != self._unit:
                self._partners.want(unit, {SCANNED: PERIOD_US}, now_us)
        if self._looking is None:
            self._looking = self._network.connect(
                self._view, Policy(), self._translation.to_semantic(VIEW).into(self._on_view)
            )
        if not self._network.has(self._label):
            self._network.add_source(self._label, self._translation.local_sort(SCANNED))
            self._offer(now_us)

    def _ring(self, ring: AreaRing) -> Floats:
        return self._metres(ring.corners)

    def _metres(self, corners: Iterable[str]) -> Floats:
        degrees = [tuple(map(float, corner.split())) for corner in corners]
        places = [self._frame.to_ned(latitude_deg, longitude_deg, 0.0) for latitude_deg, longitude_deg in degrees]
        return np.array([(east_m, north_m) for north_m, east_m, _ in places])

    # -- what is seen ------------------------------------------------------------------------------------------

    def _on_view(self, sample: Sample) -> None:
        if self.scan is not None and sample.value is not NO_VALUE:
            self.scan.grid.look(sample.valid_us, np.array(sample.value, dtype=np.float64).reshape(4, 2))

    def _on_scanned(self, unit: str, _label: str, sample: Sample) -> None:
        """Merge the cells of the same area that another platform has seen."""
        scan, value = self.scan, sample.value
        if scan is None or value is NO_VALUE or value[0] != scan.task:
            return
        if not scan.grid.merge(str(value[2])):
            self._note(f"scan: the cells seen by platform {unit} are of another area; they are ignored")

    # -- the flight --------------------------------------------------------------------------------------------

    def _step(self, scan: _Scan, piece: AssignedPiece, now_us: int) -> None:
        """Fly over the unseen rest of the piece, in a few rounds; then home."""
        if scan.is_flying or scan.is_over:
            return
        left = scan.mine & ~scan.grid.seen
        if scan.failure or scan.rounds >= ROUNDS or left.sum() <= ENOUGH * max(1, scan.mine.sum()):
            self._finish(scan, now_us)
            return
        if not self._join(scan, piece, now_us):
            return
        fix = self._pilot.fix
        if fix is None:
            return
        north_m, east_m, _ = self._frame.to_ned(fix.latitude_deg, fix.longitude_deg, 0.0)
        way = lawn_mower(scan.grid.cells[left], swath_m(self._rig, scan.height_m), (east_m, north_m))
        commands = [VehicleCommand("take-off", (scan.height_m,))]
        for x_m, y_m in way:
            latitude_deg, longitude_deg, _ = self._frame.from_ned(y_m, x_m, 0.0)
            commands.append(VehicleCommand("goto", (latitude_deg, longitude_deg, scan.height_m)))
        scan.rounds, scan.is_flying = scan.rounds + 1, True
        self._fly(scan, tuple(commands), f"scans {scan.mine.mean():.0%} of {scan.task}", now_us)

    def _fly(self, scan: _Scan, commands: tuple[VehicleCommand, ...], action: str, now_us: int) -> None:
        def over(why: str, at_us: int) -> None:
            if scan is not self.scan:
                return
            scan.is_flying, self._due_us = False, at_us
            if why and not scan.is_over:
                scan.failure = why

        self._performing.perform(action, commands, over, now_us)

    def _join(self, scan: _Scan, piece: AssignedPiece, now_us: int) -> bool:
        if self._joined == scan.task:
            return True
        try:
            self._performing.join(scan.task, piece.leader, lambda _waits, _at_us: None, now_us, word=piece.evidence)
        except Refused as refused:
            self._show(f"scan: {refused.reason}", now_us)
            return False
        self._joined = scan.task
        return True

    def _finish(self, scan: _Scan, now_us: int) -> None:
        """Say what was not seen, and why; the vehicle flies home and is free there."""
        scan.is_over = True
        seen = scan.grid.seen[scan.mine].mean() if scan.mine.any() else 1.0
        why = f": {scan.failure}" if scan.failure else ""
        unseen = "" if seen >= 1.0 - ENOUGH else f"; {1.0 - seen:.1%} of it was not{why}"
        self._note(f"scan: {seen:.0%} of this platform's piece was in view for 5 s{unseen}")
        if self._joined:
            scan.is_flying = True

            def home(why: str, at_us: int) -> None:
                if scan is self.scan:
                    if why:
                        self._note(f"scan: the vehicle does not fly home: {why}")
                    self._leave(at_us)

            self._performing.perform("flies home", (VehicleCommand("return-home"),), home, now_us)

    def _leave(self, now_us: int) -> None:
        if self._joined:
            self._joined = ""
            self._performing.leave(now_us, is_over=self.scan is None)

    # -- reports -----------------------------------------------------------------------------------------------

    def _tell(self, scan: _Scan, federation_us: int, now_us: int) -> None:
        valid_us = federation_us // PERIOD_US * PERIOD_US
        value = (scan.task, scan.grid.share, scan.grid.text())
        sample = Sample(federation_us, valid_us, value)
        self._network.push(self._label, self._translation.to_local(SCANNED).sample(sample))
        own = scan.grid.seen[scan.mine].mean() if scan.mine.any() else 1.0
        if self._joined == scan.task or scan.is_over:
            self._show(f"scan: {own:.0%} of its piece, {scan.grid.share:.0%} of the area was in view for 5 s", now_us)

    def _show(self, text: str, now_us: int) -> None:
        if text != self._shown:
            self._shown, self._shown_us = text[:200], now_us
            self._offer(now_us)
