from collections.abc import Iterator

import pytest

from dyknow.agents.platform import Platform
from tests.agents import invariants
from tests.box import Box


@pytest.fixture
def wire() -> Iterator[Box]:
    """An empty federation; the invariants of whoever is in it are checked afterwards."""
    found = Box()
    yield found
    invariants.check(found)


@pytest.fixture
def node(wire: Box) -> Platform:
    """Platform 0, with a command centre `cc` and a platform 1 beside it, a second after they met."""
    platform = wire.join("0", simulated=True, control=True)
    wire.join("1", simulated=True, control=True)
    wire.centre()
    wire.run(1.0)
    return platform
