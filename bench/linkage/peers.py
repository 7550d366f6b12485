"""What ours is compared with, on the same percepts: norfair over a grid of settings, and a new object per percept."""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any, NamedTuple, Protocol

import norfair
import numpy as np
from norfair.filter import OptimizedKalmanFilterFactory

from bench.linkage.scores import Shown, Track
from dyknow.sim_uavs.roads.percepts import SeenPercept


class Looked(Protocol):
    """One instant, and the percepts of it, whatever the truth of it is."""

    @property
    def t_us(self) -> int: ...
    @property
    def percepts(self) -> Sequence[SeenPercept]: ...


class Setting(NamedTuple):
    """Of norfair.

    Attributes:
        reach_m: the largest distance of a match.
        keeps_s: how long a track lives without a match (`hit_counter_max`).
        delay_s: how long it takes to become one (`initialization_delay`).
        trusts: R of its Kalman filter, the variance of a measurement in its units.
        ids: whether a percept that continues matches the track it was matched with before, wherever it is.
    """

    reach_m: float
    keeps_s: float
    delay_s: float
    trusts: float
    ids: bool


GRID = tuple(
    Setting(*each, trusts=1.0, ids=False) for each in product((5.0, 10.0, 20.0, 30.0), (1.0, 2.5, 5.0), (0.0, 0.4, 1.0))
)


def variants(setting: Setting) -> tuple[Setting, ...]:
    """The setting; with norfair's own R; with the percepts' names."""
    return setting, setting._replace(trusts=4.0), setting._replace(ids=True)


def per_percept(looks: Sequence[Looked]) -> list[Track]:
    """Each percept is an object of its own, and gone with it."""
    return [
        {percept.percept: Shown(percept.x_m, percept.y_m, True) for percept in look.percepts if not percept.end}
        for look in looks
    ]


def by_norfair(looks: Sequence[Looked], setting: Setting) -> list[Track]:
    """Every track that norfair reports, coasting ones included; seen is one that was matched at the look."""
    period_s = (looks[1].t_us - looks[0].t_us) / 1e6
    keeps = max(2, round(setting.keeps_s / period_s))

    def distance(detection: Any, track: Any) -> float:
        if track.last_detection.data[0] == detection.data[0]:
            return 0.0
        return float(np.linalg.norm(detection.points[0] - track.estimate[0]))

    tracker = norfair.Tracker(
        distance_function=distance if setting.ids else "euclidean",
        distance_threshold=setting.reach_m,
        hit_counter_max=keeps,
        initialization_delay=min(round(setting.delay_s / period_s), keeps - 1),
        filter_factory=OptimizedKalmanFilterFactory(R=setting.trusts),
    )
    return list(_tracks(tracker, looks))


def _tracks(tracker: Any, looks: Sequence[Looked]) -> Iterator[Track]:
    for look in looks:
        detections = [
            norfair.Detection(np.array([[percept.x_m, percept.y_m]]), data=(percept.percept, look.t_us))
            for percept in look.percepts
            if not percept.end
        ]
        tracks = tracker.update(detections)
        yield {f"n{track.id}": _shown(track, look.t_us) for track in tracks}


def _shown(track: Any, now_us: int) -> Shown:
    x_m, y_m = track.estimate[0].tolist()
    return Shown(x_m, y_m, track.last_detection.data[1] == now_us)
