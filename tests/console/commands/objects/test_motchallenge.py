"""`dyknow link` on texts of the MOTChallenge, drawn from seeds."""

import json
import random
from pathlib import Path

import pytest

from tests.console.conftest import Run

FPS, SCALE_M = 12.5, 0.05
FRAMES = 60


def walks(seed: int) -> dict[int, list[tuple[int, float, float]]]:
    """Frame and place of each walker: they are 6 m apart, and walk at 1 to 2 m/s."""
    rng = random.Random(seed)
    found = {}
    for walker in range(1, 6):
        speed, begin = rng.uniform(1.0, 2.0) * rng.choice((-1, 1)), rng.randrange(1, 10)
        found[walker] = [
            (frame, 20 + speed * frame / FPS + rng.gauss(0, 0.1), -6.0 * walker + rng.gauss(0, 0.1))
            for frame in range(begin, FRAMES)
            if rng.random() > 0.03
        ]
    return found


def lines(seed: int, kind: str) -> list[str]:
    """As det.txt (by frame, no names), gt.txt (by name), or with places on the ground."""
    rows = []
    for walker, seen in walks(seed).items():
        for frame, x_m, y_m in seen:
            left, top = x_m / SCALE_M - 8, -y_m / SCALE_M - 36
            box = f"{left:.2f},{top:.2f},16,36"
            if kind == "det":
                rows.append((frame, f"{frame},-1,{box},0.8,-1,-1,-1"))
            elif kind == "gt":
                rows.append((walker, f"{frame}, {walker}, {box}, 1, 1, 0.9"))
            else:
                rows.append((frame, f"{frame},{walker},{box},1,{x_m:.3f},{y_m:.3f},0"))
    if kind == "gt":
        rows += [(99, f"{frame},99,5,5,9,9,0,8,1") for frame in range(1, FRAMES)]
    return [row for _, row in sorted(rows, key=lambda each: each[0])]


@pytest.mark.parametrize("kind", ["det", "gt", "places"])
@pytest.mark.parametrize("seed", range(2))
def test_each_walker_is_one_object_where_it_was(kind: str, seed: int, dyknow: Run, tmp_path: Path) -> None:
    (tmp_path / "seen.txt").write_text("\n".join(lines(seed, kind)) + "\n")
    scale = () if kind == "places" else ("--m-per-pixel", str(SCALE_M))
    done = dyknow("link", "--percepts", str(tmp_path / "seen.txt"), "--fps", str(FPS), *scale, "--json")
    assert done.returncode == 0, done.stderr
    assert ("have no names" in done.stderr) is (kind == "det")
    states = [each for each in map(json.loads, done.stdout.splitlines()) if "symbol" in each and each["linked_to"]]
    walkers = {symbol: set[int]() for symbol in (each["symbol"] for each in states)}
    truth = {(frame, walker): at for walker, seen in walks(seed).items() for frame, *at in seen}
    for each in states:
        frame = round(each["t_ms"] * FPS / 1000) + 1
        near = [
            w for (f, w), (x, y) in truth.items() if f == frame and abs(each["x_m"] - x) + abs(each["y_m"] - y) < 0.6
        ]
        walkers[each["symbol"]].update(near)
    assert sorted(map(sorted, walkers.values())) == [[n] for n in range(1, 6)]


@pytest.mark.parametrize(
    ("text", "call", "says"),
    [
        ("1,-1,5,5,9,9,1,-1,-1,-1", (), "which counts frames: give how many a second it has, --fps 25"),
        ("1,-1,5,5,9,9", ("--fps", "25"), "give how many metres a pixel is, --m-per-pixel 0.05"),
        ("1,1,5,5,9,9,1,2.5,3.5,0", ("--fps", "25", "--m-per-pixel", "0.1"), "has places on the ground, in metres"),
        ('{"t_ms": 0, "percept": "a", "x_m": 0, "y_m": 0}', ("--fps", "25"), "is no MOTChallenge text"),
        ('{"t_ms": 0, "percept": "a", "x_m": 0, "y_m": 0}', ("--m-per-pixel", "1"), "is no MOTChallenge text"),
    ],
)
def test_what_a_text_does_not_say_is_asked_for(
    text: str, call: tuple[str, ...], says: str, dyknow: Run, tmp_path: Path
) -> None:
    (tmp_path / "seen.txt").write_text(text + "\n")
    done = dyknow("link", "--percepts", str(tmp_path / "seen.txt"), *call)
    assert done.returncode == 2
    assert says in " ".join(done.stderr.split())


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ("2,-1,5,5,9", "6 to 10 numbers with commas between them are a line"),
        ("2,-1,5,nan,9,9", "6 to 10 numbers with commas between them are a line"),
        ("two,-1,5,5,9,9", "6 to 10 numbers with commas between them are a line"),
        ("0,-1,5,5,9,9", "frame is a number from 1, and id a whole one"),
        ("2,1.5,5,5,9,9", "frame is a number from 1, and id a whole one"),
        ("2,-1,5,5,9,9,1,2.5,3.5,0", "it has a place on the ground, which wants no scale"),
        ("2,7,5,5,9,9,1,-1,-1,-1", "percepts of the type vision_percept have no names here, and this one has"),
    ],
)
def test_a_line_that_is_wrong_is_left_out_with_its_place(wrong: str, says: str, dyknow: Run, tmp_path: Path) -> None:
    (tmp_path / "seen.txt").write_text(f"1,-1,5,5,9,9\n{wrong}\n3,-1,5,5,9,9\n")
    done = dyknow("link", "--percepts", str(tmp_path / "seen.txt"), "--fps", "25", "--m-per-pixel", "0.1")
    assert done.returncode == 2
    assert f"seen.txt:2:1: {says}" in " ".join(done.stderr.split())
