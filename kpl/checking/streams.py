"""Streams and their sorts: those that are declared, and those that exist without the specification."""

from collections.abc import Sequence
from functools import cached_property
from typing import Final

from dyknow.kpl.checking.needs import NOTHING
from dyknow.kpl.checking.symbols import (
    DEFINITION,
    LINK_UNITS,
    OF_A_PLATFORM,
    Symbol,
    SymbolTable,
    constant_of,
    fit,
    is_pattern,
    stem,
)
from dyknow.kpl.diagnostics.collector import nearest
from dyknow.kpl.syntax import specification as spec
from dyknow.model.labels import Label
from dyknow.model.values import SYMBOL, Field, Sort
from dyknow.objects.object_streams import OBJECTS, TYPE
from dyknow.reasoning.features.derivation import FEATURES

STATE: Final = "state"
BELIEF: Final = "belief"
"""The sort of beliefs, unless one of the name of their stream is declared."""
ORIGIN: Final = ("ORIGIN_LATITUDE_DEG", "ORIGIN_LONGITUDE_DEG")
"""The constants that say where the frame lies in which objects are seen, in metres."""
ANY: Final = "?"
"""How the sorts begin that stand for any: a unit with such a sort that is not declared is reported where it is made."""


def origin_of(symbols: SymbolTable) -> tuple[float, float] | None:
    """Where x_m and y_m of objects are 0, in degrees: as it is declared, else of the roads; None: it is not known."""
    found: list[float] = []
    for name in ORIGIN:
        declared = symbols.named(DEFINITION, (name, 0))
        value = constant_of(declared) if isinstance(declared, spec.Define) else None
        if isinstance(value, int | float):
            found.append(float(value))
    if len(found) == len(ORIGIN):
        return found[0], found[1]
    roads = symbols.roads()
    return None if roads is None or roads.frame is None else (roads.frame.latitude_deg, roads.frame.longitude_deg)


