"""Plans replayed by themselves: what the operators of a domain say of the actions of a plan, state by state.

Nothing of `dyknow.planning.search` is used, only the declarations as they are read: expressions are evaluated by recursion over
a state that is a mapping of (feature, arguments), formulas over the list of all states.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product
from math import hypot, inf
from typing import Any

from dyknow.planning.domains import model
from dyknow.planning.domains.model import Application, Declarations, Quantified
from dyknow.reasoning.formulas import tree

FUNCTIONS = {"abs": abs, "hypot": hypot, "min": min, "max": max}
COMPARE = {
    "=": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
}


@dataclass
class Replay:
    """The states of a plan; `wrong` says what the plan does that it may not."""

    declared: Declarations
    wrong: list[str] = field(default_factory=list)
    states: list[tuple[int, dict[Any, Any]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.parents = {one.name: one.parent for one in self.declared.types}
        self.derived = {one.name: one for one in self.declared.derived}
        self.features = {one.name: one for one in self.declared.features}
        self.constants = {one.name: self.value(one.value, {}, {}) for one in self.declared.constants}

    def members(self, sort: str) -> list[str]:
        found = [value for one in self.declared.types if one.name == sort for value in one.values]
        for each in self.declared.objects:
            above: str | None = each.sort
            while above is not None and above != sort:
                above = self.parents.get(above)
            found += each.names if above == sort else ()
        return found

    def sort(self, one: model.Parameter) -> str | None:
        if one.sort is not None:
            return one.sort if one.sort in self.parents else None
        name = one.name
        while name and name not in self.parents:
            name = name[:-1]
        return name or None

    def value(self, node: Any, env: dict[str, Any], state: dict[Any, Any]) -> Any:
        """The value of an expression about one state."""
        match node:
            case tree.Const(value):
                return value
            case tree.Duration(us):
                return us / 1000
            case tree.Negate(operand):
                return -self.value(operand, env, state)
            case tree.Arithmetic(sign, left, right):
                a, b = self.value(left, env, state), self.value(right, env, state)
                return a + b if sign == "+" else a - b if sign == "-" else a * b if sign == "*" else a / b
            case tree.Compare(sign, left, right):
                a, b = self.value(left, env, state), self.value(right, env, state)
                return a is not None and b is not None and COMPARE[sign](a, b)
            case tree.Not(operand):
                return not self.value(operand, env, state)
            case tree.And(parts):
                return all(self.value(one, env, state) for one in parts)
            case tree.Or(parts):
                return any(self.value(one, env, state) for one in parts)
            case tree.Implies(left, right):
                return not self.value(left, env, state) or self.value(right, env, state)
            case Quantified(kind, variables, body):
                each = (self.value(body, inside, state) for inside in self.bound(variables, env))
                return all(each) if kind == "forall" else any(each)
            case Application(name, args):
                return self.named(name, args, env, state)
        raise AssertionError(node)

    def bound(self, variables: Any, env: dict[str, Any]) -> Iterator[dict[str, Any]]:
        domains = [self.members(str(self.sort(one))) for one in variables]
        for those in product(*domains):
            yield {**env, **{one.name: member for one, member in zip(variables, those, strict=True)}}

    def named(self, name: str, args: Any, env: dict[str, Any], state: dict[Any, Any]) -> Any:
        if not args and name in env:
            return env[name]
        if not args and name in ("UNITS_PER_SECOND", *self.constants):
            return 1000 if name == "UNITS_PER_SECOND" else self.constants[name]
        given = tuple(self.value(arg, env, state) for arg in args)
        if name in self.derived:
            one = self.derived[name]
            inside = {parameter.name: value for parameter, value in zip(one.parameters, given, strict=True)}
            return self.value(one.body, inside, state)
        if name in self.features:
            default = self.features[name].default
            otherwise = False if self.features[name].sort == "boolean" else None
            return state.get((name, given), otherwise if default is None else self.value(default, {}, {}))
        return FUNCTIONS[name](*given) if name in FUNCTIONS else name

    def check(self, plan: list[dict[str, Any]]) -> list[str]:
        """What is wrong with a plan, as JSON has it."""
        events: list[tuple[int, Any, Any]] = []
        state: dict[Any, Any] = {}
        for one in self.declared.init:
            key = (one.target.name, tuple(self.value(arg, {}, {}) for arg in one.target.args))
            if one.at_ms:
                events.append((one.at_ms, key, self.value(one.value, {}, {})))
            else:
                state[key] = self.value(one.value, {}, {})
        self.states.append((0, dict(state)))
        under_way: list[tuple[int, int, model.Operator, dict[str, Any], str]] = []
        busy: dict[str, int] = {}
        for action in sorted(plan, key=lambda one: one["start_s"]):
            start, end = round(action["start_s"] * 1000), round(action["end_s"] * 1000)
            state = self.until(start, state, events, under_way)
            operator, env = self.bind(action, state)
            if busy.get(action["unit"], 0) > start:
                self.wrong.append(f"{action['unit']} is busy at {start}")
            busy[action["unit"]] = end
            for condition in (*operator.preconditions, *operator.prevail):
                if not self.value(condition.formula, env, state):
                    self.wrong.append(f"{action['action']} at {start}: a precondition does not hold")
            self.timing(operator, env, state, end - start)
            under_way.append((start, end, operator, env, action["action"]))
            events += self.effects(operator, env, state, start, end)
        state = self.until(10**15, state, events, under_way)
        for goal in self.declared.goals:
            if not self.value(goal.formula, {}, state):
                self.wrong.append(f"the goal {goal.name} does not hold")
            if goal.deadline_ms is not None:
                from_then = [at for at in range(len(self.states)) if self.begins(at) >= goal.deadline_ms]
                if not all(self.value(goal.formula, {}, self.states[at][1]) for at in from_then):
                    self.wrong.append(f"the goal {goal.name} is late")
        return self.wrong

    def begins(self, at: int) -> float:
        """The last instant of a state, so that one that lasts beyond a deadline counts."""
        return self.states[at + 1][0] - 1 if at + 1 < len(self.states) else inf

    def until(self, now: int, state: dict[Any, Any], events: list[Any], under_way: list[Any]) -> dict[Any, Any]:
        for at in sorted({event[0] for event in events if event[0] <= now}):
            new = {}
            for event in [event for event in events if event[0] == at]:
                if new.setdefault(event[1], event[2]) != event[2]:
                    self.wrong.append(f"{event[1]} gets two values at {at}")
                events.remove(event)
            state = {**state, **new}
            self.states.append((at, state))
            for start, end, operator, env, shown in under_way:
                if start < at < end and not all(self.value(one.formula, env, state) for one in operator.prevail):
                    self.wrong.append(f"{shown}: a prevail condition does not hold at {at}")
        return state

    def bind(self, action: dict[str, Any], state: dict[Any, Any]) -> tuple[model.Operator, dict[str, Any]]:
        name, _, rest = action["action"].partition("(")
        operator = next(one for one in self.declared.operators if one.name == name)
        objects = [one.strip() for one in rest.rstrip(")").split(",") if one.strip()]
        env: dict[str, Any] = {}
        for parameter in operator.parameters:
            sort = self.sort(parameter)
            env[parameter.name] = action["values"][parameter.name] if sort is None else objects.pop(0)
            if sort is not None and env[parameter.name] not in self.members(sort):
                self.wrong.append(f"{env[parameter.name]} is no {sort}")
        return operator, env

    def timing(self, operator: model.Operator, env: dict[str, Any], state: dict[Any, Any], length: int) -> None:
        timing = operator.timeconstraint
        for bound, sign in ((timing and timing.shortest, 1), (timing and timing.longest, -1)):
            if bound is not None and (length - self.value(bound, env, state)) * sign < -1:
                self.wrong.append(f"{operator.name} takes {length} ms")
        if operator.duration is not None and abs(length - self.value(operator.duration, env, state)) > 1:
            self.wrong.append(f"{operator.name} takes {length} ms, not as long as expected")

    def effects(self, operator: model.Operator, env: Any, state: Any, start: int, end: int) -> Iterator[Any]:
        for one in operator.effects:
            for inside in self.bound(one.variables, env):
                if one.condition is not None and not self.value(one.condition, inside, state):
                    continue
                at = end + one.offset_ms if one.anchor == "end" else start + max(1, one.offset_ms)
                key = (one.target.name, tuple(self.value(arg, inside, state) for arg in one.target.args))
                yield min(max(at, start + 1), end), key, self.value(one.value, inside, state)


def replayed(domain: Declarations, problem: Declarations, plan: Any) -> list[str]:
    """What is wrong with a plan for a problem."""
    record = json.loads(json.dumps(plan.as_json()))
    return Replay(domain.joined(problem)).check(record["plan"])
