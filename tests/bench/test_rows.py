"""Every row of the benchmark runs: what the product has moved on from is seen here, not when figures are wanted next."""

from importlib.util import find_spec

import pytest

from bench.__main__ import rows
from bench.compare import interleave, judge
from bench.rows import Figures, Limit, Options, Ratio
from tests.bench.trials import LIVE, TRIAL, UNIT, check_figures, check_trial, extras, row_of

EXTRA = [(row, side, module) for row in (*UNIT, *LIVE) for side, module in extras(row).items()]


def test_every_row_is_tried_here_or_with_processes_of_its_own() -> None:
    assert sorted([*UNIT, *LIVE]) == rows()


@pytest.mark.parametrize("name", UNIT)
def test_every_side_of_a_row_gives_figures_and_every_bar_is_judged(name: str) -> None:
    check_trial(name)


@pytest.mark.parametrize(("name", "side", "module"), EXTRA)
def test_a_peer_that_needs_a_module_runs_where_it_is_installed(name: str, side: str, module: str) -> None:
    if find_spec(module) is None:
        pytest.skip(f"{side} of {name} needs the module {module}, which is not installed: see bench/README.md")
    with row_of(name).sides(TRIAL) as sides:
        check_figures({side: sides[side]()})


def test_rounds_that_warm_up_do_not_count_and_the_sides_take_turns() -> None:
    turns: list[str] = []

    def side(name: str) -> Figures:
        turns.append(name)
        return {"turn": float(len(turns))}

    found = interleave({"ours": lambda: side("ours"), "raw": lambda: side("raw")}, 2, warm=1)
    assert turns == ["ours", "raw"] * 3
    assert found == {"ours": [{"turn": 3.0}, {"turn": 5.0}], "raw": [{"turn": 4.0}, {"turn": 6.0}]}


def test_a_bar_about_a_side_that_was_not_measured_is_not_judged_and_one_about_no_metric_raises() -> None:
    found = {"ours": [{"p50_us": 3.0}]}
    assert judge(Ratio("p50_us", 2.0), found) is None
    assert judge(Limit("p50_us", 2.0), found) is not None
    with pytest.raises(KeyError, match="p99_us"):
        judge(Limit("p99_us", 2.0), found)


@pytest.mark.parametrize(
    ("effort", "is_trial"), [(0.01, True), (0.099, True), (0.1, False), (1.0, False), (4.0, False)]
)
def test_only_a_trial_has_fewer_processes_than_the_row_is_about(effort: float, is_trial: bool) -> None:
    options = Options(effort=effort)
    assert options.is_trial is is_trial
    assert options.size(16, 2) == (2 if is_trial else 16)
