"""The commands against real platforms on a fake wire: what is printed, and with which code they end."""

import json
import re
from collections.abc import Callable
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest

from dyknow.agents.config import PlatformConfig
from dyknow.agents.effects import Fed
from dyknow.agents.tasks.life import TaskLife
from dyknow.console.centre import client
from dyknow.console.command import Call
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import Output
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import MonitorProximity, TaskEntry, TaskList, Tasks
from dyknow.model.errors import DyknowError, NothingFound, WrongCall
from dyknow.navigation.vehicle import BatteryReport, HomeReport, PositionReport, StatusReport, VelocityReport
from dyknow.reasoning import OF_SEPARATION
from dyknow.runtime.configuration.settings import Settings
from tests.box import EPOCH, Box

Lines = Callable[[], list[dict[str, Any]]]


def test_ls_shows_platforms_with_services_labels_ages_and_clock(world: Box, call: Call, lines: Lines) -> None:
    from dyknow.console.commands.members.ls import ls

    assert ls(call, all_kinds=False) == DONE
    shown = lines()
    assert [entry["unit"] for entry in shown] == [0, 1, 2]
    assert {entry["state"] for entry in shown} == {"alive"}
    services = {entry["service"]: entry["visibility"] for entry in shown[0]["services"]}
    assert services["dyknow-federation"] == "protected"
    assert "private" not in services.values(), "what is private is no one else's business"
    ages = {entry["label"]: entry["age_ms"] for entry in shown[0]["labels"]}
    assert 0 <= ages["heli-position"] <= 200
    assert abs(shown[0]["offset_us"]) <= shown[0]["bound_us"] <= 1000


def test_ls_tells_since_when_each_platform_lives_whoever_asks(world: Box, call: Call, lines: Lines) -> None:
    from dyknow.console.commands.members.ls import ls

    for _ in range(2):
        assert ls(call, all_kinds=True) == DONE
        shown = lines()
        assert {entry["unit"]: entry["since_us"] for entry in shown if entry["kind"] == "uav"} == dict.fromkeys(
            range(3), EPOCH
        )
        world.run(1.0)


def test_ls_finds_nobody_in_an_empty_federation(call: Call, lines: Lines, monkeypatch: pytest.MonkeyPatch) -> None:
    from dyknow.console.commands.members.ls import ls

    empty = Box()
    monkeypatch.setattr(client, "_client_ports", lambda _call: empty.client_ports())
    began_us = empty.now_us
    assert ls(call, all_kinds=False) == NO
    assert lines() == []
    assert empty.now_us - began_us < 800_000, "nobody is not waited for"


def test_an_endpoint_that_cannot_be_reached_is_named_where_no_platform_is(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from dyknow.console.commands.members.ls import ls

    why = "connection refused by tcp/127.0.0.1:1: nothing listens there"
    around = Box().client_ports()._replace(trouble=lambda: [why])
    monkeypatch.setattr(client, "_client_ports", lambda _call: around)
    assert ls(Call(Settings(federation="test"), Output(json_lines=False)), all_kinds=False) == NO
    assert why in capsys.readouterr().err


def test_the_directory_is_waited_for_only_until_all_members_that_are_known_are_described(
    world: Box, call: Call, lines: Lines
) -> None:
    began_us = world.now_us
    assert _query(call) == DONE
    assert {line["unit"] for line in lines()} == {0, 1, 2}
    assert world.now_us - began_us < 200_000


def test_one_that_only_others_hear_is_waited_for(world: Box) -> None:
    world.wire.deaf.add(("2", "cc"))
    centre = world.centre()
    world.run(0.5)
    assert not centre.settled(world.now_us, 0)
    world.wire.deaf.clear()
    world.run(1.0)
    assert centre.settled(world.now_us, 0)


def _query(call: Call, **given: Any) -> int:
    from dyknow.console.commands.members.query import query

    options: dict[str, Any] = {
        "unit": None,
        "at": None,
        "between": None,
        "last": None,
        "nth": None,
        "slice_": None,
        "timeout": "2s",
        "select": None,
        "merge": None,
    }
    return query(call, given.pop("label", "heli-position"), **{**options, **given})


def test_the_latest_value_comes_from_all_platforms(world: Box, call: Call, lines: Lines) -> None:
    assert _query(call) == DONE
    shown = lines()
    assert sorted(entry["unit"] for entry in shown) == [0, 1, 2]
    assert set(shown[0]["value"]) == {"latitude_deg", "longitude_deg"}
    assert all(world.now_us - entry["valid_us"] < 1_000_000 for entry in shown)


def test_a_value_at_a_time_is_the_most_recent_one_then(world: Box, call: Call, lines: Lines) -> None:
    at_us = EPOCH + 1_234_567
    assert _query(call, unit="1", at=str(at_us)) == DONE
    [shown] = lines()
    assert at_us - 100_000 < shown["valid_us"] <= at_us


def test_between_two_times_gives_all_values_in_order_also_over_several_pages(
    world: Box, call: Call, lines: Lines
) -> None:
    world.run(60.0)
    assert _query(call, unit="0", between=("-50s", "-1s")) == DONE
    times = [entry["valid_us"] for entry in lines()]
    assert times == sorted(times)
    assert len(times) in {490, 491}


def test_the_last_values_the_nth_before_the_latest_and_those_by_number(world: Box, call: Call, lines: Lines) -> None:
    assert _query(call, unit="1", last=5) == DONE
    last = [entry["valid_us"] for entry in lines()]
    assert [b - a for a, b in pairwise(last)] == [100_000] * 4
    assert _query(call, unit="1", nth=3) == DONE
    [nth] = lines()
    assert last[1] <= nth["valid_us"] <= last[-1]
    assert "stale" not in nth, "what is asked for by number is meant to be old"
    assert _query(call, label="heli-altitude", slice_=(0, 2)) == DONE
    assert sorted(entry["unit"] for entry in lines()) == [0, 0, 0, 1, 1, 1, 2, 2, 2]
    assert _query(call, unit="1", nth=100_000) == NO
    [said] = lines()
    assert "sample 100000 before the latest is not held" in said["error"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"last": 2, "nth": 1}, "--last and --nth ask for different samples"),
        ({"last": 0}, "write 1 or more"),
        ({"nth": -1}, "write 0 or more"),
        ({"slice_": (3, 2)}, "the lower first"),
    ],
)
def test_samples_by_number_that_cannot_be_meant_are_named(call: Call, given: dict[str, Any], said: str) -> None:
    with pytest.raises(WrongCall, match=said):
        _query(call, **given)


