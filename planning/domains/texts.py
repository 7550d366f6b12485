"""Domains and problems from text (thesis 7.4.1): every statement is read, and all errors of a text are reported."""

from collections.abc import Callable, Mapping
from typing import Any, Final, Literal

from dyknow.kpl.syntax.grammar import parse_tree
from dyknow.kpl.syntax.parsing import place_of, raise_all
from dyknow.model.errors import TextError, file_of
from dyknow.planning.domains import model
from dyknow.planning.domains.checking import check_declarations
from dyknow.planning.domains.expressions import ExpressionReader, has_stamp, name_in
from dyknow.planning.domains.model import Application, Declarations, Expression
from dyknow.reasoning.formulas import tree

LIMIT_OBJECTS: Final = 200_000
LIMIT_TIMES: Final = 1000
"""Most recoveries from one fault."""
_NOTHING: Final = Declarations()


def parse_domain(text: str) -> Declarations:
    """Read a domain.

    Raises:
        TextError: where the text leaves the grammar, or a limit is passed.
        TextErrors: with everything else that is wrong: names, sorts, cycles, unbound variables, effects that
            contradict one another.
    """
    return _parsed(text, _NOTHING)


def parse_problem(text: str, domain: Declarations) -> Declarations:
    """Read what a problem adds to its domain; raises the same."""
    return _parsed(text, domain)


def parse_expression(text: str) -> Expression:
    """One expression by itself, its names unchecked; raises TextError."""
    definition: Any = parse_tree(f"#define it := {text}", "domains").children[0]
    reader = ExpressionReader(text)
    found = reader.read(definition.children[-1])
    raise_all(reader.errors)
    return found


def _parsed(text: str, before: Declarations) -> Declarations:
    parsed = parse_tree(text, "domains")
    reader = _StatementReader(text)
    try:
        found = reader.statements(parsed.children)
        check_declarations(before, found, reader)
    except RecursionError:
        raise TextError("nested too deep for where this is read", file=file_of(text), repair="nest less") from None
    raise_all(reader.errors)
    return found


