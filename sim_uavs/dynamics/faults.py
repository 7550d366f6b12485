"""Faults on demand: text <-> fault, how long each holds, and its effect on a reading. Pure.

`gps-loss`, `frozen-position`, `nan`, `silence` and `clock-stop` (its clocks stand still while it holds, and are behind from then
on, as those of a simulation on a busy machine) take no amount; `packet-loss=30` (per cent, each way), `clock=+5s`,
`clock-drift=100` (parts per million: an autopilot that runs at 0.992 of real time has -8000), `teleport=500` (metres
to the north-east), `gps-noise=10` (times the usual) and
`battery-low=15` (per cent left) do.

How orders fare, as real autopilots showed it: `refuse=2` (MAV_RESULT: 1 temporarily rejected, 2 denied, 3 unsupported,
4 failed), `forget` (accepted, and not flown), `ack-delay=1` (seconds), `ack-loss=30` (per cent), `stream-target=1` (hertz
at which a ground station repeats the target that the vehicle had), `takeover` (a pilot takes the vehicle, and gives it back),
`killed` (the autopilot ends: it reports and obeys nothing from then on, and its motors stop).

`blind`: its cameras show nothing.

`helicopter=60`, `drone=15`: its receivers hear an aircraft that is no member and comes over it from the east, at that speed in
metres a second; a helicopter by ADS-B, a drone by Remote ID.

How work with boxes fails: `failed-take-off` (it stays on the ground), `failed-attach` (the magnet takes hold of nothing),
`dropped-box` (what hangs on the line falls, at once), `misplaced-box=3` (what is let go comes down 3 m from where it should),
`late=3` (it flies at a third of its speed).

Faults that begin by themselves: `0 dropped-box at load+4s`, `1 late=3 at 30s for 20s`: the unit, the fault, when it begins, and how
long it lasts (without that: for good). Times count from the start of the vehicle, from its first arming (`arm+5s`), or from when
its winch has held something for the first time (`load+4s`).
"""

from collections.abc import Iterable
from difflib import get_close_matches
from math import nan, sqrt
from typing import Final, Literal, NamedTuple

import numpy as np

from dyknow.model.errors import TextError
from dyknow.model.instants import US_PER_S, parse_duration, print_duration
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from dyknow.sim_uavs.dynamics.sensors import GpsReading


class _Kind(NamedTuple):
    """`default` is the amount when none is written; None: this kind takes no amount."""

    default: float | None
    least: float
    most: float


_KINDS = {
    "gps-loss": _Kind(None, 0, 0),
    "frozen-position": _Kind(None, 0, 0),
    "nan": _Kind(None, 0, 0),
    "silence": _Kind(None, 0, 0),
    "packet-loss": _Kind(30.0, 0.0, 100.0),
    "clock": _Kind(5.0 * US_PER_S, -1e15, 1e15),
    "clock-drift": _Kind(100.0, -100_000.0, 100_000.0),
    "clock-stop": _Kind(None, 0, 0),
    "teleport": _Kind(500.0, -100_000.0, 100_000.0),
    "gps-noise": _Kind(10.0, 0.0, 1000.0),
    "battery-low": _Kind(15.0, 0.0, 100.0),
    "refuse": _Kind(2.0, 1.0, 4.0),
    "forget": _Kind(None, 0, 0),
    "ack-delay": _Kind(1.0, 0.0, 60.0),
    "ack-loss": _Kind(30.0, 0.0, 100.0),
    "stream-target": _Kind(1.0, 0.1, 10.0),
    "takeover": _Kind(None, 0, 0),
    "killed": _Kind(None, 0, 0),
    "failed-take-off": _Kind(None, 0, 0),
    "failed-attach": _Kind(None, 0, 0),
    "dropped-box": _Kind(None, 0, 0),
    "misplaced-box": _Kind(3.0, 0.0, 50.0),
    "late": _Kind(3.0, 1.0, 100.0),
    "blind": _Kind(None, 0, 0),
    "helicopter": _Kind(60.0, 1.0, 300.0),
    "drone": _Kind(15.0, 1.0, 100.0),
}
KINDS = tuple(_KINDS)
Beginning = Literal["start", "arm", "load"]
_DRAWN_RNG: Final = 43  # keeps the generator of schedules apart from others of the same seed
_EXAMPLE: Final = "0 dropped-box at load+4s"


