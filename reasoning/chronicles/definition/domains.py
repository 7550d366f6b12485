"""Domains: sets of symbols and their algebra (thesis 8.3.1, C7).

A symbol is a text; the values `true` and `false` of an attribute are the symbols of that spelling. A complement is
relative to all symbols. The thesis takes those of the specification for all there are; as events bring symbols that
no specification mentions (a car's name), `~D` holds whatever is not in `D`, which says the same of every symbol that
is written down.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

from dyknow.model.errors import ChronicleError

_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(-[A-Za-z0-9_]+)*|-?[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?(us|ms|s|min|h)?")
RESERVED = frozenset(
    [
        "alias",
        "and",
        "attribute",
        "chronicle",
        "constraint",
        "delay",
        "domain",
        "else",
        "event",
        "hold",
        "if",
        "in",
        "init",
        "instant",
        "message",
        "noevent",
        "not",
        "occurs",
        "oo",
        "or",
        "recognized",
        "send",
        "then",
        "variable",
        "when",
    ]
)
"""Words that name nothing in a chronicle file: those of 8.3.1, and if, then and else, which the grammar has besides."""


def symbol_text(symbol: object) -> str:
    """A symbol as it is typed: in quotes if it is neither a name nor a number. Variables are what they are."""
    text = str(symbol)
    return f'"{text}"' if isinstance(symbol, str) and (text in RESERVED or not _PLAIN.fullmatch(text)) else text


@dataclass(frozen=True, slots=True)
class SymbolSet:
    """The symbols of a domain: these, or all but these. `x in found` asks for one."""

    symbols: frozenset[str] = frozenset()
    all_but: bool = False

    def __contains__(self, symbol: object) -> bool:
        return (symbol in self.symbols) is not self.all_but

    def __or__(self, other: "SymbolSet") -> "SymbolSet":
        return ~(~self & ~other)

    def __and__(self, other: "SymbolSet") -> "SymbolSet":
        if self.all_but and other.all_but:
            return SymbolSet(self.symbols | other.symbols, all_but=True)
        if self.all_but:
            return SymbolSet(other.symbols - self.symbols)
        return SymbolSet(self.symbols - other.symbols if other.all_but else self.symbols & other.symbols)

    def __sub__(self, other: "SymbolSet") -> "SymbolSet":
        return self & ~other

    def __invert__(self) -> "SymbolSet":
        return SymbolSet(self.symbols, not self.all_but)


@dataclass(frozen=True, slots=True)
class Symbols:
    """`{red, blue}`: the symbols in the order they are written."""

    symbols: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "{" + ", ".join(map(symbol_text, self.symbols)) + "}"


@dataclass(frozen=True, slots=True)
class NamedDomain:
    """`Color`: the domain that is declared under this name."""

    name: str

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, slots=True)
class Combination:
    """`left | right`, `left & right`, `left - right`, however it was spelled (C7); `operator` is `|`, `&` or `-`."""

    operator: str
    left: "Domain"
    right: "Domain"

    def __str__(self) -> str:
        """Read from the left, & before | and -: parentheses go where something else is meant."""
        left = f"({self.left})" if self.operator == "&" and _is_sum(self.left) else self.left
        right = f"({self.right})" if _is_sum(self.right) or _is_same(self.operator, self.right) else self.right
        return f"{left} {self.operator} {right}"


@dataclass(frozen=True, slots=True)
class Complement:
    """`~ domain`."""

    domain: "Domain"

    def __str__(self) -> str:
        return f"~({self.domain})" if isinstance(self.domain, Combination) else f"~{self.domain}"


def _is_sum(domain: "Domain") -> bool:
    return isinstance(domain, Combination) and domain.operator != "&"


def _is_same(operator: str, domain: "Domain") -> bool:
    return isinstance(domain, Combination) and domain.operator == operator


Domain: TypeAlias = Symbols | NamedDomain | Combination | Complement


def symbol_set(domain: Domain, declared: Mapping[str, Domain]) -> SymbolSet:
    """The symbols of a domain, with the domains that it names.

    Raises:
        ChronicleError: a name that is not declared, or declared by itself, or too deep in others.
    """
    try:
        return _symbol_set(domain, declared, {})
    except RecursionError:
        which = f"the domain {domain.name}" if isinstance(domain, NamedDomain) else "a domain"
        raise ChronicleError(f"{which} stands on too many others; write its symbols") from None


def _symbol_set(domain: Domain, declared: Mapping[str, Domain], known: dict[str, SymbolSet | None]) -> SymbolSet:
    """Each name is looked into once: `known` are those that have been, None those that are being."""
    if isinstance(domain, Symbols):
        return SymbolSet(frozenset(domain.symbols))
    if isinstance(domain, Complement):
        return ~_symbol_set(domain.domain, declared, known)
    if isinstance(domain, NamedDomain):
        if domain.name not in declared:
            names = ", ".join(sorted(declared)) or "none"
            raise ChronicleError(f"no domain is called {domain.name}; declared: {names}")
        if domain.name not in known:
            known[domain.name] = None
            known[domain.name] = _symbol_set(declared[domain.name], declared, known)
        found = known[domain.name]
        if found is None:
            raise ChronicleError(f"the domain {domain.name} is declared by itself; write its symbols")
        return found
    left = _symbol_set(domain.left, declared, known)
    right = _symbol_set(domain.right, declared, known)
    if domain.operator == "&":
        return left & right
    return left | right if domain.operator == "|" else left - right
