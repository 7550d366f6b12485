"""The cameras of the platform's vehicle as a part: their state and the percepts are streams that the platform offers."""

from collections import Counter
from collections.abc import Iterable, Mapping
from math import degrees, sqrt

from dyknow import NO_VALUE, Label, Policy, Sample, Value
from dyknow.agents.capabilities.cameras.perception import Perception
from dyknow.agents.capabilities.flight.vehicle_streams import VehicleStreams
from dyknow.agents.effects import Reported
from dyknow.agents.exchange.export_proxy import ExportProxy
from dyknow.agents.part import NOT_MINE, Followed, Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.anchoring.links.structures import Percept
from dyknow.federation.messages.descriptions import ConditionEntry, LabelEntry
from dyknow.navigation.cameras.channels import PERSON
from dyknow.navigation.cameras.state import CameraState
from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.vehicle import AttitudeReport, ImageReport, MountReport

PERCEPTS, STATE, VIEW, PERSONS = "vision-percepts", "camera-state", "camera-view", "person-percepts"
"""Semantic labels."""
CHANNELS = ("thermal", "colour")
"""Channels of detectors of persons."""
PERIOD_US = 100_000
BLIND_US = 5_000_000
"""After so long without any image of known place that is a condition."""
COUNTED_US = 10_000_000
"""Percepts left out are a condition at once, with those left out until then; it is looked at again after so long."""


