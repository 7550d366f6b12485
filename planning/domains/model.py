"""Planning domains and problems as values (thesis 7.3, 7.4.1): types, features, operators, control formulas, goals.

Expressions are the nodes of `dyknow.reasoning.formulas.tree` for connectives, comparisons, temporal operators and
arithmetic, with the nodes below for what TAL has and streams have not: features of terms, quantifiers over types,
`next`, `goal`. A name in an expression is a `Call` without arguments; its place decides whether it is a variable,
constant, object or feature. Numbers of time are milliseconds, as in the thesis.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Final, Literal, Self, TypeAlias

from dyknow.reasoning.formulas import tree

Expression: TypeAlias = Any
"""A node of `dyknow.reasoning.formulas.tree`, or one of those below."""
BOOLEAN: Final = "boolean"
NUMBER: Final = "fp"
NUMBERS: Final = (NUMBER, "number", "integer")
"""Names of the sort of numbers; the thesis' fixed-point numbers are floating-point numbers here."""
CONSTANTS: Final = {"UNITS_PER_SECOND": 1000}
ACTS: Final = ("loiter", "brake", "land")
"""What units can do when a plan is left."""
LAST_RESORTS: Final = ("ask", "drop-goal", "give-up")
REPLANNING: Final = "replan"
"""The name of the recovery operator that is run before every new plan."""
FUNCTIONS: Final = {"abs": 1, "hypot": 2, "min": 2, "max": 2}
"""Functions of numbers by name, and how many numbers they take."""
COMMANDS: Final = {
    "take-off": 1, "goto": 3, "climb": 1, "land": 0, "return-home": 0, "hold": 0, "wait": 1, "winch": 1, "magnet": 1,
    "look-down": 0,
}  # fmt: skip
"""Commands to a vehicle, and how many numbers they take: metres east, north and above the origin of the mission, or seconds."""
SENSORS: Final = ("east", "north", "height", "airborne", "attached", "load")
"""The sensed quantities of an object: metres from the mission's origin, whether it flies or carries another."""


@dataclass(frozen=True, slots=True)
class Application(tree.Node):
    """A feature, derived feature or function of terms; without arguments any name."""

    name: str
    args: tuple[Expression, ...] = ()


@dataclass(frozen=True, slots=True)
class Next(tree.Node):
    """True in a state if the operand is true in the next state of the sequence; it stands for `[t + 1]`."""

    operand: Expression


@dataclass(frozen=True, slots=True)
class InGoal(tree.Node):
    """True if the operand is true in all goal states."""

    operand: Expression


@dataclass(frozen=True, slots=True)
class Parameter:
    """A variable and its type; `sort` None: the type is in the name, `box2` is a box."""

    name: str
    sort: str | None = None


@dataclass(frozen=True, slots=True)
class Quantified(tree.Node):
    kind: Literal["forall", "exists"]
    variables: tuple[Parameter, ...]
    body: Expression


@dataclass(frozen=True, slots=True)
class TypeDeclaration(tree.Node):
    """A value domain: a type of objects below `parent`, or one with the values that are listed."""

    name: str
    parent: str | None = None
    values: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Constant(tree.Node):
    name: str
    value: Expression


@dataclass(frozen=True, slots=True)
class FeatureDeclaration(tree.Node):
    """A fluent: the types of its arguments, the sort of its value, and its default value.

    Attributes:
        within: measured values that lie no further apart are equal to monitors, as fixed-point numbers are.
        disturbed_us: how long an action may undo what another one needs later (thesis 7.7, causal links).
    """

    name: str
    sorts: tuple[str, ...]
    sort: str
    default: Expression | None = None
    within: float | None = None
    disturbed_us: int | None = None


@dataclass(frozen=True, slots=True)
class SensedFeature(tree.Node):
    """A feature whose values are those of a sensor; others are what the effects of actions make them."""

    name: str
    sensor: str


@dataclass(frozen=True, slots=True)
class Derived(tree.Node):
    """A feature that is defined by an expression (a feature macro, thesis 7.4.1)."""

    name: str
    parameters: tuple[Parameter, ...]
    body: Expression


