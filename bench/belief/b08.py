"""B8: association of scans with 10, 50 and 200 targets; ours, and JPDA with loopy belief propagation of Stone Soup.

Both get the same estimates at the beginning and the same detections, look for nothing new, and propagate beliefs; "exact" sums
small parts with cycles as the environment model usually does. Timed is what turns the detections of a scan, already objects
of each side, into estimates; accuracy is GOSPA of the positions, over all scans.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime, timedelta
from functools import partial
from importlib.util import find_spec
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.belief.scenes import ACCELERATION, NOISE_SD_M, P_D, SPEED_SD_M_S, TargetScene, gospa, scene
from bench.rows import Bar, Figures, Options, Ratio, Side
from dyknow.anchoring.belief.association.scans import EXACT_INSTANCES
from dyknow.anchoring.belief.description import (
    GaussianAttribute,
    InitialInstance,
    LifeThresholds,
    ObjectTypes,
    WorldModel,
    WorldSensor,
    uniform,
)
from dyknow.anchoring.belief.environment import EnvironmentModel
from dyknow.anchoring.belief.observations import WorldObservation

TITLE = "association of scans: N targets, P_D 0.9, clutter a share of N"
SCANS = {10: 20, 50: 8, 200: 2}
CLUTTER = (0.25, 1.0)
LEAST = {10: 20.0, 50: 200.0, 200: 200.0}
PEER = "stone-soup"
EXTRA = {PEER: "stonesoup"}
BARS: tuple[Bar, ...] = tuple(
    bar
    for targets, least in LEAST.items()
    for clutter in CLUTTER
    for bar in (
        Ratio(f"scans_s_{targets}_{clutter:g}", least, peer=PEER, at_least=True),
        Ratio(f"gospa_m_{targets}_{clutter:g}", 1.01, peer=PEER),
    )
)
Estimates = NDArray[np.float64]
Step = Callable[[int], Estimates]


def ours(recorded: TargetScene, exact_instances: int = 0) -> Step:
    """Estimates (N, 2) after each scan, by the environment model."""
    half = np.full(2, recorded.side_m / 2.0)
    place = GaussianAttribute("position_m", 2, 2, ACCELERATION, low=-half, high=half, rate_sd=(SPEED_SD_M_S,))
    radar = WorldSensor(
        "radar", P_D, 0.0, 0.0, recorded.clutter, {"position_m": NOISE_SD_M**2 * np.eye(2)}, is_frame=True
    )
    initial = [
        InitialInstance(f"t{number}", 1.0, {"position_m": (mean, recorded.covariance)})
        for number, mean in enumerate(recorded.mean)
    ]
    model = WorldModel(
        ObjectTypes(uniform("type", ("target",))), [place], sensors={"radar": radar},
        thresholds=LifeThresholds(0.1, 0.9, 1e-6), initial=initial,
    )  # fmt: skip
    environment = EnvironmentModel(model, 0, exact_instances=exact_instances)
    scans = [
        [WorldObservation(number * 1_000_000, "radar", {"position_m": each}) for each in scan.detections]
        for number, scan in enumerate(recorded.scans, start=1)
    ]

    def step(number: int) -> Estimates:
        environment.observe_scan(scans[number])
        return environment.table.gaussian["position_m"].mean[:, :2]

    return step


def stone_soup(recorded: TargetScene) -> Step:
    """The same by JPDAwithLBP, its mixtures reduced to their moments as in its tutorial."""
    from stonesoup.dataassociator.probability import JPDAwithLBP
    from stonesoup.functions import gm_reduce_single
    from stonesoup.hypothesiser.probability import PDAHypothesiser
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.types.array import StateVectors
    from stonesoup.types.detection import Detection
    from stonesoup.types.state import GaussianState
    from stonesoup.types.track import Track
    from stonesoup.types.update import GaussianStateUpdate
    from stonesoup.updater.kalman import KalmanUpdater

    begin = datetime(2026, 1, 1)  # noqa: DTZ001 - it has no zones
    order = [0, 2, 1, 3]  # x, its rate, y, its rate
    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(ACCELERATION), ConstantVelocity(ACCELERATION)])
    measured = LinearGaussian(ndim_state=4, mapping=(0, 2), noise_covar=NOISE_SD_M**2 * np.eye(2))
    updater = KalmanUpdater(measured)
    hypothesiser = PDAHypothesiser(
        predictor=KalmanPredictor(motion),
        updater=updater,
        clutter_spatial_density=recorded.clutter / recorded.side_m**2,
        prob_detect=P_D,
        prob_gate=0.9999,
    )
    associator = JPDAwithLBP(hypothesiser=hypothesiser)
    tracks = [
        Track([GaussianState(mean[order][:, None], recorded.covariance[np.ix_(order, order)], timestamp=begin)])
        for mean in recorded.mean
    ]
    scans = [
        (time, {Detection(each[:, None], timestamp=time, measurement_model=measured) for each in scan.detections})
        for number, scan in enumerate(recorded.scans, start=1)
        for time in [begin + timedelta(seconds=number)]
    ]

    def reduced(hypotheses: Any, time: datetime) -> Any:
        states = [updater.update(each) if each else each.prediction for each in hypotheses]
        mean, covariance = gm_reduce_single(
            StateVectors([each.state_vector for each in states]),
            np.stack([each.covar for each in states], axis=2),
            np.array([each.probability for each in hypotheses], dtype=float),
        )
        return GaussianStateUpdate(mean, covariance, hypotheses, time)

    def step(number: int) -> Estimates:
        time, detections = scans[number]
        found = associator.associate(set(tracks), detections, time)
        for track in tracks:
            track.append(reduced(found[track], time))
        return np.array([[float(track.state_vector[0]), float(track.state_vector[2])] for track in tracks])

    return step


@contextmanager
def sides(options: Options) -> Iterator[Mapping[str, Side]]:
    rounds = dict.fromkeys(("ours", "exact", PEER), 0)

    def side(name: str, begin: Callable[[TargetScene], Step]) -> Side:
        def run() -> Figures:
            rounds[name] += 1
            found: Figures = {}
            for targets, scans in SCANS.items():
                for clutter in CLUTTER:
                    many = max(1, round(scans * options.effort))
                    recorded = scene(targets, clutter, many, 1000 * targets + rounds[name])
                    step, errors, seconds = begin(recorded), [], 0.0
                    for number, scan in enumerate(recorded.scans):
                        began = perf_counter()
                        estimates = step(number)
                        seconds += perf_counter() - began
                        errors.append(gospa(scan.truth[:, :2], estimates))
                    found[f"scans_s_{targets}_{clutter:g}"] = many / seconds
                    found[f"gospa_m_{targets}_{clutter:g}"] = float(np.mean(errors))
            return found

        return run

    exact = partial(ours, exact_instances=EXACT_INSTANCES)
    found: dict[str, Side] = {"ours": side("ours", ours), "exact": side("exact", exact)}
    if find_spec(EXTRA[PEER]) is not None:
        found[PEER] = side(PEER, stone_soup)
    yield found
