"""Constraints on variables and domains, read as thesis 8.3.1 and 8.3.5 say."""

from dyknow.reasoning.chronicles.definition.domains import Combination, Complement, NamedDomain, Symbols
from dyknow.reasoning.chronicles.definition.model import (
    Choice,
    ChronicleVariable,
    Conjunction,
    Disjunction,
    Equal,
    Iff,
    Implication,
    MemberOf,
    Negation,
    Use,
)


def variables_of(condition, file):
    match condition:
        case MemberOf(variable, _):
            return [variable]
        case Equal(variable, other):
            return [variable, *([other] if isinstance(other, ChronicleVariable) else [])]
        case Use(_, arguments):
            return [one for one in arguments if isinstance(one, ChronicleVariable)]
        case Negation(operand):
            return variables_of(operand, file)
        case Conjunction(operands) | Disjunction(operands):
            return [one for each in operands for one in variables_of(each, file)]
        case Implication(left, right) | Iff(left, right):
            return variables_of(left, file) + variables_of(right, file)
    return [
        one for each in (condition.condition, condition.then, condition.otherwise) for one in variables_of(each, file)
    ]


def truth(condition, value, file):
    """Whether a condition holds where `value` gives the symbol of a parameter."""
    match condition:
        case MemberOf(variable, domain, inside):
            return is_in(value(variable), domain, file) == inside
        case Equal(variable, other, same):
            return (value(variable) == value(other)) == same
        case Negation(operand):
            return not truth(operand, value, file)
        case Conjunction(operands):
            return all(truth(one, value, file) for one in operands)
        case Disjunction(operands):
            return any(truth(one, value, file) for one in operands)
        case Implication(left, right):
            return not truth(left, value, file) or truth(right, value, file)
        case Iff(left, right):
            return truth(left, value, file) == truth(right, value, file)
        case Choice(first, then, otherwise):
            return truth(then, value, file) if truth(first, value, file) else truth(otherwise, value, file)
    declared = file.named_constraints[condition.name]
    given = {str(mine): value(one) for mine, one in zip(declared.parameters, condition.arguments, strict=True)}
    return all(
        truth(one, lambda each: each if isinstance(each, str) else given[str(each)], file)
        for one in declared.constraints
    )


def is_in(symbol, domain, file):
    match domain:
        case Symbols(symbols):
            return symbol in symbols
        case NamedDomain(name):
            return is_in(symbol, file.domains[name], file)
        case Complement(inner):
            return not is_in(symbol, inner, file)
        case Combination(operator, left, right):
            first, second = is_in(symbol, left, file), is_in(symbol, right, file)
            return {"|": first or second, "&": first and second, "-": first and not second}[operator]
    raise TypeError(domain)
