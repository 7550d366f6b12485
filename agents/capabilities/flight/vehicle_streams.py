"""Reports of a platform's vehicle as streams of the local instance: fused once, then split by semantic label.

The estimate is put out on the grid of its period, and every other label on the same grid, so that states and exports of
several platforms meet. A sample of a label is made once, in its units, and converted where the platform has others.
Federation time.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Final

from dyknow import SURE, Field, Label, Network, Quality, Sample, Sort, Value, independent
from dyknow.agents.effects import Reported
from dyknow.agents.part import NOT_MINE, Followed, Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.messages.descriptions import LabelEntry
from dyknow.federation.shares import TokenBucket
from dyknow.federation.sharing.translation import Translation
from dyknow.navigation.fusion import Estimate, PositionFilter
from dyknow.navigation.geodesy import metres_per_degree
from dyknow.navigation.vehicle import BatteryReport, HomeReport, Report, WinchReport
from dyknow.network.generator import Consumer

ESTIMATE = Sort(
    "estimate",
    (
        *(Field(name, "deg") for name in ("latitude_deg", "longitude_deg")),
        Field("altitude_m", "m"),
        *(Field(name, "m/s") for name in ("north_m_s", "east_m_s", "down_m_s")),
        *(Field(name, "m2") for name in ("var_n", "var_e", "var_d")),
        *(Field(name, "m2/s2") for name in ("var_vn", "var_ve", "var_vd")),
    ),
)
LABELS = ("heli-position", "heli-altitude", "heli-velocity", "heli-height", "heli-home", "battery")
LOAD: Final = "winch-load"
WINCH_PERIOD_US: Final = 200_000
BATTERY_KEPT_US = 10_000_000
CHANGES_PER_S, CHANGES_AT_ONCE = 0.1, 4.0
"""How often a change between good and bad positions is noted; those between are counted."""


class VehicleStreams:
    """The streams a platform produces about itself.

    Steps return the fused estimates, which have gone through the network; `on_health` is called, in words, when the
    estimates stop or come again, and why, but not for every change of many.
    """

    def __init__(
        self,
        unit: str,
        network: Network,
        translation: Translation,
        period_us: int,
        on_health: Callable[[str], None] = lambda _text: None,
    ) -> None:
        self.filter = PositionFilter(period_us)
        self.period_us = period_us
        self.estimate = Label.parse(f"estimate[{unit}]")
        self._network, self._translation, self._unit = network, translation, unit
        self._on_health, self._health = on_health, self.filter.health[:2]
        self._changes, self._unnoted = TokenBucket(CHANGES_PER_S, CHANGES_AT_ONCE, CHANGES_AT_ONCE), 0
        self._home: HomeReport | None = None
        self._battery: BatteryReport | None = None
        self._newest_us: dict[str, int] = {}
        network.add_source(self.estimate, ESTIMATE)
        self._out = {name: self._source(name) for name in LABELS}

    @classmethod
    def of(cls, ports: Ports, _parts: PartRegistry) -> "VehicleStreams":
        """Build it from the ports and parts of a platform."""
        return cls(ports.unit, ports.network, ports.translation, ports.config.period_us, ports.note)

    def _source(self, name: str) -> Consumer:
        """A new source for a label; it takes samples in the label's units."""
        local = self._translation.local_label(name, self._unit)
        self._network.add_source(local, self._translation.local_sort(name))
        return self._translation.to_local(name).into(partial(self._network.push, local))

    def entries(self) -> list[LabelEntry]:
        """The semantic labels this platform offers."""
        ontology = self._translation.ontology
        return [ontology.entry(name, self.period_us) for name in LABELS]

    def on_report(self, report: Report, now_us: int) -> Sequence[Sample]:
        """Take a report of the vehicle; samples that are due go through the network at once."""
        if isinstance(report, HomeReport):
            self._home = report
        elif isinstance(report, BatteryReport):
            self._battery = report
        found = self._push(self.filter.on_report(report, now_us), now_us)
        if isinstance(report, HomeReport | BatteryReport) and self.filter.health.state == "stale":
            self._push_others(report.valid_us - report.valid_us % self.period_us, None, now_us)
        return found

    def on_time(self, now_us: int) -> Sequence[Sample]:
        """Put out the estimates that are due."""
        return self._push(self.filter.on_time(now_us), now_us)

    @property
    def deadline_us(self) -> int | None:
        return self.filter.deadline_us

    def _push(self, samples: Sequence[Sample], now_us: int) -> Sequence[Sample]:
        self._note_health(now_us)
        for sample in samples:
            estimate = sample.available_at(now_us)
            with self._network.instant.whole():  # its parts first: who takes the estimate finds them there
                for name, part in _PARTS.items():
                    self._out[name](part(estimate))
                self._network.push(self.estimate, estimate)
            self._push_others(sample.valid_us, sample.value, now_us)
        return samples

    def _note_health(self, now_us: int) -> None:
        state, reason, _ = self.filter.health
        if (state, reason) == self._health:
            return
        self._health = (state, reason)
        if not self._changes.take(now_us):
            self._unnoted += 1
            return
        text = "position " + (f"{state}: {reason}" if state == "stale" else reason or state)
        self._on_health(text + (f" ({self._unnoted} changes before it were not noted)" if self._unnoted else ""))
        self._unnoted = 0

    def _push_others(self, valid_us: int, estimate: Estimate | None, now_us: int) -> None:
        """Push home and battery, which are not estimated, and the height, which is that of the estimate above home."""
        home, battery = self._home, self._battery
        if home is not None and estimate is not None:
            height_m = estimate.altitude_m - home.altitude_m
            self._put("heli-height", valid_us, (height_m,), now_us, independent(estimate.var_d))
        if home is not None:
            self._put("heli-home", valid_us, (home.latitude_deg, home.longitude_deg, home.altitude_m), now_us)
        if battery is not None and valid_us - battery.valid_us <= BATTERY_KEPT_US:
            self._put("battery", valid_us, (battery.fraction,), now_us)

    def _put(self, name: str, valid_us: int, value: Value, now_us: int, quality: Quality = SURE) -> None:
        """Push a sample, if it is newer than the last one."""
        if valid_us > self._newest_us.get(name, -1):
            self._newest_us[name] = valid_us
            self._out[name](Sample(now_us, valid_us, value, quality))