def test_a_frozen_platform_is_named_and_the_others_answers_are_there(world: Box, call: Call, lines: Lines) -> None:
    world.freeze("1")
    world.run(0.5)
    assert _query(call) == DONE
    shown = lines()
    assert sorted(entry["unit"] for entry in shown if "value" in entry) == [0, 2]
    [missing] = [entry for entry in shown if "error" in entry]
    assert missing["unit"] == 1
    assert shown[-1] is missing, "who does not answer keeps nobody waiting"


def test_a_platform_that_froze_out_of_a_newcomers_reach_is_named_and_listed(
    world: Box, call: Call, lines: Lines
) -> None:
    from dyknow.console.commands.members.ls import ls

    world.freeze("1")
    world.run(0.5)
    assert _query(call, label="battery") == DONE
    assert {entry["unit"]: "error" in entry for entry in lines()} == {0: False, 1: True, 2: False}
    assert ls(call, all_kinds=False) == DONE
    assert {entry["unit"]: entry["state"] for entry in lines()} == {0: "alive", 1: "gone", 2: "alive"}


def test_a_platform_that_was_killed_stays_as_gone_until_it_returns(
    world: Box, call: Call, lines: Lines, capsys: pytest.CaptureFixture[str]
) -> None:
    from dyknow.console.commands.members.ls import ls

    killed_us = world.now_us
    world.kill("1")
    for wait_s in (1.0, 300.0):
        world.run(wait_s)
        assert ls(call, all_kinds=False) == DONE
        shown = {entry["unit"]: entry for entry in lines()}
        assert {unit: entry["state"] for unit, entry in shown.items()} == {0: "alive", 1: "gone", 2: "alive"}
        assert -200_000 <= shown[1]["gone_us"] - killed_us <= 1000
        assert _query(call, label="battery") == DONE
        assert {entry["unit"]: "error" in entry for entry in lines()} == {0: False, 1: True, 2: False}
        assert _query(call, unit="1") == NO
        (missing,) = lines()
        assert missing["error"].startswith("gone ")
        assert missing["error"].endswith(" ago")
    text = Call(call.settings, Output(json_lines=False))
    assert ls(text, all_kinds=False) == DONE
    assert re.search(r"^.*\b1\b.*gone \d+(\.\d)? (s|min) ago", capsys.readouterr().out, re.MULTILINE)
    world.fly("1", 0.0, 200.0, 2.0)
    world.run(2.0)
    assert ls(call, all_kinds=False) == DONE
    assert {entry["state"] for entry in lines()} == {"alive"}


def test_a_platform_that_was_killed_is_named_while_any_platform_lives_also_one_that_never_met_it(
    world: Box, call: Call, lines: Lines
) -> None:
    from dyknow.console.commands.members.ls import ls

    killed_us = world.now_us
    world.kill("1")
    world.run(30.0)
    world.fly("7", 0.0, 400.0)
    world.run(3.0)
    for witness in ("0", "2"):
        world.kill(witness)
    world.run(5.0)
    assert ls(call, all_kinds=False) == DONE
    shown = {entry["unit"]: entry for entry in lines()}
    assert {unit: entry["state"] for unit, entry in shown.items()} == {0: "gone", 1: "gone", 2: "gone", 7: "alive"}
    assert abs(shown[1]["gone_us"] - killed_us) < 300_000
    assert _query(call, label="battery") == DONE
    assert {entry["unit"]: "error" in entry for entry in lines()} == {0: True, 1: True, 2: True, 7: False}
    world.fly("1", 0.0, 200.0, 2.0)
    world.run(2.0)
    assert ls(call, all_kinds=False) == DONE
    assert {entry["unit"]: entry["state"] for entry in lines()}[1] == "alive"


