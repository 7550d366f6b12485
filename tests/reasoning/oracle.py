"""What formulas mean, written a second time and by brute force: thesis 7.5.1 word by word over recorded states.

`verdict` looks at states so far and knows nothing of those to come; `naive` rewrites the formula as Def. 7.5.3 prints it.
Nothing of the product is used but the tree of formulas.
"""

from dataclasses import replace

from reasoning.formulas import (
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

TESTS = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    "=": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
    ">=": lambda a, b: a >= b,
    ">": lambda a, b: a > b,
}


def all_of(values):
    values = list(values)
    return False if False in values else None if None in values else True


def any_of(values):
    values = list(values)
    return True if True in values else None if None in values else False


def negation(value):
    return None if value is None else not value


def atom(formula, values):
    if isinstance(formula, Const):
        return formula.value
    if isinstance(formula, Compare):
        value = values.get(formula.left.label)
        return None if value is None else TESTS[formula.operator](value, formula.right.value)
    return values.get(formula.label)


def members(domain, domains):
    def named(found):
        return domains[found] if isinstance(found, str) else found

    out = {one for each in domain.minus for one in named(each)}
    return [one for one in named(domain.base) if one not in out]


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


def verdict(formula, states, at=0, period_us=None, domains=None, ended=False):
    """True, False or None: what the states [(time, values), ...] so far say of the formula at state `at`.

    With `ended`, no state will follow. A bounded window is over when no later state can lie in it: when time has
    reached its end or, with a known period, when one period more passes it.
    """

    def inside(one, index):
        return verdict(one, states, index, period_us, domains, ended)

    match formula:
        case Not(operand):
            return negation(inside(operand, at))
        case And(parts):
            return all_of(inside(part, at) for part in parts)
        case Or(parts):
            return any_of(inside(part, at) for part in parts)
        case Implies(left, right):
            return any_of([negation(inside(left, at)), inside(right, at)])
        case Forall(variable, domain, body):
            return all_of(inside(put(body, variable, one), at) for one in members(domain, domains))
        case Exists(variable, domain, body):
            return any_of(inside(put(body, variable, one), at) for one in members(domain, domains))
        case Always(operand, lo, hi):
            return negation(inside(Until(Const(True), Not(operand), lo, hi), at))
        case Eventually(operand, lo, hi):
            return inside(Until(Const(True), operand, lo, hi), at)
        case Until(left, right, lo, hi):
            start = states[at][0]
            end = float("inf") if hi is None else start + hi
            lefts = [inside(left, k) for k in range(at, len(states))]
            ways = [
                all_of([inside(right, j), *lefts[: j - at]])
                for j in range(at, len(states))
                if start + lo <= states[j][0] <= end
            ]
            if not ended and states[-1][0] + (period_us or 1) <= end:
                ways.append(all_of([None, *lefts]))
            return any_of(ways)
    return atom(formula, states[at][1])


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