class _StatementReader(ExpressionReader):
    def statements(self, nodes: list[Any]) -> Declarations:
        kinds: dict[str, list[Any]] = {name: [] for name in Declarations.__dataclass_fields__}
        read: Mapping[str, tuple[str, Callable[[Any], list[Any]]]] = {
            "domain": ("types", self._type),
            "units": ("units", lambda node: [name_in(one) for one in node.children]),
            "constant": ("constants", self._constant),
            "feature": ("features", self._feature),
            "sensed": ("sensed", self._sensed),
            "define": ("derived", self._derived),
            "operator": ("operators", self._operator),
            "control": ("controls", self._control),
            "monitor": ("monitors", self._monitor),
            "recovery": ("recoveries", self._recovery),
            "objects": ("objects", self._objects),
            "init": ("init", self._init),
            "goal": ("goals", self._goal),
        }
        for node in nodes:
            kind, reading = read[node.data]
            kinds[kind] += reading(node)
        return Declarations(**{name: tuple(found) for name, found in kinds.items()})

    def _type(self, node: Any) -> list[Any]:
        name, *others = [one for one in node.children if hasattr(one, "data")]
        marks = [one.type for one in node.children if hasattr(one, "type")]
        has_parent = self.text[place_of(name, self.text).end : place_of(node, self.text).end].lstrip().startswith(":")
        parent = name_in(others.pop(0)) if others and (has_parent or "PARENT" in marks) else None
        values = tuple(name_in(one) for one in others)
        return [model.TypeDeclaration(name_in(name), parent, values, place=place_of(name, self.text))]

    def _constant(self, node: Any) -> list[Any]:
        name, _, value = node.children
        return [model.Constant(name_in(name), self.read(value), place=place_of(name, self.text))]

    def _feature(self, node: Any) -> list[Any]:
        parts = [one for one in node.children if hasattr(one, "data") and one.data not in {"within", "disturbed"}]
        options = {one.data: one.children[-1] for one in node.children if one not in parts and hasattr(one, "data")}
        name, *rest = parts
        sorts: tuple[str, ...] = ()
        if rest[0].data == "sorts":
            sorts = tuple(name_in(one) for one in rest.pop(0).children)
        default = self.read(rest[1]) if len(rest) > 1 else None
        within = self._not_negative(options["within"], "a tolerance", ":within 0.5") if "within" in options else None
        disturbed_us = self.time_us(options["disturbed"]) if "disturbed" in options else None
        place = place_of(name, self.text)
        return [
            model.FeatureDeclaration(name_in(name), sorts, name_in(rest[0]), default, within, disturbed_us, place=place)
        ]

    def _not_negative(self, node: Any, what: str, repair: str) -> float:
        number = self.read(node)
        is_number = isinstance(number, tree.Const) and not isinstance(number.value, bool | str)
        value = float(number.value) if is_number else -1.0
        if not value >= 0:
            self.error(f"{what} is a number that is not negative", place_of(node, self.text), repair)
        return value

    def _sensed(self, node: Any) -> list[Any]:
        name, sensor = map(name_in, node.children)
        return [model.SensedFeature(name, sensor, place=place_of(node.children[0], self.text))]

    def _derived(self, node: Any) -> list[Any]:
        name, *rest = [one for one in node.children if hasattr(one, "data")]
        params = self._params(rest[0]) if len(rest) > 1 else ()
        return [model.Derived(name_in(name), params, self.read(rest[-1]), place=place_of(name, self.text))]

    def _params(self, node: Any) -> tuple[model.Parameter, ...]:
        return tuple(model.Parameter(*(name_in(name) for name in each.children)) for each in node.children)

    def _label(self, node: Any) -> str:
        inside = node.children[-1]
        return name_in(inside) if hasattr(inside, "data") else str(inside)[1:-1]

    def _control(self, node: Any) -> list[Any]:
        label, formula = node.children
        return [model.Control(self._label(label), self.over_states(formula), place=place_of(label, self.text))]

    def _monitor(self, node: Any) -> list[Any]:
        label, formula, *recovery = node.children
        name = name_in(recovery[-1]) if recovery else None
        found = self.over_states(formula)
        return [model.MonitorFormula(found, name, self._label(label), place=place_of(label, self.text))]

    def _objects(self, node: Any) -> list[Any]:
        sort, *names = [one for one in node.children if hasattr(one, "data")]
        given = tuple(name_in(one) for one in names) if not names or names[0].data == "name" else self._range(names[0])
        return [model.Objects(name_in(sort), given, place=place_of(node, self.text))]

    def _range(self, node: Any) -> tuple[str, ...]:
        """`b1 .. b20`."""
        first, last = (name_in(one) for one in node.children)
        stem = first.rstrip("0123456789")
        begin, end = first[len(stem) :], last[len(stem) :]
        if not (last.startswith(stem) and begin.isdecimal() and end.isdecimal() and len(begin) < 9 and len(end) < 9):
            self.error("a range goes from one number to another", place_of(node, self.text), "b1 .. b20")
            return ()
        if not 0 <= int(end) - int(begin) < LIMIT_OBJECTS:
            repair = f"b1 .. b20, at most {LIMIT_OBJECTS} objects"
            self.error("the range is empty or too long", place_of(node, self.text), repair)
            return ()
        return tuple(f"{stem}{number}" for number in range(int(begin), int(end) + 1))

    def _init(self, node: Any) -> list[Any]:
        found, at_ms = [], 0
        for change in node.children:
            left, _, value = self._change(change)
            if left.data == "stamped":
                at_ms = self.stamp_of(left.children[0])[0][1]
                left = left.children[1]
            target, given = self._target(left, value)
            found.append(model.Observation(target, given, at_ms, place=place_of(change, self.text)))
        return found

    def _change(self, node: Any) -> tuple[Any, bool, Any]:
        """The sides of an assignment, the second None if there is none."""
        parts = [one for one in node.children if hasattr(one, "data")]
        return parts[0], len(parts) > 1, parts[1] if len(parts) > 1 else None

    def _target(self, left: Any, value: Any) -> tuple[Application, Expression]:
        """`f(x) := v`, `f(x) == v`, `f(x)`, `!f(x)`."""
        found = self.read(left)
        place = place_of(left, self.text)
        if value is not None and isinstance(found, Application):
            return found, self.read(value)
        match found:
            case Application() if value is None:
                return found, tree.Const(True, place=place)
            case tree.Not(Application() as inside) if value is None:
                return inside, tree.Const(False, place=place)
            case tree.Compare("=", Application() as inside, right) if value is None:
                return inside, right
        self.error("the value of a feature is wanted", place, "attached(uav1, b1), or xpos(b1) := 3.5")
        return Application("", place=place), tree.Const(True)

    def _goal(self, node: Any) -> list[Any]:
        parts = list(node.children)
        name = name_in(parts.pop(0)) if parts[0].data == "name" else ""
        formula, deadline_ms, weight = self.read(parts[0]), None, None
        for option in parts[1:]:
            given = option.children[-1]
            if option.data == "deadline":
                deadline_ms = self.time_us(given) // 1000
            else:
                weight = self._not_negative(given, "a weight", ":weight 10")
        return [model.GoalStatement(name, formula, deadline_ms, weight, place=place_of(node, self.text))]

    def _recovery(self, node: Any) -> list[Any]:
        name, *rest = [one for one in node.children if hasattr(one, "data")]
        params = self._params(rest.pop(0)) if rest and rest[0].data == "params" else ()
        found: dict[str, Any] = {"assumptions": (), "located": (), "without": ()}
        for clause in rest:
            parts = [one for one in clause.children if hasattr(one, "data")]
            match clause.data:
                case "act":
                    found["act"] = name_in(parts[0])
                case "when":
                    found["when"] = self.read(parts[0])
                case "assume":
                    changes = _Clauses(self, "start", "end").changes(parts)
                    found["assumptions"] = (*found["assumptions"], changes)
                case "locate":
                    found["located"] = (*found["located"], *self._each(parts))
                case "without":
                    found["without"] = (*found["without"], *self._each(parts))
                case "times":
                    text = str(clause.children[1])
                    if not text.isdecimal() or not 0 < int(text[:9]) <= LIMIT_TIMES:
                        self.error(
                            f"a number from 1 to {LIMIT_TIMES} is wanted", place_of(clause, self.text), ":times 3 ask"
                        )
                        text = "1"
                    found |= {"times": int(text), "then": name_in(parts[-1])}
        return [model.RecoveryOperator(name_in(name), params, **found, place=place_of(name, self.text))]

    def _operator(self, node: Any) -> list[Any]:
        name, *rest = node.children
        params = self._params(rest.pop(0)) if rest and rest[0].data == "params" else ()
        start, end = "start", "end"
        for clause in rest:
            if clause.data == "at":
                names = [name_in(one) for one in clause.children[1:]]
                start, end = names[0], names[-1]
        clauses = _Clauses(self, start, end)
        for clause in rest:
            clauses.add(clause)
        return [clauses.made(name_in(name), params, place_of(name, self.text))]


