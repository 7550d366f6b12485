"""Pictures as SVG are those of the pages, and hold whatever names there are."""

from pathlib import Path
from xml.etree import ElementTree as ET

from dyknow.anchoring.matching.candidates import ObservedProperty
from dyknow.anchoring.matching.descriptions import AllowedValues, ObjectDescription
from dyknow.anchoring.matching.files import read_matching
from dyknow.anchoring.matching.situations import MatchingOptions, classify
from dyknow.console.output.drawings import plan_svg, situation_svg
from dyknow.planning.contingent.files import read_recovery
from dyknow.planning.contingent.recovery_planning import RecoveryPlan, plan_recovery

ROOT = Path(__file__).parents[3]


def test_the_pictures_of_the_pages_are_those_of_their_examples() -> None:
    case = read_recovery((ROOT / "examples/matching/mark.json").read_text())
    found = plan_recovery(case.problem, case.value)
    assert isinstance(found, RecoveryPlan)
    assert plan_svg(found.plan) == (ROOT / "docs/figures/recovery.svg").read_text()
    given = read_matching((ROOT / "examples/matching/reacquire.json").read_text())
    situation = classify(given.description, given.percepts, given.options)
    assert situation_svg(situation) == (ROOT / "docs/figures/matching.svg").read_text()


def test_names_that_look_like_markup_are_text() -> None:
    description = ObjectDescription({"<b>": AllowedValues(((True, 1.0),))})
    situation = classify(description, {"a&b": {"<b>": ObservedProperty(False)}}, MatchingOptions())
    drawn = ET.fromstring(situation_svg(situation))
    assert {"<b>", "a&b"} <= {each.text for each in drawn}
    assert len(ET.fromstring(situation_svg(classify(description, {}, MatchingOptions())))) == 2