class Cameras(Part):
    """Takes images, attitudes and angles of the mount as they are reported; times of streams are federation time.

    Args:
        streams: of the vehicle; its estimates are the platform's own position.
        exporter: sheds streams while there is too much to do; then fewer images are looked at.
        offer: called when the condition changes.

    Attributes:
        perception: makes percepts of images.
    """

    takes = {Reported: "on_reported"}  # noqa: RUF012  (a declaration)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._frame, self._clock, self._network = ports.config.rig.frame, ports.clock, ports.network
        self._translation = ports.translation
        self._exporter, self._note, self._offer = parts[ExportProxy.of], ports.note, ports.offer
        self.perception = Perception(ports.config.rig, f"vp{ports.config.unit}_")
        names = (PERCEPTS, STATE, VIEW, PERSONS)
        self._percepts, self._state, self._view, self._persons = (
            ports.translation.local_label(name, ports.config.unit) for name in names
        )
        self._scored: dict[str, tuple[Value, ...]] = {}
        self._to_local = {name: ports.translation.to_local(name) for name in names}
        self._places: dict[str, tuple[Value, ...]] = {}
        self._images = 0
        self._images_us: int | None = None
        self._seen_us: int | None = None
        self._blind: ConditionEntry | None = None
        self._lossy: ConditionEntry | None = None
        self._counted = Counter[str]()
        self._counted_us: int | None = None
        self._has_scored = False
        for name in names:
            ports.network.add_source(
                ports.translation.local_label(name, ports.config.unit), ports.translation.local_sort(name)
            )
        ports.network.connect(parts[VehicleStreams.of].estimate, Policy(), self._on_estimate)

    def labels(self) -> Iterable[LabelEntry]:
        ontology = self._translation.ontology
        return [
            ontology.entry(name, period_us)
            for name, period_us in ((PERCEPTS, 0), (STATE, PERIOD_US), (VIEW, 0), (PERSONS, 0))
            if name != PERSONS or self._has_scored
        ]

    def conditions(self) -> Iterable[ConditionEntry]:
        return [each for each in (self._blind, self._lossy) if each is not None]

    def _on_estimate(self, sample: Sample) -> None:
        if sample.value is not NO_VALUE:
            self.perception.on_estimate(sample.valid_us, sample.value)

    def on_reported(self, event: Reported, now_us: int) -> Followed:
        """Images and angles of the mount are for this part alone, attitudes for others, too."""
        report = event.report
        if isinstance(report, ImageReport):
            self._images += 1
            if self._images % self._exporter.shed == 0:
                self.perception.on_image(report)
                self._images_us = now_us if self._images_us is None else self._images_us
            return (self,)
        if isinstance(report, MountReport):
            self.perception.on_mount(report)
            self._see(now_us)
            return None
        if isinstance(report, AttitudeReport):
            self.perception.on_attitude(report)
        return NOT_MINE

    @property
    def deadline_us(self) -> int | None:
        due_us = self.perception.deadline_us
        return None if due_us is None else self._clock.wall_us(due_us)

    def on_time(self, now_us: int) -> None:
        """Look at images that have waited long enough."""
        due_us = self.deadline_us
        if due_us is not None and now_us >= due_us:
            self._see(now_us)

    def _see(self, now_us: int) -> None:
        federation_us = self._clock.federation_us(now_us)
        self._push_state(federation_us)
        for valid_us, percepts, view_m in self.perception.looks(federation_us):
            with self._network.instant.whole():
                if view_m is not None:
                    self._push(self._view, VIEW, valid_us, tuple(view_m.reshape(-1).tolist()), federation_us)
                for percept in percepts:
                    self._push(self._percepts, PERCEPTS, valid_us, self._record(percept), federation_us)
                    self._push_person(valid_us, percept, federation_us, now_us)
        self._judge(now_us)

    def _push_person(self, valid_us: int, percept: Percept, federation_us: int, now_us: int) -> None:
        """Push the percepts that detectors of persons have scored; the stream is offered from the first of them on."""
        record = person_record(percept)
        if record is None:
            before = self._scored.pop(percept.symbol, None)
            record = None if before is None or percept.state is not None else (*before[:-1], True)
        else:
            self._scored[percept.symbol] = record
        if record is None:
            return
        if not self._has_scored:
            self._has_scored = True
            self._offer(now_us)
        self._push(self._persons, PERSONS, valid_us, record, federation_us)

    def _push_state(self, federation_us: int) -> None:
        """The state of the cameras on the grid of its period, as soon as it is known."""
        known_us = self.perception.known_us
        if known_us is None:
            return
        valid_us = known_us - known_us % PERIOD_US
        state = self.perception.state(valid_us) if self._seen_us is None or valid_us > self._seen_us else None
        if state is not None:
            self._seen_us = valid_us
            self._push(self._state, STATE, valid_us, _camera_state(state, self._frame), federation_us)

    def _push(self, label: Label, name: str, valid_us: int, value: Value, now_us: int) -> None:
        self._network.push(label, self._to_local[name].sample(Sample(now_us, valid_us, value)))

    def _record(self, percept: Percept) -> Value:
        """A percept as a value of its label; the last one of a percept is where it was before."""
        state = percept.state
        if state is None:
            return (*self._places.pop(percept.symbol), True)
        colour = state.attributes.get("colour", NO_VALUE)
        place = (percept.symbol, state.x_m, state.y_m, state.deviation_m / sqrt(2.0), colour)
        self._places[percept.symbol] = place
        return (*place, False)

    def _judge(self, now_us: int) -> None:
        """Show that images come and their place is not known, for as long as that is so."""
        self._count(now_us)
        last_us = self.perception.placed_us
        since_us = self._images_us if last_us is None else self._clock.wall_us(last_us)
        is_blind = since_us is not None and self._images_us is not None and now_us - since_us > BLIND_US
        if is_blind == (self._blind is not None):
            return
        text = f"cameras: no percepts: {_counts(self.perception.left_out) or 'no images'}"
        self._blind = ConditionEntry(text=text[:200], since_us=now_us) if is_blind else None
        self._note(text if is_blind else "cameras: percepts come again")
        self._offer(now_us)

    def _count(self, now_us: int) -> None:
        """Show that images or detections are left out while others are taken; those before the first do not count."""
        if self.perception.placed_us is None or (
            self._counted_us is not None and now_us < self._counted_us + COUNTED_US
        ):
            return
        before, self._counted = self._counted, +self.perception.left_out
        if self._counted_us is None:
            self._counted_us = now_us - COUNTED_US
            return
        new = self._counted - before
        if not new and self._lossy is None:
            return
        self._counted_us = now_us
        text = f"cameras: left out: {_counts(self._counted)}"
        self._lossy = ConditionEntry(text=text[:200], since_us=now_us) if new else None
        self._note(text if new else "cameras: nothing is left out any longer")
        self._offer(now_us)


def person_record(percept: Percept) -> tuple[Value, ...] | None:
    """A percept as a value of `person-percepts`; None: no detector of persons has scored it."""
    state = percept.state
    if state is None:
        return None
    found = [state.attributes.get(f"{name} {channel}", NO_VALUE) for name in (PERSON, "image") for channel in CHANNELS]
    if found[0] is NO_VALUE and found[1] is NO_VALUE:
        return None
    covariance = state.covariance
    spread = float(covariance[0, 0]), float(covariance[0, 1]), float(covariance[1, 1])
    return (percept.symbol, state.x_m, state.y_m, *spread, *found, False)


def _counts(left_out: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {why}" for why, count in sorted(left_out.items()) if count)


def _camera_state(state: CameraState, frame: LocalFrame) -> Value:
    """Where the camera is, and where the middle of its image is: from north, and down from the horizon."""
    pose = state.pose
    latitude_deg, longitude_deg, altitude_m = frame.from_ned(*pose.position_m.tolist())
    bearing_rad = pose.attitude.yaw_rad + pose.mount.pan_rad
    return latitude_deg, longitude_deg, altitude_m, degrees(bearing_rad) % 360.0, degrees(pose.mount.tilt_rad)
