"""The rows of the benchmark that start processes: see `tests/bench`."""

import pytest

from tests.bench.trials import LIVE, check_trial

pytestmark = pytest.mark.live


@pytest.mark.parametrize("name", LIVE)
def test_every_side_of_a_row_gives_figures_and_every_bar_is_judged(name: str) -> None:
    check_trial(name)