def test_a_platform_that_said_good_bye_is_neither_named_nor_listed(world: Box, call: Call, lines: Lines) -> None:
    from dyknow.console.commands.members.ls import ls

    world.end("1")
    world.run(1.0)
    assert ls(call, all_kinds=False) == DONE
    assert {entry["unit"]: entry["state"] for entry in lines()} == {0: "alive", 2: "alive"}
    assert _query(call, label="battery") == DONE
    assert {entry["unit"]: "error" in entry for entry in lines()} == {0: False, 2: False}


def test_data_older_than_its_policy_allows_is_red_and_said_to_be(
    world: Box, call: Call, lines: Lines, capsys: pytest.CaptureFixture[str]
) -> None:
    from dyknow.console.commands.members.ls import ls

    text = Call(call.settings, Output(json_lines=False))
    assert ls(call, all_kinds=False) == DONE
    assert {entry["data"] for entry in lines()} == {"fresh"}
    world.lacking |= {PositionReport, VelocityReport}
    world.run(3.0)
    assert ls(call, all_kinds=False) == DONE
    shown = lines()
    assert {(entry["state"], entry["data"]) for entry in shown} == {("alive", "stale")}
    labels = {entry["label"]: entry for entry in shown[0]["labels"]}
    assert labels["heli-position"]["stale"]
    assert labels["heli-position"]["age_ms"] > 1000
    assert not labels["battery"]["stale"]
    world.lacking |= {HomeReport, BatteryReport, StatusReport}
    world.run(3.0)
    assert ls(text, all_kinds=False) == DONE
    assert "alive, no data" in capsys.readouterr().out
    assert _query(call) == DONE
    assert [(entry["stale"], entry["age_ms"] > 5000) for entry in lines()] == [(True, True)] * 3
    assert _query(text) == DONE
    assert capsys.readouterr().out.count(" s old") == 3
    world.lacking.clear()
    world.run(1.0)
    assert _query(call) == DONE
    assert not any(entry["stale"] for entry in lines())


def test_one_value_is_selected_or_made_of_all(world: Box, call: Call, lines: Lines) -> None:
    assert _query(call, label="heli-altitude", merge="mean") == DONE
    [merged] = lines()
    assert (merged["unit"], merged["units"], merged["merge"]) == (None, [0, 1, 2], "mean")
    assert merged["value"]["altitude_m"] == pytest.approx(60.0, abs=1.0)
    assert _query(call, label="heli-altitude", select="newest") == DONE
    [chosen] = lines()
    assert chosen["unit"] in {0, 1, 2}


def test_a_time_to_come_is_refused_and_nobody_answered(world: Box, call: Call, lines: Lines) -> None:
    assert _query(call, unit="0", at="+10s") == NO
    [refused] = lines()
    assert "error" in refused


def test_an_unknown_label_is_answered_with_the_nearest_known(world: Box, call: Call) -> None:
    with pytest.raises(NothingFound, match="Did you mean 'heli-position'"):
        _query(call, label="heli-positon")


def test_an_unknown_unit_is_told(world: Box, call: Call) -> None:
    with pytest.raises(NothingFound, match="no platform '9' is there"):
        _query(call, unit="9")


def test_times_in_the_wrong_order_are_a_wrong_call(world: Box, call: Call) -> None:
    with pytest.raises(WrongCall, match="--between"):
        _query(call, between=("-1s", "-5s"))


@pytest.mark.parametrize("off_us", [0, 37_000])
def test_a_stream_off_the_grid_is_watched_at_its_own_instants_and_the_cause_is_told(
    monkeypatch: pytest.MonkeyPatch, call: Call, lines: Lines, capsys: pytest.CaptureFixture[str], off_us: int
) -> None:
    from dyknow.console.commands.members.watch import watch

    world = Box()
    world.add("3", PlatformConfig("3", 0, clock=world.clock, vehicle=False))
    monkeypatch.setattr(client, "_client_ports", lambda _call: world.client_ports())
    world.specify(
        "3", "source position gps\nstrmgen pos[self] = gps\nexport heli-position = pos[self] with sample every 100\n"
    )

    def feed() -> None:
        world._reach(world.nodes["3"], Fed(world.now_us, "gps", world.now_us, (58.0, 15.0)))
        world.at(world.now_us + 100_000, feed)

    world.at(world.now_us + 1_000_000 + off_us, feed)
    world.run(3.0)
    assert watch(call, "heli-position", unit=None, every="200ms", max_delay="1s", count=5) == DONE
    out, err = capsys.readouterr()
    shown = [json.loads(line) for line in out.splitlines()]
    assert {entry["valid_us"] % 200_000 for entry in shown} <= {off_us, off_us + 100_000}
    assert {b["valid_us"] - a["valid_us"] for a, b in pairwise(shown)} == {200_000}
    told = " ".join(err.split())
    assert ("its samples arrive at x." in told and "off the grid of 200 ms" in told) == (off_us > 0)
    assert "no sample has arrived yet" not in told


