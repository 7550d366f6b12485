"""The tests that the page on testing shows pass."""

from collections.abc import Callable

import pytest

from examples.testing import test_world


@pytest.mark.parametrize("shown", [value for name, value in vars(test_world).items() if name.startswith("test_")])
def test_what_the_page_shows_passes(shown: Callable[[], None]) -> None:
    shown()
