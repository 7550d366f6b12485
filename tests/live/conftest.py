from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.live.command_line.command import Dyknow


@pytest.fixture
def dyknow(tmp_path: Path) -> Iterator[Dyknow]:
    """The command in a federation of its own; what it started is ended afterwards."""
    found = Dyknow(tmp_path)
    try:
        yield found
    finally:
        found.close()


BEGUN_FIRST = (
    "flights/test_replayed_federation.py",
    "vehicles/test_mavsdk.py",
    "flights/test_crossing.py",
    "command_line/test_cli_others.py",
    "command_line/test_lost_monitoring.py",
)
"""The files that take longest: begun last, one of them would keep a worker busy after all others have ended."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    def place(item: pytest.Item) -> int:
        path = item.path.as_posix()
        return next((at for at, name in enumerate(BEGUN_FIRST) if path.endswith(name)), len(BEGUN_FIRST))

    items.sort(key=place)
