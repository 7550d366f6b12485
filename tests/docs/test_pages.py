"""The pages of docs/ say what is so: files are included whole, commands are run, what is shown comes out."""

import re
from pathlib import Path

import pytest

from dyknow import Network
from dyknow.console.commands.texts.specification_files import instance_of
from dyknow.kpl import Hooks, parse_chronicles, parse_specification
from dyknow.kpl.syntax.grammar import parse_tree
from dyknow.model.errors import SourceText
from dyknow.policies.policy import _FORMS
from tests.docs.pages import DOCS, PAGES, ROOT, commands, fences, folder, library_table, output

NAMES = [page.name for page in PAGES]


@pytest.mark.parametrize("name", [*NAMES, "../README.md"])
def test_included_files_are_verbatim(name: str) -> None:
    for fence in fences(DOCS / name):
        if fence.about and fence.language != "console":
            assert fence.text == (ROOT / fence.about).read_text(encoding="utf-8"), fence.about


@pytest.mark.parametrize("name", NAMES)
def test_every_command_says_what_the_page_shows(name: str, tmp_path: Path) -> None:
    place = folder(tmp_path)
    for fence in fences(DOCS / name):
        if fence.language == "console" and not fence.about:
            for shown in commands(fence):
                assert output(shown.command, place) == shown.output, shown.command


@pytest.mark.parametrize("name", NAMES)
def test_every_specification_can_be_read(name: str) -> None:
    for fence in fences(DOCS / name):
        if fence.language == "kpl":
            assert parse_specification(SourceText(fence.text, name))
        elif fence.language == "chronicle":
            assert parse_chronicles(SourceText(fence.text, name))
        elif fence.language == "formula":
            assert all(parse_tree(line, "formula_only") for line in fence.text.splitlines())


@pytest.mark.parametrize("name", NAMES)
def test_every_piece_of_python_runs(name: str) -> None:
    for fence in fences(DOCS / name):
        if fence.language == "python":
            exec(compile(fence.text, name, "exec"), {"__name__": name})


@pytest.mark.parametrize("name", [*NAMES, "../README.md"])
def test_every_file_a_page_links_to_exists(name: str) -> None:
    text = re.sub(r"```.*?```|`[^`\n]*`", "", (DOCS / name).read_text(encoding="utf-8"), flags=re.DOTALL)
    linked = re.findall(r"\]\((?!https?:|#)([^)#]+)", text)
    assert [link for link in linked if not (DOCS / name).parent.joinpath(link).exists()] == []


def test_every_constraint_and_every_statement_is_explained() -> None:
    text = (DOCS / "kpl.md").read_text(encoding="utf-8")
    assert [each for each in _FORMS.split(", ") if f"`{each}`" not in text] == []
    statements = re.search(r"^_statement: (.*)$", (ROOT / "kpl" / "syntax" / "kpl.lark").read_text(), re.MULTILINE)
    assert statements is not None
    words = {"for_each": "for", "import_": "import", "chronicle_file": "chronicle", "sort_": "sort", "label_": "label"}
    named = [words.get(each, each) for each in statements[1].split(" | ")]
    assert [each for each in named if not re.search(rf"^### `{each}\b", text, re.MULTILINE)] == []


def test_every_command_there_is_stands_in_the_readme() -> None:
    from dyknow.console.main import COMMANDS

    text = (ROOT / "README.md").read_text(encoding="utf-8")
    names = [name for name, (where, _summary) in COMMANDS.items() if where]
    assert len(names) > 20
    assert [name for name in names if not re.search(rf"^\|.*`{name}`.*\|.*\|$", text, re.MULTILINE)] == []


def test_the_specification_of_the_readme_is_right() -> None:
    specifications = [fence.text for fence in fences(ROOT / "README.md") if fence.language == "kpl"]
    for text in specifications:
        found = instance_of(Network(), Hooks(), (), "0").findings(parse_specification(text), (), text)
        assert (found.errors, found.warnings) == ((), ())


def test_the_ready_units_are_all_listed() -> None:
    assert library_table() in (DOCS / "units.md").read_text(encoding="utf-8")


def test_every_example_is_shown_on_a_page() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in (*PAGES, ROOT / "README.md"))
    shown = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "examples").rglob("*.*")
        if path.suffix in {".kpl", ".chr"}
    }
    assert sorted(path for path in shown if path not in text) == []
