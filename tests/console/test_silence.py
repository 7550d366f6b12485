"""A watched stream from which nothing comes is not left without a word."""

import pytest

from dyknow.console.command import Call
from dyknow.console.commands.members.delegate import delegate, tasks
from dyknow.console.commands.members.ls import ls
from dyknow.console.commands.members.monitors import monitors
from dyknow.console.commands.members.watch import watch
from dyknow.console.errors import DONE, NO
from dyknow.model.errors import FederationFailed
from dyknow.navigation.vehicle import PositionReport
from tests.box import Box
from tests.console.conftest import Lines


def test_a_stream_that_falls_silent_is_told_once_with_the_age_of_its_newest_sample(
    world: Box, call: Call, capsys: pytest.CaptureFixture[str]
) -> None:
    world.lacking.add(PositionReport)
    world.run(10.0)
    world.at(world.now_us + 9_000_000, world.lacking.clear)
    assert watch(call, "heli-position", unit="0", every="200ms", max_delay="1s", count=3) == DONE
    out, err = capsys.readouterr()
    assert len(out.splitlines()) == 3
    assert err.count("no sample from platform 0: its newest sample is") == 1


def test_a_stream_whose_samples_are_all_too_late_is_told_with_how_late_they_are(
    world: Box, call: Call, capsys: pytest.CaptureFixture[str]
) -> None:
    world.report_us = 30_000
    world.run(5.0)
    world.at(world.now_us + 5_000_000, lambda: world.kill("0"))
    with pytest.raises(FederationFailed, match="the streams have ended"):
        watch(call, "heli-position", unit="0", every="200ms", max_delay="1ms", count=1)
    out, err = capsys.readouterr()
    assert out == ""
    assert "ms after it was valid, and --max-delay 1 ms drops what is later" in err


def test_a_task_that_a_successor_ended_is_named_by_every_command_that_shows_monitoring(
    world: Box, call: Call, lines: Lines, capsys: pytest.CaptureFixture[str]
) -> None:
    assert delegate(call, "monitor-proximity", to="0") == DONE
    world.run(2.0)
    world.kill("0")
    world.run(5.0)
    (conversation,) = world.platform("1").built.tasks.coordinated
    successor = world.platform("1")
    successor.built.tasks.cancel(conversation, world.now_us)
    world.settle("1")
    world.run(1.0)
    capsys.readouterr()
    assert tasks(call) == DONE
    assert [(each["unit"], each["state"], each["ended_by"]) for each in lines()] == [(2, "ended by 1", 1)]
    for command, code in ((monitors, NO), (ls, DONE)):
        assert command(call) == code
        warned = " ".join(capsys.readouterr().err.split())
        assert f"task {conversation} was ended by 1 on 2," in warned