def test_watch_prints_a_federated_stream_and_takes_it_down(world: Box, call: Call, lines: Lines) -> None:
    from dyknow.console.commands.members.watch import watch

    assert watch(call, "heli-position", unit=None, every="200ms", max_delay="1s", count=9) == DONE
    shown = lines()
    assert len(shown) == 9
    assert {entry["unit"] for entry in shown} == {0, 1, 2}
    for unit in range(3):
        times = [entry["valid_us"] for entry in shown if entry["unit"] == unit]
        assert all(later - earlier == 200_000 for earlier, later in pairwise(times))
    world.run(1.0)
    assert not any(platform.built.tasks.all() for platform in world.platforms.values())


@pytest.mark.parametrize("given", [{"every": "0s"}, {"max_delay": "0s"}, {"every": "5"}])
def test_a_stream_needs_a_period_and_a_delay(call: Call, given: dict[str, str]) -> None:
    from dyknow.console.commands.members.watch import watch

    with pytest.raises(WrongCall, match=r"^--(every|max-delay): .*(too short|say 5ms or 5s)"):
        watch(call, "heli-position", unit=None, count=1, **{"every": "200ms", "max_delay": "1s", **given})


def test_a_stream_of_an_unknown_label_is_answered_with_the_nearest_known(world: Box, call: Call) -> None:
    from dyknow.console.commands.members.watch import watch

    with pytest.raises(NothingFound, match="Did you mean 'heli-position'"):
        watch(call, "heli-positio", unit=None, every="200ms", max_delay="1s", count=1)


def test_a_span_without_samples_is_told(world: Box, call: Call, lines: Lines) -> None:
    assert _query(call, between=("-2h", "-1h")) == NO
    shown = lines()
    assert {entry["unit"] for entry in shown} == {0, 1, 2}
    assert all("error" in entry for entry in shown)
    assert _query(call, unit="0", between=("-1s", "0s")) == DONE


@pytest.mark.parametrize(
    ("kind", "said"), [("explode", "gps-loss"), ("clock=5", "say 5ms or 5s"), ("nan=1", "write nan")]
)
def test_a_fault_that_there_is_not_is_a_wrong_call(call: Call, kind: str, said: str) -> None:
    from dyknow.console.commands.members.delegate import fault

    with pytest.raises(WrongCall, match=f"^KIND: .*{said}"):
        fault(call, "0", kind, None)


def _delegated(call: Call, lines: Lines) -> str:
    from dyknow.console.commands.members.delegate import delegate

    assert delegate(call, "monitor-proximity", [], to="0", wait=None) == DONE
    said = lines()
    assert said[0]["performative"] == "agree"
    assert said[0]["unit"] == 0
    return str(said[0]["conversation"])


def test_a_delegated_task_lives_on_is_listed_and_is_cancelled_by_another_command(
    world: Box, call: Call, lines: Lines
) -> None:
    from dyknow.console.commands.members.delegate import cancel, tasks
    from dyknow.console.commands.members.monitors import monitors

    conversation = _delegated(call, lines)
    world.run(3.0)
    assert tasks(call) == DONE
    listed = [(entry["conversation"], entry["task"], entry["unit"]) for entry in lines()]
    assert (conversation, "monitor-proximity", 0) in listed
    assert monitors(call) == DONE
    shown = lines()
    pairs = {(entry["by"], tuple(entry["units"])) for entry in shown if entry["monitor"] == "proximity"}
    assert {by for by, _ in pairs} == {0, 1, 2}
    assert {entry["inputs"] for entry in shown} == {"fresh"}
    assert {entry["shows"] for entry in shown} == {"ok"}
    assert cancel(call, conversation[:-1]) == DONE
    world.run(2.0)
    lines()
    assert tasks(call) == NO
    assert monitors(call) == NO


def test_a_task_that_runs_already_is_named_and_no_second_one_begins(
    world: Box, call: Call, lines: Lines, capsys: pytest.CaptureFixture[str]
) -> None:
    from dyknow.console.commands.members.delegate import delegate, tasks

    conversation = _delegated(call, lines)
    world.run(2.0)
    assert delegate(call, "monitor-proximity", [], to="1", wait="acceptance") == NO, "wherever it is asked for"
    [told] = lines()
    assert (told["event"], told["conversation"], told["unit"]) == ("runs-already", conversation, 0)
    assert delegate(Call(call.settings, Output(json_lines=False)), "monitor-proximity", [], to=None, wait=None) == NO
    assert "platform 0 coordinates it since" in " ".join(capsys.readouterr().out.split())
    assert delegate(call, "create-monitor", ["name=nmac"], to="1", wait=None) == DONE
    assert delegate(call, "create-monitor", ["name=nmac"], to="2", wait=None) == DONE, "another platform's own"
    lines()
    assert delegate(call, "create-monitor", ["name=nmac"], to="1", wait=None) == NO
    assert [entry["unit"] for entry in lines()] == [1]
    for pairs in (["profile=nmac"], ["avoidance=no"]):
        assert delegate(call, "monitor-proximity", pairs, to="0", wait=None) == DONE, "another request"
    world.run(1.0)
    lines()
    assert tasks(call) == DONE
    assert sum(entry["task"] == "monitor-proximity" for entry in lines()) == 3


