"""`dyknow chronicle` over recorded events."""

import json
from pathlib import Path

import pytest

from tests.console.conftest import Run

OVERTAKE = """
chronicle overtake[?car1, ?car2] {
    event(behind[?car1, ?car2]:(?, true), t1)
    event(in_front[?car1, ?car2]:(false, true), t2)
    t2 - t1 in [1, 60s]
}
"""
EVENTS = [
    {"t_ms": 100, "attribute": "behind[a, b]", "from": None, "to": True},
    {"t_ms": 100, "attribute": "in_front[a, b]", "from": None, "to": False},
    {"t_ms": 900.9, "attribute": "in_front[a, b]", "from": False, "to": True},
]


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    chronicles, events = tmp_path / "overtake.chr", tmp_path / "events.jsonl"
    chronicles.write_text(OVERTAKE)
    events.write_text("\n".join(json.dumps(event) for event in EVENTS))
    return chronicles, events


def run(dyknow: Run, files: tuple[Path, Path], *more: str):
    return dyknow("chronicle", str(files[0]), "--events", str(files[1]), *more)


def test_each_instance_is_a_line_told_when_it_was_certain(dyknow: Run, files: tuple[Path, Path]) -> None:
    done = run(dyknow, files, "--json")
    assert done.returncode == 0
    assert [json.loads(line) for line in done.stdout.splitlines()] == [
        {
            "chronicle": "overtake",
            "bindings": {"?car1": "a", "?car2": "b"},
            "instants": {"t1": 100, "t2": 900},
            "recognised_ms": 900,
        }
    ]


def test_people_see_a_table(dyknow: Run, files: tuple[Path, Path]) -> None:
    done = run(dyknow, files)
    assert done.returncode == 0
    assert "?car1=a ?car2=b" in done.stdout
    assert "t1=100 t2=900" in done.stdout


def test_nothing_recognised_is_an_answer_and_names_that_never_occur_are_told(
    dyknow: Run, files: tuple[Path, Path]
) -> None:
    files[0].write_text(OVERTAKE.replace("in_front", "infront"))
    done = run(dyknow, files, "--json")
    assert (done.returncode, done.stdout) == (1, "")
    assert "infront occurs nowhere" in done.stderr
    assert "Did you mean 'in_front'?" in done.stderr


def test_what_waits_for_the_clock_is_told_and_a_line_of_time_settles_it(dyknow: Run, files: tuple[Path, Path]) -> None:
    files[0].write_text("chronicle still[?a] { event(behind[?a, ?]:(?, true), t1) noevent(hit[?a], (t1, t1 + 5s)) }")
    done = run(dyknow, files, "--json")
    assert (done.returncode, done.stdout) == (1, "")
    assert "1 more would be recognised if nothing happened after 900 ms" in done.stderr
    files[1].write_text(files[1].read_text() + '\n{"t_ms": 5100}\n')
    done = run(dyknow, files, "--json")
    assert json.loads(done.stdout)["recognised_ms"] == 5100


def test_events_out_of_order_are_ignored_and_told(dyknow: Run, files: tuple[Path, Path]) -> None:
    late = {"t_ms": 50, "attribute": "behind[a, b]", "from": True, "to": False}
    files[1].write_text(files[1].read_text() + "\n" + json.dumps(late))
    done = run(dyknow, files, "--json")
    assert done.returncode == 0
    assert f"1 out of order; the first in {files[1]}:4" in done.stderr


def test_a_value_that_was_another_is_told_as_a_missing_event(dyknow: Run, files: tuple[Path, Path]) -> None:
    files[1].write_text(files[1].read_text().replace('"from": false, "to": true', '"from": null, "to": true'))
    done = run(dyknow, files, "--json")
    assert done.returncode == 1
    assert f"{files[1]}:3: in_front[a, b] changes from unknown, and was false" in done.stderr


def test_a_value_that_has_always_been_has_no_age(dyknow: Run, files: tuple[Path, Path]) -> None:
    files[0].write_text(OVERTAKE.replace("t2 - t1 in [1, 60s]", "t1 < t2"))
    files[1].write_text(files[1].read_text().replace('"t_ms": 100', '"t_ms": "-oo"'))
    done = run(dyknow, files, "--json", "--max-age", "1s")
    assert json.loads(done.stdout)["instants"] == {"t1": "-oo", "t2": 900}


def test_wrong_chronicles_are_a_wrong_call(dyknow: Run, files: tuple[Path, Path]) -> None:
    files[0].write_text("chronicle overtake[?a] { event(behind[?a] true, t1) }")
    assert "overtake.chr:1:" in run(dyknow, files).stderr
    files[0].write_text("chronicle c { event(a, t1) t1 < t1 }")
    done = run(dyknow, files)
    assert done.returncode == 2
    assert "contradict each other" in done.stderr


