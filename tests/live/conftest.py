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