class Streams:
    """The streams of a symbol table, as it is now: sorts are worked out once."""

    def __init__(self, symbols: SymbolTable) -> None:
        self.symbols, self.known = symbols, symbols.known
        self._sorts: dict[int, str | None] = {}
        self._derived: dict[str, bool] = {}
        self._objects: dict[Label, Sort | None] = {}
        self._linking = set[int]()
        self._known_by_stem: dict[str, list[Label]] = {}
        for label in self.known.labels:
            self._known_by_stem.setdefault(stem(label), []).append(label)

    @cached_property
    def derived(self) -> frozenset[str]:
        """The features that are derived in a federation, without those that streams of values here are called like."""
        return frozenset(filter(self._is_derived, FEATURES))

    def _is_derived(self, feature: str) -> bool:
        if feature not in self._derived:
            self._derived[feature] = True  # while it is worked out: a stream may be selected from such features
            records = (self.record(made.label, made.variables) for made in self.symbols.of_feature(feature))
            self._derived[feature] = all(record is not None and record.fields for record in records)
        return self._derived[feature]

    def derives(self, label: Label) -> bool:
        """Whether it is a derived feature, with as many units as it takes."""
        if label == Label(OF_A_PLATFORM):
            return not self.symbols.of_feature(OF_A_PLATFORM)
        kind = FEATURES.get(label.feature)
        return kind is not None and kind.arity == len(label.objects) and self._is_derived(label.feature)

    def has(self, label: Label, variables: frozenset[str] = NOTHING) -> bool:
        """Whether the label, or the stream whose attribute it is, has a producer."""
        whole = label._replace(feature=stem(label))
        for made in self.symbols.makers(label, variables):
            is_of_all = isinstance(made.made, spec.Link | spec.Composite | spec.Belief)
            if made.label.feature == label.feature or is_of_all or fit(whole, variables, made.label, made.variables):
                return True
        if label in self.known.labels and not is_pattern(label, variables):
            return True
        if self.is_about_objects(label):
            return True
        return any(fit(label, variables, known, NOTHING) for known in self._known_by_stem.get(stem(label), ()))

    # Objects

    def objects(self, label: Label) -> Sort | None:
        """Of what sort the object states of a stream are; None: it is no such stream."""
        if label not in self._objects:
            self._objects[label] = None  # while it is worked out: a stream may be made of itself
            record = None if "." in label.feature else self._record(label, NOTHING)
            self._objects[label] = record if record is not None and record.is_of_objects else None
        return self._objects[label]

    @cached_property
    def object_streams(self) -> dict[str, Sort]:
        """The streams of object states whose objects are known by their symbols alone."""
        names = dict.fromkeys(each.feature for each in self.symbols.labels() if not each.objects)
        return {name: sort for name in names if (sort := self.objects(Label(name))) is not None}

    def attribute(self, name: str) -> Field | None:
        """An attribute that the objects of some stream have."""
        every = (each for sort in self.object_streams.values() for each in sort.fields)
        found = next((each for each in every if each.name == name), None)
        return Field(TYPE, "text") if found is None and name == TYPE and self.object_streams else found

    def _of_one(self, label: Label) -> Sort | None:
        """Of what sort the states of one object are, `cars[car1]`; None: the label means something else."""
        return self.objects(Label(label.feature)) if len(label.objects) == 1 else None

    def is_about_objects(self, label: Label) -> bool:
        """Whether it is the domain of a stream of object states, or something of one object."""
        whole, attribute = label._replace(feature=stem(label)), label.feature.partition(".")[2]
        if attribute == OBJECTS and self.objects(whole) is not None:
            return True
        if self._of_one(whole) is not None:
            return True
        if len(label.objects) != 1:
            return False
        is_made = self.symbols.of_feature(whole.feature)
        return not attribute and not is_made and self.attribute(label.feature) is not None

    # Of which sort

    def has_feature(self, feature: str) -> bool:
        """Whether there are streams of that feature, of whatever objects."""
        return feature in self._known_by_stem or bool(self.symbols.of_feature(feature))

    def sort_of(self, label: Label, variables: frozenset[str] = NOTHING) -> str | None:
        """The sort of a stream; None when it is not known, or not one."""
        return self._sort_of(label, variables, frozenset())

    def record(self, label: Label, variables: frozenset[str] = NOTHING) -> Sort | None:
        """The sort of the values of `label`, or of the stream whose attribute it is; None if they are unchecked."""
        if label.feature in self.known.figures:
            return None
        whole = label._replace(feature=stem(label))
        return self._of_one(whole) or self._record(whole, variables)

    def _record(self, whole: Label, variables: frozenset[str]) -> Sort | None:
        makers = list(self.symbols.makers(whole, variables))
        sorts = {self._made_sort(made, frozenset()) for made in makers} or {self.known.labels.get(whole)}
        name = sorts.pop()
        if sorts or name is None:
            return None
        shape = self.symbols.shape(name)
        return self._linked(makers) if shape is None and makers else shape

    def _linked(self, makers: Sequence[Symbol]) -> Sort | None:
        """The sort of the states of linked objects where none is declared, from all links that make them."""
        from dyknow.anchoring.belief.live.records import BELIEF_SORT
        from dyknow.anchoring.percepts.records import object_sort

        if isinstance(makers[0].made, spec.Belief):
            return BELIEF_SORT
        feature, is_placed = makers[0].label.feature, origin_of(self.symbols) is not None
        if isinstance(makers[0].made, spec.Composite):
            return object_sort(feature, (), is_placed=is_placed, is_composite=True)
        links = [each.made for each in makers if isinstance(each.made, spec.Link) and each.made.unit in LINK_UNITS]
        if not links or id(makers[0]) in self._linking:
            return None
        self._linking.add(id(makers[0]))
        below = [self.record(link.source) for link in links]
        self._linking.discard(id(makers[0]))
        is_on_roads = any(link.unit == "OnRoad" for link in links)
        return object_sort(feature, below, is_on_roads=is_on_roads, is_placed=is_placed)

    def lacks(self, label: Label, variables: frozenset[str] = NOTHING) -> tuple[str, str] | None:
        """Message and repair for an attribute that the values of a stream are known not to have."""
        whole, attribute = label._replace(feature=stem(label)), label.feature.partition(".")[2]
        if attribute == OBJECTS and self.objects(whole) is None:
            said = f"{whole} is no stream of object states, whose sort begins with `{SYMBOL} in text`"
            return said, f"{next(iter(self.object_streams), 'cars')}.{OBJECTS}"
        record = self.record(label, variables) if attribute else None
        if record is None or any(made.label.feature == label.feature for made in self.symbols.makers(label)):
            return None
        names = [each.name for each in record.fields]
        if attribute in names or (attribute == OBJECTS and record.is_of_objects):
            return None
        near = nearest(attribute, names, names[0] if names else "", cutoff=0)
        repair = label._replace(feature=f"{whole.feature}.{near}") if near else whole
        has = f"it has {', '.join(names)}" if names else "it is one value"
        return f"{whole} is of sort {record.name}, which has no field {attribute}; {has}", str(repair)

    def names_no_objects(self, label: Label, variables: frozenset[str] = NOTHING) -> str:
        """The message if the values of a stream of members are known to name no objects; else empty."""
        if self.objects(label) is not None:
            return ""
        sort = self.sort_of(label, variables)
        values = None if sort is None else self.symbols.shape(sort)
        if values is None or (values.unit in {"", "text"} and all(each.unit == "text" for each in values.fields)):
            return ""
        return f"the values of {label} are of sort {sort}, and name no objects"

    def _sort_of(self, label: Label, variables: frozenset[str], under: frozenset[int]) -> str | None:
        if (states := self._of_one(label)) is not None:
            return states.name
        for made in self.symbols.makers(label, variables):
            return None if made.label.feature != label.feature or id(made) in under else self._made_sort(made, under)
        if label in self.known.labels or not self.derives(label):
            return self.known.labels.get(label)
        return None if label == Label(OF_A_PLATFORM) else FEATURES[label.feature].sort

    def _made_sort(self, made: Symbol, under: frozenset[int]) -> str | None:
        if id(made) not in self._sorts:
            self._sorts[id(made)] = self._found_sort(made, under | {id(made)})
        return self._sorts[id(made)]

    def _found_sort(self, made: Symbol, under: frozenset[int]) -> str | None:
        declared = made.declaration.body if isinstance(made.declaration, spec.ForEach) else made.declaration
        if isinstance(declared, spec.Import):
            label = self.symbols.semantic(declared.semantic)
            return None if label is None else label.sort.name
        match made.made:
            case spec.FromSource(source):
                return self.symbols.source(source)
            case spec.Composite():
                return made.label.feature
            case spec.Link(_, unit) if unit in LINK_UNITS and self.symbols.unit(unit) is None:
                return made.label.feature
            case spec.Belief():
                return made.label.feature if self.symbols.shape(made.label.feature) is not None else BELIEF
            case spec.Refinement(unit) | spec.Link(_, unit):
                found = self.symbols.unit(unit)
                return None if found is None or found[0].startswith(ANY) else found[0]
            case spec.StateStream():
                return STATE
            case spec.FirstOf((first, *_)):
                return self._sort_of(first.label, made.variables, under)
            case spec.Select(term, variable) | spec.Merge(term, variable):
                return self._sort_of(term.label, made.variables | {variable}, under)
        return None
