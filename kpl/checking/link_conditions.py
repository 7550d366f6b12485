"""Conditions of links and composites against the specification around them: each name is an attribute of an end, or a stream.

`NAME[from]` is an attribute of the states of `from`, where they have one, else a stream called so, with the symbol of the
object in it; what else a condition names are streams, events and domains as in any formula.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from dyknow.anchoring.links.composites import COUNT, PARTS
from dyknow.anchoring.links.deciding.context import STATE_FEATURES
from dyknow.anchoring.links.specification import DISTANCES, FROM, THRESHOLD, TO
from dyknow.anchoring.percepts.records import ANCHORED, ROAD_FIELDS
from dyknow.kpl.checking.error_collector import DeclarationErrors
from dyknow.kpl.checking.formulas import Sort
from dyknow.kpl.checking.formulas_in_context import OF_UNITS, FormulaChecker
from dyknow.kpl.checking.needs import conditions_of, label_of
from dyknow.kpl.checking.streams import Streams
from dyknow.kpl.checking.symbols import CHRONICLE, LINK_UNITS, SELF, recognises, stem
from dyknow.kpl.diagnostics.collector import nearest
from dyknow.kpl.syntax import specification as spec
from dyknow.model.labels import Label
from dyknow.model.values import END, SYMBOL
from dyknow.reasoning.features.derivation import FEATURES
from dyknow.reasoning.features.objects import lacks
from dyknow.reasoning.formulas import tree

ON_ROADS: Final = "on_road"
_ENDS: Final = frozenset({FROM, TO})
_UNREAD: Final = frozenset({SYMBOL, END, ANCHORED})
_OWN: Final[Mapping[str, Sort]] = {**dict.fromkeys(STATE_FEATURES, "number"), ON_ROADS: "boolean"}
"""The attributes of every state."""
_HEIGHT: Final = "altitude"
"""The feature derived from an object's `altitude_m`, unless the object has an attribute of that name."""


def attributes_of(type_: Label, streams: Streams) -> Mapping[str, Sort] | None:
    """The attributes of the states of a type of objects, with their sorts; None: not all of them are known."""
    return _attributes(type_, streams, frozenset())


def _attributes(type_: Label, streams: Streams, above: frozenset[Label]) -> Mapping[str, Sort] | None:
    if type_ in above:
        return None
    made = [each.made for each in streams.symbols.makers(type_)]
    if any(isinstance(each, spec.Composite) for each in made):
        return {**_OWN, PARTS: "object", COUNT: "number"}
    links = [each for each in made if isinstance(each, spec.Link)]
    record = streams.record(type_)
    is_ready = all(each.unit in LINK_UNITS and streams.symbols.unit(each.unit) is None for each in links)
    if (record is None or not record.fields) and not (links and is_ready):
        return None
    fields = () if record is None else record.fields
    known: dict[str, Sort] = {
        **_OWN,
        **{each.name: OF_UNITS.get(each.unit, "number") for each in fields if each.name not in _UNREAD},
    }
    for each in links:
        below = _attributes(each.source, streams, above | {type_})
        if below is None:
            return None
        known |= below
        if each.unit == "OnRoad":
            known |= {name: OF_UNITS.get(unit, "number") for name, unit in ROAD_FIELDS.items()}
    return known


def is_of_end(label: Label) -> bool:
    """Whether it is something of one end, as it is written or of one stream: `colour[from]`."""
    return len(label.objects) == 1 and label.objects[0] in _ENDS


def stands_in_state(label: Label, types: Mapping[str, Label], streams: Streams) -> bool:
    """Whether a condition takes a label from the states of its objects; `types`: of the ends."""
    if label.feature == THRESHOLD:
        return label.objects in {(), (TO,)}
    if label.feature in DISTANCES:
        return sorted(label.objects) == [FROM, TO]
    if not is_of_end(label):
        return False
    type_ = types[label.objects[0]]
    whole, _, attribute = label.feature.rpartition(".")
    if whole and whole != type_.feature:
        return False
    if attribute in _OWN and not whole:
        return True
    known = attributes_of(type_, streams)
    if known is not None:
        return attribute in known
    return bool(whole) or not streams.symbols.of_feature(attribute)


def types_of_ends(made: spec.Link | spec.Composite, target: Label) -> dict[str, Label]:
    """The types of `from` and `to`."""
    return {FROM: made.source, TO: made.source if isinstance(made, spec.Composite) else target}


def streams_of_ends(made: spec.Link | spec.Composite, target: Label, streams: Streams) -> Iterator[str]:
    """Features of one end in its conditions that are streams, and no attributes."""
    types = types_of_ends(made, target)
    for condition in conditions_of(made):
        for node in tree.walk(condition):
            if isinstance(node, tree.Feature):
                label = label_of(node)[0]
                if is_of_end(label) and not stands_in_state(label, types, streams):
                    yield label.feature


