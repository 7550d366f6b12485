"""The library as specifications use it."""

import pytest

from dyknow import Field, Network, Sample, Sort
from dyknow.compunits import library
from dyknow.kpl import Hooks, Instance, parse_specification
from dyknow.model.errors import TextErrors
from tests.compunits.test_motion import HERE, moved

POSITION = Sort("position", (Field("latitude_deg", "deg"), Field("longitude_deg", "deg")))


def running(text: str) -> tuple[Instance, list]:
    made: list = []
    hooks = Hooks(on_output=lambda name, sample: made.append((name, sample)))
    instance = Instance(Network(), sorts={"position": POSITION}, prototypes=library().values(), hooks=hooks)
    instance.add(parse_specification(text), 0, text)
    return instance, made


def fed(instance: Instance, seconds: int) -> None:
    for i in range(seconds):
        instance.push("gps", Sample(i * 1_000_000, i * 1_000_000, moved(HERE, 10.0 * i, 0.0)))


def test_a_chain_of_ready_units_runs() -> None:
    instance, made = running(
        """
        source position gps
        compunit speed MovingAverage(speed)
        compunit kmh MetresPerSecondToKilometresPerHour(speed)
        compunit position KalmanPosition(position)
        strmgen pos[car] = gps
        strmgen speed[car] = SpeedEst(pos[car])
        strmgen smooth[car] = MovingAverage(speed[car])
        strmgen kmh[car] = MetresPerSecondToKilometresPerHour(smooth[car])
        strmgen estimate[car] = KalmanPosition(pos[car])
        stream speeds = kmh[car]
        stream positions = estimate[car]
        """
    )
    fed(instance, 10)
    speeds = [sample.value for name, sample in made if name == "speeds"]
    positions = [sample for name, sample in made if name == "positions"]
    assert speeds == pytest.approx([36.0] * 9, rel=1e-3)
    assert len(positions) == 10
    assert all(sample.quality.covariance for sample in positions)


def test_a_unit_for_any_sort_has_the_sorts_it_is_declared_with() -> None:
    with pytest.raises(TextErrors, match="MovingAverage takes speed here; pos"):
        running(
            """
            source position gps
            compunit speed MovingAverage(speed)
            strmgen pos[car] = gps
            strmgen smooth[car] = MovingAverage(pos[car])
            stream out = smooth[car]
            """
        )
    with pytest.raises(TextErrors, match="MovingAverage is implemented with other sorts"):
        running("compunit speed MovingAverage(position)")


def test_a_unit_for_any_sort_that_is_not_declared_is_told_with_the_repair() -> None:
    with pytest.raises(TextErrors, match=r"name its sorts\n(.*\n)*.*write: compunit sort MovingAverage\(sort\)"):
        running(
            """
            source position gps
            strmgen pos[car] = gps
            strmgen smooth[car] = MovingAverage(pos[car])
            stream out = smooth[car]
            """
        )
