import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import NO_VALUE, Quality, Sample
from dyknow.compunits import conversion
from dyknow.compunits.conversions import FACTORS
from tests.compunits.units import process, prototype, value_of

KNOWN = [
    ("CelsiusToKelvin", 20.0, 293.15),
    ("DegreesToRadians", 180.0, math.pi),
    ("FeetPerMinuteToMetresPerSecond", 196.8503937, 1.0),
    ("FeetToMetres", 1000.0, 304.8),
    ("FractionToPercent", 0.5, 50.0),
    ("KelvinToCelsius", 0.0, -273.15),
    ("KilometresPerHourToMetresPerSecond", 36.0, 10.0),
    ("KilometresToMetres", 1.5, 1500.0),
    ("KnotsToMetresPerSecond", 1.0, 0.514444),
    ("MillisecondsToSeconds", 250.0, 0.25),
    ("NauticalMilesToMetres", 2.0, 3704.0),
    ("PercentToFraction", 25.0, 0.25),
]


@pytest.mark.parametrize(("name", "given_value", "expected"), KNOWN)
def test_known_conversions(name, given_value, expected) -> None:
    assert value_of(name, given_value) == pytest.approx(expected)
    assert value_of(name, (given_value,)) == (pytest.approx(expected),)


@given(st.floats(-1e9, 1e9))
def test_every_conversion_leads_back(value) -> None:
    for name in FACTORS:
        back = "To".join(reversed(name.split("To")))
        assert value_of(back, value_of(name, value)) == pytest.approx(value, rel=1e-9, abs=1e-6)


def test_every_field_is_converted_and_the_covariance_with_them() -> None:
    quality = Quality(0.9, ((4.0, 1.0), (1.0, 2.0)))
    made = process("KilometresToMetres").on_sample(0, Sample(9, 3, (1.0, -2.0), quality), 9)
    assert made == Sample(9, 3, (1000.0, -2000.0), Quality(0.9, ((4e6, 1e6), (1e6, 2e6))))


def test_a_conversion_works_sample_by_sample_and_between_any_sorts() -> None:
    feet = prototype("FeetToMetres")
    assert feet.samplewise
    assert feet.fits("altitude", ["flight_level"])
    assert not feet.fits("altitude", ["a", "b"])


def test_a_user_makes_conversions() -> None:
    fahrenheit = conversion("FahrenheitToCelsius", 5 / 9, -160 / 9, "celsius", "fahrenheit")
    assert value_of(fahrenheit, 212.0) == pytest.approx(100.0)
    assert fahrenheit.fits("celsius", ["fahrenheit"])
    assert not fahrenheit.fits("celsius", ["kelvin"])
    with pytest.raises(ValueError, match="finite"):
        conversion("Wrong", math.nan)


def test_what_is_no_number_has_no_value() -> None:
    for value in (NO_VALUE, math.nan, "12", True, (1.0, None), (), 10**400):
        assert value_of("FeetToMetres", value) is NO_VALUE
    assert value_of("KilometresToMetres", 1e308) is NO_VALUE
