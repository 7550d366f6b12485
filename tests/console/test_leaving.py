"""A platform that leaves, comes back, or is asked for what it does not do."""

import pytest

from dyknow.console.command import Call
from dyknow.console.commands.members.delegate import delegate
from dyknow.console.commands.members.ls import ls
from dyknow.console.errors import DONE
from dyknow.model.errors import FederationFailed, NothingFound, WrongCall
from tests.box import Box
from tests.console.conftest import Lines


def _listed(world: Box, call: Call, lines: Lines) -> list[int]:
    world.run(1.0)
    lines()
    ls(call, all_kinds=False)
    return [entry["unit"] for entry in lines()]


def test_a_platform_that_left_comes_back_when_it_is_asked_to(world: Box, call: Call, lines: Lines) -> None:
    assert delegate(call, "leave", [], to="1", wait=False) == DONE
    assert _listed(world, call, lines) == [0, 2]
    with pytest.raises(NothingFound, match="no platform '1'"):
        delegate(call, "hold", [], to="1", wait=False)
    assert delegate(call, "rejoin", [], to="1", wait=False) == DONE
    assert _listed(world, call, lines) == [0, 1, 2]


def test_the_last_platform_comes_back_too(world: Box, call: Call, lines: Lines) -> None:
    for unit in ("0", "1", "2"):
        assert delegate(call, "leave", [], to=unit, wait=False) == DONE
    assert _listed(world, call, lines) == []
    assert delegate(call, "rejoin", [], to="2", wait=False) == DONE
    assert _listed(world, call, lines) == [2]


def test_who_shall_come_back_is_named_and_may_not_be_there(world: Box, call: Call) -> None:
    with pytest.raises(WrongCall, match="--to"):
        delegate(call, "rejoin", [], to=None, wait=False)
    with pytest.raises(FederationFailed, match="platform 7"):
        delegate(call, "rejoin", [], to="7", wait=False)
