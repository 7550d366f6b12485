"""The examples of the library against real platforms: each runs as its reader would run it."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.live.command_line.command import Dyknow

pytestmark = pytest.mark.live
EXAMPLES = Path(__file__).parents[3] / "examples" / "python"
WITHIN_S = 60.0
LINES = 20


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Dyknow]:
    found = Dyknow(tmp_path_factory.mktemp("run"))
    try:
        [ready] = found.run("up", "2", "--scenario", "hover", "--seed", "5", "--detach")
        assert ready["event"] == "ready"
        found.until("ls", state="alive")
        found.until("query", "heli-position", "--at", "-2s", label="heli-position")
        yield found
    finally:
        found.close()


def started(fleet: Dyknow, name: str) -> "subprocess.Popen[str]":
    environment = {
        **fleet._environment(),
        "DYKNOW_FEDERATION": fleet.federation,
        "PYTHONPATH": str(EXAMPLES.parents[1]),
    }
    found = subprocess.Popen(
        [sys.executable, str(EXAMPLES / f"{name}.py")],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
    )  # fmt: skip
    fleet.started.append(found)
    return found


def ended(process: "subprocess.Popen[str]") -> list[str]:
    out, err = process.communicate(timeout=WITHIN_S)
    assert (process.returncode, err) == (0, "")
    return out.splitlines()


def test_there_are_ten_and_none_is_longer_than_twenty_lines() -> None:
    lengths = {path.name: len(path.read_text().splitlines()) for path in EXAMPLES.glob("*.py")}
    assert len(lengths) >= 10
    assert not {name: lines for name, lines in lengths.items() if lines > LINES}


def test_query(fleet: Dyknow) -> None:
    lines = ended(started(fleet, "query"))
    assert [line.split()[0] for line in lines] == ["0", "1", "1", "between"]
    assert "latitude_deg" in lines[2]
    low_m, high_m = (float(number) for number in re.findall(r"[\d.]+(?= m)", lines[3]))
    assert 50.0 < low_m <= high_m < 70.0


def test_watch(fleet: Dyknow) -> None:
    lines = [line.split()[:2] for line in ended(started(fleet, "watch"))]
    assert [unit for unit, _ in lines] == ["0"] * 10
    assert all(int(valid_us) % 200_000 == 0 for _, valid_us in lines)


def test_ls(fleet: Dyknow) -> None:
    lines = ended(started(fleet, "ls"))
    assert [line.split()[:2] for line in lines if "monitors" not in line] == [["0", "alive"], ["1", "alive"]]


def test_lists(fleet: Dyknow) -> None:
    lines = ended(started(fleet, "lists"))
    [task] = [line for line in lines if line.startswith("0 monitor-proximity")]
    assert task.split()[2] == "running"
    assert any(line.startswith(("in ", "out ")) and "(" in line for line in lines)
    assert lines[-1] == "left: []"


def test_delegate(fleet: Dyknow) -> None:
    lines = ended(started(fleet, "delegate"))
    assert lines[0].endswith(" running")
    assert re.fullmatch(r"[1-9]\d* monitors", lines[-2])
    assert lines[-1] == "cancelled"
    assert fleet.run("tasks", code=1) == [], "nothing of the task is left"


def test_alarms_of_a_monitor_over_a_stream_of_ones_own(fleet: Dyknow) -> None:
    alarms = started(fleet, "alarms")
    own = ended(started(fleet, "monitor"))
    assert [line.split()[0] for line in own[:2]] == ["opened", "closed"]
    said = [line for line in ended(alarms) if line.split()[0] in {"opened", "closed"}]
    assert [line.split()[:4] for line in said] == [["opened", "slow", "by", "8"], ["closed", "slow", "by", "8"]]


def test_join_offers_a_stream_of_ones_own(fleet: Dyknow) -> None:
    joined = started(fleet, "join")
    found = fleet.until("query", "battery", "--unit", "7", unit=7)
    assert 0.9 < found[-1]["value"]["fraction"] <= 1.0
    assert ended(joined) == []
    assert {line["unit"] for line in fleet.run("ls")} == {0, 1}, "it has left"


def test_async_query(fleet: Dyknow) -> None:
    lines = ended(started(fleet, "async_query"))
    assert lines[0] == "2 positions 2 heights"
    assert "north_m_s" in lines[1]


def test_a_frame_of_what_was_asked(fleet: Dyknow) -> None:
    pytest.importorskip("pandas")
    rows = [line.split() for line in ended(started(fleet, "frame"))]
    assert rows[0] == ["count", "mean"]
    assert [row[0] for row in rows[2:]] == ["0", "1"]
    assert all(10 <= int(count) <= 22 and 55 < float(mean) < 65 for _, count, mean in rows[2:])


def test_a_strangers_program(fleet: Dyknow) -> None:
    highest, alarm = ended(started(fleet, "stranger"))
    assert 55.0 < float(highest.split()[1]) < 65.0
    assert alarm.startswith("opened cool {'heat[9]': 3")


def test_what_is_not_there_is_an_error_that_says_what_there_is(fleet: Dyknow, monkeypatch: pytest.MonkeyPatch) -> None:
    import dyknow

    monkeypatch.setenv("XDG_RUNTIME_DIR", str(fleet.directory))
    with dyknow.connect(fleet.federation) as fed:
        with pytest.raises(dyknow.NothingFound, match="Did you mean 'heli-position'"):
            fed.query("heli-positon")
        with pytest.raises(dyknow.NothingFound, match="no platform '5'"):
            fed.query("heli-position", unit=5)
        with pytest.raises(dyknow.WrongCall, match="not an instant"):
            fed.query("heli-position", at="yesterday")
        with pytest.raises(dyknow.WrongCall, match="unknown task"):
            fed.delegate("fly-away", to=0)
        with pytest.raises(dyknow.Refused, match="platform 0: refuse: "):
            fed.delegate("goto", to=0, latitude_deg=55.7, longitude_deg=13.5, altitude_m=5000.0)
    with pytest.raises(dyknow.SessionFailed, match="closed"):
        fed.ls()
