"""`dyknow link` over recordings in which one of several is as described: 200 seeded cases, a tenth unless DYKNOW_FULL is set."""

import json
import os
import random
from pathlib import Path
from typing import Any

import pytest

from dyknow.console.command import Call
from dyknow.console.commands.objects.link import link
from dyknow.console.errors import DONE

COUNT = 200 if os.environ.get("DYKNOW_FULL") else 20
COLOURS, KINDS = ("red", "green", "blue", "white"), ("car", "truck", "van")
LINKS = """strmgen world = link(vision_percept, WorldObject,
  eventually [1s, oo] true, eventually [0, 1s] xy_dist[from, to] < thresh, true)
"""
STREETS_M = 40.0


class Case:
    """A few vehicles on streets of their own, each unlike what is wanted in one respect at least, and what is wanted.

    In a third of the cases nothing that comes into view is as described.
    """

    def __init__(self, seed: int) -> None:
        rng = random.Random(seed)
        self._rng = rng
        self.colour, self.kind = rng.choice(COLOURS), rng.choice(KINDS)
        self.is_fast = rng.random() < 0.5
        self.comes = rng.random() > 1 / 3
        wanted = (self.colour, self.kind, self.is_fast)
        others = [(c, k, fast) for c in COLOURS for k in KINDS for fast in (True, False) if (c, k, fast) != wanted]
        near = [each for each in others if sum(a == b for a, b in zip(each, wanted, strict=True)) == 2]
        self.vehicles = [rng.choice(near) for _ in range(4)] + [rng.choice(others) for _ in range(2)]
        self.enters_ms = [rng.randrange(0, 4000, 200) for _ in self.vehicles]
        self.at: int | None = None
        if self.comes:
            self.at = rng.randrange(len(self.vehicles) + 1)
            self.vehicles.insert(self.at, wanted)
            self.enters_ms.insert(self.at, rng.randrange(0, 4000, 200))

    @property
    def text(self) -> str:
        """The description: of what is seen at once, or of what is so for a second."""
        seen = f'colour[suspect] = "{self.colour}" and kind[suspect] = "{self.kind}"'
        speed = "speed[suspect] > 6" if self.is_fast else "speed[suspect] < 3"
        return f"{LINKS}want suspect in world = always [0, 1s] ({seen} and {speed})\n"

    def lines(self) -> list[dict[str, Any]]:
        """Percepts five times a second for 8 s; colours are not recognised in one image of five."""
        found = []
        for t_ms in range(0, 8000, 200):
            for number, (colour, kind, fast) in enumerate(self.vehicles):
                if t_ms >= self.enters_ms[number]:
                    x_m = (12.0 if fast else 0.0) * (t_ms - self.enters_ms[number]) / 1000.0
                    place = {"x_m": x_m + self._rng.gauss(0.0, 0.3), "y_m": STREETS_M * number}
                    seen = {"kind": kind} | ({"colour": colour} if self._rng.random() > 0.2 else {})
                    found.append({"t_ms": t_ms, "percept": f"p{number}", "sd_m": 0.3, **place, **seen})
        return found


@pytest.mark.parametrize("seed", range(COUNT))
def test_of_several_that_are_alike_it_is_the_one_that_is_described_or_none(
    call: Call, tmp_path: Path, capsys: pytest.CaptureFixture[str], seed: int
) -> None:
    case = Case(seed)
    (spec := tmp_path / "want.kpl").write_text(case.text)
    (percepts := tmp_path / "percepts.jsonl").write_text("\n".join(map(json.dumps, case.lines())))
    assert link(call, spec, percepts=percepts) == DONE
    out, notes = capsys.readouterr()
    lines = [json.loads(line) for line in out.splitlines()]
    found = [(each["t_ms"], each["from"]) for each in lines if each.get("event") == "find"]
    shown = {source for each in lines if each.get("symbol") == "suspect" for source in each["linked_to"]}
    if case.at is None:
        assert (found, shown) == ([], set())
        assert "suspect was not found" in notes
    else:
        ((t_ms, source),) = found
        assert (source, shown) == (f"p{case.at}", {f"p{case.at}"})
        assert case.enters_ms[case.at] + 1000 <= t_ms <= case.enters_ms[case.at] + 3000
