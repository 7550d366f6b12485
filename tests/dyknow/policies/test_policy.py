from dataclasses import replace

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dyknow import Policy, PolicyError, TextError
from dyknow.policies.policy import MAX_POLICY
from tests.strategies import policies

READ = {
    "": Policy(),
    "any update": Policy(),
    "any change, max delay oo": Policy(change="any change"),
    "sample every 100, max delay 1s": Policy(change="sample", sample_us=100_000, max_delay_us=1_000_000),
    " from 300 to 400 ": Policy(from_us=300_000, to_us=400_000),
    "from 300": Policy(from_us=300_000),
    "from 300 to oo": Policy(from_us=300_000),
    "to 400": Policy(to_us=400_000),
    "to oo, any order, no approximation": Policy(exact=True),
    "monotone order": Policy(order="monotone"),
    "strict order,sample every 20ms": Policy(change="sample", sample_us=20_000),
    "from 0 to oo, sample every 1s, max delay 500us,\n use most recent": Policy(
        change="sample", sample_us=1_000_000, max_delay_us=500, from_us=0, approximation="most recent"
    ),
    "sample every 5, use linear": Policy(change="sample", sample_us=5_000, approximation="linear"),
    "delay before approximation 70": Policy(delay_before_us=70_000),
    "max age 500, max age of prediction 1s": Policy(max_age_us=500_000, prediction_age_us=1_000_000),
    "min certainty 0.95, max deviation 2.5, importance 3": Policy(
        min_certainty=0.95, max_deviation=2.5, importance=3.0
    ),
}


@pytest.mark.parametrize(("text", "policy"), READ.items())
def test_policies_are_read_as_people_write_them(text: str, policy: Policy) -> None:
    assert Policy.parse(text) == policy


@given(policies())
def test_the_canonical_text_reads_back_and_names_the_policy(policy: Policy) -> None:
    read = Policy.parse(str(policy))
    assert read == policy
    assert str(read) == str(policy)
    assert read.content_hash() == policy.content_hash()


@given(policies(), policies())
def test_equal_policies_are_those_of_equal_text(a: Policy, b: Policy) -> None:
    assert (a == b) == (str(a) == str(b))


def test_the_text_is_the_thesis_own() -> None:
    policy = Policy.parse("use most recent, max delay 1s, sample every 100, from 0")
    assert str(policy) == "sample every 100, max delay 1000, from 0 to oo, use most recent"
    assert str(Policy()) == "any update"
    assert str(Policy(max_delay_us=1_500)) == "max delay 1500us"


def test_a_hash_is_eight_hexadecimal_digits_and_does_not_change() -> None:
    assert Policy.parse("sample every 100, max delay 1000").content_hash() == "08f6869c"


def test_a_sample_constraint_implies_strict_order() -> None:
    assert Policy(change="sample", sample_us=5).order == "strict"
    assert Policy.parse("sample every 5, any order") == Policy.parse("sample every 5, strict order")


@pytest.mark.parametrize(
    "wrong",
    [
        {"change": "sample"}, {"sample_us": 5}, {"change": "any change", "sample_us": 5}, {"change": "sample", "sample_us": 0},
        {"change": "sample", "sample_us": -5}, {"max_delay_us": -1}, {"from_us": 5, "to_us": 4}, {"from_us": -1}, {"to_us": 2**63},
        {"approximation": "linear"}, {"approximation": "most recent", "change": "sample", "sample_us": 5, "from_us": 0},
        {"approximation": "most recent", "change": "sample", "sample_us": 5, "max_delay_us": 1},
        {"approximation": "most recent", "from_us": 0, "max_delay_us": 1}, {"delay_before_us": -1}, {"order": "random"},
        {"change": "no change"}, {"approximation": "best"},
    ],
)  # fmt: skip
def test_constraints_that_cannot_hold_together_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(PolicyError):
        Policy(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "line", "column", "said"),
    [
        ("from 300 until 400", 1, 10, "`to`, not `until`"),
        ("sample every", 1, 13, "ends within a constraint"),
        ("sample 100", 1, 1, "no constraint starts like this"),
        ("sample every 100 max delay 5", 1, 18, "separated by commas"),
        ("sample every fast", 1, 14, "not a duration"),
        ("max delay 1,\nmax delay 2", 2, 1, "one constraint of each kind"),
        ("any update, any change", 1, 13, "one constraint of each kind"),
        ("to 5, from 1 to 6", 1, 7, "one constraint of each kind"),
        ("any update,", 1, 12, "ends within a constraint"),
        (",", 1, 1, "no constraint"),
        ("max delay -5", 1, 11, "'-5' is not a duration"),
        ("from tomorrow", 1, 6, "tomorrow is not an instant"),
        ('from "2026-13-01"', 1, 6, "is not an instant"),
        ("max delay 0.5us", 1, 11, "finer than a microsecond"),
        ("from300 to 400", 1, 1, "no constraint"),
        ("sample every oo", 1, 14, "not a duration"),
        ("max delay 1; drop", 1, 12, "unexpected ';'"),
    ],
)
def test_a_text_that_is_no_policy_is_refused_with_its_place(text: str, line: int, column: int, said: str) -> None:
    with pytest.raises(TextError) as refused:
        Policy.parse(text)
    assert (refused.value.line, refused.value.column) == (line, column)
    assert said in refused.value.message


def test_contradictions_in_a_text_are_policy_errors() -> None:
    for text in ("from 5 to 4", "use most recent", "sample every 0", "sample every 5, use most recent"):
        with pytest.raises(PolicyError):
            Policy.parse(text)


WORDS = "any update change sample every max delay oo from to order monotone strict no approximation use most recent linear before 5 1s ,"


@given(st.text(max_size=60) | st.lists(st.sampled_from(WORDS.split()), max_size=12).map(" ".join))
def test_any_text_is_a_policy_or_refused(text: str) -> None:
    try:
        policy = Policy.parse(text)
    except (TextError, PolicyError):
        return
    assert Policy.parse(str(policy)) == policy


def test_a_long_text_is_refused_before_it_is_read() -> None:
    with pytest.raises(TextError, match=str(MAX_POLICY)):
        Policy.parse("any update," * 1_000_000)


@given(policies(), st.integers(1, 50))
def test_policies_are_values(policy: Policy, delay_us: int) -> None:
    assume(policy.max_delay_us != delay_us)
    other = replace(policy, max_delay_us=delay_us)
    assert other != policy
    assert len({policy, replace(policy), other}) == 2
