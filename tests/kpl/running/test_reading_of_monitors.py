"""What can be said of what formulas read before anything runs."""

from dyknow.kpl import Known, parse_specification
from dyknow.model.errors import SourceText
from tests.kpl.specifications import check_specification

SPECIFICATION = """\
source names cars
source speed radar
strmgen car_ids = cars
strmgen speed[car1] = radar
define fast[c] = speed[c] > 30
define MIN_XY = 15.0
"""


def warnings(monitor: str) -> list[tuple[str, str]]:
    text = f"{SPECIFICATION}monitor watched = {monitor}\n"
    found = check_specification(parse_specification(text), Known(), SourceText(text, "mission.kpl"))
    assert not found.errors
    return [(each.message, each.repair) for each in found.warnings]


def test_what_a_quantifier_ranges_over_is_asked_for() -> None:
    assert warnings("always forall c in car_ids: not fast[c]") == []


def test_what_is_derived_from_units_is_there_without_a_stream() -> None:
    said = [said for said, _ in warnings("always (xy_dist[self, 1] >= MIN_XY and speed[car1] != 30)")]
    assert said == ["car_ids has no subscriber here"]


def test_a_feature_that_nothing_makes_is_a_warning_with_what_may_have_been_meant() -> None:
    assert ("nothing here makes sped, so that its value stays unknown", "speed[car1]") in warnings(
        "always sped[car1] < 30"
    )
