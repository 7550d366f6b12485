"""Checks of formulas against the specification around them: the meaning of their names, and the sorts of their values.

A name is a bound variable, else a constant or an object, else a stream without objects, else it is wrong, and so is an
object that nothing is called: it is a free variable. Streams of a feature that is made, but not of these objects, may
come later. Values of unknown sorts are unchecked.
"""

from typing import Final

from dyknow.kpl.checking.definitions import Definitions
from dyknow.kpl.checking.error_collector import DeclarationErrors
from dyknow.kpl.checking.formulas import Checker, Sort, Vocabulary
from dyknow.kpl.checking.needs import label_of
from dyknow.kpl.checking.streams import Streams
from dyknow.kpl.checking.symbols import MARGIN, MONITOR, OF_A_PLATFORM, SELF
from dyknow.kpl.diagnostics.collector import nearest
from dyknow.kpl.syntax.specification import Define, MonitorDeclaration
from dyknow.model import values
from dyknow.model.errors import TextError
from dyknow.model.labels import Label
from dyknow.objects.object_streams import OBJECTS, attribute_of
from dyknow.reasoning.features.derivation import FEATURES
from dyknow.reasoning.features.objects import lacks
from dyknow.reasoning.formulas import tree
from dyknow.reasoning.monitoring.margins import check_windows

TRUTHS: Final = (*tree.TEMPORAL, tree.Compare, tree.Not, tree.And, tree.Or, tree.Implies, tree.Forall, tree.Exists)
OF_UNITS: Final[dict[str, Sort]] = {"bool": "boolean", "text": "object"}


