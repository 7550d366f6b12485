"""Images in, percepts out: detections, put on the ground, fused over the cameras and tracked. Pure.

An image waits until position, attitude and mount are known up to its time, at most `PATIENCE_US`: then they are predicted,
or, where too little is known, the image is left out and counted by reason.
"""

from collections import Counter, deque
from functools import reduce
from math import isfinite
from typing import Final, NamedTuple

from dyknow import Value
from dyknow.anchoring.belief.cameras import camera_view
from dyknow.anchoring.links.structures import Percept
from dyknow.anchoring.percepts.tracking import PerceptTracker
from dyknow.navigation.cameras.channels import PERSON, Detection, GroundDetection, fused, located
from dyknow.navigation.cameras.ground import FlatGround
from dyknow.navigation.cameras.pinhole import FloatArray, PanTilt, Pixel
from dyknow.navigation.cameras.rig import CameraRig
from dyknow.navigation.cameras.state import CameraState, CameraStateEstimator
from dyknow.navigation.fusion import Estimate
from dyknow.navigation.vehicle import AttitudeReport, ImageDetection, ImageReport, MountReport

PATIENCE_US: Final = 250_000
MOST_WAITING: Final = 16
MOST_DETECTIONS: Final = 200
"""Most detections in the images of one instant; the others are left out."""
LONGEST_TEXT: Final = 32
"""Characters of an attribute."""


class ImageLook(NamedTuple):
    """The percepts of one image.

    Attributes:
        view_m: (4, 2) corners, east and north, of the ground that percepts of this time are of; None: no percepts were due,
            or no ground is in view.
    """

    valid_us: int
    percepts: list[Percept]
    view_m: FloatArray | None


class Perception:
    """The cameras of one vehicle.

    Args:
        rig: which cameras there are.
        prefix: of the symbols of percepts.

    Attributes:
        left_out: images and detections that nothing became of, by reason.
        looked_at: how many images were put on the ground.
        placed_us: the time of the newest image of known place; None before the first.
    """

    def __init__(self, rig: CameraRig, prefix: str) -> None:
        self._rig = rig
        self._estimator = CameraStateEstimator(rig.frame, errors=rig.errors, is_level=True)
        self._tracker = PerceptTracker(prefix=prefix)
        self._ground = FlatGround()
        self._waiting: deque[ImageReport] = deque()
        self._newest_us = -1
        self.looked_at = 0
        self.placed_us: int | None = None
        self.left_out: Counter[str] = Counter()

    def on_estimate(self, valid_us: int, estimate: Estimate) -> None:
        """Take the fused position of the platform."""
        self._estimator.on_estimate(valid_us, estimate)

    def on_attitude(self, report: AttitudeReport) -> None:
        """Take an attitude; an attitude with NaN or infinite angles is left out."""
        if all(map(isfinite, report[2:])):
            self._estimator.on_attitude(report)

    def on_mount(self, report: MountReport) -> None:
        """Take the angles of the mount; angles that are not numbers are left out."""
        if isfinite(report.pan_rad) and isfinite(report.tilt_rad):
            self._estimator.on_mount(report.valid_us, PanTilt(report.pan_rad, report.tilt_rad))
        else:
            self.left_out["mount without angles"] += 1

    def on_image(self, report: ImageReport) -> None:
        """Take the detections in the images of an instant; late and repeated ones are left out."""
        if report.valid_us <= self._newest_us:
            self.left_out["image out of order"] += 1
            return
        self._newest_us = report.valid_us
        if len(self._waiting) == MOST_WAITING:
            self._waiting.popleft()
            self.left_out["too many images"] += 1
        self._waiting.append(report)

    def state(self, valid_us: int) -> CameraState | None:
        """Where the cameras are and look; None: it is not known for that time."""
        return self._estimator.at(valid_us)

    @property
    def known_us(self) -> int | None:
        """The newest time at which the state of the cameras need not be predicted; None: it was never known."""
        return self._estimator.whole_until_us

    @property
    def deadline_us(self) -> int | None:
        """When the first image that waits is taken as it is."""
        return self._waiting[0].valid_us + PATIENCE_US if self._waiting else None

    def looks(self, now_us: int) -> list[ImageLook]:
        """The images that wait no longer and brought percepts, or would have shown them."""
        found: list[ImageLook] = []
        until_us = self.known_us
        while self._waiting:
            valid_us = self._waiting[0].valid_us
            if now_us < valid_us + PATIENCE_US and (until_us is None or until_us < valid_us):
                break
            image = self._waiting.popleft()
            state = self._estimator.at(valid_us)
            if state is None:
                self.left_out["camera state unknown"] += 1
                continue
            self.looked_at += 1
            self.placed_us = valid_us
            made = self._tracker.on_detections(valid_us, self._on_ground(image, state))
            view_m = self._view_m(state) if self._tracker.reported_us == valid_us else None
            if made or view_m is not None:
                found.append(ImageLook(valid_us, made, view_m))
        return found

    def _view_m(self, state: CameraState) -> FloatArray | None:
        """Of the camera that sees most."""
        widest = max(self._rig.cameras.values(), key=lambda each: each.width_px / each.focal_px, default=None)
        return None if widest is None else camera_view(widest, state.pose, self._ground)

    def _on_ground(self, image: ImageReport, state: CameraState) -> list[GroundDetection]:
        cameras = self._rig.cameras
        seen: dict[str, list[Detection]] = {name: [] for name in cameras}
        for each in image.detections[:MOST_DETECTIONS]:
            camera = cameras.get(each.channel)
            if camera is None or not (0.0 <= each.u_px <= camera.width_px and 0.0 <= each.v_px <= camera.height_px):
                self.left_out["detection outside of every image"] += 1
                continue
            seen[each.channel].append(
                Detection(each.channel, Pixel(each.u_px, each.v_px), _attributes(image.valid_us, each))
            )
        self.left_out["too many detections"] += max(0, len(image.detections) - MOST_DETECTIONS)
        places = [located(one, cameras, state, self._ground) for one in seen.values()]
        return reduce(fused, places)


def _attributes(valid_us: int, detection: ImageDetection) -> dict[str, Value]:
    """Texts, cut off; the score of a detection that may be a person, with its place and image, by channel."""
    found: dict[str, Value] = {}
    for name, value in detection.attributes:
        if isinstance(value, str):
            found[name] = value[:LONGEST_TEXT]
        elif name == PERSON and isinstance(value, float) and 0.0 <= value <= 1.0:
            found[f"{PERSON} {detection.channel}"] = value
            place = f"@{detection.u_px:.0f},{detection.v_px:.0f}"
            found[f"image {detection.channel}"] = f"{detection.channel}/{valid_us}{place}"
    return found
