"""Progression as Def. 7.5.3 prints it, by rewriting the formula; nothing of the product but the tree of formulas."""

from dataclasses import replace

from dyknow.reasoning.formulas.tree import (
    Always,
    And,
    Compare,
    Const,
    Domain,
    Eventually,
    Exists,
    Feature,
    Forall,
    Implies,
    Not,
    Or,
    Until,
    Variable,
)
from tests.reasoning.meaning import COMPARISONS


def atom(formula, values):
    if isinstance(formula, Const):
        return formula.value
    if isinstance(formula, Compare):
        value = values.get(formula.left.label)
        return None if value is None else COMPARISONS[formula.operator](value, formula.right.value)
    return values.get(formula.label)


def put(formula, variable, member):
    """`formula` with the member for the variable."""
    match formula:
        case Feature(name, objects, attribute):
            new = tuple(member if isinstance(one, Variable) and one.name == variable else one for one in objects)
            return Feature(name, new, attribute)
        case Compare(operator, left, right):
            return Compare(operator, put(left, variable, member), right)
        case Not(inside):
            return Not(put(inside, variable, member))
        case Always(inside, lo, hi) | Eventually(inside, lo, hi):
            return type(formula)(put(inside, variable, member), lo, hi)
        case And(parts) | Or(parts):
            return type(formula)(tuple(put(part, variable, member) for part in parts))
        case Implies(left, right):
            return Implies(put(left, variable, member), put(right, variable, member))
        case Until(left, right, lo, hi):
            return Until(put(left, variable, member), put(right, variable, member), lo, hi)
        case Forall(name, domain, body, growing) | Exists(name, domain, body, growing):
            minus = tuple(
                each if isinstance(each, str) else tuple(member if one == Variable(variable) else one for one in each)
                for each in domain.minus
            )
            body = body if name == variable else put(body, variable, member)
            return type(formula)(name, Domain(domain.base, minus), body, growing)
    return formula


def naive(formula, values, step_us):
    """Def. 7.5.3 through a state with no value missing, the next one `step_us` later; simplified by its rules only."""
    match formula:
        case Not(operand):
            inside = naive(operand, values, step_us)
            return Const(not inside.value) if isinstance(inside, Const) else Not(inside)
        case And(parts):
            return simplest(And, [naive(part, values, step_us) for part in parts], neutral=True)
        case Or(parts):
            return simplest(Or, [naive(part, values, step_us) for part in parts], neutral=False)
        case Implies(left, right):
            return naive(Or((Not(left), right)), values, step_us)
        case Always(operand, lo, hi):
            return naive(Not(Until(Const(True), Not(operand), lo, hi)), values, step_us)
        case Eventually(operand, lo, hi):
            return naive(Until(Const(True), operand, lo, hi), values, step_us)
        case Until(left, right, lo, hi):
            if hi is not None and hi < 0:
                return Const(False)
            rest = replace(formula, lo_us=lo - step_us, hi_us=None if hi is None else hi - step_us)
            later = simplest(And, [naive(left, values, step_us), rest], neutral=True)
            return simplest(Or, [naive(right, values, step_us), later], neutral=False) if lo <= 0 else later
    return Const(atom(formula, values))


def simplest(make, parts, *, neutral):
    if any(part == Const(not neutral) for part in parts):
        return Const(not neutral)
    left = tuple(part for part in parts if part != Const(neutral))
    return make(left) if len(left) > 1 else left[0] if left else Const(neutral)