class FormulaChecker(Checker):
    """Looks at the formulas of declarations; errors go to the collector."""

    def __init__(self, streams: Streams, errors: DeclarationErrors) -> None:
        self._streams, self._collector = streams, errors
        known = streams.known
        self._definitions = Definitions(streams.symbols)
        self._arities = dict(self._definitions.features.keys())
        self._objects_there = {*self._definitions.objects, *(one for label in known.labels for one in label.objects)}
        self._labels = streams.symbols.labels()
        bare = [label.feature for label in self._labels if not label.objects]
        constants = {**self._definitions.constants, SELF: SELF}
        self._domains = {*bare, *known.unread, OF_A_PLATFORM, *streams.object_streams}
        super().__init__(Vocabulary(named=self._definitions.objects, constants=constants), "")
        self._defined: dict[tuple[str, int], Sort] = {}
        self._members: dict[str, str] = {}
        self._is_quiet = False

    def look_at(self, declaration: Define | MonitorDeclaration) -> None:
        """The formula of a monitor is a truth value, that of a definition this or another value."""
        formula = declaration.formula
        try:
            if isinstance(declaration, Define) and self._is_circular(declaration):
                return
            if isinstance(declaration, MonitorDeclaration) or isinstance(formula, TRUTHS):
                self.truth(formula)
            else:
                self.term(formula)
        except RecursionError:
            self.error("nested too deep for where this is checked", declaration.place, "nest less")

    def error(self, message: str, place: tree.Place, repair: str = "") -> None:
        if not self._is_quiet:
            self._collector.wrong(message, tree.Node(place=place), repair)

    def truth(self, node: tree.Formula) -> tree.Formula:
        """Of a quantifier over a stream of object states the variable is one of its objects."""
        if not isinstance(node, tree.Forall | tree.Exists):
            return super().truth(node)
        before, base = self._members, node.domain.base
        stream = base.removesuffix(f".{OBJECTS}") if isinstance(base, str) else ""
        is_known = stream in self._streams.object_streams
        self._members = {**before, node.variable: stream if is_known else ""}
        found = super().truth(node)
        self._members = before
        return found

    def term(self, node: tree.Formula) -> tuple[tree.Formula, Sort]:
        """Events are those of chronicles and messages, which no specification declares."""
        return (node, "boolean") if isinstance(node, tree.Occurred) else super().term(node)

    def feature(self, node: tree.Feature) -> tuple[tree.Feature, Sort]:
        return node, self._sort(node, *label_of(node))

    def bound(self, bound: tree.Bound) -> int:
        """A definition may stand for a time. A circular definition is reported where it is declared."""
        try:
            return super().bound(self._definitions.put_in(bound))
        except TextError:
            return 0

    def part_of(self, feature: tree.Feature) -> str:
        record = self._streams.record(*label_of(feature))
        if record is None or not record.fields:
            return "a field of it, where it is defined"
        return tree.label_text(f"{feature.name}.{record.fields[0].name}", feature.objects)

    def _set(self, found: tree.DomainSet, place: tree.Place) -> tree.DomainSet:
        if not isinstance(found, str):
            return found
        if found.partition(".")[0] in self._streams.known.unread:
            return found
        if not self._streams.has(Label(found)) and found not in self._domains:
            near = self._collector.closest(found, self._domains)
            have = f"there are {', '.join(sorted(self._domains)[:8])}; or list members: {{a, b}}"
            self._unmade(f"there is no domain {found}", place, Label(found), near, have)
        elif said := self._streams.names_no_objects(Label(found)):
            self.error(said, place, "a stream of objects, or of sets of them")
        return found

    def _unmade(self, message: str, place: tree.Place, label: Label, meant: str, repair: str) -> None:
        if not self._is_quiet:
            self._collector.unmade(message, tree.Node(place=place), label, meant, repair)

    def margin(self, name: str, node: tree.Node) -> None:
        """How far a monitor is from violation is known of formulas over streams whose windows end."""
        monitor = self._streams.symbols.named(MONITOR, name)
        if not isinstance(monitor, MonitorDeclaration):
            near = self._collector.closest(name, self._streams.symbols.names(MONITOR))
            self.error(
                f"no monitor is called {name}", node.place, f"{MARGIN}[{near}]" if near else f"monitor {name} = ..."
            )
            return
        try:
            formula = self._definitions.resolved(monitor.formula, SELF)
        except TextError:
            return  # that is told where it is declared
        features = {one.name for one in tree.walk(formula) if isinstance(one, tree.Feature)}
        derived = features & self._streams.derived
        if derived == features and derived:
            said = f"{name} is over what is derived from units ({', '.join(sorted(derived))}), which has no margins"
            self.error(said, node.place, "a monitor over streams of this instance")
        try:
            check_windows(formula)
        except TextError as wrong:
            self.error(f"{name} has no margins: {wrong.message}", node.place, wrong.repair)

    # The sort of a feature

    def _sort(self, node: tree.Feature, label: Label, variables: frozenset[str]) -> Sort:
        streams, arity = self._streams, len(node.objects)
        is_made = streams.has_feature(node.name)
        if node.name in streams.known.unread:
            return "any"
        if node.attribute is None and (node.name, arity) in self._definitions.features:
            return self._sort_of_definition(node.name, arity)
        if node.name in streams.known.figures:
            if node.name == MARGIN and arity == 1 and not variables:
                self.margin(label.objects[0], node)
            return self._taken(node, 1, "number")
        if not is_made and self._is_of_another_type(node):
            return "any"
        if streams.has(label, variables):
            return self._sort_of_stream(node, label, variables)
        if node.name in FEATURES:
            return "any" if is_made else self._taken(node, FEATURES[node.name].arity, FEATURES[node.name].sort)
        if node.name in self._arities and not is_made:
            return self._taken(node, self._arities[node.name], "any")
        if not node.objects and not is_made:
            self._unknown_name(node, label)
        elif is_made and not node.objects:
            self._of_no_object(node, label)
        elif is_made:
            self._free(node)
        return "any"

    def _is_of_another_type(self, node: tree.Feature) -> bool:
        """Whether an object does not have the feature that is asked for, by the stream it is quantified over; it is reported."""
        name, streams = node.name, self._streams
        derived = FEATURES.get(name)
        for one in node.objects:
            member = self._members.get(one.name, "") if isinstance(one, tree.Variable) else ""
            sort = streams.object_streams.get(member)
            if sort is None or attribute_of(sort, name) is not None:
                continue
            fields = [each.name for each in sort.fields]
            if derived is not None and (lacking := lacks(sort, derived.needs)):
                said = f"{name} cannot be derived of {member}: their sort {sort.name} has no {lacking}"
                self.error(said, node.place, f"sort {sort.name} with these fields; it has {', '.join(fields)}")
                return True
            if derived is None and len(node.objects) == 1:
                near = nearest(name, fields, "", cutoff=0)
                said = f"{member} are of sort {sort.name}, which has no {name}; it has {', '.join(fields)}"
                self.error(said, node.place, tree.label_text(near, node.objects))
                return True
        return False

    def _taken(self, node: tree.Feature, arity: int, sort: Sort) -> Sort:
        if arity == len(node.objects):
            return sort
        self.takes(node, node.name, arity)
        return "any"

    def _sort_of_definition(self, name: str, arity: int) -> Sort:
        """The sort of a definition; errors inside are reported at the definition itself."""
        if (name, arity) not in self._defined:
            self._defined[name, arity] = "any"
            definition, before = self._definitions.features[name, arity], self._is_quiet
            self._is_quiet = True
            if not self._is_circular(definition):
                formula = definition.formula
                self._defined[name, arity] = "boolean" if isinstance(formula, TRUTHS) else self.term(formula)[1]
            self._is_quiet = before
        return self._defined[name, arity]

    def _is_circular(self, definition: Define) -> bool:
        """Whether it is defined by itself, which is reported where definitions are put in."""
        try:
            self._definitions.check(definition)
        except TextError:
            return True
        return False

    def _sort_of_stream(self, node: tree.Feature, label: Label, variables: frozenset[str]) -> Sort:
        lacking = self._streams.lacks(label, variables)
        if lacking is not None:
            self.error(lacking[0], node.place, lacking[1])
        attribute = self._streams.attribute(node.name) if node.attribute is None and len(label.objects) == 1 else None
        if attribute is not None and not self._streams.has_feature(node.name):
            return OF_UNITS.get(attribute.unit, "number")
        record = self._streams.record(label, variables)
        if lacking is not None:
            return "any"
        if record is None or not record.fields:
            return "any" if node.name in FEATURES or node.attribute else self._simple(record, label, variables)
        if node.attribute is None:  # of a derived feature's name it may be that one, in a federation
            return "any" if node.name in FEATURES else "record"
        return OF_UNITS.get(next(each.unit for each in record.fields if each.name == node.attribute), "number")

    def _simple(self, record: values.Sort | None, label: Label, variables: frozenset[str]) -> Sort:
        """The sort of simple values, where it says what they are; one called `number`, undeclared, is of numbers."""
        if record is None:
            return "number" if self._streams.sort_of(label, variables) == "number" else "any"
        return OF_UNITS.get(record.unit, "number") if record.unit else "any"

    def _unknown_name(self, node: tree.Feature, label: Label) -> None:
        near = self._collector.closest(str(label), (*self._labels, *self._arities, *self._known.constants))
        said = f"{label} is no variable, constant, object or stream; a free variable must be bound"
        self._unmade(
            said, node.place, label, near, f"forall {label} in DOMAIN: ..., or strmgen {label} = ..., before it"
        )

    def _of_no_object(self, node: tree.Feature, label: Label) -> None:
        """Streams of the feature are each of some object, and this names none."""
        near = self._collector.closest(str(label), self._labels)
        self._unmade(f"{label} is made of objects, and none is named", node.place, label, near, "")

    def _free(self, node: tree.Feature) -> None:
        """Report objects without a name: streams of the feature may come later, but not of unknown objects."""
        for one in node.objects:
            if isinstance(one, str) and not (
                one.isdecimal() or one in self._known.constants or one in self._objects_there
            ):
                said = f"{one} is free: nothing binds it, and no object is called so"
                near = self._collector.closest(one, (*self._objects_there, *label_of(node)[1]))
                self.error(said, node.place, near or f"forall {one} in DOMAIN: ...")
