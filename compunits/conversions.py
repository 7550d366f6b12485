"""One unit of measure for another: y = scale x + offset, of each component, and of the covariance scale^2.

They take numbers and records of numbers of any sort, and give such of the sort they are declared with. `conversion`
makes more of them.
"""

import math
from collections.abc import Mapping
from typing import Final

from dyknow import NO_VALUE, Quality, Sample, UnitPrototype, computational_unit, variant
from dyknow.compunits.numeric import in_shape_of, numbers_of

FACTORS: Final[Mapping[str, tuple[float, float]]] = {
    "CelsiusToKelvin": (1.0, 273.15),
    "DegreesToRadians": (math.pi / 180.0, 0.0),
    "FeetToMetres": (0.3048, 0.0),
    "FeetPerMinuteToMetresPerSecond": (0.3048 / 60.0, 0.0),
    "FractionToPercent": (100.0, 0.0),
    "KelvinToCelsius": (1.0, -273.15),
    "KilometresPerHourToMetresPerSecond": (1.0 / 3.6, 0.0),
    "KilometresToMetres": (1000.0, 0.0),
    "KnotsToMetresPerSecond": (1852.0 / 3600.0, 0.0),
    "MetresPerSecondToFeetPerMinute": (60.0 / 0.3048, 0.0),
    "MetresPerSecondToKilometresPerHour": (3.6, 0.0),
    "MetresPerSecondToKnots": (3600.0 / 1852.0, 0.0),
    "MetresToFeet": (1.0 / 0.3048, 0.0),
    "MetresToKilometres": (0.001, 0.0),
    "MetresToNauticalMiles": (1.0 / 1852.0, 0.0),
    "MillisecondsToSeconds": (0.001, 0.0),
    "NauticalMilesToMetres": (1852.0, 0.0),
    "PercentToFraction": (0.01, 0.0),
    "RadiansToDegrees": (180.0 / math.pi, 0.0),
    "SecondsToMilliseconds": (1000.0, 0.0),
}
"""Name: (scale, offset), by the definitions of the units."""


@computational_unit("?to", "?from", samplewise=True)
class Conversion:
    """scale x + offset; an input that is not made of finite numbers has no value."""

    def __init__(self, scale: float = 1.0, offset: float = 0.0) -> None:
        if not (math.isfinite(scale) and math.isfinite(offset)):
            raise ValueError(f"a conversion is scale * value + offset of finite numbers, got {scale!r}, {offset!r}")
        self._scale, self._offset = scale, offset

    def __call__(self, now_us: int, sample: Sample) -> Sample:
        numbers = numbers_of(sample.value)
        if numbers is None:
            return Sample(now_us, sample.valid_us, NO_VALUE, sample.quality)
        made = in_shape_of(sample.value, [self._scale * each + self._offset for each in numbers])
        return Sample(now_us, sample.valid_us, made, self._scaled(sample.quality))

    def _scaled(self, quality: Quality) -> Quality:
        if not quality.covariance:
            return quality
        squared = self._scale * self._scale
        return quality._replace(covariance=tuple([tuple([squared * v for v in row]) for row in quality.covariance]))


def conversion(name: str, scale: float, offset: float = 0.0, *sorts: str) -> UnitPrototype:
    """A conversion of your own; `sorts` are those of the output and the input, any if they are not given."""
    return variant(Conversion, name, *sorts, scale=scale, offset=offset)


CONVERSIONS: Final = tuple([conversion(name, scale, offset) for name, (scale, offset) in FACTORS.items()])
