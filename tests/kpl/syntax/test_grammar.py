"""Tables of parsers are kept from one process to the next, where nobody else may write."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from dyknow.kpl.diagnostics.languages import language
from dyknow.kpl.syntax.grammar import TEXTS, _marks, parse_tree, parser
from dyknow.model.errors import TextError

ROOT = Path(__file__).parents[3]
PARSES = (
    "from dyknow.kpl.syntax.grammar import parser; print(parser().parse('always a', start='formula_only').pretty())"
)


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """The folder of the tables, empty, and parsers that are not made yet."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    forget()
    yield tmp_path / "dyknow-grammars"
    forget()


def forget():
    """No parser was made yet in this process, nor marks in its states."""
    parser.cache_clear()
    _marks.cache_clear()


def again(grammar="kpl.lark"):
    """The parser as another process makes it."""
    forget()
    return parser(grammar)


def is_built(found):
    """Whether its tables were built: what was loaded has no text of a grammar."""
    return hasattr(found, "source_grammar")


def outcome(text, kind):
    """The tree with its places, or what is wrong, and where."""
    try:
        tree = parse_tree(text, kind)
    except TextError as error:
        return str(error)
    return [(node.data, vars(node.meta)) for node in tree.iter_subtrees()]


@pytest.mark.parametrize("kind", TEXTS)
def test_tables_that_were_kept_read_as_those_that_were_built(kept, kind):
    samples = [sample for mistake in language(TEXTS[kind].language).mistakes for sample in mistake.samples]
    good = [
        "always (a and b[self] > 3 m)",
        "source pos gps\nstrmgen p = gps",
        "chronicle c { event(a[?x]: (0, 1), t) }",
    ]
    grammar = TEXTS[kind].grammar
    assert is_built(again(grammar))
    built = [outcome(text, kind) for text in samples + good]
    assert not is_built(again(grammar))
    assert [outcome(text, kind) for text in samples + good] == built
    assert len(list(kept.iterdir())) == 1


def test_folder_and_file_are_the_users_alone(kept):
    again()
    (file,) = kept.iterdir()
    assert kept.stat().st_mode & 0o777 == 0o700
    assert file.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize("what", ["folder", "file"])
def test_what_others_may_write_is_not_read(kept, what):
    again()
    (file,) = kept.iterdir()
    file.write_bytes(b"cos\nmkdir\n(V" + os.fsencode(kept.parent / "hacked") + b"\ntR.")
    (kept if what == "folder" else file).chmod(0o777)
    assert is_built(again())
    assert not (kept.parent / "hacked").exists()


def test_a_link_in_place_of_the_folder_is_not_followed(kept):
    (elsewhere := kept.parent / "elsewhere").mkdir()
    kept.symlink_to(elsewhere)
    assert is_built(again())
    assert not list(elsewhere.iterdir())


def test_a_file_that_is_damaged_is_written_again(kept):
    again()
    (file,) = kept.iterdir()
    whole = file.read_bytes()
    for damaged in (b"", whole[: len(whole) // 2], b"nonsense"):
        file.write_bytes(damaged)
        assert is_built(again())
        assert not is_built(again())


@pytest.mark.parametrize("home", ["/dev/null", "/proc/1"])
def test_where_nothing_can_be_kept_texts_are_read_all_the_same(home):
    environment = {**os.environ, "HOME": home, "PYTHONPATH": str(ROOT)}
    environment.pop("XDG_CACHE_HOME", None)
    done = subprocess.run([sys.executable, "-c", PARSES], env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "always" in done.stdout


def test_processes_that_begin_at_once_leave_one_whole_file(kept):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    both = [subprocess.Popen([sys.executable, "-c", PARSES], env=environment, stdout=subprocess.PIPE) for _ in range(2)]
    first, second = [process.communicate()[0].decode() for process in both]
    assert first == second
    assert "always" in first
    assert len(list(kept.iterdir())) == 1
    assert not is_built(again())