def _position(sample: Sample) -> Sample:
    estimate: Estimate = sample.value
    north_m, east_m = metres_per_degree(estimate.latitude_deg)
    quality = independent(estimate.var_n / north_m**2, estimate.var_e / east_m**2)
    return Sample(*sample[:2], (estimate.latitude_deg, estimate.longitude_deg), quality)


def _altitude(sample: Sample) -> Sample:
    estimate: Estimate = sample.value
    return Sample(*sample[:2], (estimate.altitude_m,), independent(estimate.var_d))


def _velocity(sample: Sample) -> Sample:
    estimate: Estimate = sample.value
    value = estimate.north_m_s, estimate.east_m_s, estimate.down_m_s
    return Sample(*sample[:2], value, independent(estimate.var_vn, estimate.var_ve, estimate.var_vd))


_PARTS = {"heli-position": _position, "heli-altitude": _altitude, "heli-velocity": _velocity}
"""The sample of a label from one of the estimate, in the ontology's units, the covariance in their squares."""


class WinchStream(Part):
    """The winch of the vehicle as a stream: how much line is out, and what hangs on it.

    A vehicle has a winch once it has reported one; from then on the platform offers the stream. A winch without a scale has
    none: its load is not known.

    Args:
        offer: called when there is a winch.
    """

    takes = {Reported: "on_reported"}  # noqa: RUF012  (a declaration)

    def __init__(self, ports: Ports, _parts: PartRegistry) -> None:
        self._clock, self._network, self._translation = ports.clock, ports.network, ports.translation
        self._offer = ports.offer
        self._label, self._to_local = ports.translation.local_label(LOAD, ports.unit), ports.translation.to_local(LOAD)
        self._newest_us = -1
        self._is_offered = False

    def labels(self) -> Iterable[LabelEntry]:
        return [self._translation.ontology.entry(LOAD, WINCH_PERIOD_US)] if self._is_offered else []

    def on_reported(self, event: Reported, now_us: int) -> Followed:
        """Make a sample of it; the pilot takes the report, too."""
        report = event.report
        if not isinstance(report, WinchReport) or report.load_kg is None or report.line_m is None:
            return NOT_MINE
        if report.valid_us <= self._newest_us:
            return NOT_MINE
        self._newest_us = report.valid_us
        if not self._is_offered:
            self._is_offered = True
            self._network.add_source(self._label, self._translation.local_sort(LOAD))
            self._offer(now_us)
        load = Sample(self._clock.federation_us(now_us), report.valid_us, (report.load_kg, report.line_m))
        self._network.push(self._label, self._to_local.sample(load))
        return NOT_MINE
