"""What people read."""

import pytest

from dyknow import NO_VALUE
from dyknow.console.output.output import Output, unit_json
from dyknow.console.output.shown import printable, styled


def test_brackets_in_what_others_say_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    Output(json_lines=False).say(styled("heli-position[1], speed[uav1]", "red"))
    assert capsys.readouterr().out == "heli-position[1], speed[uav1]\n"


def test_notes_are_shown_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    Output(json_lines=False).note("no speed[uav1] here")
    assert capsys.readouterr().err == "no speed[uav1] here\n"


def test_nothing_that_others_say_commands_the_terminal() -> None:
    assert printable("\x1b[2J\x07gone\u202e") == "\\x1b[2J\\x07gone\\u202e"


def test_a_numbered_unit_is_a_number_in_json() -> None:
    assert [unit_json("3"), unit_json("visitor")] == [3, "visitor"]


def test_an_attribute_without_a_value_is_null_in_json(capsys: pytest.CaptureFixture[str]) -> None:
    Output(json_lines=True).line({"value": {"symbol": "car1", "colour": NO_VALUE}})
    assert capsys.readouterr().out == '{"value":{"symbol":"car1","colour":null}}\n'


def test_json_lines_hold_no_words_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    out = Output(json_lines=True)
    with out.waiting("patience"):
        out.say(styled("ready", "green"), event="ready")
    caught = capsys.readouterr()
    assert (caught.out, caught.err) == ('{"event":"ready"}\n', "")


def test_an_alarm_in_a_narrow_terminal_stays_beside_its_time(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    Output(json_lines=False).aside("12:00:01.250", "opened  proximity  0, 1  by 0, 10 ms after the sample")
    first, *rest = capsys.readouterr().out.splitlines()
    assert first.startswith("12:00:01.250  opened")
    assert rest
    assert all(line.startswith(" " * 14) for line in rest)


def test_what_is_to_be_copied_is_never_broken(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    name = "cc-4711-64a1b2c3d4e5f-12"
    Output(json_lines=False).table("", ("task", "conversation"), [("monitor-proximity", name)], whole=("conversation",))
    assert name in capsys.readouterr().out


def test_what_is_said_may_have_a_text_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    Output(json_lines=True).say("for people", event="note", text="for programs")
    assert capsys.readouterr().out == '{"event":"note","text":"for programs"}\n'
