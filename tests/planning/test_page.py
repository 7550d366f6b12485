"""The page on planning: what it shows of times and costs comes out, but for how long the search takes."""

import re
from pathlib import Path

from dyknow.planning import parse_domain, parse_problem
from tests.docs.pages import DOCS, ROOT, commands, fences, folder, output

PAGE = DOCS / "planning.md"


def without_search_times(text: str) -> str:
    return re.sub(r"in [\d.]+ ms", "in N ms", text)


def test_plans_are_those_that_the_page_shows(tmp_path: Path) -> None:
    place = folder(tmp_path)
    shown = [each for fence in fences(PAGE) if fence.about == "live" for each in commands(fence)]
    assert len(shown) == 4
    for each in shown:
        assert without_search_times(output(each.command, place)) == without_search_times(each.output), each.command


def test_the_parts_that_the_page_shows_are_those_of_its_files() -> None:
    files = "".join((ROOT / "examples/planning" / name).read_text() for name in ("sampling.dom", "steered.prob"))
    domain = parse_domain((ROOT / "examples/planning/sampling.dom").read_text())
    assert parse_problem((ROOT / "examples/planning/steered.prob").read_text(), domain)
    statements = [line for fence in fences(PAGE) if fence.language == "text" for line in fence.text.splitlines()]
    assert len(statements) > 30
    assert [line for line in statements if line.strip() and line.split("//")[0].strip() not in files] == []
