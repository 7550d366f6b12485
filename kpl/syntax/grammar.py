"""The parsers of our texts: three grammars, each read once, and the limits every text passes first.

To build the tables of a parser takes longer than to read most specifications: they are kept for later processes, in
`$XDG_CACHE_HOME/dyknow-grammars` or `~/.cache/dyknow-grammars`, as plain data. Folder and file are used only if they belong
to this user, and no other may write there. Where tables cannot be kept, they are built each time.

A hostile text can neither exhaust the stack nor the clock: length, number of tokens and bracket depth are looked at before
parsing, nesting of the parse tree before anything walks it recursively.
"""

import os
import re
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from stat import S_ISDIR, S_ISREG, S_IWGRP, S_IWOTH
from tempfile import NamedTemporaryFile
from typing import TYPE_CHECKING, Any, BinaryIO, Final, NamedTuple

from dyknow.kpl.diagnostics.languages import Mistake, language
from dyknow.kpl.diagnostics.mistakes import Mark, explain, learn
from dyknow.model.errors import TextError, file_of

if TYPE_CHECKING:
    from lark import Lark, Token, Tree

LIMIT_CHARACTERS: Final = 64 * 1024
LIMIT_PROBLEM: Final = 1024 * 1024
"""Characters of a planning domain or problem, which lists what is initially so."""
LIMIT_TOKENS: Final = 22_000
"""Names, numbers, strings and signs of a text, which take 20 to 40 us each to parse: the dearest text is answered in a second."""
LIMIT_NESTING: Final = 200
_PIECE: Final = r'"[^"\n]*"|\w+(?:-\w+)*|[^\w\s]'
_WIDEST: Final = 2**62
_OPENING, _CLOSING = "([{", ")]}"
_CHAINS = ("sum", "product", "time_term", "time_product", "combined", "intersection", "shifted")


class Text(NamedTuple):
    """A kind of text: its grammar, the rule it begins with, and the language of its diagnostics."""

    grammar: str
    begin: str
    language: str
    inner: str = "define the inner parts as features of their own"
    characters: int = LIMIT_CHARACTERS
    comment: str = "#"


TEXTS: Final[Mapping[str, Text]] = {
    "formula_only": Text("kpl.lark", "formula_only", "formulas"),
    "start": Text("kpl.lark", "start", "statements"),
    "chronicles": Text("chronicles.lark", "start", "chronicles", "name the inner parts: domain D = ..."),
    "domains": Text(
        "domains.lark",
        "start",
        "domains",
        "define the inner parts: #define name(...) := ...",
        LIMIT_PROBLEM,
        "//",
    ),
}
_TOKENS: Final = {mark: re.compile(f"({mark}[^\\n]*)|{_PIECE}") for mark in {text.comment for text in TEXTS.values()}}


@cache
def parser(grammar: str = "kpl.lark") -> "Lark":
    """The parser of a grammar, for all its beginnings, with the tables that an earlier process kept.

    lark is imported here, at use.
    """
    import msgpack
    from lark import Lark, __version__

    written = files("dyknow.kpl.syntax").joinpath(grammar).read_text(encoding="utf-8")
    begins = sorted({text.begin for text in TEXTS.values() if text.grammar == grammar})
    name = sha256("\n".join(["msgpack", __version__, sys.version, *begins, written]).encode()).hexdigest()
    try:
        file = _tables_folder() / f"{name}.tables"
    except (OSError, RuntimeError):  # no home, or not this user's alone
        file = None
    with suppress(Exception):  # any fault of the file: the tables are built and written again
        if file is not None:
            with _checked(file) as tables:
                kept = msgpack.unpackb(tables.read(), strict_map_key=False)
            loaded: Lark = Lark._load_from_dict(kept["data"], kept["memo"])  # type: ignore[no-untyped-call]  # noqa: SLF001
            return _quick(loaded)
    built = Lark(
        written, parser="lalr", lexer="basic", start=begins, maybe_placeholders=False, propagate_positions=True
    )
    if file is not None:
        with suppress(OSError):
            _keep(built, file)
    return _quick(built)


def _quick(built: "Lark") -> "Lark":
    """The parser, that passes on at once what a rule such as `?sum: product` makes of its one part: a quarter of its time."""
    callbacks = built._callbacks  # noqa: SLF001  (lark has no other place for it)
    for rule in callbacks:
        is_one = (
            len(rule.expansion) == 1 and not rule.expansion[0].is_term and not rule.expansion[0].name.startswith("_")
        )
        if is_one and rule.options.expand1 and not rule.alias:
            callbacks[rule] = _only
    return built


def _only(children: list[Any]) -> Any:
    return children[0]


def _tables_folder() -> Path:
    """Where tables are kept; raises OSError if it is not this user's alone, RuntimeError if there is no home."""
    cache_home = Path(os.environ.get("XDG_CACHE_HOME", ""))
    folder = (cache_home if cache_home.is_absolute() else Path.home() / ".cache") / "dyknow-grammars"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    _check(os.lstat(folder), S_ISDIR)
    return folder