class SimulatedFault(NamedTuple):
    """`amount` is in the unit of its kind; of `clock` microseconds; 0 for kinds without one."""

    kind: str
    amount: float = 0.0

    def __str__(self) -> str:
        if _KINDS[self.kind].default is None:
            return self.kind
        if self.kind == "clock":
            sign = "-" if self.amount < 0 else "+"
            return f"clock={sign}{print_duration(abs(round(self.amount)))}"
        return f"{self.kind}={self.amount:g}"


def parse_fault(text: str) -> SimulatedFault:
    """Read what `str(fault)` writes. Raises TextError with the kinds there are, or the amounts a kind takes."""
    name, equals, written = text.strip().partition("=")
    kind = _KINDS.get(name)
    if kind is None:
        raise TextError(f"no fault is called {name!r}", text=text, width=len(name), repair=_meant(name))
    if kind.default is None:
        if equals:
            raise TextError(f"{name} takes no amount", text=text, column=len(name) + 1, repair=name)
        return SimulatedFault(name)
    amount = _parse_amount(name, written, text) if equals else kind.default
    if not kind.least <= amount <= kind.most:
        raise TextError(
            f"{name} takes {kind.least:g} to {kind.most:g}",
            text=text,
            column=len(name) + 2,
            width=len(written),
            repair=str(SimulatedFault(name, kind.default)),
        )
    return SimulatedFault(name, amount)


def _meant(name: str) -> str:
    """The kind that may be meant; all kinds if none is like the name."""
    return next(iter(get_close_matches(name, KINDS, n=1)), ", ".join(KINDS))


def _parse_amount(name: str, written: str, text: str) -> float:
    try:
        if name == "clock":
            sign = -1 if written.startswith("-") else 1
            return float(sign * parse_duration(written.removeprefix("+").removeprefix("-"), "s"))
        return float(written)
    except (ValueError, TextError) as wrong:
        repair = str(SimulatedFault(name, _KINDS[name].default or 0.0))
        raise TextError(
            f"{written!r} is no amount for {name}", text=text, column=len(name) + 2, width=len(written), repair=repair
        ) from wrong


class ActiveFaults:
    """The faults that hold: one per kind, each until its end (None: for good) or until another of its kind begins."""

    def __init__(self) -> None:
        self._held: dict[str, tuple[SimulatedFault, int, int | None]] = {}
        self._behind_us = 0

    def inject(self, fault: SimulatedFault, now_us: int, until_us: int | None = None) -> None:
        self._held[fault.kind] = (fault, now_us, until_us)

    def amount(self, kind: str, now_us: int) -> float | None:
        """The amount of the fault of this kind that holds now, or None."""
        held = self._held.get(kind)
        if held is None:
            return None
        fault, begun_us, until_us = held
        if until_us is not None and now_us >= until_us:
            if kind == "clock-stop":
                self._behind_us += until_us - begun_us
            del self._held[kind]
            return None
        return fault.amount

    def holds(self, kind: str, now_us: int) -> bool:
        return self.amount(kind, now_us) is not None

    def step_us(self, now_us: int) -> int:
        """How far the vehicle's UTC, but not its time since boot, is ahead."""
        return round(self.amount("clock", now_us) or 0.0)

    def drift_us(self, now_us: int) -> int:
        """How far the vehicle's oscillator has run ahead since its drift began, less how long it has stood still."""
        ppm, is_still = self.amount("clock-drift", now_us), self.holds("clock-stop", now_us)
        ahead_us = 0 if ppm is None else round(ppm * 1e-6 * (now_us - self._held["clock-drift"][1]))
        still_us = now_us - self._held["clock-stop"][1] if is_still else 0
        return ahead_us - self._behind_us - still_us