class _Clauses:
    """The clauses of one operator; repeated clauses add up."""

    def __init__(self, reader: _StatementReader, start: str, end: str) -> None:
        self._reader, self._start, self._end = reader, start, end
        self._single: dict[str, Any] = {}
        self._several: dict[str, list[Any]] = {
            "preconditions": [],
            "prevail": [],
            "effects": [],
            "controls": [],
            "monitors": [],
            "commands": [],
            "located": [],
        }

    def made(self, name: str, params: tuple[model.Parameter, ...], place: tree.Place) -> model.Operator:
        several: dict[str, Any] = {kind: tuple(found) for kind, found in self._several.items()}
        return model.Operator(name, params, **self._single, **several, place=place)

    def add(self, clause: Any) -> None:
        reader = self._reader
        parts = [one for one in clause.children if hasattr(one, "data")]
        marks = [one for one in clause.children if hasattr(one, "type")]
        monitored = any(one.type == "MONITORED" for one in marks)
        place = place_of(clause, reader.text)
        match clause.data:
            case "cost" | "duration":
                if monitored:
                    reader.error(
                        "an expected duration is no bound that could be monitored",
                        place,
                        f":timeconstraint monitored {self._end} - {self._start} <= ...",
                    )
                self._once(clause.data, self._plain(parts[0]), place)
            case "timeconstraint":
                self._once(clause.data, self._timing(parts[0], monitored), place)
            case "precond":
                formula = self._at(parts[0], ((self._start, 0),))
                self._several["preconditions"].append(model.OperatorCondition(formula, monitored, place=place))
            case "prevail":
                formula = self._at(parts[0], ((self._start, 0), (self._end, 0)))
                self._several["prevail"].append(model.OperatorCondition(formula, monitored, place=place))
            case "operator_control":
                name = next((str(one)[1:-1] for one in marks if one.type == "STRING"), "")
                formula = self._at(parts[0], ((self._start, 0),))
                self._several["controls"].append(model.OperatorCondition(formula, name=name, place=place))
            case "operator_monitor":
                recovery = name_in(parts[1]) if len(parts) > 1 else None
                self._several["monitors"].append(model.MonitorFormula(reader.read(parts[0]), recovery, place=place))
            case "operator_recovery":
                self._once("recovery", name_in(parts[0]), place)
            case "commands":
                self._several["commands"] += [reader.read(each) for each in parts]
            case "locate":
                self._several["located"] += [reader.read(each) for each in parts]
            case "effects":
                self._effects(parts, monitored)

    def _once(self, kind: str, found: Any, place: tree.Place) -> None:
        if kind in self._single:
            self._reader.error(f"a second :{kind}", place, "an operator has one; join them")
        self._single[kind] = found

    def _plain(self, node: Any) -> Expression:
        return self._reader.read(node.children[1] if node.data == "stamped" else node)

    def _at(self, node: Any, wanted: tuple[tuple[str, int], ...]) -> Expression:
        """A formula with the stamp that its clause has, or none."""
        return self._reader.read_at(node, wanted)

    def _timing(self, node: Any, monitored: bool) -> model.TimeConstraint:
        """`lo <= end - start <= hi`, one side of it, or `end - start == d`."""
        reader, place = self._reader, place_of(node, self._reader.text)
        end, start = Application(self._end), Application(self._start)
        length: Expression = tree.Arithmetic("-", end, start)  # type: ignore[arg-type] # a name is a term here
        least: Expression | None = None
        most: Expression | None = None
        for part in model.conjuncts(reader.read(node)):
            match part:
                case tree.Compare("<=", left, right) if right == length:
                    least = left
                case tree.Compare("<=", left, right) if left == length:
                    most = right
                case tree.Compare(">=", left, right) if left == length:
                    least = right
                case tree.Compare(">=", left, right) if right == length:
                    most = left
                case tree.Compare("=", left, right) if length in {left, right}:
                    least = most = right if left == length else left
                case _:
                    repair = f"0 <= {self._end} - {self._start} <= 5 * UNITS_PER_SECOND"
                    reader.error("this does not bound the duration", place, repair)
        return model.TimeConstraint(least, most, monitored, place=place)

    def changes(self, changes: list[Any]) -> tuple[model.Effect, ...]:
        """Changes that stand in one clause, by themselves."""
        self._effects(changes, monitored=False)
        return tuple(self._several["effects"])

    def _effects(self, changes: list[Any], monitored: bool) -> None:
        stamp = (self._end, 0)
        for change in changes:
            parts = [one for one in change.children if hasattr(one, "data")]
            left, value = parts[0], parts[1] if len(parts) > 1 else None
            stamp = self._effect(left, value, stamp, monitored, place_of(change, self._reader.text))

    def _effect(
        self, left: Any, value: Any, stamp: tuple[str, int], monitored: bool, place: tree.Place
    ) -> tuple[str, int]:
        """`[end] f := v`, `[start] A -> [end] f := v`, `forall x: ...`; without a stamp the one before counts."""
        reader, variables, condition = self._reader, list[model.Parameter](), None
        while left.data in {"forall", "stamped", "expr", "group"}:
            if left.data == "forall":
                variables += reader.variables(left.children[0])
                left = left.children[1]
            elif left.data == "expr":
                condition, stamped = self._at(left.children[0], ((self._start, 0),)), has_stamp(left.children[0])
                left, stamp = left.children[2], (self._start, 0) if stamped else stamp
            elif left.data == "group":
                left = left.children[0]
            else:
                points = reader.stamp_of(left.children[0])
                if len(points) != 1:
                    reader.error("an effect has one time point", place, "[end] f(x) := v")
                stamp, left = points[0], left.children[1]
        if stamp[0] not in {self._start, self._end}:
            reader.error(f"{stamp[0] or 'a number'} is no time point of this operator", place, "[start + 500], [end]")
        anchor: Literal["start", "end"] = "start" if stamp[0] == self._start else "end"
        if (anchor == "start" and stamp[1] < 0) or (anchor == "end" and stamp[1] > 0):
            reader.error("an effect lies within its operator", place, "[start], [start + 500], [end - 500], [end]")
        target, given = reader._target(left, value)  # noqa: SLF001 - both read one text
        found = model.Effect(
            *(anchor, stamp[1], target, given, tuple(variables), condition, monitored),
            place=place,
        )
        self._several["effects"].append(found)
        return stamp