def test_a_line_that_is_no_event_is_told_by_file_and_line(dyknow: Run, files: tuple[Path, Path]) -> None:
    for line, said in ((b'{"t_ms": NaN}', "events.jsonl:3"), (b"x" * 3_000_000, "longer than"), (b"\xff\xfe", "UTF-8")):
        files[1].write_bytes(b'{"t_ms": 1, "message": "fine"}\n\n' + line + b"\n")
        done = run(dyknow, files)
        assert done.returncode == 2
        assert said in done.stderr


def test_files_that_are_not_there_are_named(dyknow: Run, files: tuple[Path, Path], tmp_path: Path) -> None:
    missing = str(tmp_path / "nowhere")
    for one, other in ((missing, str(files[1])), (str(files[0]), missing), (str(files[0]), str(tmp_path))):
        done = dyknow("chronicle", one, "--events", other)
        assert done.returncode == 2
        assert "cannot be read" in done.stderr


def test_chronicles_are_checked_and_shown_like_specifications(dyknow: Run, files: tuple[Path, Path]) -> None:
    shown = dyknow("kpl", "show", str(files[0]))
    assert shown.returncode == 0
    assert "event(behind[?car1, ?car2]:(?, true), t1)" in shown.stdout
    assert dyknow("kpl", "check", str(files[0])).stdout == "1 declaration, 0 errors, 0 warnings\n"
    files[0].write_text(OVERTAKE.replace("t2 - t1 in [1, 60s]", "t2 - t1 in [1, 60s)\nt2 == t1"))
    checked = dyknow("kpl", "check", str(files[0]), "--json")
    assert checked.returncode == 1
    assert [json.loads(line)["line"] for line in checked.stdout.splitlines()] == [5, 6]


def test_what_may_become_an_instance_is_told_with_what_is_missing_and_until_when(
    dyknow: Run, files: tuple[Path, Path]
) -> None:
    files[1].write_text("\n".join(json.dumps(event) for event in EVENTS[:2]))
    done = run(dyknow, files, "--partial", "--json")
    (partial,) = map(json.loads, done.stdout.splitlines())
    assert partial["partial"] == "overtake"
    assert partial["bindings"] == {"?car1": "a", "?car2": "b"}
    assert partial["instants"] == {"t1": 100}
    assert len(partial["missing"]) == 1
    assert "in_front" in partial["missing"][0]
    assert partial["dies_ms"] == 60_101
    shown = run(dyknow, files, "--partial").stdout
    assert "t1=100" in shown
    assert "60101" in shown
    files[1].write_text("\n".join(json.dumps(event) for event in [*EVENTS, {"t_ms": 70_000}]))
    assert "partial" not in run(dyknow, files, "--partial", "--json").stdout


def test_a_time_constraint_without_parameters_is_about_the_instants_of_where_it_is_used(
    dyknow: Run, files: tuple[Path, Path]
) -> None:
    """Thesis 8.3.5: its temporal parameters may be left out."""
    for least_ms, recognised in ((801, 0), (800, 1)):
        text = OVERTAKE.replace("t2 - t1 in [1, 60s]", "order()")
        files[0].write_text(
            f"time constraint order {{ t1 < t2 far() }}\ntime constraint far {{ t2 - t1 >= {least_ms} }}\n{text}"
        )
        assert len(run(dyknow, files, "--json").stdout.splitlines()) == recognised


def test_a_time_constraint_without_parameters_that_is_used_where_its_instants_are_not_is_told(
    dyknow: Run, files: tuple[Path, Path]
) -> None:
    files[0].write_text("time constraint order { t1 < t3 }\n" + OVERTAKE.replace("t2 - t1 in [1, 60s]", "order()"))
    done = run(dyknow, files)
    assert done.returncode == 2
    assert "6:5: nothing happens at t3: it is only compared" in done.stderr


def test_what_a_mistake_says_to_write_is_made_of_what_was_written_and_repairs_it(tmp_path: Path, dyknow: Run) -> None:
    file = tmp_path / "mistaken.chr"
    lines = [
        "message landed[?uav]",
        "chronicle twice[?car1] {",
        "event(landed[?car1], t1)",
        "event(landed(?car1), t2)",
        "noevent(landed[?car1], t2)",
        "t2 - t1 in [1, 5)",
        "}",
    ]
    file.write_text("\n".join(lines))
    errors = [json.loads(line) for line in dyknow("kpl", "check", str(file), "--json").stdout.splitlines()]
    assert [error["line"] for error in errors] == [4, 5, 6]
    for error in errors:
        lines[error["line"] - 1] = error["repair"]
    file.write_text("\n".join(lines))
    done = dyknow("kpl", "check", str(file), "--json")
    assert (done.returncode, done.stdout) == (0, "")
