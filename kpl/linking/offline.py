"""Links where there are recorded percepts and no streams: which conditions mean something there, and which attributes they name."""

from collections.abc import Iterable, Iterator, Mapping

from dyknow.anchoring.links.deciding.context import STATE_FEATURES
from dyknow.anchoring.links.specification import DISTANCES
from dyknow.kpl.checking.error_collector import DeclarationErrors
from dyknow.kpl.checking.link_conditions import (
    ON_ROADS,
    ConditionChecker,
    attributes_of,
    is_of_end,
    stands_in_state,
    types_of_ends,
)
from dyknow.kpl.checking.needs import conditions_of, domains_of, label_of
from dyknow.kpl.checking.streams import Streams
from dyknow.kpl.checking.symbols import SymbolTable
from dyknow.kpl.linking.declarations import LinkDeclarations, percept_labels
from dyknow.kpl.syntax.parsing import raise_all
from dyknow.model.errors import TextError
from dyknow.model.labels import Label
from dyknow.objects.object_streams import OBJECTS
from dyknow.reasoning.formulas import tree


def check_conditions(links: LinkDeclarations, symbols: SymbolTable, text: str) -> None:
    """Look at the names in all conditions.

    Raises:
        TextErrors: every name that is neither an attribute nor declared.
    """
    percepts = {label.feature for label in percept_labels(links)}
    known, symbols.known = symbols.known, symbols.known._replace(unread={*symbols.known.unread, *percepts})
    errors = DeclarationErrors(text)
    checker = ConditionChecker(Streams(symbols), errors)
    for label, made in links:
        checker.look_at_conditions(label, made)
    symbols.known = known
    raise_all(errors.errors)


class OfflineConditions:
    """Conditions, with definitions put in, over recorded percepts.

    Raises:
        TextErrors: they speak of streams.
    """

    def __init__(self, links: LinkDeclarations, symbols: SymbolTable, text: str) -> None:
        self._text, self._streams = text, Streams(symbols)
        self._types = {str(label) for label, _ in links} | {str(made.source) for _, made in links}
        self._missing: dict[str, tree.Feature] = {}
        self._seen: set[str] = set()
        sorts = [self._streams.record(each) for label, made in links for each in (label, made.source)]
        self._declared = {field.name for sort in sorts if sort is not None for field in sort.fields}
        errors = DeclarationErrors(text)
        for label, made in links:
            ends = types_of_ends(made, label)
            for condition in conditions_of(made):
                for node, name in self._around(condition, ends):
                    said = f"{name} is a stream, and there are recorded percepts only"
                    errors.wrong(said, node, "dyknow kpl run FILE.kpl --feed FILE.jsonl, with the streams")
        raise_all(errors.errors)

    def _around(self, condition: tree.Formula, ends: Mapping[str, Label]) -> Iterator[tuple[tree.Node, str]]:
        """Nodes that are about neither the ends nor other objects of the linkage, with their names."""
        events = {id(node.event) for node in tree.walk(condition) if isinstance(node, tree.Occurred)}
        for node in tree.walk(condition):
            if isinstance(node, tree.Occurred):
                yield node.event, str(label_of(node.event)[0])
            elif isinstance(node, tree.Forall | tree.Exists):
                named = (one.removesuffix(f".{OBJECTS}") for one in domains_of(node))
                yield from ((node, name) for name in named if name not in self._types)
            elif isinstance(node, tree.Feature) and id(node) not in events and not self._is_of_objects(node, ends):
                yield node, str(label_of(node)[0])

    def _is_of_objects(self, node: tree.Feature, ends: Mapping[str, Label]) -> bool:
        """Whether it is read from states of objects; an attribute that no sort declares has to be seen."""
        label = label_of(node)[0]
        if is_of_end(label):
            is_read = stands_in_state(label, ends, self._streams)
            if is_read and attributes_of(ends[label.objects[0]], self._streams) is None:
                self._name(node, label)
            return is_read
        of_objects = all(isinstance(one, tree.Variable) or one in ends for one in node.objects)
        return stands_in_state(label, ends, self._streams) or (
            of_objects and (len(label.objects) == 1 or (len(label.objects) == 2 and label.feature in DISTANCES))
        )

    def _name(self, node: tree.Feature, label: Label) -> None:
        name = label.feature.rpartition(".")[2]
        if name not in {*self._declared, *STATE_FEATURES, ON_ROADS}:
            self._missing.setdefault(name, node)

    def on_attributes(self, names: Iterable[str]) -> None:
        """A percept has these."""
        for name in names:
            self._seen.add(name)
            self._missing.pop(name, None)

    def errors(self) -> list[TextError]:
        """Attributes that conditions name, and no percept had."""
        errors, have = DeclarationErrors(self._text), ", ".join(sorted(self._seen)) or "none"
        for name, node in self._missing.items():
            near = errors.closest(name, {*self._seen, *STATE_FEATURES}) or next(iter(sorted(self._seen)), "speed")
            repair = f"{near}[{label_of(node)[0].objects[0]}]"
            errors.wrong(f"no percept has {name}; their attributes: {have}", node, repair)
        return sorted(errors.errors, key=lambda each: (each.line, each.column))