class ConditionChecker(FormulaChecker):
    """Looks at the conditions of links and composites; errors go to the collector."""

    def __init__(self, streams: Streams, errors: DeclarationErrors) -> None:
        super().__init__(streams, errors)
        self._types: dict[str, Label] = {}
        self._is_alone = False

    def look_at_conditions(self, target: Label, made: spec.Link | spec.Composite) -> None:
        """Check all conditions of a declaration that makes objects of one type."""
        is_composite = isinstance(made, spec.Composite)
        self._types = types_of_ends(made, target)
        streams = self._streams.object_streams
        self._members = {end: str(type_) for end, type_ in self._types.items() if str(type_) in streams}
        for i, condition in enumerate(conditions_of(made)):
            self._is_alone = i == 0 and not is_composite
            try:
                self.truth(condition)
            except RecursionError:
                self.error("nested too deep for where this is checked", made.place, "nest less")

    def term(self, node: tree.Formula) -> tuple[tree.Formula, Sort]:
        """An event that is recognised is one of a chronicle that is declared; others are streams."""
        if not isinstance(node, tree.Occurred):
            return super().term(node)
        label, variables = label_of(node.event)
        chronicles = self._streams.symbols.names(CHRONICLE)
        if label.feature == spec.RECOGNISED and label.objects:
            if label.objects[0] not in chronicles:
                near = self._collector.closest(label.objects[0], chronicles)
                repair = (
                    tree.label_text(spec.RECOGNISED, [near, *label.objects[1:]])
                    if near
                    else 'chronicle file "FILE.chr"'
                )
                self.error(f"no chronicle is called {label.objects[0]}", node.event.place, repair)
            elif not recognises(self._streams.symbols, label):
                said = f"{label.objects[0]} has another number of arguments"
                self.error(said, node.event.place, tree.label_text(spec.RECOGNISED, [label.objects[0], FROM]))
        elif not self._streams.has(label, variables) and stem(label) not in self._streams.known.unread:
            near = self._collector.closest(
                str(label), [*self._labels, *(f"{spec.RECOGNISED}[{one}]" for one in chronicles)]
            )
            self._unmade(
                f"nothing makes the event {label}", node.event.place, label, near, f"{spec.RECOGNISED}[NAME, from]"
            )
        return node, "boolean"

    def feature(self, node: tree.Feature) -> tuple[tree.Feature, Sort]:
        label, variables = label_of(node)
        if self._is_alone and TO in label.objects:
            said = "a condition to establish is of `from` alone: there is no `to` before an object is known"
            self.error(said, node.place, tree.label_text(node.stem, [FROM]))
        elif stands_in_state(label, self._types, self._streams):
            return node, self._sort_in_state(label)
        elif label.feature == THRESHOLD:
            self.error(f"{THRESHOLD} is a distance, as it is for `to`", node.place, THRESHOLD)
        elif is_of_end(label) and not self._has_stream(node, label, variables):
            self._no_attribute(node, label)
        elif meant := self._mistyped_end(node):
            name, end = meant
            objects = [end if one == name else str(one) for one in label.objects]
            self.error(f"nothing is called {name}", node.place, tree.label_text(node.stem, objects))
        elif not label.objects and self._is_attribute(node, label):
            self.error(f"{label} is an attribute of objects: name the object", node.place, f"{label.feature}[{FROM}]")
        elif variables & _ENDS and not self._has_stream(node, label, variables):
            names = [each for each in self._labels if each != label]
            self._unmade(f"nothing makes {label}", node.place, label, self._collector.closest(str(label), names), "")
        else:
            return super().feature(node)
        return node, "any"

    def _is_attribute(self, node: tree.Feature, label: Label) -> bool:
        """Whether a name without an object is no stream, but an attribute."""
        known = attributes_of(self._types[FROM], self._streams) or {}
        return label.feature in known and not self._has_stream(node, label, frozenset())

    def _mistyped_end(self, node: tree.Feature) -> tuple[str, str] | None:
        """A name that is nearly that of an end, and of nothing else here; and that end."""
        for one in node.objects:
            is_known = not isinstance(one, str) or one in self._known.constants or one in self._objects_there
            if isinstance(one, str) and not is_known and (near := nearest(one, [FROM, TO, SELF])):
                return one, near
        return None

    def _has_stream(self, node: tree.Feature, label: Label, variables: frozenset[str]) -> bool:
        streams, known = self._streams, self._streams.known
        if node.name in known.unread or node.name in known.figures:
            return True
        if node.attribute is None and (node.name, len(node.objects)) in self._definitions.features:
            return True
        whole = label.feature.rpartition(".")[0]
        if is_of_end(label) and whole in streams.object_streams:
            return False
        if not is_of_end(label) or streams.symbols.of_feature(node.name):
            return streams.has(label, variables) or label.feature in FEATURES
        sort = streams.object_streams.get(str(self._types[label.objects[0]]))
        return label.feature == _HEIGHT and sort is not None and not lacks(sort, FEATURES[_HEIGHT].needs)

    def _sort_in_state(self, label: Label) -> Sort:
        if not is_of_end(label):
            return "number"
        known = attributes_of(self._types[label.objects[0]], self._streams)
        return (known or _OWN).get(label.feature.rpartition(".")[2], "any")

    def _no_attribute(self, node: tree.Feature, label: Label) -> None:
        end, type_ = label.objects[0], self._types[label.objects[0]]
        whole, _, attribute = label.feature.rpartition(".")
        if whole and whole != type_.feature:
            self.error(f"`{end}` is of {type_}, not of {whole}", node.place, f"{attribute}[{end}]")
            return
        known = attributes_of(type_, self._streams) or {}
        shown = [name for name in sorted(known) if name not in _OWN] or sorted(_OWN)
        near = self._collector.closest(attribute, sorted(known)) or shown[0]
        said = f"objects of {type_} have no {attribute}, and no stream is called so; they have {_listed(shown)}"
        self.error(said, node.place, f"{near}[{end}]")


def _listed(names: Iterable[str]) -> str:
    return ", ".join(list(names)[:12])
