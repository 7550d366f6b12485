"""Samples of others are in the ranges of their units before anything is made of them."""

import pytest

from dyknow import NO_VALUE, Field, Sort
from dyknow.federation.sharing.ontology import default_ontology
from dyknow.federation.sharing.ranges import _MOST, in_range
from dyknow.model.errors import SortError
from dyknow.model.instants import LATEST_S

LABELS = sorted(default_ontology())


def value_of(sort, numbers):
    """A value of a record sort, its numbers given by unit."""
    plain = {"text": "a", "bool": False}
    return tuple(plain[field.unit] if field.unit in plain else numbers(field.unit) for field in sort.fields)


@pytest.mark.parametrize("label", LABELS)
def test_each_number_of_each_label_has_a_range(label):
    sort = default_ontology()[label].sort
    is_in_range = in_range(sort)
    for sign in (1.0, -1.0):
        at_most = value_of(sort, lambda unit, sign=sign: sign * _MOST[unit])
        sort.check(at_most)
        assert is_in_range(at_most)
        for at, field in enumerate(sort.fields):
            if field.unit in _MOST:
                beyond = (*at_most[:at], sign * _MOST[field.unit] * 1.001, *at_most[at + 1 :])
                assert not is_in_range(beyond), field


def test_no_value_a_truth_and_a_text_have_no_range():
    sort = Sort("a", (Field("symbol", "text"), Field("x_m", "m"), Field("end", "bool")))
    for value in (NO_VALUE, ("a", NO_VALUE, True), ("a", 1, False)):
        sort.check(value)
        assert in_range(sort)(value)
    assert not in_range(sort)(("a", 10**9, False))


def test_a_simple_value_is_in_the_range_of_its_unit():
    seconds = in_range(Sort("age", unit="s"))
    assert seconds(LATEST_S)
    assert not seconds(2 * LATEST_S)
    assert in_range(Sort("words", unit="text"))("x")


@pytest.mark.parametrize("number", [1.1e30, -1.1e30, 1e303, float("inf"), float("nan")])
def test_no_stream_has_a_number_that_products_would_not_bear(number):
    for sort, value in (
        (Sort("a", unit="furlong"), number),
        (Sort("a"), number),
        (Sort("a", (Field("b", ""),)), (number,)),
    ):
        with pytest.raises(SortError):
            sort.check(value)
