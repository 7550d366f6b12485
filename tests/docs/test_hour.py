"""A new user's hour: every command of every page in its order, in a fresh checkout, with the processes it starts."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.docs.hour import STROKES_A_SECOND, machine, steps
from tests.docs.pages import PAGES, ROOT

pytestmark = [pytest.mark.live, pytest.mark.full]
README = ROOT / "README.md"
ELSEWHERE = {"emergency.md"}
"""Waits for a scan of minutes between two commands: `test_missions_page.py` types it."""
WALKED = [page for page in (README, *PAGES) if steps(page) and page.name not in ELSEWHERE]
PROMISED = {
    "first-alarm.md": ("Five minutes from a fresh clone", "", 5 * 60),
    "hour.md": ("the commands take five minutes", "", 60 * 60),
    "tutorial.md": ("To type and run all of it takes a quarter of an hour", "", 15 * 60),
    "README.md": ("flies an encounter end to end, in under a minute", "make demo", 60),
}
"""By page: what it promises, for which command (empty: for all), in seconds."""


def test_pages_are_walked_and_typing_takes_its_time() -> None:
    assert len(WALKED) >= 10
    assert sum(len(steps(page)) for page in WALKED) > 120
    (step,) = [step for step in steps(README) if step.command.startswith("dyknow down")]
    assert step.typing_s == (len("dyknow down") + 1) / STROKES_A_SECOND


@pytest.mark.parametrize("page", WALKED, ids=lambda page: page.name)
def test_no_step_fails_and_what_is_printed_comes(page: Path, record_property: Callable[[str, object], None]) -> None:
    with machine() as found:
        taken = found.walk(page)
    record_property("taken", str(taken))
    print(taken)
    promise, command, within_s = PROMISED.get(page.name, ("", "", 0))
    assert promise in page.read_text(encoding="utf-8")
    if promise:
        assert (taken.of(command) if command else taken.total_s) <= within_s, str(taken)
