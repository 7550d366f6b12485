"""The five cases of "Have another look", section 3."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.anchoring.matching.candidates import ObservationGates, ObservedProperty, PerceptProperties
from dyknow.anchoring.matching.descriptions import AllowedInterval, AllowedPlace, AllowedValues, ObjectDescription
from dyknow.anchoring.matching.situations import AnchoringSituation, MatchingOptions, classify
from tests.anchoring.matching.transcription import complete, partial, section_3

VALUES = {"shape": ["gasbottle", "box"], "colour": ["red", "green"], "mark": [True, False]}


def one_of(*values: str | bool | float) -> AllowedValues:
    return AllowedValues(tuple((value, 1.0) for value in values))


def percept(**observed: str | bool | float | None) -> PerceptProperties:
    return {name: None if value is None else ObservedProperty(value) for name, value in observed.items()}


def names(situation: AnchoringSituation) -> list[str]:
    return [each.percept for each in situation.anchors]


MARKED = ObjectDescription({"shape": one_of("gasbottle"), "mark": one_of(True)})
"""The gas bottle with a mark."""
SEEN = percept(shape="gasbottle", mark=True)
HALF_SEEN = percept(shape="gasbottle", mark=None)
OTHER = percept(shape="box", mark=None)


def test_200_random_situations_are_classified_as_the_transcription_of_section_3_does() -> None:
    cases = set()
    for seed in range(200):
        random = Random(seed)
        described = {
            name: random.sample(values, random.choice([1, 1, 2]))
            for name, values in VALUES.items()
            if random.random() < 0.8
        }
        unlike = random.choice([0.05, 0.3, 0.9])
        unseen = random.choice([0.0, 0.2, 0.5])
        percepts = {
            f"po{number}": {
                name: None
                if random.random() < unseen
                else random.choice(described.get(name, values) if random.random() > unlike else values)
                for name, values in VALUES.items()
            }
            for number in range(random.choice([0, 1, 1, 2, 3, 5]))
        }
        flags = {each: random.random() < 0.5 for each in ("is_definite", "is_reacquire", "is_cautious", "is_only_one")}
        expected = section_3(described, percepts, **flags)
        situation = classify(
            ObjectDescription({name: one_of(*values) for name, values in described.items()}, flags["is_definite"]),
            {name: percept(**values) for name, values in percepts.items()},
            MatchingOptions(
                "reacquire" if flags["is_reacquire"] else "find", flags["is_cautious"], flags["is_only_one"]
            ),
        )
        assert (situation.case, situation.result, set(names(situation)), situation.recovery) == expected, seed
        for match in situation.matches:
            is_complete = complete(described, percepts[match.percept])
            is_partial = partial(described, percepts[match.percept])
            assert match.status == ("complete" if is_complete else "partial" if is_partial else "none"), seed
        cases.add((expected[0], expected[1]))
    assert cases == {
        (1, "fail"),
        (2, "temporary"),
        (3, "anchor"),
        (4, "anchor"),
        (4, "temporary"),
        (5, "anchor"),
        (5, "fail"),
    }


def test_every_percept_and_property_has_its_reason() -> None:
    situation = classify(MARKED, {"po1": OTHER, "po2": HALF_SEEN}, MatchingOptions())
    assert situation.reasons() == (
        "po2: shape gasbottle is as described",
        "po2: mark was not observed, and is described as true",
        "po1: shape box contradicts the description, gasbottle",
        "po1: mark was not observed, and is described as true",
    )


def test_a_property_that_the_description_does_not_mention_is_ignored() -> None:
    situation = classify(MARKED, {"po1": percept(shape="gasbottle", mark=True, colour=None)}, MatchingOptions())
    assert (situation.case, names(situation)) == (3, ["po1"])


def test_a_property_of_low_confidence_is_unobserved_whether_it_agrees_or_not() -> None:
    for value in (True, False):
        doubtful = {"shape": ObservedProperty("gasbottle"), "mark": ObservedProperty(value, 0.4)}
        situation = classify(MARKED, {"po1": doubtful}, MatchingOptions())
        assert (situation.case, situation.recovery) == (2, "recover")
        assert "confidence 0.4 is below 0.5" in situation.reasons()[1]
        sure = MatchingOptions(gates=ObservationGates(confidence=0.3))
        assert classify(MARKED, {"po1": doubtful}, sure).case == (3 if value else 1)


def test_a_place_that_is_less_certain_than_its_gate_is_unobserved() -> None:
    near = ObjectDescription({"place": AllowedPlace((4.0, 2.0), 0.5)})
    drifted = {
        name: {"place": ObservedProperty(at, sd_m=2.0)} for name, at in (("po1", (4.0, 2.0)), ("po2", (9.0, 2.0)))
    }
    assert classify(near, drifted, MatchingOptions("reacquire")).case == 2
    sharp = {name: {"place": ObservedProperty(at, sd_m=0.1)} for name, at in (("po1", (4.0, 2.0)), ("po2", (9.0, 2.0)))}
    situation = classify(near, sharp, MatchingOptions("reacquire"))
    assert (situation.case, names(situation)) == (3, ["po1"])
    wide = MatchingOptions("reacquire", gates=ObservationGates(sd_m=3.0))
    assert classify(near, drifted, wide).case == 3


def test_prior_knowledge_allows_a_shortcut_only_for_one_partial_match_of_a_definite_description() -> None:
    alone = MatchingOptions(is_only_one=True)
    situation = classify(MARKED, {"po1": HALF_SEEN, "po2": OTHER}, alone)
    assert (situation.case, situation.result, names(situation)) == (3, "anchor", ["po1"])
    assert "no other object is similar" in situation.reasons()[0]
    assert classify(MARKED, {"po1": HALF_SEEN, "po2": HALF_SEEN}, alone).case == 2
    a_marked_one = ObjectDescription(MARKED.properties, is_definite=False)
    assert classify(a_marked_one, {"po1": HALF_SEEN}, alone).case == 2
    assert classify(a_marked_one, {"po1": HALF_SEEN}, MatchingOptions("reacquire", is_only_one=True)).case == 3


def test_cautious_anchors_are_temporary_and_keep_which_of_them_is_complete() -> None:
    situation = classify(MARKED, {"po1": HALF_SEEN, "po2": SEEN}, MatchingOptions(is_cautious=True))
    assert [(each.percept, each.match.status, each.is_temporary) for each in situation.anchors] == [
        ("po2", "complete", True),
        ("po1", "partial", True),
    ]
    assert situation.anchors[1].properties == {"shape": ObservedProperty("gasbottle")}


def test_of_graded_matches_the_best_is_taken_where_one_is_best_and_that_the_threshold_was_raised_is_reported() -> None:
    tall = ObjectDescription({"height": AllowedInterval(1.0, 1.5, soft=0.5)})
    seen = {"po1": percept(height=1.3), "po2": percept(height=1.6), "po3": percept(height=2.5)}
    situation = classify(tall, seen, MatchingOptions(threshold=0.7))
    assert (situation.case, names(situation), situation.threshold) == (4, ["po1"], 1.0)
    assert "raised from 0.7 to 1" in situation.reasons()[0]
    assert [each.status for each in situation.matches] == ["complete", "partial", "none"]
    assert classify(tall, {**seen, "po4": percept(height=1.2)}, MatchingOptions(threshold=0.7)).case == 5
    assert classify(tall, {"po2": seen["po2"]}, MatchingOptions(threshold=0.9)).case == 2


def test_of_several_complete_matches_an_indefinite_description_takes_the_first_by_name() -> None:
    any_marked = ObjectDescription(MARKED.properties, is_definite=False)
    situation = classify(any_marked, {"po2": SEEN, "po1": SEEN, "po0": HALF_SEEN}, MatchingOptions())
    assert (situation.case, names(situation), situation.recovery) == (5, ["po1"], None)


def test_case_5_asks_for_the_property_that_tells_the_percepts_apart() -> None:
    seen = {
        f"po{number}": percept(shape="gasbottle", mark=True, colour=colour, size=size)
        for number, (colour, size) in enumerate((("red", 1.0), ("red", 2.0), ("green", 3.0)))
    }
    situation = classify(MARKED, seen, MatchingOptions())
    assert (situation.case, situation.result, names(situation)) == (5, "fail", [])
    assert situation.ask is not None
    assert (situation.ask.name, dict(situation.ask.values)) == ("size", {"1": ("po0",), "2": ("po1",), "3": ("po2",)})
    assert "which size does it have: 1 (po0), 2 (po1), 3 (po2)?" in situation.reasons()


def test_case_5_says_so_where_nothing_that_was_observed_differs() -> None:
    situation = classify(MARKED, {"po1": SEEN, "po2": SEEN}, MatchingOptions())
    assert situation.ask is not None
    assert situation.ask.name == ""
    assert any("point at one" in each for each in situation.reasons())


@pytest.mark.parametrize(
    ("allowed", "value"), [(one_of(True), 1.0), (one_of(1.0), True), (AllowedInterval(0, 1), "0.5")]
)
def test_values_of_another_kind_contradict(allowed: AllowedValues, value: float | bool | str) -> None:
    assert classify(ObjectDescription({"p": allowed}), {"po1": percept(p=value)}, MatchingOptions()).case == 1


@given(st.lists(st.sampled_from(["complete", "partial", "none"]), max_size=6), st.booleans(), st.booleans())
def test_what_is_not_anchored_has_a_recovery_or_a_question(statuses: list[str], definite: bool, cautious: bool) -> None:
    made = {"complete": SEEN, "partial": HALF_SEEN, "none": OTHER}
    seen = {f"po{number}": made[status] for number, status in enumerate(statuses)}
    description = ObjectDescription(MARKED.properties, definite)
    situation = classify(description, seen, MatchingOptions(is_cautious=cautious))
    assert (situation.recovery is None) == (situation.result == "anchor")
    assert all(each.match.status != "none" for each in situation.anchors)
    assert len(situation.reasons()) >= 2 * len(statuses)