def test_a_task_that_another_platform_may_end_does_not_take_the_place_of_ones_own(
    world: Box, call: Call, lines: Lines
) -> None:
    from dyknow.console.commands.members.delegate import delegate
    from dyknow.console.commands.members.monitors import monitors

    of_a_platform = world.asked("2", "0", MonitorProximity())
    world.run(3.0)
    assert delegate(call, "monitor-proximity", [], to="0", wait=None) == DONE
    world.run(2.0)
    world.cancel("2", "0", of_a_platform.conversation)
    world.run(2.0)
    lines()
    assert monitors(call) == DONE
    assert {entry["by"] for entry in lines() if "monitor" in entry} == {0, 1, 2}


def test_a_task_is_not_believed_to_run_where_platforms_have_no_monitors(
    world: Box, call: Call, lines: Lines, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dyknow.console.commands.members.delegate import delegate

    answer = TaskLife.on_tasks

    def lie(life: TaskLife, act: Act, content: Tasks, now_us: int) -> None:
        if life._unit != "2":
            return answer(life, act, content, now_us)
        made_up = TaskEntry(
            conversation="cc-4711-1.2", task="monitor-proximity", unit="2", state="running", since_us=1,
            delegator="interface@cc-4711", monitors=("proximity", "proximity-warn"), avoidance=True,
        )  # fmt: skip
        return life._agent.answer(act, Performative.INFORM, TaskList(tasks=(made_up,)), now_us)

    monkeypatch.setattr(TaskLife, "on_tasks", lie)
    assert delegate(call, "monitor-proximity", [], to="0", wait=None) == DONE
    assert lines()[0]["performative"] == "agree"


def test_who_alone_has_no_monitor_is_named(world: Box, call: Call, lines: Lines) -> None:
    from dyknow.console.commands.members.alarms import alarms
    from dyknow.console.commands.members.monitors import monitors

    _delegated(call, lines)
    world.run(2.0)
    lost = world.platform("1").built.tasks
    for task in [task for task in lost.all() if task.monitor]:
        lost.end(task, "0", world.now_us)
    world.settle("1")
    for command in (monitors, alarms):
        lines()
        command(call)
        assert {"by": 1, "error": "lacks a monitor that is delegated for all platforms"} in lines()


def test_a_task_that_a_successor_holds_is_named_with_its_holder(world: Box, call: Call, lines: Lines) -> None:
    from dyknow.console.commands.members.delegate import delegate

    conversation = _delegated(call, lines)
    world.run(3.0)
    world.kill("0")
    world.run(8.0)
    assert delegate(call, "monitor-proximity", [], to="2", wait=None) == NO
    [told] = lines()
    assert (told["conversation"], told["unit"]) == (conversation, 1)


def test_an_unknown_task_and_an_unknown_conversation_are_told(world: Box, call: Call) -> None:
    from dyknow.console.commands.members.delegate import cancel, delegate

    with pytest.raises(WrongCall, match="Did you mean 'monitor-proximity'"):
        delegate(call, "monitor-proximty", [], to=None, wait=None)
    with pytest.raises(NothingFound, match="dyknow tasks"):
        cancel(call, "cc-1-1")


def test_a_task_for_one_platform_needs_its_name(world: Box, call: Call) -> None:
    from dyknow.console.commands.members.delegate import delegate

    with pytest.raises(WrongCall, match="there are 0, 1, 2"):
        delegate(call, "hold", [], to=None, wait=None)


def test_a_refusal_is_an_answer_of_no(world: Box, call: Call, lines: Lines) -> None:
    from dyknow.console.commands.members.delegate import delegate

    pairs = ["semantic-labels=max-speed", "sample-period=1s", "delay=1s", "to-units=0"]
    assert delegate(call, "create-multicast", pairs, to="1", wait="acceptance") == NO
    assert lines()[-1]["performative"] == "refuse"


def test_alarms_are_told_as_they_happen_and_remembered(
    monkeypatch: pytest.MonkeyPatch, call: Call, lines: Lines
) -> None:
    from dyknow.console.commands.members.alarms import alarms

    world = Box()
    world.fly("0", -60.0, 0.0, 5.0)
    world.fly("1", 60.0, 3.0, -5.0)
    monkeypatch.setattr(client, "_client_ports", lambda _call: world.client_ports())
    world.run(1.5)
    _delegated(call, lines)
    assert alarms(call, follow=True, count=4) == DONE
    followed = lines()
    assert {entry["event"] for entry in followed} >= {"opened"}
    assert {tuple(sorted(entry["units"])) for entry in followed} == {(0, 1)}
    world.run(20.0)
    assert alarms(call, follow=False, count=None) == DONE
    remembered = lines()
    assert {entry["id"] for entry in followed} <= {entry["id"] for entry in remembered}
    assert {"opened", "closed"} == {entry["event"] for entry in remembered}
    assert [entry["detected_us"] for entry in remembered] == sorted(entry["detected_us"] for entry in remembered)
    assert {entry["monitor"] for entry in remembered} >= {"proximity", "proximity-warn"}


def test_an_alarm_says_what_it_is_about_in_which_units_and_whether_it_is_still_open(
    monkeypatch: pytest.MonkeyPatch, call: Call, lines: Lines, capsys: pytest.CaptureFixture[str]
) -> None:
    from dyknow.console.commands.members.alarms import _quantity, alarms
    from dyknow.federation.messages.contents import Alarm

    world = Box()
    world.fly("0", 0.0, 0.0)
    world.fly("1", 0.0, 5.0)
    monkeypatch.setattr(client, "_client_ports", lambda _call: world.client_ports())
    world.run(1.5)
    _delegated(call, lines)
    world.run(3.0)
    assert alarms(Call(call.settings, Output(json_lines=False))) == DONE
    out = " ".join(capsys.readouterr().out.split())
    assert re.search(r"opened proximity 0, 1 by [01], .* after the sample, still open xy_dist 5\.0 m", out)
    high = Alarm(
        id="9-1", event="opened", monitor="too_high", by="9", units=("9",), valid_us=1, detected_us=2, values={}
    )
    assert _quantity("alt.altitude_m[uav1]", 60.31, high) == "alt.altitude_m[uav1] 60.3 m"
    assert _quantity("alt.altitude_m[9]", 60.31, high) == "alt.altitude_m 60.3 m"
    assert _quantity("cpa_time[0, 9]", 1_500_000, high) == "cpa_time[0, 9] 1.5 s"
    assert _quantity("mode[9]", "AUTO", high) == "mode AUTO"


def test_ls_watches_until_it_is_interrupted(world: Box, call: Call, capsys: pytest.CaptureFixture[str]) -> None:
    from dyknow.console.commands.members.ls import ls

    def interrupt() -> None:
        raise KeyboardInterrupt

    world.at(world.now_us + 2_500_000, interrupt)
    with pytest.raises(KeyboardInterrupt):
        ls(Call(call.settings, Output(json_lines=False)), watch=True)
    assert capsys.readouterr().out.count("altitude") == 3


def _freeze_for_a_moment(world: Box) -> None:
    world.lacking |= {PositionReport, VelocityReport, HomeReport, BatteryReport, StatusReport}
    world.at(world.now_us + 4_000_000, world.lacking.clear)


WITHIN_US = 2_000_000


@pytest.mark.parametrize(
    ("happens", "events"),
    [
        (lambda world: world.kill("2"), {"gone", "unknown"}),
        (lambda world: world.freeze("2"), {"silent", "gone", "unknown"}),
        (lambda world: world.end("2"), {"left", "ended"}),
        (_freeze_for_a_moment, {"unknown", "known"}),
    ],
    ids=["killed", "frozen", "left", "without data for a moment"],
)
def test_followers_of_alarms_are_told_when_monitoring_is_lost_and_when_it_is_back(
    world: Box, call: Call, lines: Lines, happens: Callable[[Box], None], events: set[str]
) -> None:
    from dyknow.console.commands.members.alarms import alarms

    class Enough(Exception):
        pass

    def end() -> None:
        raise Enough

    _delegated(call, lines)
    world.run(3.0)
    since_us = world.now_us + 3_000_000
    world.at(world.now_us + 3_000_000, lambda: happens(world))
    world.at(world.now_us + 12_000_000, end)
    with pytest.raises(Enough):
        alarms(call, follow=True, count=None)
    told = [entry for entry in lines() if entry.get("monitor") not in OF_SEPARATION]
    assert {entry["event"] for entry in told} == events
    for event in events:
        delay_us = min(entry["at_us"] for entry in told if entry["event"] == event) - since_us
        within_us = {"gone": 3_000_000 if "silent" in events else 1_000_000, "known": 4_500_000}.get(event, WITHIN_US)
        assert 0 <= delay_us <= within_us, event
    if "unknown" in events:
        lost = [entry for entry in told if entry["event"] == "unknown"]
        assert {tuple(entry["units"]) for entry in lost} >= {(0, 2), (1, 2)}
        assert all(entry["which"] for entry in lost)
        back = [entry for entry in told if entry["event"] == "known"]
        assert len(back) == (len(lost) if "known" in events else 0)


def test_who_follows_alarms_is_told_that_none_is_open_and_who_is_nearest(
    world: Box, call: Call, capsys: pytest.CaptureFixture[str]
) -> None:
    from dyknow.console.centre.separation import closest
    from dyknow.console.commands.members.alarms import _note_calm

    with client.connected(call) as connection:
        connection.settle()
        pair = closest(connection)
        assert pair is not None
        assert pair[2] == pytest.approx(200.0, abs=5.0), "they fly in a row, 200 m apart"
        _note_calm(Call(call.settings, Output(json_lines=False)), connection)
    assert "no alarm is open now; the nearest two are" in " ".join(capsys.readouterr().err.split())


def test_alarms_and_monitors_end_with_how_many_monitors_are_unknown(
    world: Box, call: Call, lines: Lines, capsys: pytest.CaptureFixture[str]
) -> None:
    from dyknow.console.commands.members.alarms import alarms
    from dyknow.console.commands.members.monitors import monitors

    text = Call(call.settings, Output(json_lines=False))
    _delegated(call, lines)
    world.run(3.0)
    assert alarms(text, follow=False, count=None) == NO
    assert "unknown" not in capsys.readouterr().err
    world.kill("2")
    world.run(2.0)
    assert alarms(text, follow=False, count=None) == NO
    told = " ".join(capsys.readouterr().err.split())
    assert "4 of 8 monitors are unknown" in told
    assert "platform 2: gone" in told
    assert alarms(call, follow=False, count=None) == NO
    assert lines()[-1] == {"monitors": 8, "unknown": 4}
    assert monitors(call) == DONE
    shown = lines()
    assert shown[-1] == {"monitors": 8, "unknown": 4}
    assert shown[-2]["by"] == 2
    unknown = [entry for entry in shown if entry.get("shows") == "unknown"]
    assert {tuple(entry["units"]) for entry in unknown} == {(0, 2), (1, 2)}
    assert not any(entry.get("shows") == "ok" for entry in shown if 2 in entry.get("units", ()))


def test_a_follower_who_comes_later_is_told_what_is_unknown_already(world: Box, call: Call, lines: Lines) -> None:
    from dyknow.runtime.library.alarm_news import AlarmNews

    _delegated(call, lines)
    world.run(3.0)
    world.kill("2")
    world.run(3.0)
    with client.connected(call) as one:
        for _ in range(2):
            news = AlarmNews(one)
            told = [each for _ in range(10) for each in one.run(news.next(0.2))]
            assert {each.event for each in told} == {"unknown", "gone"}
            assert sum(each.event == "unknown" for each in told) == 4


def test_a_monitor_without_another_platform_to_watch_says_so(
    monkeypatch: pytest.MonkeyPatch, call: Call, lines: Lines, capsys: pytest.CaptureFixture[str]
) -> None:
    from dyknow.console.commands.members.monitors import monitors

    world = Box()
    world.fly("0", 0.0, 0.0)
    monkeypatch.setattr(client, "_client_ports", lambda _call: world.client_ports())
    world.run(2.0)
    _delegated(call, lines)
    world.run(1.0)
    assert monitors(call) == DONE
    assert {(entry["monitor"], entry["shows"]) for entry in lines()} == {
        ("proximity", "idle"),
        ("proximity-warn", "idle"),
    }
    assert monitors(Call(call.settings, Output(json_lines=False))) == DONE
    out = capsys.readouterr().out
    assert "without another platform to watch" in out


def test_acts_are_told_in_s_expressions(world: Box, call: Call, lines: Lines) -> None:
    from dyknow.console.commands.members.acts import acts

    _delegated(call, lines)
    assert acts(call, follow=False) == DONE
    said = [entry["act"] for entry in lines() if entry["act"]]
    assert any("(monitor-proximity)" in act for act in said)
    assert any("(create-monitor name: proximity" in act for act in said)


def test_acts_are_a_line_each_without_questions_and_without_second_copies(
    world: Box, call: Call, lines: Lines, capsys: pytest.CaptureFixture[str]
) -> None:
    from dyknow.console.commands.members.acts import acts

    _delegated(call, lines)
    world.run(1.0)
    text = Call(call.settings, Output(json_lines=False))

    def shown(**options: Any) -> list[str]:
        assert acts(text, **options) == DONE
        return [line.partition("  ")[2] for line in capsys.readouterr().out.splitlines()]

    short, whole = shown(), shown(is_whole=True)
    assert short.count("0 -> 1  request create-monitor proximity 0 0 cc") <= 1
    assert any(line.startswith("0 -> 1  request create-monitor proximity") for line in short)
    assert not any("query-ref" in line for line in short)
    assert any("query-ref" in line for line in whole)
    assert len(whole) > len(short)
    assert shown(last=2) == short[-2:]
    assert all("0" in line.partition("  ")[0].split(" -> ") for line in shown(unit="0"))
    assert any(line.startswith(("(inform", "(agree", "(request")) for line in _full(text, capsys))


def _full(call: Call, capsys: pytest.CaptureFixture[str]) -> list[str]:
    from dyknow.console.commands.members.acts import acts

    assert acts(call, full=True, last=3) == DONE
    return capsys.readouterr().out.splitlines()


def test_followed_acts_are_those_from_now_on(
    world: Box, call: Call, lines: Lines, capsys: pytest.CaptureFixture[str]
) -> None:
    from dyknow.console.commands.members.acts import acts

    class Enough(Exception):
        pass

    def stop() -> None:
        raise Enough

    _delegated(call, lines)
    world.run(2.0)
    world.at(world.now_us + 2_000_000, stop)
    with pytest.raises(Enough):
        acts(Call(call.settings, Output(json_lines=False)), follow=True)
    assert "create-monitor" not in capsys.readouterr().out


def test_a_fault_reaches_the_simulated_vehicle(world: Box, call: Call, lines: Lines) -> None:
    from dyknow.console.commands.members.delegate import fault

    assert fault(call, "1", "packet-loss=30", "5s") == DONE
    [told] = lines()
    assert (told["unit"], told["fault"]) == (1, "packet-loss=30")
    assert told["until_us"] == pytest.approx(world.now_us + 5_000_000, abs=1_000_000)
    [(injected, _)] = world.vehicle("1").faults
    assert str(injected) == "packet-loss=30"


def test_a_formula_is_checked_over_live_states(world: Box, call: Call, lines: Lines) -> None:
    from dyknow.console.commands.texts.check import check

    assert check(call, "always height[self] < 20", trace=None, unit="0", timeout="3s") == NO
    [told] = lines()
    assert (told["verdict"], type(told["t_ms"])) == ("false", int)
    assert check(call, "always height[self] > 20", trace=None, unit="0", timeout="2s") == DONE
    [told] = lines()
    assert (told["verdict"], told["t_ms"], told["index"]) == ("undecided", None, None)
    assert told["states"].startswith("strmgen check_states = state(heli-height[0] with sample every 100")


def test_one_formula_is_checked_over_a_derived_feature_and_a_stream_of_the_platform(
    world: Box, call: Call, lines: Lines
) -> None:
    from dyknow.console.commands.texts.check import check

    text = "always (height[self] < 20 or heli-altitude.altitude_m[0] < 0)"
    assert check(call, text, trace=None, unit="0", timeout="3s") == NO
    [told] = lines()
    assert told["verdict"] == "false"
    samples = {label for reason in told["because"] for label in reason["samples"]}
    assert samples == {"height[0]", "heli-altitude.altitude_m[0]"}


def test_a_formula_about_what_never_had_a_value_is_noted(
    monkeypatch: pytest.MonkeyPatch, call: Call, capsys: pytest.CaptureFixture[str]
) -> None:
    from dyknow.console.commands.texts.check import check

    world = Box()
    world.lacking.add(BatteryReport)
    world.fly("0", 0.0, 0.0)
    monkeypatch.setattr(client, "_client_ports", lambda _call: world.client_ports())
    assert check(call, "always speed[self] < 1000", trace=None, unit="0", timeout="1s") == DONE
    assert capsys.readouterr().err == ""
    assert check(call, "always battery[self] > 0", trace=None, unit="0", timeout="1s") == DONE
    out, err = capsys.readouterr()
    assert '"undecided"' in out
    assert "note: battery[0] has no value on platform 0." in err.replace("\n", " ")


@pytest.mark.parametrize("formula", ["always sped[self] < 3", "always speed[self, 1] < 3", "always speed[self] <"])
def test_a_mistake_in_a_formula_about_a_platform_is_a_wrong_call(world: Box, call: Call, formula: str) -> None:
    from dyknow.console.commands.texts.check import check
    from dyknow.console.errors import WRONG, exit_code

    with pytest.raises(DyknowError) as told:
        check(call, formula, trace=None, unit="0", timeout="1s")
    assert exit_code(told.value) == WRONG
    assert "^" in str(told.value)


def test_a_federation_with_a_faster_clock_is_understood(
    monkeypatch: pytest.MonkeyPatch, call: Call, lines: Lines
) -> None:
    from dyknow.console.commands.members.ls import ls
    from dyknow.federation.members.clock import FederationClock

    world = Box(clock=FederationClock(EPOCH - 5_000_000, 10.0))
    world.fly("0", 0.0, 0.0)
    world.fly("1", 0.0, 300.0)
    monkeypatch.setattr(client, "_client_ports", lambda _call: world.client_ports())
    world.run(2.0)
    assert ls(call, all_kinds=False) == DONE
    assert [entry["state"] for entry in lines()] == ["alive", "alive"]
    assert _query(call, unit="0", at="-5s") == DONE
    [told] = lines()
    assert told["valid_us"] == pytest.approx(world.clock.federation_us(world.now_us) - 5_000_000, abs=4_000_000)


def test_hz_measures_the_rate_the_loss_and_the_latency_of_a_label(
    world: Box, call: Call, lines: Lines, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from dyknow.console.commands.members.hz import hz

    assert hz(call, "heli-altitude", duration="3s") == DONE
    shown = lines()
    assert [entry["unit"] for entry in shown] == [0, 1, 2]
    assert {entry["rate_hz"] for entry in shown} == {10.0}
    assert {entry["loss"] for entry in shown} == {0.0}
    assert all(500 <= entry["latency_us"] <= 5_000 for entry in shown)
    monkeypatch.setattr(client, "os", SimpleNamespace(getpid=lambda: 2))  # another process, another member
    assert hz(Call(call.settings, Output(json_lines=False)), "heli-altitude", unit="1", duration="2s") == DONE
    assert "10.0 Hz   10.0 Hz   0.0%" in capsys.readouterr().out
    with pytest.raises(NothingFound, match="Did you mean 'heli-altitude'"):
        hz(call, "heli-altitud")


def test_what_is_lost_is_a_share_of_what_was_due() -> None:
    from dyknow.console.commands.members.hz import _Arrival, _record

    one = _record("0", "battery", 100_000, [_Arrival(at * 100_000, 2_000 + at) for at in (0, 1, 3, 4, 7)])
    assert (one["samples"], one["loss"], one["rate_hz"]) == (5, 0.375, 5.714)
    assert (one["latency_us"], one["latency_max_us"]) == (2_003, 2_007)
    assert _record("0", "battery", 100_000, [])["rate_hz"] is None
