"""Wanted objects against the specification around them: of which type they are, and what can be said of such objects."""

from collections.abc import Iterator

from dyknow.model.labels import Label
from dyknow.model.values import END, SYMBOL
from kpl.checking.error_collector import DeclarationErrors
from kpl.checking.streams import Streams
from kpl.checking.symbols import DEFINITION
from kpl.syntax import specification as spec
from reasoning.formulas import tree

OF_STATES = ("speed", "deviation", "x", "y", "x_m", "y_m", "vx_m_s", "vy_m_s", "sd_m")
"""What every object has."""
ON_ROADS = "on_road"
_NEED_MORE = (tree.Forall, tree.Exists, tree.Occurred, tree.Since)


def check_want(want: spec.Want, streams: Streams, errors: DeclarationErrors) -> None:
    """Report what is wrong with it, but for the names of streams."""
    chain = list(_chain(want.stream, streams))
    if not chain:
        if not streams.has(want.stream):
            return
        linked = [each.label for each in streams.symbols.symbols() if isinstance(each.made, spec.Link)]
        said = f"no link makes {want.stream}, so that none of its objects can be found by a description"
        nearest = errors.closest(str(want.stream), linked) or next(map(str, linked), "")
        errors.wrong(said, want, f"want {want.symbol} in {nearest or 'cars, and strmgen cars = link(...)'}")
        return
    known = _features(chain, streams)
    if isinstance(want.description, tree.Feature) and want.description.name in OF_STATES:
        errors.wrong(f"{want.description.name} is a number: a description is true or false", want, _example(want))
    for node in tree.walk(want.description):
        if isinstance(node, _NEED_MORE):
            errors.wrong("a description is of one object, at times from when it came into view", node, _example(want))
        elif isinstance(node, tree.Feature):
            _check_feature(node, want, known, streams, errors)


def _check_feature(
    node: tree.Feature, want: spec.Want, known: set[str] | None, streams: Streams, errors: DeclarationErrors
) -> None:
    if streams.symbols.named(DEFINITION, (node.name, len(node.objects))) is not None:
        return
    if not node.objects:
        errors.wrong(f"{node.name} is no constant; a text stands in quotes", node, f'"{node.name}"')
    elif node.objects != (tree.Variable(want.symbol),):
        said = f"a description speaks of {want.symbol} alone"
        errors.wrong(said, node, f"{node.name}[{want.symbol}]")
    elif known is not None and node.name not in known:
        repair = errors.closest(node.name, known)
        said = f"objects of {want.stream} have no {node.name}; they have {', '.join(sorted(known))}"
        errors.wrong(said, node, f"{repair}[{want.symbol}]" if repair else _example(want))


def _chain(stream: Label, streams: Streams) -> Iterator[spec.Link]:
    """The links that lead to a stream, downwards."""
    seen = set[Label]()
    while stream not in seen:
        seen.add(stream)
        made = [one.made for one in streams.symbols.makers(stream) if isinstance(one.made, spec.Link)]
        if not made:
            return
        yield made[0]
        stream = made[0].source


def _features(chain: list[spec.Link], streams: Streams) -> set[str] | None:
    """What objects of a type have; None: it is not known of those below."""
    known = {*OF_STATES, *((ON_ROADS,) if streams.symbols.roads() is not None else ())}
    for link in chain:
        sort = streams.record(link.source)
        if sort is None or not sort.fields:
            return None
        known.update(each.name for each in sort.fields)
    return known - {SYMBOL, END, "anchored"}


def _example(want: spec.Want) -> str:
    return f"speed[{want.symbol}] > 5"
