"""Domains of objects: the members of a stream of object states, for a quantifier or a declaration for each member.

`forall c in cars: ...` is about those of `cars.objects` in the state in which it is looked at. They come and go, so that it
grows by itself.
"""

from dataclasses import fields, replace
from typing import Any

from dyknow.kpl.checking.needs import domains_of
from dyknow.kpl.checking.streams import Streams
from dyknow.kpl.checking.symbols import SymbolTable
from dyknow.model.labels import Label
from dyknow.objects.object_streams import OBJECTS, domain_of
from dyknow.reasoning.formulas import tree


def members_label(label: Label, symbols: SymbolTable) -> Label:
    """The stream that names the members of a domain: of a stream of object states that of its objects."""
    return domain_of(label) if Streams(symbols).objects(label) is not None else label


def over_objects(formula: tree.Formula, symbols: SymbolTable) -> tree.Formula:
    """The formula, whose quantifiers name the domains of streams of object states, and grow with them."""
    named = domains_of(formula)
    streams = Streams(symbols) if named else None
    domains = {
        name: str(domain_of(Label(name)))
        for name in named
        if streams is not None and streams.objects(Label(name)) is not None
    }
    growing = {name for name in named if name.endswith(f".{OBJECTS}")} | set(domains)
    found: tree.Formula = _put(formula, domains, growing) if growing else formula
    return found


def _put(node: Any, domains: dict[str, str], growing: set[str]) -> Any:
    if isinstance(node, tuple):
        return tuple(_put(one, domains, growing) for one in node)
    if isinstance(node, tree.Domain):
        base, *minus = (domains.get(one, one) if isinstance(one, str) else one for one in (node.base, *node.minus))
        return replace(node, base=base, minus=tuple(minus))
    if not isinstance(node, tree.Node):
        return node
    changed = {each.name: _put(getattr(node, each.name), domains, growing) for each in fields(node) if each.init}
    if isinstance(node, tree.Forall | tree.Exists) and node.domain.base in growing:
        changed["growing"] = True
    return replace(node, **changed)
