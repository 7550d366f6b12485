"""`dyknow check` over recorded traces."""

import json
from pathlib import Path

import pytest

from tests.console.conftest import Run

STATES = [{"t_ms": 100 * index, "p": index < 5, "speed[uav1]": 10.0 + index} for index in range(14)]


@pytest.fixture
def trace(tmp_path: Path) -> str:
    path = tmp_path / "flight.jsonl"
    path.write_text("\n".join(json.dumps(state) for state in STATES))
    return str(path)


@pytest.mark.parametrize(
    ("formula", "code", "verdict", "t_ms", "index"),
    [
        ("always speed[uav1] <= 22", 1, "false", 1300, 13),
        ("eventually speed[uav1] >= 12", 0, "true", 200, 2),
        ("always speed[uav1] <= 30", 0, "undecided", None, None),
        ("always (not p -> speed[uav1] > 100)", 1, "false", 500, 5),
    ],
)
def test_the_verdict_is_told_with_the_state_that_decided_it(
    dyknow: Run, trace: str, formula: str, code: int, verdict: str, t_ms: int | None, index: int | None
) -> None:
    done = dyknow("check", formula, "--trace", trace, "--json")
    assert done.returncode == code
    said = json.loads(done.stdout)
    assert (said["verdict"], said["t_ms"], said["index"]) == (verdict, t_ms, index)
    assert ("left" in said, "because" in said) == (verdict == "undecided", verdict != "undecided")


@pytest.mark.parametrize(
    ("formula", "verdict"),
    [
        ("always link[a] = l1", "false"),
        ("always (link[a] = l1 or link[a] = l2)", "undecided"),
        ("eventually (link[a] != l1 and link[a] = link[b])", "true"),
        ("always (link[a] = link[b] -> link[a] = l2)", "false"),
    ],
)
def test_values_may_be_objects_and_are_compared_with_names_and_with_each_other(
    dyknow: Run, tmp_path: Path, formula: str, verdict: str
) -> None:
    """Thesis 7.5.1: a comparison of two value terms."""
    path = tmp_path / "links.jsonl"
    links = [("l1", "l2"), ("l1", "l1"), ("l2", "l2")]
    path.write_text("".join(f'{{"t_ms": {i}, "link[a]": "{a}", "link[b]": "{b}"}}\n' for i, (a, b) in enumerate(links)))
    assert json.loads(dyknow("check", formula, "--trace", str(path), "--json").stdout)["verdict"] == verdict


def test_a_verdict_comes_with_the_part_the_samples_and_the_time_that_decided(dyknow: Run, trace: str) -> None:
    formula = "always forall u in {uav1}: speed[u] > 20 -> eventually[0, 200] speed[u] <= 20"
    done = dyknow("check", formula, "--trace", trace)
    assert [line.strip() for line in done.stdout.splitlines()] == [
        "false, decided by state 13 (t = 1300 ms)",
        "speed[uav1] <= 20 is false",
        "with speed[uav1] = 23.0",
        "for u = uav1",
        "in eventually[0, 200ms] speed[uav1] <= 20",
        "since t = 1100 ms, until t = 1300 ms",
    ]
    (because,) = json.loads(dyknow("check", formula, "--trace", trace, "--json").stdout)["because"]
    assert because == {
        "part": "speed[uav1] <= 20",
        "holds": False,
        "samples": {"speed[uav1]": 23.0},
        "members": {"u": "uav1"},
        "in": "eventually[0, 200ms] speed[uav1] <= 20",
        "since_ms": 1100.0,
        "until_ms": 1300.0,
    }


def test_what_is_undecided_comes_with_what_is_left_of_it(dyknow: Run, trace: str) -> None:
    done = dyknow("check", "always (not p -> eventually[0, 2s] p)", "--trace", trace)
    assert "(eventually[0, 1200ms] p) and always (not p -> eventually[0, 2s] p)" in " ".join(done.stdout.split())


def test_a_wrong_formula_is_a_wrong_call_drawn_with_a_caret(dyknow: Run, trace: str) -> None:
    done = dyknow("check", "always speed[uav1] <", "--trace", trace)
    assert done.returncode == 2
    assert "^" in done.stderr


def test_an_ambiguous_formula_is_refused_with_both_readings(dyknow: Run, trace: str) -> None:
    done = dyknow("check", "always p -> p", "--trace", trace)
    assert done.returncode == 2
    assert "(always p)" in done.stderr


def test_a_trace_that_is_none_is_told_by_file_and_line(dyknow: Run, tmp_path: Path) -> None:
    path = tmp_path / "bad.jsonl"
    path.write_text('{"t_ms": 1, "p": true}\n{"t": 2}\n')
    done = dyknow("check", "always p", "--trace", str(path))
    assert done.returncode == 2
    assert f"{path}:2" in done.stderr


def test_a_misspelt_feature_is_noted_since_it_has_no_value_anywhere(dyknow: Run, trace: str) -> None:
    done = dyknow("check", "always speeed[uav1] < 3", "--trace", trace, "--json")
    assert done.returncode == 0
    assert json.loads(done.stdout)["verdict"] == "undecided"
    assert "Did you mean 'speed[uav1]'" in done.stderr.replace("\n", " ")


def test_a_domain_without_members_is_noted_since_nothing_is_checked(dyknow: Run, trace: str) -> None:
    done = dyknow("check", "always forall u in uavs: sped[u] < 5", "--trace", trace)
    assert done.returncode == 0
    assert "note: uavs has no members" in done.stderr
    assert "Known: p, speed[uav1]." in done.stderr


def test_a_formula_over_thousands_of_members_is_bounded_work(dyknow: Run, tmp_path: Path) -> None:
    path = tmp_path / "flight.jsonl"
    path.write_text(json.dumps({"t_ms": 0} | {f"s[m{number}]": 1 for number in range(10_000)}) + "\n")
    done = dyknow("check", "always forall u in us: s[u] < 5", "--trace", str(path), "--json")
    assert json.loads(done.stdout)["verdict"] == "undecided"


def test_states_out_of_order_and_nan_are_told_and_harm_nothing(dyknow: Run, tmp_path: Path) -> None:
    path = tmp_path / "flight.jsonl"
    path.write_text('{"t_ms": 0, "x": 1}\n{"t_ms": 0, "x": 9}\n{"t_ms": 100, "x": NaN}\n{"t_ms": 50, "x": 9}\n')
    done = dyknow("check", "always x < 5", "--trace", str(path))
    assert done.returncode == 0
    assert f"note: states were left out: 1 duplicate, 1 out of order; the first in {path}:2." in done.stderr
    assert f"note: values are no numbers and count as none: 1 NaN; the first in {path}:3." in done.stderr


def test_it_must_be_said_over_what_a_formula_is_checked(dyknow: Run) -> None:
    done = dyknow("check", "always p")
    assert done.returncode == 2
    assert "--trace FILE" in done.stderr


def test_a_bare_always_over_a_measured_value_is_noted_with_a_formula_that_bears_noise(dyknow: Run, trace: str) -> None:
    done = dyknow("check", "always speed[uav1] <= 22", "--trace", trace)
    assert "violates this; what counts only if it lasts: always eventually[0, 500ms] speed[uav1] <= 22" in " ".join(
        done.stderr.split()
    )


def test_a_formula_that_no_platform_would_read_is_not_sent(dyknow: Run) -> None:
    done = dyknow("check", f"always {'(' * 65}p{')' * 65}", "--unit", "0")
    assert done.returncode == 2
    assert done.stderr == "dyknow check: text: brackets are nested deeper than 64, from character 72 on\n"