@dataclass(frozen=True, slots=True)
class OperatorCondition(tree.Node):
    """A condition of an operator; `name` is what a control formula is reported by."""

    formula: Expression
    monitored: bool = False
    name: str = ""


@dataclass(frozen=True, slots=True)
class Effect(tree.Node):
    """At `offset_ms` after the start or the end the feature takes the value.

    For all members of the types of `variables`, if `condition` holds at the start. The value and the arguments are those
    of the start as well.
    """

    anchor: Literal["start", "end"]
    offset_ms: int
    target: Application
    value: Expression
    variables: tuple[Parameter, ...] = ()
    condition: Expression | None = None
    monitored: bool = False


@dataclass(frozen=True, slots=True)
class TimeConstraint(tree.Node):
    """`shortest <= end - start <= longest`, in milliseconds; None is no bound."""

    shortest: Expression | None
    longest: Expression | None
    monitored: bool = False


@dataclass(frozen=True, slots=True)
class MonitorFormula(tree.Node):
    """A formula to be monitored while a plan is executed, and the operator that is run if it is violated (7.6.1)."""

    formula: Expression
    recovery: str | None = None
    name: str = ""


@dataclass(frozen=True, slots=True)
class Operator(tree.Node):
    """An operator in the order of its clauses; `duration` is the expected one, else the middle of `timeconstraint`.

    `recovery` is run if an action fails, or violates what its conditions, effects and durations are monitored by.
    `commands` are what the unit's vehicle is to do, one after another. `located` are features of one object that are
    sensed at its end: the action has not ended before they were seen, and the seen values count instead of the effects.
    """

    name: str
    parameters: tuple[Parameter, ...]
    cost: Expression | None = None
    duration: Expression | None = None
    timeconstraint: TimeConstraint | None = None
    preconditions: tuple[OperatorCondition, ...] = ()
    prevail: tuple[OperatorCondition, ...] = ()
    effects: tuple[Effect, ...] = ()
    controls: tuple[OperatorCondition, ...] = ()
    monitors: tuple[MonitorFormula, ...] = ()
    recovery: str | None = None
    commands: tuple[Application, ...] = ()
    located: tuple[Application, ...] = ()


@dataclass(frozen=True, slots=True)
class RecoveryOperator(tree.Node):
    """The reaction to a violation before a new plan is made (7.5.3); `replan` is done before every new plan.

    Attributes:
        parameters: named as those of the operator, or the free variables of the formula, that names it.
        when: it is done only where this holds; otherwise there is a new plan and nothing else.
        act: what units do at once.
        assumptions: by clause; each clause changes all its features at once, from the values before it.
        located: features of objects that are to be found by sight.
        without: units that take no part in new plans.
        times: so often the fault is recovered from; the next time `then` is done.
    """

    name: str
    parameters: tuple[Parameter, ...] = ()
    when: Expression | None = None
    act: Literal["loiter", "brake", "land"] = "loiter"
    assumptions: tuple[tuple[Effect, ...], ...] = ()
    located: tuple[Application, ...] = ()
    without: tuple[Application, ...] = ()
    times: int = 3
    then: str = "ask"


@dataclass(frozen=True, slots=True)
class Control(tree.Node):
    """A global control formula: every state sequence of a plan satisfies it (7.4.2)."""

    name: str
    formula: Expression


@dataclass(frozen=True, slots=True)
class Objects(tree.Node):
    sort: str
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Observation(tree.Node):
    """The value of a feature from a time on: initially, or by an event outside the plan, such as an area that opens."""

    target: Application
    value: Expression
    at_ms: int = 0


@dataclass(frozen=True, slots=True)
class GoalStatement(tree.Node):
    """A condition at the end, and from `deadline_ms` on; one with a weight may stay unreached at that cost."""

    name: str
    formula: Expression
    deadline_ms: int | None = None
    weight: float | None = None


