"""Chronicle files to text, a statement a line: reading it gives the same file."""

from collections.abc import Iterable

from reasoning.chronicles.definition import model
from reasoning.chronicles.definition.times import ComplexConstraint


def print_chronicles(file: model.ChronicleFile) -> str:
    """The file as it is typed."""
    return "\n\n".join(map(print_declaration, file.declarations)) + "\n"


def print_declaration(declaration: model.Declaration) -> str:
    """One declaration, as it is typed."""
    match declaration:
        case model.DomainDefinition(name, domain):
            return f"domain {name} = {domain}"
        case model.Attribute(name, parameters, constraints):
            return f"attribute {_signature(name, parameters)}{_body(constraints) if constraints else ''}"
        case model.Message(name, parameters, constraints):
            return f"message {_signature(name, parameters)}{_body(constraints) if constraints else ''}"
        case model.NamedConstraint(name, parameters, constraints):
            return f"constraint {_signature(name, parameters)}{_body(constraints)}"
        case ComplexConstraint(name, points, timings):
            return f"time constraint {name}{_points(points)}{_body(timings)}"
    return _chronicle(declaration)


def _chronicle(chronicle: model.Chronicle) -> str:
    points = _points(chronicle.instants)
    statements: list[str] = []
    for statement in chronicle.statements:
        shown = str(statement)
        if shown.startswith("(") and statements and statements[-1].startswith("chronicle "):
            statements[-1] += ";"
        statements.append(shown)
    return f"chronicle {_signature(chronicle.name, chronicle.parameters)}{points}{_body(statements)}"


def _points(instants: tuple[str, ...]) -> str:
    return f"({', '.join(instants)})" if instants else ""


def _signature(name: str, parameters: tuple[model.Parameter, ...]) -> str:
    return str(model.EventType(name, parameters))


def _body(statements: Iterable[object]) -> str:
    lines = "".join(f"    {statement}\n" for statement in statements)
    return f" {{\n{lines}}}"
