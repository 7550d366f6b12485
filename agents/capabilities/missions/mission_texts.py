"""The texts of a mission: domain, problem and constraints read, actions that are given made part of the domain.

An action that is given is a step: its operator, over its objects, may be used in its turn only. Between steps others may
stand, unless the plan is given as a whole; the goal has all steps done. So the search completes what is open.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from dyknow.agents.capabilities.missions.command_run import VehicleCommand
from dyknow.model.errors import DyknowError, Refused, did_you_mean
from dyknow.model.sample import Value
from dyknow.navigation.geodesy import LocalFrame
from dyknow.planning.domains import model
from dyknow.planning.domains.model import Application, Declarations, Expression, Operator
from dyknow.planning.domains.packing import packed, unpacked
from dyknow.planning.domains.printing import print_declarations
from dyknow.planning.domains.texts import parse_domain, parse_problem
from dyknow.planning.domains.types import Types
from dyknow.planning.search.plans import PlannedAction
from dyknow.planning.search.tasks import PlanningTask, calculated
from dyknow.reasoning.formulas import tree
from dyknow.reasoning.formulas.tree import label_text

STEP: Final = "mission-step"
MAX_OBJECTS: Final = 2000


@dataclass(frozen=True, slots=True)
class MissionTexts:
    """A mission: the domain with the given part of the plan, and the problem.

    Attributes:
        platforms: by unit of the problem, the platform that has that vehicle.
    """

    domain: Declarations
    problem: Declarations
    platforms: Mapping[str, str]

    @property
    def sensors(self) -> dict[str, str]:
        """By feature, its sensor."""
        return {one.name: one.sensor for one in (*self.domain.sensed, *self.problem.sensed)}


def read_mission(
    domain: str, problem: str, constraints: str, actions: Iterable[str], *, is_whole: bool, platforms: Mapping[str, str]
) -> MissionTexts:
    """Read what was delegated.

    Raises:
        TextError, TextErrors: a text is wrong, and where.
        Refused: a unit or an action that is not there, or too many objects.
    """
    read_domain = parse_domain(domain)
    read_problem = parse_problem(problem, read_domain)
    if constraints:
        read_problem = read_problem.joined(parse_problem(constraints, read_domain.joined(read_problem)))
    whole = read_domain.joined(read_problem)
    if (count := sum(len(each.names) for each in whole.objects)) > MAX_OBJECTS:
        raise Refused(f"objects: expected at most {MAX_OBJECTS}, got {count}", "too-large")
    types = Types(whole)
    units = [name for sort in whole.units for name in types.members[sort]]
    if not units:
        raise Refused("the problem has no unit: say #units in the domain, and its #objects", "no-unit")
    unknown = [name for name in platforms if name not in units]
    if unknown:
        raise Refused(f"{unknown[0]} is no unit of the problem; units are {', '.join(units)}", "unknown-unit")
    steps = [step_of(text, whole) for text in actions]
    if steps:
        # In one piece: the given part of the plan names objects, which a domain alone does not have.
        return MissionTexts(_stepped(whole, steps, is_whole=is_whole), Declarations(), _all(units, platforms))
    return MissionTexts(read_domain, read_problem, _all(units, platforms))


def _all(units: Iterable[str], platforms: Mapping[str, str]) -> dict[str, str]:
    """By unit, the platform that was named, or the one that bears its name, or its number."""
    return {unit: platforms.get(unit) or unit.lstrip("abcdefghijklmnopqrstuvwxyz-_") or unit for unit in units}


def step_of(text: str, whole: Declarations) -> tuple[Operator, tuple[str, ...]]:
    """An action as plans show it, `fly-to(uav0, north)`: its operator and objects."""
    name, _, rest = text.strip().removesuffix(")").partition("(")
    operators = {one.name: one for one in whole.operators}
    if name not in operators:
        raise Refused(f"{text!r}: there is no such operator.{did_you_mean(name, tuple(operators))}", "unknown-action")
    operator, types = operators[name], Types(whole)
    sorts = [sort for one in operator.parameters if (sort := types.of_variable(one)) is not None]
    objects = tuple(each.strip() for each in rest.split(",") if each.strip())
    fits = len(objects) == len(sorts) and all(map(types.has, sorts, objects))
    if not fits:
        raise Refused(f"{text!r}: write {name}({', '.join(sorts)})", "unknown-action")
    return operator, objects


def _stepped(whole: Declarations, steps: list[tuple[Operator, tuple[str, ...]]], *, is_whole: bool) -> Declarations:
    """The declarations in which each step is done in its turn."""
    at: dict[tuple[str, tuple[str, ...]], list[int]] = {}
    for number, (operator, objects) in enumerate(steps):
        at.setdefault((operator.name, objects), []).append(number)
    types = Types(whole)
    changed = [_in_turn(one, types, at, is_whole=is_whole) for one in whole.operators]
    goal = model.GoalStatement("steps", _equals(Application(STEP), tree.Const(float(len(steps)))))
    return replace(
        whole,
        operators=tuple(changed),
        features=(*whole.features, model.FeatureDeclaration(STEP, (), model.NUMBER, tree.Const(0.0))),
        goals=(*whole.goals, goal),
    )


def _in_turn(
    one: Operator, types: Types, at: Mapping[tuple[str, tuple[str, ...]], list[int]], *, is_whole: bool
) -> Operator:
    names = [each.name for each in one.parameters if types.of_variable(each) is not None]
    turns: list[Expression] = []
    others: list[Expression] = []
    for (name, objects), numbers in at.items():
        if name != one.name:
            continue
        same = [_equals(Application(each), Application(given)) for each, given in zip(names, objects, strict=True)]
        is_this = same[0] if len(same) == 1 else tree.And(tuple(same))
        its_turn = [_equals(Application(STEP), tree.Const(float(number))) for number in numbers]
        turns.append(tree.And((is_this, its_turn[0] if len(its_turn) == 1 else tree.Or(tuple(its_turn)))))
        others.append(tree.Not(is_this))
    if not turns:
        never = (model.OperatorCondition(tree.Const(False)),) if is_whole else ()
        return replace(one, preconditions=(*one.preconditions, *never))
    free = () if is_whole else (others[0] if len(others) == 1 else tree.And(tuple(others)),)
    allowed = (*turns, *free)
    condition = model.OperatorCondition(allowed[0] if len(allowed) == 1 else tree.Or(allowed))
    counted = tree.Arithmetic("+", Application(STEP), tree.Const(1.0))  # type: ignore[arg-type]  # a name is a term here
    is_step = turns[0] if len(turns) == 1 else tree.Or(tuple(turns))
    effect = model.Effect("start", 0, Application(STEP), counted, condition=None if is_whole else is_step)
    return replace(one, preconditions=(*one.preconditions, condition), effects=(*one.effects, effect))


def _equals(left: Expression, right: Expression) -> Expression:
    return tree.Compare("=", left, right)


def with_initial(problem: Declarations, values: Mapping[str, Value]) -> Declarations:
    """The problem with these values by label in its initial state, in place of those that it has."""
    given = {label: value for label, value in values.items() if isinstance(value, bool | int | float | str)}
    kept = tuple(
        one
        for one in problem.init
        if one.at_ms > 0 or label_text(one.target.name, tuple(arg.name for arg in one.target.args)) not in given
    )
    added = []
    for label, value in given.items():
        name, _, rest = label.removesuffix("]").partition("[")
        target = Application(name, tuple(Application(each.strip()) for each in rest.split(",") if each.strip()))
        added.append(model.Observation(target, Application(value) if isinstance(value, str) else tree.Const(value)))
    return replace(problem, init=(*kept, *added))


def texts_record(given: Mapping[str, Any]) -> dict[str, Any]:
    """The result of `read_mission` for these arguments as plain values, or its error, for `texts_in`."""
    try:
        return {"texts": packed(read_mission(**given))}
    except DyknowError as wrong:
        return {"wrong": str(wrong), "code": wrong.code if isinstance(wrong, Refused) else None}


def texts_in(record: Mapping[str, Any]) -> MissionTexts:
    """The texts of a record without mistakes.

    Raises:
        ValueError: no process of this platform wrote it.
    """
    return unpacked(str(record.get("texts")), MissionTexts)


def texts_of(domain: Declarations, problem: Declarations) -> tuple[str, str]:
    """As they are typed, for a search elsewhere."""
    return print_declarations(domain), print_declarations(problem)


class ActionCommands:
    """Commands to vehicles for actions of a plan.

    Args:
        frame: of the mission's origin.
    """

    def __init__(self, texts: MissionTexts, frame: LocalFrame) -> None:
        self._task = PlanningTask(texts.domain.joined(texts.problem))
        self._frame = frame

    def of(self, action: PlannedAction) -> tuple[VehicleCommand, ...]:
        """The commands of an action; an operator without commands has the vehicle wait for as long as the action takes.

        Raises:
            Refused: a number of a command is not known.
        """
        if not action.operator.commands:
            return (VehicleCommand("wait", ((action.end_ms - action.start_ms) / 1000,)),)
        bound: dict[str, Any] = dict(action.values)
        objects = iter(action.objects)
        for one in action.operator.parameters:
            if one.name not in bound:
                bound[one.name] = next(objects, None)
        return tuple([self._command(one, bound, action) for one in action.operator.commands])

    def _command(self, one: Application, bound: Mapping[str, Any], action: PlannedAction) -> VehicleCommand:
        numbers = [self._number(arg, bound) for arg in one.args]
        if any(not isinstance(each, int | float) or isinstance(each, bool) for each in numbers):
            raise Refused(f"{action.shown}: the numbers of {one.name} are not known", "unknown-number")
        if one.name == "goto":
            east_m, north_m, height_m = map(float, numbers)
            latitude_deg, longitude_deg, _ = self._frame.from_ned(north_m, east_m, 0.0)
            numbers = [latitude_deg, longitude_deg, height_m]
        return VehicleCommand(one.name, tuple(map(float, numbers)))

    def _number(self, expression: Expression, bound: Mapping[str, Any]) -> Any:
        """A number of constants, of the action's own numbers, and of features that no action changes."""
        match expression:
            case tree.Duration(us):
                return us / 1e6
            case tree.Arithmetic(sign, left, right):
                return calculated(sign, self._number(left, bound), self._number(right, bound))
            case Application(name, ()) if name in bound:
                return bound[name]
            case Application(name, args) if name in self._task.features:
                objects = tuple(str(bound.get(arg.name, arg.name)) for arg in args if isinstance(arg, Application))
                return self._task.value_of(self._task.features[name], label_text(name, objects))
        return self._task.constant(expression)
