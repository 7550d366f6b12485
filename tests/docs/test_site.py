"""The site has every page, loads nothing from elsewhere, and lists every code of a refusal."""

import ast
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from docs import command_page
from docs.site_pages import on_page_markdown
from tests.docs.pages import DOCS, PAGES, ROOT

ROOMS = ("agents", "federation", "kpl", "planning", "runtime", "sim_uavs")


def codes() -> Iterator[str]:
    """The codes with which the product refuses."""
    for path in (each for room in ROOMS for each in (ROOT / room).rglob("*.py")):
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(call, ast.Call) and getattr(call.func, "id", "") in {"Refused", "Reason"}:
                given = [*call.args[1:2], *(each.value for each in call.keywords if each.arg == "code")]
                yield from (str(each.value) for each in given if isinstance(each, ast.Constant) and each.value)


def test_every_page_is_reached_from_the_menu_once() -> None:
    menu = re.findall(r": ([\w-]+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(menu) == [page.name for page in PAGES]


def test_every_code_of_a_refusal_is_in_the_table() -> None:
    table = {*re.findall(r"`([a-z-]+)`", (DOCS / "errors.md").read_text(encoding="utf-8"))}
    used = {*codes()}
    assert len(used) > 40
    assert used - table == set()


def test_the_page_of_commands_has_what_the_commands_say() -> None:
    """`python -m docs.command_page` makes the page."""
    assert command_page.PAGE.read_text(encoding="utf-8") == command_page.page()


def test_an_included_file_is_the_title_of_its_fence_and_other_files_are_named() -> None:
    page = "```kpl examples/cars.kpl\nsource pos gps\n```\n\n```console live 7\n$ dyknow ls\n```\n\n[uav0.kpl](../examples/uav0.kpl)\n"
    assert on_page_markdown(page) == (
        '```kpl title="examples/cars.kpl"\nsource pos gps\n```\n\n```console\n$ dyknow ls\n```\n\nuav0.kpl\n'
    )


@pytest.mark.full
def test_the_site_is_built_and_loads_nothing_from_elsewhere(tmp_path: Path) -> None:
    made = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(tmp_path)],
        cwd=ROOT, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"}, text=True, check=False,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    assert (made.returncode, made.stdout) == (0, "")
    pages = {page.stem: page.read_text(encoding="utf-8") for page in tmp_path.glob("*.html")}
    assert pages.keys() == {page.stem for page in PAGES} | {"404"}
    loaded = re.compile(r"<(?:script|img|link)[^>]*(?:src|href)=\"?(https?:[^\"> ]+)")
    assert [found for text in pages.values() for found in loaded.findall(text)] == []
    assert "FederationClient" in pages["api"]
