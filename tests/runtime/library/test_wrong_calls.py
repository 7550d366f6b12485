"""What a program gives wrongly is refused as an error of this project."""

import pytest

import dyknow
from dyknow.documents.durations import duration_us
from dyknow.model.errors import WrongCall
from dyknow.runtime.configuration.instants import instant_us


@pytest.mark.parametrize("units", ["a.py", ("a.py",), ["a.py"]])
def test_one_module_or_several(units) -> None:
    assert dyknow.join("7", units=units)._process.config.modules == ("a.py",)


@pytest.mark.parametrize("units", [3, {"a.py": 1}, (3,), None])
def test_units_are_modules(units) -> None:
    with pytest.raises(WrongCall, match="units are modules"):
        dyknow.join("7", units=units)


@pytest.mark.parametrize("given", [0.2, None, 5, ("1s",)])
def test_a_period_is_a_text_with_a_unit(given) -> None:
    with pytest.raises(WrongCall, match="is not a duration"):
        duration_us(given, option="every")


@pytest.mark.parametrize("given", [None, 0.5, (1,)])
def test_an_instant_is_a_text_or_microseconds(given) -> None:
    assert instant_us("17", 0, option="at") == 17
    with pytest.raises(WrongCall, match="is not an instant"):
        instant_us(given, 0, option="at")
