"""The parser of our texts: one grammar, read once, and the limits every text passes first.

A hostile text can neither exhaust the stack nor the clock: length and bracket depth are looked at before parsing,
nesting of the parse tree before anything walks it recursively.
"""

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Final

from dyknow.errors import TextError
from kpl.mistakes import Mark, Mistake, explain, learn
from kpl.statement_mistakes import STATEMENT_MISTAKES

if TYPE_CHECKING:
    from lark import Lark, Token, Tree

LIMIT_CHARACTERS: Final = 64 * 1024
LIMIT_NESTING: Final = 200
_OPENING, _CLOSING = "([{", ")]}"
_CHAINS = ("sum", "product")


@cache
def parser() -> "Lark":
    """The parser for both starts; lark is imported here, at use."""
    from lark import Lark

    return Lark(
        files("kpl").joinpath("kpl.lark").read_text(encoding="utf-8"),
        parser="lalr",
        lexer="basic",
        start=["start", "formula_only"],
        maybe_placeholders=False,
        propagate_positions=True,
    )


@cache
def _marks(start: str) -> Mapping[Mark, Mistake]:
    if start == "formula_only":
        return learn(lambda sample: parser().parse(sample, start=start))
    return learn(lambda sample: parser().parse(sample, start=start), STATEMENT_MISTAKES)


def parse_tree(text: str, start: str, file: str = "") -> "Tree[Token]":
    """The parse tree of `text`, no deeper than `LIMIT_NESTING`.

    Raises:
        TextError: at the first place where the text leaves the grammar, or a limit.
    """
    from lark.exceptions import UnexpectedInput

    _check_length(text, file)
    _check_brackets(text, file)
    try:
        tree = parser().parse(text, start=start)
    except UnexpectedInput as error:
        raise explain(error, text, file, lambda: _marks(start)) from None
    _check_depth(tree, text, file)
    return tree


def _check_length(text: str, file: str) -> None:
    if len(text) > LIMIT_CHARACTERS:
        raise TextError(
            f"the text has {len(text)} characters, {LIMIT_CHARACTERS} are allowed",
            file=file,
            repair="split it, or define its parts as features of their own",
        )


def _too_deep(text: str, file: str, offset: int) -> TextError:
    before = text[:offset]
    return TextError(
        f"nested more than {LIMIT_NESTING} deep",
        text=text,
        line=before.count("\n") + 1,
        column=offset - before.rfind("\n"),
        file=file,
        repair="define the inner parts as features of their own",
    )


def _check_brackets(text: str, file: str) -> None:
    depth = 0
    for offset, character in enumerate(text):
        if character in _OPENING:
            depth += 1
            if depth > LIMIT_NESTING:
                raise _too_deep(text, file, offset)
        elif character in _CLOSING:
            depth -= 1


def _check_depth(tree: "Tree[Token]", text: str, file: str) -> None:
    """Long sums count as deep: they are read as ((a + b) + c) + d."""
    from lark import Tree

    waiting = [(tree, 1)]
    while waiting:
        node, depth = waiting.pop()
        if node.data in _CHAINS:
            depth += len(node.children) // 2
        if depth > LIMIT_NESTING:
            raise _too_deep(text, file, node.meta.start_pos)
        waiting += [(child, depth + 1) for child in node.children if isinstance(child, Tree)]