@dataclass(frozen=True, slots=True)
class Declarations:
    """A domain, a problem, or both."""

    types: tuple[TypeDeclaration, ...] = ()
    units: tuple[str, ...] = ()
    constants: tuple[Constant, ...] = ()
    features: tuple[FeatureDeclaration, ...] = ()
    sensed: tuple[SensedFeature, ...] = ()
    derived: tuple[Derived, ...] = ()
    operators: tuple[Operator, ...] = ()
    controls: tuple[Control, ...] = ()
    monitors: tuple[MonitorFormula, ...] = ()
    objects: tuple[Objects, ...] = ()
    init: tuple[Observation, ...] = ()
    goals: tuple[GoalStatement, ...] = ()
    recoveries: tuple[RecoveryOperator, ...] = ()

    def joined(self, other: "Declarations") -> Self:
        """Both, this one first."""
        return type(self)(*(getattr(self, each.name) + getattr(other, each.name) for each in fields(self)))


def type_in(name: str, types: Any) -> str | None:
    """The type that a variable's name begins with: `box`, `box2`, `box'` and `box-2` are boxes."""
    stem = name.rstrip("'").rstrip("0123456789").rstrip("_-").rstrip("'")
    return name if name in types else stem if stem in types else None


def calls(expression: Expression) -> Iterator[Application]:
    """Every call of an expression, those inside others included."""
    return (node for node in tree.walk(expression) if isinstance(node, Application))


def outer_variables(expression: Expression) -> tuple[Parameter, ...]:
    """Variables that `forall` binds around all of a formula, inside an `always` that stands around it."""
    inner = expression.operand if isinstance(expression, tree.Always) else expression
    if isinstance(inner, Quantified) and inner.kind == "forall":
        return (*inner.variables, *outer_variables(inner.body))
    return ()


def conjuncts(expression: Expression) -> Iterator[Expression]:
    """The parts of a conjunction, of conjunctions inside it as well."""
    if isinstance(expression, tree.And):
        for part in expression.parts:
            yield from conjuncts(part)
    else:
        yield expression


def substitute(expression: Expression, given: Mapping[str, Expression]) -> Expression:
    """The expression with those in place of names; a quantifier keeps its variables, renamed where one would be another's.

    A variable is renamed by a prime, so that its type stays in its name.
    """
    if not given:
        return expression
    if isinstance(expression, Application):
        if not expression.args:
            return given.get(expression.name, expression)
        return replace(expression, args=tuple([substitute(one, given) for one in expression.args]))
    if isinstance(expression, Quantified):
        bound = {one.name for one in expression.variables}
        inside = {name: one for name, one in given.items() if name not in bound}
        met = {each.name for one in inside.values() for each in calls(one)}
        if met.isdisjoint(bound):
            return replace(expression, body=substitute(expression.body, inside))
        return substitute(_renamed(expression, met | {each.name for each in calls(expression.body)}), given)
    changed = {}
    for name in expression.__dataclass_fields__:
        inner = getattr(expression, name)
        if name != "place" and isinstance(inner, tree.Node):
            changed[name] = substitute(inner, given)
        elif isinstance(inner, tuple) and name == "parts":
            changed[name] = tuple([substitute(one, given) for one in inner])
    return replace(expression, **changed) if changed else expression


def _renamed(one: Quantified, taken: set[str]) -> Quantified:
    """With variables of other names."""
    variables, names = list[Parameter](), dict[str, Expression]()
    for each in one.variables:
        name = each.name
        while name in taken:
            name += "'"
        taken.add(name)
        variables.append(Parameter(name, each.sort))
        names[each.name] = Application(name)
    return replace(one, variables=tuple(variables), body=substitute(one.body, names))


def definition(expression: Expression, variable: str, derived: Mapping[str, Derived]) -> Expression | None:
    """The term that a conjunction equates a variable with; inside `Next` or `InGoal` if the equation is.

    Derived features are looked into: `is-at(box, x, y)` equates x with `xpos(box)`.
    """
    for part in conjuncts(expression):
        match part:
            case tree.Compare("=", Application(name, ()), term) | tree.Compare("=", term, Application(name, ())) if (
                name == variable
            ):
                if all(one.name != variable for one in calls(term)):
                    return term
            case Next(operand) | InGoal(operand):
                if (inside := definition(operand, variable, derived)) is not None:
                    return type(part)(inside)
            case Application(name, args) if name in derived and Application(variable) in args:
                known = derived[name]
                given = {one.name: arg for one, arg in zip(known.parameters, args, strict=False)}
                if (inside := definition(substitute(known.body, given), variable, derived)) is not None:
                    return inside
    return None
