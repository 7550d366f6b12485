"""`dyknow match` over files and standard input."""

import json
import os
import subprocess
import sys
from pathlib import Path

from tests.console.conftest import Run

ROOT = Path(__file__).parents[4]


def test_a_file_is_answered_with_one_line_of_json(dyknow: Run) -> None:
    done = dyknow("match", str(ROOT / "examples/matching/marked.json"))
    assert done.returncode == 0
    found = json.loads(done.stdout)
    assert list(found) == ["case", "match", "result", "anchors", "recovery", "reasons", "ask"]
    assert (found["case"], found["match"], found["anchors"]) == (2, {"po1": "partial", "po2": "none"}, ["po1"])


def test_standard_input_is_read_and_what_is_wrong_with_it_is_refused() -> None:
    command = [sys.executable, "-c", "from dyknow.console.main import main; main()", "match", "-"]
    for text, code in (('{"description": {}, "percepts": {}, "x": 1}', 0), ('{"description": 3}', 2)):
        done = subprocess.run(
            command, input=text, capture_output=True, text=True, timeout=30, check=False, cwd=ROOT, env=os.environ
        )
        assert done.returncode == code
        assert ("x is no known key" in done.stderr) == (code == 0)
        assert ("standard input:1:17: description: an object is expected" in done.stderr) == (code == 2)


def test_a_file_that_is_not_there_is_a_wrong_call(dyknow: Run) -> None:
    done = dyknow("match", "missing.json")
    assert (done.returncode, done.stdout) == (2, "")
    assert "missing.json cannot be read" in done.stderr
