"""`dyknow kpl run`, `graph` and `verify`: what they show, what they refuse, and what ends them."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from dyknow.agents.specification.options import RunOptions
from dyknow.console.command import Call
from dyknow.console.commands.texts import specification_runs, specifications, verification
from dyknow.console.output.output import Output, folded
from dyknow.model.errors import NameRefused, TextError, UnitError, WrongCall
from tests.console.conftest import Lines

PATIENCE_S = 100.0
SPECIFICATION = """\
source pos gps
strmgen pos[car1] = gps
stream all = pos[car1]
stream punctual = pos[car1] with max delay 50
"""
FEED = """\
{"t_ms": 0, "at_ms": 10, "gps": 1.5}

{"t_ms": 100, "at_ms": 190, "gps": [58.4, 15.6]}
{"t_ms": 200, "gps": null}
"""
UNIT = """\
from dyknow import source, value_unit

@value_unit("pos", "pos", name="Doubled")
def doubled(value):
    return value * 2

@source("pos", name="clock")
def clock(from_us):
    valid_us = -(-from_us // 20_000) * 20_000
    while True:
        yield valid_us, 1.0
        valid_us += 20_000
"""


class Place:
    """A folder with a specification, a feed and a module."""

    def __init__(self, folder: Path, call: Call) -> None:
        self.folder, self.call = folder, call
        self.spec = self.write("car.kpl", SPECIFICATION)
        self.feed = self.write("car.jsonl", FEED)
        self.units = self.write("car.py", UNIT)

    def write(self, name: str, text: str) -> Path:
        path = self.folder / name
        path.write_text(text)
        return path

    def run(self, **chosen: Any) -> int:
        run = {key: chosen.pop(key) for key in ("modules", "roads", "govern", "admit", "feed") if key in chosen}
        return specification_runs.run(self.call, self.spec, options=RunOptions(**{"feed": self.feed, **run}), **chosen)


@pytest.fixture
def place(tmp_path: Path, call: Call) -> Place:
    return Place(tmp_path, call)


def test_every_sample_of_a_declared_stream_is_an_object(place: Place, lines: Lines) -> None:
    assert place.run() == 0
    found = [(one["stream"], one["valid_us"], one["available_us"], one["value"]) for one in lines()]
    assert found == [
        ("all", 0, 10_000, 1.5),
        ("punctual", 0, 10_000, 1.5),
        ("all", 100_000, 190_000, [58.4, 15.6]),
        ("all", 200_000, 200_000, None),
        ("punctual", 200_000, 200_000, None),
    ]


def test_a_sample_tells_how_good_it_is_and_a_state_how_its_values_were_obtained(place: Place, lines: Lines) -> None:
    place.write(
        "car.py",
        """
from dyknow import Quality, Sample, computational_unit

@computational_unit("pos", "pos", name="Guess")
def guess(now_us, pos):
    return Sample(now_us, pos.valid_us, pos.value, Quality(0.5, ((4.0,),)))
""",
    )
    place.write(
        "car.kpl",
        "source pos gps\nsource pos other\ncompunit pos Guess(pos)\nstrmgen a = gps\nstrmgen b = other\n"
        "strmgen c = Guess(a)\nstrmgen both = state(a, b)\nstream guessed = c\nstream both = both\n",
    )
    place.write("car.jsonl", '{"t_ms": 0, "other": 7}\n{"t_ms": 100, "gps": 1}\n')
    assert place.run(modules=[str(place.units)]) == 0
    state, guessed = sorted(lines(), key=lambda one: str(one["stream"]))
    assert (guessed["certainty"], guessed["covariance"]) == (0.5, [[4.0]])
    assert state["origins"] == {
        "a": {"manner": "exact", "valid_us": 100_000},
        "b": {"manner": "most recent", "valid_us": 0},
    }


def test_a_merged_sample_says_of_which_member_it_is(place: Place, lines: Lines) -> None:
    text = (
        "source number a\nsource number b\nsource object ids\nstrmgen v[c1] = a\nstrmgen v[c2] = b\nstrmgen who = ids\n"
        "strmgen merged = merge v[car] for car in who\nstream out = merged\nstream one = v[c1]\n"
    )
    feed = '{"t_ms": 0, "ids": ["c1", "c2"]}\n{"t_ms": 100, "a": 1, "b": 2}\n{"t_ms": 200, "b": 1}\n'
    place.spec, place.feed = place.write("merged.kpl", text), place.write("merged.jsonl", feed)
    assert place.run() == 0
    said = [(each["stream"], each["valid_us"], each.get("of")) for each in lines() if each["event"] == "sample"]
    assert sorted(said, key=str) == [
        ("one", 100_000, None), ("out", 100_000, "v[c1]"), ("out", 100_000, "v[c2]"), ("out", 200_000, "v[c2]")
    ]  # fmt: skip


def test_for_people_values_are_short_and_no_value_is_said(place: Place, capsys: pytest.CaptureFixture[str]) -> None:
    place.call = Call(place.call.settings, Output(json_lines=False))
    place.write("car.jsonl", '{"t_ms": 0, "gps": 0.30000000000000004}\n{"t_ms": 5, "at_ms": 6.04, "gps": null}\n')
    assert place.run() == 0
    shown = [line.split() for line in capsys.readouterr().out.splitlines() if " all " in line]
    assert shown == [
        ["0", "ms", "all", "0.3", "0", "ms", "later"],
        ["5", "ms", "all", "no", "value", "1", "ms", "later"],
    ]


def test_self_is_the_unit_that_was_given(place: Place, lines: Lines) -> None:
    place.write("car.kpl", "source pos gps\nstrmgen pos[self] = gps\nstream mine = pos[uav7]\n")
    assert place.run(unit="uav7") == 0
    assert len(lines()) == 3
    with pytest.raises(NameRefused):
        place.run(unit="UAV 7")


def test_a_run_ends_after_its_duration(place: Place, lines: Lines) -> None:
    assert place.run(duration="150ms") == 0
    assert [one["valid_us"] for one in lines()] == [0, 0]
    place.write("car.kpl", "source pos clock\nstrmgen pos[car1] = clock\nstream all = pos[car1]\n")
    assert place.run(feed=None, modules=[str(place.units)], pace=10.0, duration="1s") == 0
    assert 40 <= len(lines()) <= 51


@pytest.mark.parametrize("speed", [-1.0, float("nan"), float("inf"), 1e9])
def test_a_speed_that_is_none_is_refused(place: Place, speed: float) -> None:
    with pytest.raises(WrongCall, match="--speed is how many times"):
        place.run(pace=speed)


def test_nothing_to_come_is_told(place: Place, capsys: pytest.CaptureFixture[str]) -> None:
    assert place.run(feed=None) == 0
    assert "no samples of gps: give --feed FILE.jsonl" in capsys.readouterr().err
    place.write("car.jsonl", '{"t_ms": 0, "gsp": 1}\n')
    assert place.run() == 0
    said = capsys.readouterr().err
    assert "has nothing for gps" in said
    assert "has samples of gsp, which is no source here" in said


def test_a_unit_that_no_module_offers_is_noted_below_for_as_without(
    place: Place, capsys: pytest.CaptureFixture[str]
) -> None:
    place.write(
        "car.kpl",
        "source object gps\nstrmgen cars = gps\ncompunit number Foo(object)\nfor c in cars strmgen x[c] = Foo(cars)\n",
    )
    assert place.run() == 0
    assert "note: no module offers Foo: x[c] and what is made of it wait (--units MODULE)." in capsys.readouterr().err


def test_exports_and_imports_are_said_to_need_a_federation(place: Place, capsys: pytest.CaptureFixture[str]) -> None:
    place.write("car.kpl", "source position gps\nstrmgen pos[self] = gps\nexport heli-position = pos[self]\n")
    assert place.run(unit="3") == 0
    assert "dyknow join --unit 3 --spec" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("t_ms: 100\n", 1, "no JSON"),
        ('{"t_ms": 0, "gps": 1}\n{"t_ms": 1, "gps": NaN}\n', 2, "NaN is no value"),
        ('{"t_ms": -5, "gps": 1}\n', 1, "t_ms is a time"),
        ('{"t_ms": "now", "gps": 1}\n', 1, "t_ms is a time"),
        ('{"t_ms": 5, "at_ms": null, "gps": 1}\n', 1, "at_ms is a time"),
        ('{"t_ms": 1e300, "gps": 1}\n', 1, "t_ms is a time"),
        ('{"gps": 1}\n', 1, "t_ms is a time"),
        ("[1, 2]\n", 1, "a line is a JSON object"),
        ('{"t_ms": 5, "gps": {"lat": 1}}\n', 1, "one JSON object of values"),
        ('{"t_ms": 5, "gps": ' + "[" * 100_000 + "\n", 1, "no JSON"),
        ('{"t_ms": 5, "gps": "' + "x" * (1 << 20) + '"}\n', 1, "is longer than"),
    ],
)
def test_a_feed_that_is_none_is_told_with_its_line(place: Place, text: str, line: int, said: str) -> None:
    place.write("car.jsonl", text)
    with pytest.raises(TextError, match=said) as wrong:
        place.run()
    assert (wrong.value.line, wrong.value.file) == (line, str(place.feed))


def test_files_that_cannot_be_read_or_written_are_wrong_calls(place: Place) -> None:
    (place.folder / "latin.jsonl").write_bytes(b"\xff\xfe")
    for feed in (place.folder, place.folder / "nothing.jsonl", place.folder / "latin.jsonl"):
        with pytest.raises(WrongCall, match=r"--feed: .* cannot be read"):
            place.run(feed=feed)
    for record in (place.folder, place.folder / "nowhere" / "run.jsonl"):
        with pytest.raises(WrongCall, match=r"--record: .* cannot be written"):
            place.run(record=record)
    place.spec = place.folder
    with pytest.raises(WrongCall, match="cannot be read"):
        place.run()


@pytest.mark.parametrize("name", ["spec", "feed", "units"])
def test_a_record_never_replaces_what_is_read(place: Place, name: str) -> None:
    path = getattr(place, name)
    before = path.read_text()
    with pytest.raises(WrongCall, match="is read by this run"):
        place.run(record=path, modules=[str(place.units)])
    assert path.read_text() == before


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("import nothing_of_this_name\n", "needs 'nothing_of_this_name', which is not installed"),
        ("def broken(:\n", r"car\.py:1: .*; repair it"),
        ("raise RuntimeError('no device')\n", r"car\.py:1: RuntimeError: no device"),
        ("raise SystemExit(0)\n", "SystemExit"),
    ],
)
def test_a_module_that_does_not_load_is_told_with_its_place(place: Place, text: str, said: str) -> None:
    place.write("car.py", text)
    with pytest.raises(UnitError, match=said):
        place.run(modules=[str(place.units)])


@pytest.mark.parametrize("name", ["nothing.py", "no_such_module", "os"])
def test_a_module_that_is_not_there_is_told_and_one_without_units_does_no_harm(place: Place, name: str) -> None:
    if name == "os":
        assert place.run(modules=[name]) == 0
        return
    with pytest.raises(UnitError, match="there is no"):
        place.run(modules=[name])


def test_a_unit_that_fails_is_told_three_times_and_the_others_go_on(
    place: Place, capsys: pytest.CaptureFixture[str]
) -> None:
    place.write(
        "car.kpl",
        f"{SPECIFICATION}compunit pos Doubled(pos)\nstrmgen twice[car1] = Doubled(pos[car1])\nstream b = twice[car1]\n",
    )
    place.write("car.jsonl", "".join(f'{{"t_ms": {i}, "gps": true}}\n' for i in range(3)))
    place.write("car.py", UNIT.replace("value * 2", "value.nothing"))
    assert place.run(modules=[str(place.units)]) == 0
    said = capsys.readouterr()
    assert said.err.count("note: twice[car1]") == 3
    assert said.err.count(f"at {place.units}:5") == 3
    assert "further ones of it are not reported" in said.err
    assert [json.loads(line)["stream"] for line in said.out.splitlines()].count("all") == 3


def test_a_stream_called_like_a_generator_is_another_node(place: Place, lines: Lines) -> None:
    place.write("car.kpl", "source pos gps\nstrmgen here = gps\nstream here = here with sample every 100\n")
    assert place.run(graph="json") == 0
    graph = lines()[-1]
    assert [node["name"] for node in graph["nodes"]] == ["here", "stream here"]
    assert [(edge["source"], edge["target"]) for edge in graph["edges"]] == [("here", "stream here")]


def test_what_waits_for_others_at_the_end_of_a_feed_is_waited_for(place: Place, lines: Lines) -> None:
    place.write(
        "car.kpl",
        "source pos gps\nsource pos other\nstrmgen a = gps\nstrmgen b = other\n"
        "strmgen both = state(a, b) with sample every 100, max delay 300\nstream states = both\n"
        "monitor low = always a < 5 with sample every 100, max delay 1s\n",
    )
    place.write("car.jsonl", '{"t_ms": 0, "gps": 1, "other": 1}\n{"t_ms": 100, "gps": 7}\n')
    assert place.run() == 0
    told = [(one["event"], one["valid_us"]) for one in lines()]
    assert told[:3] == [("sample", 0), ("alarm-opened", 100_000), ("sample", 100_000)]


def test_what_a_governor_tells_is_there_when_there_is_one(place: Place, lines: Lines) -> None:
    place.write("car.kpl", f"{SPECIFICATION}stream told = refinements\n")
    assert specifications.check(place.call, place.spec) == 0
    assert specifications.graph(place.call, place.spec, unit="0", form="json") == 0
    assert place.run(govern="100ms") == 0
    with pytest.raises(WrongCall, match="--govern"):
        place.run()


@pytest.mark.parametrize("form", ["text", "mermaid", "dot"])
def test_the_network_is_drawn_in_the_end(place: Place, capsys: pytest.CaptureFixture[str], form: str) -> None:
    place.call = Call(place.call.settings, Output(json_lines=False))
    assert place.run(graph=form) == 0
    drawn = capsys.readouterr().out
    assert "punctual" in drawn
    assert {"text": "dropped: 1 late", "mermaid": "flowchart LR", "dot": "digraph"}[form] in drawn


def test_the_network_is_one_object_with_json(place: Place, lines: Lines) -> None:
    assert specifications.graph(place.call, place.spec, unit="0", form="mermaid") == 0
    (drawn,) = lines()
    assert {node["name"] for node in drawn["nodes"]} == {"pos[car1]", "all", "punctual"}
    assert {(edge["source"], edge["target"]) for edge in drawn["edges"]} == {
        ("pos[car1]", "all"),
        ("pos[car1]", "punctual"),
    }


def test_the_network_tells_families_imports_and_exports(place: Place, lines: Lines) -> None:
    place.write(
        "car.kpl",
        "source cars ids\nstrmgen ids = ids\nimport heli-position from 1 as pos[uav1]\n"
        "compunit position Same(position)\nfor car in ids strmgen p[car] = Same(pos[uav1])\n"
        "export heli-position = pos[uav1]\n",
    )
    place.write(
        "car.py", "from dyknow import value_unit\n\n@value_unit('position', 'position')\ndef Same(x):\n  return x\n"
    )
    assert specifications.graph(place.call, place.spec, modules=[str(place.units)], unit="0", form="json") == 0
    (drawn,) = lines()
    kinds = {node["name"]: node["kind"] for node in drawn["nodes"]}
    assert kinds == {"ids": "source", "pos[uav1]": "import", "p[car]": "family", "heli-position": "export"}


@pytest.mark.parametrize("width", [20, 40, 60, 80])
def test_long_lines_of_the_network_go_on_below_and_fit(width: int) -> None:
    line = "    <- pos[car1] with sample every 500, max delay 200; dropped: 1 late, 3 off grid"
    parts = folded(line, width).splitlines()
    assert all(len(part) <= width for part in parts)
    assert all(part.startswith(" " * 10) for part in parts[1:])
    assert " ".join(" ".join(parts).split()) == " ".join(line.split())


def test_a_recorded_run_satisfies_its_specification_and_one_that_was_changed_does_not(
    place: Place, lines: Lines
) -> None:
    record = place.folder / "run.jsonl"
    assert place.run(record=record) == 0
    lines()
    assert verification.verify(place.call, place.spec, journal=record) == 0
    assert [one["satisfied"] for one in lines()] == [True]
    changed = record.read_text().replace('"punctual", "valid_us": 0, "available_us": 10000', '"punctual", "valid_us": 0, "available_us": 99000')  # fmt: skip
    record.write_text(changed)
    assert verification.verify(place.call, place.spec, journal=record) == 1
    *broken, summary = lines()
    assert summary["violations"] == len(broken) > 0
    assert any("max delay 50ms" in one["said"] and one["available_us"] == 99_000 for one in broken)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "begins with its specification"),
        ("no json\n", "no JSON"),
        ('{"specification": ""}\n{"label": "pos[car1]"}\n', "valid_us, available_us and a value"),
        ('{"specification": ""}\n{"stream": 5, "valid_us": 0, "available_us": 0, "value": 1}\n', "a label or a stream"),
        ('{"specification": ""}\n{"label": "a", "valid_us": 0.5, "available_us": 0, "value": 1}\n', "valid_us"),
        ('{"specification": ""}\n{"label": "a[", "valid_us": 0, "available_us": 0, "value": 1}\n', "label"),
        ('{"specification": "", "unit": "UAV 7"}\n', "UAV 7"),
        (
            '{"specification": ""}\n{"label": "a", "valid_us": 0, "available_us": 0, "value": 1, "certainty": "x"}\n',
            "from 0 to 1",
        ),
        (
            '{"specification": ""}\n{"label": "a", "valid_us": 0, "available_us": 0, "value": 1, "certainty": 7}\n',
            "from 0 to 1",
        ),
        (
            '{"specification": ""}\n{"label": "a", "valid_us": 0, "available_us": 0, "value": 1, "covariance": [1]}\n',
            "square",
        ),
    ],
)
def test_a_record_that_is_none_is_told(place: Place, text: str, said: str) -> None:
    record = place.write("run.jsonl", text)
    with pytest.raises((TextError, NameRefused), match=said):
        verification.verify(place.call, place.spec, journal=record)


def test_a_record_that_cannot_be_read_is_a_wrong_call(place: Place) -> None:
    for journal in (place.folder, place.folder / "nothing.jsonl"):
        with pytest.raises(WrongCall, match="kpl run --record FILE"):
            verification.verify(place.call, place.spec, journal=journal)


# In a process of its own, which is there until it is ended


@pytest.fixture
def watched(place: Place) -> "Iterator[subprocess.Popen[str]]":
    place.write("car.kpl", "source pos clock\nstrmgen pos[car1] = clock\nstream first = pos[car1]\n")
    kept = {name: value for name, value in os.environ.items() if not name.startswith("DYKNOW_")}
    # As a terminal starts it: what runs in the background of a shell ignores Ctrl-C.
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from dyknow.console.main import main; main()"
    command = ["kpl", "run", str(place.spec), "--units", str(place.units), "--watch", "--json"]
    with subprocess.Popen(
        [sys.executable, "-c", code, *command],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=kept,
    ) as running:  # fmt: skip
        yield running
        running.kill()


def until(running: "subprocess.Popen[str]", **wanted: Any) -> None:
    assert running.stdout is not None
    for line in running.stdout:
        said = json.loads(line)
        if all(said.get(name) == value for name, value in wanted.items()):
            return
    raise AssertionError(f"it ended without {wanted}: {running.stderr and running.stderr.read()}")


@pytest.mark.live
def test_a_file_that_becomes_wrong_leaves_running_what_ran_and_is_taken_when_it_is_right(
    place: Place, watched: "subprocess.Popen[str]"
) -> None:
    until(watched, event="sample", stream="first")
    place.write("car.kpl", place.spec.read_text().replace("stream first = pos[car1]", "stream first = pso[car1] with"))
    assert watched.stderr is not None
    for line in watched.stderr:
        if "rejected; the previous one keeps running" in line:
            break
    until(watched, event="sample", stream="first")
    place.spec.unlink()
    for line in watched.stderr:
        if "rejected; the previous one keeps running" in line:
            break
    place.write("car.kpl", "source pos clock\nstrmgen pos[car1] = clock\nstream second = pos[car1]\n")
    until(watched, event="changed")
    until(watched, event="sample", stream="second")
    watched.send_signal(signal.SIGINT)
    assert watched.wait(PATIENCE_S) == 130


@pytest.mark.live
def test_what_a_chronicle_file_and_a_definition_become_is_taken_in(
    place: Place, watched: "subprocess.Popen[str]"
) -> None:
    text = (
        "source pos clock\nstrmgen pos[car1] = clock\nstream first = pos[car1]\ndefine LEAST = -1\n"
        'monitor late = always since(pos[car1]) > LEAST\nchronicle file "seen.chr"\nstream seen = chronicle[{}]\n'
    )
    until(watched, event="sample", stream="first")
    place.write("seen.chr", "chronicle one[] { event(pos[car1]:(?, ?), t1) }")
    place.write("car.kpl", text.format("one"))
    until(watched, event="changed")
    place.write(
        "seen.chr", "chronicle one[] { event(pos[car1]:(?, ?), t1) }\nchronicle two[] { event(pos[car1]:(?, ?), t1) }"
    )
    until(watched, event="changed")
    until(watched, event="sample", stream="seen")
    place.write("car.kpl", text.format("two").replace("= -1", "= 1000000"))
    until(watched, event="alarm-opened")


@pytest.mark.live
def test_ctrl_c_ends_a_run_without_a_word(place: Place, watched: "subprocess.Popen[str]") -> None:
    until(watched, event="sample", stream="first")
    watched.send_signal(signal.SIGINT)
    _, said = watched.communicate(timeout=PATIENCE_S)
    assert watched.returncode == 130
    assert "Traceback" not in said
