"""Chronicle files from text and to text (thesis 8.3): reading what was printed gives the same file.

All errors of a text are reported. Where it leaves the grammar its declarations are read one by one, and in one that is
wrong the lines that are wrong are left out, so that one mistake hides none after it.
"""

import re
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Final

from dyknow.kpl.diagnostics.languages import language
from dyknow.kpl.syntax.chronicle_checking import check_chronicles
from dyknow.kpl.syntax.chronicle_reading import MAX_ERRORS, ChronicleReader
from dyknow.kpl.syntax.grammar import LIMIT_CHARACTERS, moved, parse_tree, placed
from dyknow.kpl.syntax.parsing import raise_all
from dyknow.model.errors import TextError
from dyknow.reasoning.chronicles.definition import model
from dyknow.reasoning.chronicles.definition.model import ChronicleFile
from dyknow.reasoning.chronicles.definition.times import ComplexConstraint

if TYPE_CHECKING:
    from lark import Token, Tree

_BEGIN = re.compile(r"^(?:domain|attribute|message|constraint|time|chronicle)\b", re.MULTILINE)
_NAMED = re.compile(r"\b(?:domain|attribute|message|constraint|chronicle)\s+([\w.-]+)")
_COMMENT = re.compile(r"#[^\n]*")
_READ_AGAIN: Final = 2 * LIMIT_CHARACTERS
"""Most characters that are read again in search of more errors."""


def parse_chronicles(text: str) -> ChronicleFile:
    """Read a chronicle file.

    Raises:
        TextErrors: every error: where the text leaves the grammar, names that are not declared or not bound, values
            outside their domains, circular definitions.
        TextError: a limit is passed.
    """
    found, errors = read_chronicles(text)
    raise_all(errors)
    return found


def read_chronicles(text: str) -> tuple[ChronicleFile, list[TextError]]:
    """The readable chronicles, and the errors of the text; raises TextError at a limit."""
    reader, left, broken = ChronicleReader(text), list[TextError](), frozenset[str]()
    try:
        trees = list(parse_tree(text, "chronicles").children)
    except TextError as first:
        if len(text) > LIMIT_CHARACTERS or not text.strip():
            raise
        trees, left, broken = _mended(text, first)
        left = left or [first]
    if not trees and not left:
        message, repair = language("chronicles").empty
        raise TextError(message, text=text, repair=repair)
    found = [reader.declaration(tree) for tree in trees]
    check_chronicles(found, reader, broken)
    return ChronicleFile(tuple([each.declaration for each in found])), left + reader.errors


def _mended(text: str, first: TextError) -> "tuple[list[Tree[Token] | Token], list[TextError], frozenset[str]]":
    """The trees of the correct pieces, an error for each place that leaves the grammar, and the names of incomplete
    pieces.

    `first` is the error of the whole text.
    """
    trees: list[Tree[Token] | Token] = []
    errors: list[TextError] = []
    names: set[str] = set()
    budget = _READ_AGAIN
    for start, end in _pieces(text):
        lines, piece = text.count("\n", 0, start), text[start:end]
        while piece.strip() and budget > 0 and len(errors) < MAX_ERRORS:
            budget -= len(piece)
            try:
                if piece == text:
                    raise first
                trees += moved(parse_tree(piece, "chronicles"), start, lines).children
            except TextError as wrong:
                errors.append(placed(wrong, text, lines))
                names.update(_NAMED.findall(text[start:end]))
                piece = _without(piece, wrong)
            else:
                break
        else:
            names.update(_NAMED.findall(text[start:end]))
    return trees, errors, frozenset(names)


def _pieces(text: str) -> Iterator[tuple[int, int]]:
    """From each word that begins a declaration at the beginning of a line to the next."""
    starts = [found.start() for found in _BEGIN.finditer(text)]
    return zip(
        [0, *(start for start in starts if start)], [*(start for start in starts if start), len(text)], strict=True
    )


def _without(piece: str, wrong: TextError) -> str:
    """The piece without the statement that is wrong: its line, the lines that brackets tie to it, and the line before if
    the error is at the beginning of its own. Nothing is left where that takes a brace away.
    """
    lines = piece.split("\n")
    depths = [0]
    for line in lines:
        plain = _COMMENT.sub("", line)
        depths.append(max(0, depths[-1] + plain.count("(") - plain.count(")")))
    first = last = min(wrong.line, len(lines)) - 1
    if not lines[first][: wrong.column - 1].strip():
        first = max(0, first - 1)
        while first and not lines[first].strip():
            first -= 1
    while first and depths[first]:
        first -= 1
    while last + 1 < len(lines) and depths[last + 1]:
        last += 1
    cut = lines[first : last + 1]
    if any("{" in line or "}" in line for line in cut):
        return ""
    return "\n".join([*lines[:first], *(" " * len(line) for line in cut), *lines[last + 1 :]])


def print_chronicles(file: model.ChronicleFile) -> str:
    """The file as it is typed."""
    return "\n\n".join(map(print_declaration, file.declarations)) + "\n"


def print_declaration(declaration: model.Declaration) -> str:
    """One declaration, as it is typed."""
    match declaration:
        case model.DomainDefinition(name, domain):
            return f"domain {name} = {domain}"
        case model.Attribute(name, parameters, constraints):
            return f"attribute {_signature(name, parameters)}{_body(constraints) if constraints else ''}"
        case model.Message(name, parameters, constraints):
            return f"message {_signature(name, parameters)}{_body(constraints) if constraints else ''}"
        case model.NamedConstraint(name, parameters, constraints):
            return f"constraint {_signature(name, parameters)}{_body(constraints)}"
        case ComplexConstraint(name, points, timings):
            return f"time constraint {name}{_points(points)}{_body(timings)}"
    return _chronicle(declaration)


def _chronicle(chronicle: model.Chronicle) -> str:
    points = _points(chronicle.instants)
    statements: list[str] = []
    for statement in chronicle.statements:
        shown = str(statement)
        if shown.startswith("(") and statements and statements[-1].startswith("chronicle "):
            statements[-1] += ";"
        statements.append(shown)
    return f"chronicle {_signature(chronicle.name, chronicle.parameters)}{points}{_body(statements)}"


def _points(instants: tuple[str, ...]) -> str:
    return f"({', '.join(instants)})" if instants else ""


def _signature(name: str, parameters: tuple[model.Parameter, ...]) -> str:
    return str(model.EventType(name, parameters))


def _body(statements: Iterable[object]) -> str:
    lines = "".join(f"    {statement}\n" for statement in statements)
    return f" {{\n{lines}}}"
