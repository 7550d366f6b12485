"""Specifications to text: one declaration a line; parsing the text gives the specification back."""

import re
from collections.abc import Iterable

from dyknow.kpl.syntax import specification as spec
from dyknow.kpl.syntax.link_options import LEAST_PARTS, print_options
from dyknow.kpl.syntax.printing import print_formula
from dyknow.model.instants import print_duration
from dyknow.model.labels import RESERVED, Label
from dyknow.model.values import Sort
from dyknow.policies.policy import Policy

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(-[A-Za-z0-9_]+)*")


def print_specification(specification: Iterable[spec.Declaration]) -> str:
    """The text of a specification; empty if it declares nothing."""
    return "".join(f"{print_declaration(declaration)}\n" for declaration in specification)


def print_declaration(declaration: spec.Declaration) -> str:
    """One declaration as it is typed, on one line."""
    match declaration:
        case spec.SourceDeclaration(sort, name):
            return f"source {sort} {name}"
        case spec.UnitDeclaration(sort, name, inputs):
            return f"compunit {sort} {name}({', '.join(inputs)})"
        case spec.GeneratorDeclaration(label, made):
            return f"strmgen {label} = {print_making(made)}"
        case spec.StreamDeclaration(name, term):
            return f"stream {name} = {_term(term)}"
        case spec.ForEach(variables, domain, body, left_out):
            but = f" - {{{', '.join(left_out)}}}" if left_out else ""
            return f"for {', '.join(variables)} in {_term(domain)}{but} {print_declaration(body)}"
        case spec.SortDeclaration(sort):
            return f"sort {_sort(sort)}"
        case spec.LabelDeclaration(name, sort, meaning):
            return f'label {name} : {_sort(sort)} "{meaning}"'
        case spec.Export(semantic, term, visibility, receivers, cost):
            seen = "" if visibility == "public" else f"{visibility} "
            to = f" to {', '.join(receivers)}" if receivers else ""
            if cost is not None:
                return f"offer {semantic} = {term.label} at cost {cost:.15g}{to}{_with(term.policy)}"
            return f"export {seen}{semantic} = {term.label}{to}{_with(term.policy)}"
        case spec.Import(semantic, spec.CALLED, term):
            return f"call {semantic} as {_term(term)}"
        case spec.Import(semantic, unit, term):
            return f"import {semantic} from {unit} as {_term(term)}"
        case spec.Define(feature, formula):
            return f"define {print_formula(feature)} = {print_formula(formula)}"
        case spec.MonitorDeclaration():
            return f"monitor {declaration.name} = {print_formula(declaration.formula)}{_options(declaration)}"
        case spec.ChronicleDeclaration(path, policy, _, max_age_us, since_ever):
            of = f" of {', '.join(since_ever)}" if isinstance(since_ever, tuple) else ""
            said = [
                "" if policy == spec.ANY_UPDATE else str(policy),
                "" if max_age_us is None else f"max age {print_duration(max_age_us)}",
                f"first values{of} since ever" if since_ever else "",
            ]
            options = ", ".join(filter(None, said))
            return f'chronicle file "{path}"{f" with {options}" if options else ""}'
        case spec.RoadsDeclaration(path):
            return f'roads "{path}"'
        case spec.WantDeclaration(symbol, stream, description):
            return f"want {symbol} in {stream} = {print_formula(description)}"


def _sort(sort: Sort) -> str:
    """A sort with its units as they are typed: units that are no names are quoted."""
    if sort.fields:
        parts = (f"{part.name} in {_unit(part.unit)}" if part.unit else part.name for part in sort.fields)
        return f"{sort.name}({', '.join(parts)})"
    return f"{sort.name} in {_unit(sort.unit)}" if sort.unit else sort.name


def _unit(unit: str) -> str:
    is_typed = unit == "1" or all(_NAME.fullmatch(part) and part not in RESERVED for part in unit.split("/", 1))
    return unit if is_typed else f'"{unit}"'


def print_making(made: spec.Making) -> str:
    """How the generator of a declaration is made, as it is written."""
    match made:
        case spec.FromSource(source):
            return source
        case spec.Refinement(unit, inputs, policy):
            return f"{unit}({', '.join(map(_term, inputs))}){_with(policy)}"
        case spec.StateStream(inputs, policy):
            return f"state({', '.join(map(_term, inputs))}){_with(policy)}"
        case spec.Link(source, unit, options=options, is_ready=True):
            return f"link({source}, {unit}){print_options(options)}"
        case spec.Link(source, unit, establish, reestablish, maintain, options):
            conditions = ", ".join(map(print_formula, (establish, reestablish, maintain)))
            return f"link({source}, {unit}, {conditions}){print_options(options)}"
        case spec.Composite(source, together, stays, least):
            conditions = ", ".join(map(print_formula, (together, stays)))
            return f"composite({source}, {conditions}){'' if least == LEAST_PARTS else f' with least {least}'}"
        case spec.Belief(paths, observed, task):
            files = ", ".join(f'"{path}"' for path in paths)
            wanted = f" for {task}" if isinstance(task, Label) else f' for "{task}"' if task else ""
            return f"believe({files}, {', '.join(map(_observing, observed))}{wanted})"
        case spec.FirstOf(inputs):
            return f"first of {', '.join(map(_term, inputs))}"
        case spec.Select(term, variable, domain):
            return f"select {_term(term)} for {variable} in {_term(domain)}"
        case spec.Merge(term, variable, domain):
            return f"merge {_term(term)} for {variable} in {_term(domain)}"


def _observing(observing: spec.Observing) -> str:
    view = "" if observing.view is None else f" in {observing.view}"
    return f"{observing.label} as {observing.sensor}{view}{'' if observing.trust == 1.0 else f' trust {observing.trust:g}'}"


def _term(term: spec.StreamTerm) -> str:
    return f"{term.label}{_with(term.policy)}"


def _with(policy: Policy) -> str:
    return "" if policy == spec.ANY_UPDATE else f" with {policy}"


def _options(monitor: spec.MonitorDeclaration) -> str:
    said = [
        "" if monitor.policy == spec.ANY_UPDATE else str(monitor.policy),
        "" if monitor.no_value == "undecided" else f"no value {monitor.no_value}",
        "" if monitor.close_after == 2 else f"close after {monitor.close_after}",
        "starts avoidance" if monitor.starts_avoidance else "",
    ]
    options = ", ".join(filter(None, said))
    return f" with {options}" if options else ""
