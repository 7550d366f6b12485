"""Domains and problems checked against themselves: names, sorts, cycles, bindings, effects that contradict one another.

Every error is reported, with its place. A problem is checked together with its domain; errors of the domain have been
reported before.
"""

from collections.abc import Iterable, Iterator
from typing import Any, Final

from dyknow.kpl.diagnostics.collector import ErrorCollector, nearest
from dyknow.planning.domains import model
from dyknow.planning.domains.model import BOOLEAN, NUMBER, Application, Declarations
from dyknow.planning.domains.recoveries import check_located, check_recoveries
from dyknow.planning.domains.sorts import SortChecker
from dyknow.reasoning.formulas import tree

_BUILT_IN: Final = (BOOLEAN, *model.NUMBERS)


def check_declarations(before: Declarations, found: Declarations, errors: ErrorCollector) -> None:
    """Check `found`, after the declarations `before`; errors go to the collector."""
    checks = _Checks(before.joined(found), errors)
    checks.names(before, found)
    if errors.errors:
        return
    checks.statements(found)


class _Checks:
    def __init__(self, declared: Declarations, errors: ErrorCollector) -> None:
        self._declared, self._errors = declared, errors
        self._sorts = SortChecker(declared, errors)

    def names(self, before: Declarations, found: Declarations) -> None:
        """Names that are declared twice, types that are not there or above themselves."""
        self._once(before.types, found.types, "type")
        for kind in ("constants", "features", "derived"):
            self._once((*before.constants, *before.features, *before.derived), getattr(found, kind), "name")
        self._once((), (*found.constants, *found.features, *found.derived), "name")
        self._once(before.sensed, found.sensed, "sensed feature")
        self._once(before.operators, found.operators, "operator")
        self._once((*before.controls, *before.monitors), (*found.controls, *found.monitors), "formula")
        self._once(before.recoveries, found.recoveries, "recovery")
        for one in found.types:
            self._type(one)
        for name in found.units:
            self._known_type(name, found.types[0] if found.types else tree.Node())
        self._objects(before, found)

    def _once(self, before: Iterable[Any], found: Iterable[Any], kind: str) -> None:
        met = {one.name for one in before}
        for one in found:
            if one.name in met:
                self._errors.error(f"the {kind} {one.name} is declared twice", one.place, "give one another name")
            met.add(one.name)

    def _type(self, one: model.TypeDeclaration) -> None:
        if one.name in _BUILT_IN:
            self._errors.error(f"{one.name} is built in", one.place, "choose another name")
        if one.parent is not None:
            self._known_type(one.parent, one)
        parents = self._sorts.types.parents
        above, met = one.parent, set[str]()
        while above is not None and above not in met:
            met.add(above)
            above = parents.get(above)
        if one.name in met:
            self._errors.error(f"the type {one.name} is above itself", one.place, "#domain box : carryable")
        if one.values and one.parent is not None:
            self._errors.error("a type with values has no parent", one.place, "#domain state = {idle, busy}")

    def _known_type(self, name: str, node: tree.Node, *, built_in: bool = False) -> bool:
        known = [*self._sorts.types.parents, *(_BUILT_IN if built_in else ())]
        if name not in known:
            self._errors.error(f"there is no type {name}", node.place, nearest(name, known) or f"#domain {name}")
        return name in known

    def _objects(self, before: Declarations, found: Declarations) -> None:
        met = {name: each.sort for each in before.objects for name in each.names}
        taken = set(self._sorts.features) | set(self._sorts.derived) | self._sorts.constants
        values = {value for one in self._declared.types for value in one.values}
        for one in found.types:
            for value in one.values:
                if value in taken or [*one.values].count(value) > 1:
                    self._errors.error(f"{value} is declared twice", one.place, "give one another name")
        for each in found.objects:
            if self._known_type(each.sort, each) and each.sort in self._sorts.types.values:
                self._errors.error(f"{each.sort} has values, not objects", each.place)
            for name in each.names:
                if name in met or name in taken or name in values:
                    self._errors.error(f"{name} is declared twice", each.place, "give one another name")
                met[name] = each.sort

    def statements(self, found: Declarations) -> None:
        sorts = self._sorts
        for one in found.constants:
            if not isinstance(one.value, Application) or one.value.args:
                sorts.number(one.value, {})
            else:
                sorts.sort(one.value, {})
        for feature in found.features:
            self._feature(feature)
        for sensed in found.sensed:
            self._sensed(sensed)
        for derived in found.derived:
            self._derived(derived)
        for operator in found.operators:
            self._operator(operator)
        for control in found.controls:
            self._global(control, control.formula, monitor=False)
        for monitor in found.monitors:
            self._global(monitor, monitor.formula, monitor=True)
        check_recoveries(found, self._declared, sorts, self._errors, self._effect)
        self._init(found.init)
        for goal in found.goals:
            sorts.formula(goal.formula, {one.name: sorts.types.of_variable(one) for one in sorts.free(goal.formula)})

    def _feature(self, one: model.FeatureDeclaration) -> None:
        if one.name in model.FUNCTIONS:
            self._errors.error(f"{one.name} is built in", one.place, "choose another name")
        for sort in one.sorts:
            if self._known_type(sort, one, built_in=True) and sort in _BUILT_IN:
                self._errors.error(
                    "a feature is of objects, not of numbers", one.place, "#define near(box, box2, d) := ..."
                )
        if self._known_type(one.sort, one, built_in=True) and one.default is not None:
            self._value(one, one.default, {})

    def _value(self, feature: model.FeatureDeclaration, value: Any, bound: Any) -> None:
        """A value for a feature."""
        sort = self._sorts.sort(value, bound)
        wanted = NUMBER if feature.sort in model.NUMBERS else feature.sort
        if sort is not None and sort != wanted and wanted not in self._sorts.types.above(sort):
            self._errors.error(f"{feature.name} is a {wanted}, this is a {sort}", value.place)

    def _sensed(self, one: model.SensedFeature) -> None:
        feature = self._sorts.features.get(one.name)
        if one.sensor not in model.SENSORS:
            self._errors.error(f"there is no sensor {one.sensor}", one.place, nearest(one.sensor, [*model.SENSORS]))
        if feature is None:
            known = [*self._sorts.features]
            self._errors.error(f"there is no feature {one.name}", one.place, nearest(one.name, known))
        elif len(feature.sorts) != (2 if one.sensor == "attached" else 1):
            self._errors.error(f"{one.sensor} is not sensed of that", one.place, "#sensed xpos: east")

    def _derived(self, one: model.Derived) -> None:
        circle = self._circle(one.name)
        if circle:
            shown = " -> ".join(circle)
            self._errors.error(f"{one.name} is defined by itself: {shown}", one.place, "define it by features alone")
            return
        bound = self._sorts.bound(one.parameters, one)
        self._sorts.sort(one.body, bound)
        self._no_states(one.body)

    def _no_states(self, body: Any) -> None:
        for node in tree.walk(body):
            if isinstance(node, (*tree.TEMPORAL, model.Next)):
                self._errors.error("a derived feature is about one state", node.place, "put it into a #control")
                return

    def _circle(self, name: str) -> list[str]:
        """A way from a derived feature back to itself."""
        waiting, met = [[name]], set[str]()
        while waiting:
            way = waiting.pop()
            for one in model.calls(self._sorts.derived[way[-1]].body):
                if one.name == name:
                    return [*way, name]
                if one.name in self._sorts.derived and one.name not in met:
                    met.add(one.name)
                    waiting.append([*way, one.name])
        return []

    def _global(self, one: tree.Node, formula: Any, *, monitor: bool) -> None:
        sorts = self._sorts
        free = sorts.free(formula)
        bound = {each.name: sorts.types.of_variable(each) or NUMBER for each in free}
        sorts.formula(formula, bound, temporal=True, monitor=monitor)
        inner = formula.operand if isinstance(formula, tree.Always) else formula
        premise = inner.left if isinstance(inner, tree.Implies) else inner
        for name, sort in bound.items():
            if sort == NUMBER:
                sorts.equated(name, premise, one)

    def _operator(self, one: model.Operator) -> None:
        sorts = self._sorts
        bound = sorts.bound(one.parameters, one)
        whole = tree.And(tuple(each.formula for each in one.preconditions))
        for name, sort in bound.items():
            if sort == NUMBER:
                sorts.equated(name, whole, one)
        units = set(self._declared.units)
        acting = [name for name, sort in bound.items() if units & set(sorts.types.above(str(sort)))]
        if units and not acting:
            self._errors.error(
                f"no parameter of {one.name} is a unit",
                one.place,
                f"#operator {one.name}({self._declared.units[0]}, ...)",
            )
        for each in (*one.preconditions, *one.prevail, *one.controls):
            sorts.formula(each.formula, bound)
        for term in (one.cost, one.duration, *self._bounds(one.timeconstraint)):
            if term is not None:
                sorts.number(term, bound)
        for monitor in one.monitors:
            sorts.formula(monitor.formula, bound, temporal=True, monitor=True)
        for effect in one.effects:
            self._effect(effect, bound)
        for command in one.commands:
            self._command(command, bound)
        check_located(one.located, bound, sorts, self._errors)
        self._contradictions(one)

    def _command(self, one: Application, bound: dict[str, str | None]) -> None:
        wanted = model.COMMANDS.get(one.name)
        if wanted is None:
            self._errors.error(f"there is no command {one.name}", one.place, nearest(one.name, [*model.COMMANDS]))
        elif wanted != len(one.args):
            self._errors.error(f"{one.name} takes {wanted} numbers, not {len(one.args)}", one.place, "goto(x, y, 20)")
        for arg in one.args:
            self._sorts.number(arg, bound)

    def _bounds(self, timing: model.TimeConstraint | None) -> tuple[Any, ...]:
        return () if timing is None else (timing.shortest, timing.longest)

    def _effect(self, one: model.Effect, bound: dict[str, str | None]) -> None:
        inside = {**bound, **self._sorts.bound(one.variables, one)}
        if one.condition is not None:
            self._sorts.formula(one.condition, inside)
        feature = self._target(one.target, inside)
        if feature is not None:
            self._value(feature, one.value, inside)

    def _target(self, target: Application, bound: Any) -> model.FeatureDeclaration | None:
        if not target.name:
            return None
        if target.name in self._sorts.derived:
            self._errors.error(
                f"{target.name} is derived: it changes with what it is defined by", target.place, "change its features"
            )
            return None
        self._sorts.sort(target, bound)
        return self._sorts.features.get(target.name)

    def _contradictions(self, one: model.Operator) -> None:
        """Effects that give a feature two values at one time, whatever the state."""
        met: dict[tuple[Any, ...], model.Effect] = {}
        for effect in one.effects:
            key = (effect.anchor, effect.offset_ms, effect.target, effect.variables, effect.condition)
            other = met.setdefault(key, effect)
            if other.value != effect.value:
                self._errors.error(
                    f"{one.name} gives {effect.target.name} two values at one time", effect.place, "give it one of them"
                )

    def _init(self, found: tuple[model.Observation, ...]) -> None:
        met: dict[tuple[Application, int], model.Observation] = {}
        for one in found:
            feature = self._target(one.target, {})
            if feature is None:
                continue
            self._value(feature, one.value, {})
            if met.setdefault((one.target, one.at_ms), one).value != one.value:
                self._errors.error(f"{one.target.name} gets two values at one time", one.place, "give it one of them")
            for arg in (*one.target.args, one.value):
                self._plain(arg)

    def _plain(self, value: Any) -> None:
        """Initial values are written out, not calculated from features."""
        for node in _with_args(value):
            self._errors.error(
                "an initial value is a number, an object or a truth value", node.place, "xpos(b1) := 3.5"
            )
            return


def _with_args(value: Any) -> Iterator[Application]:
    return (node for node in model.calls(value) if node.args)
