"""Specifications to text: one declaration a line; parsing the text gives the specification back."""

from collections.abc import Iterable

from dyknow.policy import Policy
from kpl.printing import print_formula
from kpl.specification import (
    ANY_UPDATE,
    ChronicleFile,
    Declaration,
    Define,
    Export,
    ForEach,
    FromSource,
    GeneratorDeclaration,
    Import,
    Link,
    Making,
    Merge,
    MonitorDeclaration,
    Refinement,
    Select,
    SourceDeclaration,
    StateStream,
    StreamDeclaration,
    StreamTerm,
    UnitDeclaration,
)


def print_specification(specification: Iterable[Declaration]) -> str:
    """The text of a specification; empty if it declares nothing."""
    return "".join(f"{print_declaration(declaration)}\n" for declaration in specification)


def print_declaration(declaration: Declaration) -> str:
    """One declaration as it is typed, on one line."""
    match declaration:
        case SourceDeclaration(sort, name):
            return f"source {sort} {name}"
        case UnitDeclaration(sort, name, inputs):
            return f"compunit {sort} {name}({', '.join(inputs)})"
        case GeneratorDeclaration(label, made):
            return f"strmgen {label} = {_made(made)}"
        case StreamDeclaration(name, term):
            return f"stream {name} = {_term(term)}"
        case ForEach(variable, domain, body):
            return f"for {variable} in {_term(domain)} {print_declaration(body)}"
        case Export(semantic, term):
            return f"export {semantic} = {_term(term)}"
        case Import(semantic, unit, term):
            return f"import {semantic} from {unit} as {_term(term)}"
        case Define(feature, formula):
            return f"define {print_formula(feature)} = {print_formula(formula)}"
        case MonitorDeclaration():
            return f"monitor {declaration.name} = {print_formula(declaration.formula)}{_options(declaration)}"
        case ChronicleFile(path, policy):
            return f'chronicle file "{path}"{_with(policy)}'


def _made(made: Making) -> str:
    match made:
        case FromSource(source):
            return source
        case Refinement(unit, inputs):
            return f"{unit}({', '.join(map(_term, inputs))})"
        case StateStream(inputs, policy):
            return f"state({', '.join(map(_term, inputs))}){_with(policy)}"
        case Link(source, unit, establish, reestablish, maintain):
            conditions = ", ".join(map(print_formula, (establish, reestablish, maintain)))
            return f"link({source}, {unit}, {conditions})"
        case Select(term, variable, domain):
            return f"select {_term(term)} for {variable} in {_term(domain)}"
        case Merge(term, variable, domain):
            return f"merge {_term(term)} for {variable} in {_term(domain)}"


def _term(term: StreamTerm) -> str:
    return f"{term.label}{_with(term.policy)}"


def _with(policy: Policy) -> str:
    return "" if policy == ANY_UPDATE else f" with {policy}"


def _options(monitor: MonitorDeclaration) -> str:
    said = [
        "" if monitor.policy == ANY_UPDATE else str(monitor.policy),
        "" if monitor.no_value == "undecided" else f"no value {monitor.no_value}",
        "" if monitor.close_after == 2 else f"close after {monitor.close_after}",
    ]
    options = ", ".join(filter(None, said))
    return f" with {options}" if options else ""