def spoil(reading: GpsReading, last: GpsReading | None, faults: ActiveFaults, now_us: int) -> GpsReading | None:
    """The reading of the position sensor under the active faults; None: it has no fix."""
    if faults.holds("gps-loss", now_us):
        return None
    if faults.holds("nan", now_us):
        nowhere = Vector(nan, nan, nan)
        return reading._replace(position=nowhere, velocity=nowhere)
    if faults.holds("frozen-position", now_us) and last is not None:
        return last
    far = faults.amount("teleport", now_us)
    if far is not None:
        side = far / sqrt(2.0)
        return reading._replace(position=reading.position.plus(Vector(side, side, 0.0)))
    return reading


class ScheduledFault(NamedTuple):
    """`after_us` counts from `since`; `for_us` None: it lasts."""

    fault: SimulatedFault
    after_us: int
    since: Beginning = "start"
    for_us: int | None = None

    def __str__(self) -> str:
        since = "" if self.since == "start" else f"{self.since}+"
        lasts = "" if self.for_us is None else f" for {print_duration(self.for_us)}"
        return f"{self.fault} at {since}{print_duration(self.after_us)}{lasts}"


def parse_scheduled(text: str) -> tuple[str, ScheduledFault]:
    """The unit and its fault.

    Raises:
        TextError: it is none; with the form of one.
    """
    unit, _, rest = text.strip().partition(" ")
    return unit, parse_fault_at(rest)


def parse_fault_at(text: str) -> ScheduledFault:
    """Read the text of `str(scheduled)`; raises TextError."""
    match text.split():
        case [fault, "at", when]:
            lasts = None
        case [fault, "at", when, "for", lasts]:
            pass
        case _:
            raise TextError(f"{text!r} is no fault of a schedule", text=text, width=len(text), repair=_EXAMPLE)
    anchor, plus, after = when.partition("+")
    if not plus:
        anchor, after = ("start", when) if when not in {"arm", "load"} else (when, "0s")
    if anchor not in {"start", "arm", "load"}:
        raise TextError(f"{anchor!r}: a fault begins after start, arm or load", text=text, repair=_EXAMPLE)
    since: Beginning = "arm" if anchor == "arm" else "load" if anchor == "load" else "start"
    for_us = None if lasts is None else parse_duration(lasts, "s")
    return ScheduledFault(parse_fault(fault), parse_duration(after, "s"), since, for_us)


def drawn(seed: int, index: int) -> ScheduledFault:
    """One fault of work with boxes, for the vehicle of this index."""
    rng = np.random.default_rng((seed, index, _DRAWN_RNG))
    after_us = int(rng.integers(20, 80)) * US_PER_S // 10
    match int(rng.integers(5)):
        case 0:
            return ScheduledFault(SimulatedFault("dropped-box"), after_us, "load")
        case 1:
            return ScheduledFault(SimulatedFault("failed-attach"), 0, "arm", 30 * US_PER_S)
        case 2:
            return ScheduledFault(SimulatedFault("failed-take-off"), 0, "arm", 15 * US_PER_S)
        case 3:
            away_m = float(rng.integers(40, 100)) / 10.0
            return ScheduledFault(SimulatedFault("misplaced-box", away_m), 0, "load", 30 * US_PER_S)
        case _:
            return ScheduledFault(SimulatedFault("late", float(rng.integers(3, 7))), after_us, "arm", 40 * US_PER_S)


class FaultSchedule:
    """The faults of one vehicle that have not begun.

    Args:
        now_us: when the vehicle starts.
    """

    def __init__(self, faults: Iterable[ScheduledFault], now_us: int) -> None:
        self._waiting = list(faults)
        self._since_us: dict[str, int] = {"start": now_us}

    def due(self, now_us: int, *, is_armed: bool, holds: bool) -> list[tuple[SimulatedFault, int | None]]:
        """The faults that begin now, and until when they last."""
        if not self._waiting:
            return []
        for name, is_so in (("arm", is_armed), ("load", holds)):
            if is_so:
                self._since_us.setdefault(name, now_us)
        found = [each for each in self._waiting if now_us >= self._since_us.get(each.since, now_us + 1) + each.after_us]
        self._waiting = [each for each in self._waiting if each not in found]
        return [(each.fault, None if each.for_us is None else now_us + each.for_us) for each in found]