def _checked(file: Path) -> BinaryIO:
    tables = file.open("rb")
    try:
        _check(os.fstat(tables.fileno()), S_ISREG)
    except OSError:
        tables.close()
        raise
    return tables


def _check(found: os.stat_result, is_kind: Callable[[int], bool]) -> None:
    if not is_kind(found.st_mode) or found.st_uid != os.geteuid() or found.st_mode & (S_IWGRP | S_IWOTH):
        raise PermissionError("it may be written by others")


def _keep(built: "Lark", file: Path) -> None:
    """Whole or not at all: other processes may read it, or write it, now."""
    import msgpack
    from lark.grammar import Rule
    from lark.lexer import TerminalDef

    data, memo = built.memo_serialize([TerminalDef, Rule])
    with NamedTemporaryFile(dir=file.parent, delete=False) as tables:
        tables.write(msgpack.packb(_plain({"data": data, "memo": memo})))
    Path(tables.name).replace(file)


def _plain(found: Any) -> Any:
    """The same with whole numbers that fit into 64 bits: a terminal without an end is wider than that."""
    if isinstance(found, dict):
        return {name: _plain(inner) for name, inner in found.items()}
    if isinstance(found, list | tuple):
        return [_plain(inner) for inner in found]
    return min(found, _WIDEST) if isinstance(found, int) and not isinstance(found, bool) else found


@cache
def _marks(kind: str) -> Mapping[Mark, Mistake]:
    text = TEXTS[kind]
    return learn(lambda sample: parser(text.grammar).parse(sample, start=text.begin), language(text.language).mistakes)


def parse_tree(text: str, kind: str) -> "Tree[Token]":
    """The parse tree of `text`, a text of `TEXTS`, no deeper than `LIMIT_NESTING`.

    Raises:
        TextError: at the first place where the text leaves the grammar, or a limit.
    """
    from lark.exceptions import UnexpectedInput

    known = TEXTS[kind]
    _check_length(text, known.characters)
    _check_brackets(text, known.inner)
    _check_tokens(text, known)
    try:
        tree = parser(known.grammar).parse(text, start=known.begin)
    except UnexpectedInput as error:
        raise explain(error, text, lambda: _marks(kind), language(known.language)) from None
    _check_depth(tree, text, known.inner)
    return tree


def _check_length(text: str, limit: int) -> None:
    if len(text) > limit:
        raise TextError(
            f"the text has {len(text)} characters, {limit} are allowed",
            file=file_of(text),
            repair="split it, or define its parts as features of their own",
        )


def _check_tokens(text: str, known: Text) -> None:
    """Length alone bounds no time: of a text of one character a token the parser makes a tree a hundred times as large."""
    if len(text) <= LIMIT_TOKENS:
        return
    number = 0
    for token in _TOKENS[known.comment].finditer(text):
        number += token[1] is None
        if number > LIMIT_TOKENS:
            message = f"the text has more than {LIMIT_TOKENS} names, numbers and signs"
            raise TextError.at_offset(
                text, token.start(), message, repair="split it, or define its parts by themselves"
            )


def _too_deep(text: str, offset: int, repair: str) -> TextError:
    return TextError.at_offset(text, offset, f"nested more than {LIMIT_NESTING} deep", repair=repair)


def _check_brackets(text: str, repair: str) -> None:
    depth = 0
    for offset, character in enumerate(text):
        if character in _OPENING:
            depth += 1
            if depth > LIMIT_NESTING:
                raise _too_deep(text, offset, repair)
        elif character in _CLOSING:
            depth -= 1


def _check_depth(tree: "Tree[Token]", text: str, repair: str) -> None:
    """A long chain counts as deep, since it is read as ((a + b) + c) + d."""
    from lark import Tree

    waiting = [(tree, 1)]
    while waiting:
        node, depth = waiting.pop()
        if node.data in _CHAINS:
            depth += len(node.children) // 2
        if depth > LIMIT_NESTING:
            raise _too_deep(text, node.meta.start_pos, repair)
        waiting += [(child, depth + 1) for child in node.children if isinstance(child, Tree)]


def moved(tree: "Tree[Token]", offset: int, lines: int) -> "Tree[Token]":
    """The tree of a part of the text, with the places that it has in the whole."""
    for node in tree.iter_subtrees():
        inside: list[Any] = [node.meta, *(child for child in node.children if not hasattr(child, "children"))]
        for at in inside:
            if getattr(at, "start_pos", None) is not None:
                at.start_pos, at.end_pos, at.line = at.start_pos + offset, at.end_pos + offset, at.line + lines
    return tree


def placed(wrong: TextError, text: str, lines: int) -> TextError:
    """The error, in the whole text, of a part of it that begins `lines` lines later."""
    return wrong.but(text=text, line=wrong.line + lines)
