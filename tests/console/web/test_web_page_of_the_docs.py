"""The commands of docs/web.md, as they are printed: each runs, and what it serves can be opened."""

import json
import shutil
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("uvicorn")

from tests.docs.pages import DOCS, ROOT, fences
from tests.live.command_line.command import Dyknow

pytestmark = pytest.mark.live
LINES = [line for fence in fences(DOCS / "web.md") for line in fence.text.splitlines() if line.startswith("dyknow ")]


@pytest.fixture
def dyknow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Dyknow]:
    shutil.copytree(ROOT / "examples" / "recordings", tmp_path / "examples" / "recordings")
    monkeypatch.chdir(tmp_path)
    found = Dyknow(tmp_path)
    try:
        yield found
    finally:
        found.close()


def test_what_the_page_says_is_typed_and_a_page_is_served(dyknow: Dyknow) -> None:
    assert [line.split()[1] for line in LINES] == ["up", "delegate", "web", "web"]
    for line in LINES:
        words = line.split()[1:]
        if words[0] != "web":
            dyknow.raw(*words)
            continue
        served = dyknow.start(*words, "--json", "--port", "0")
        assert served.stdout is not None
        said = json.loads(served.stdout.readline())
        assert said["event"] == "serving"
        with urllib.request.urlopen(said["url"].partition("#")[0], timeout=20) as page:
            assert b"<title>dyknow</title>" in page.read()
        served.terminate()
