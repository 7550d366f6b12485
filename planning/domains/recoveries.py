"""Checks of recovery operators: their changes, and that operators and monitors that name one have its parameters."""

from collections.abc import Callable, Iterable, Iterator

from dyknow.kpl.diagnostics.collector import ErrorCollector, nearest
from dyknow.planning.domains import model
from dyknow.planning.domains.model import Declarations, Effect
from dyknow.planning.domains.sorts import SortChecker
from dyknow.reasoning.formulas.tree import Place


def check_recoveries(
    found: Declarations,
    declared: Declarations,
    sorts: SortChecker,
    errors: ErrorCollector,
    check_effect: Callable[[Effect, dict[str, str | None]], None],
) -> None:
    """Look at the recoveries and monitors of `found`; `declared` has all declarations."""
    for one in found.recoveries:
        bound = sorts.bound(one.parameters, one)
        for name, words, given in (("act", model.ACTS, one.act), ("times", model.LAST_RESORTS, one.then)):
            if given not in words:
                errors.error(f"{given} is no word for :{name}", one.place, nearest(given, words) or ", ".join(words))
        if one.when is not None:
            sorts.formula(one.when, bound)
        for clause in one.assumptions:
            for effect in clause:
                check_effect(effect, bound)
        check_located(one.located, bound, sorts, errors)
        for unit in one.without:
            sort = sorts.sort(unit, bound)
            if sort is not None and not set(declared.units) & set(sorts.types.above(sort)):
                errors.error(
                    "what a plan is made without is a unit", unit.place, f":without {next(iter(bound), 'uav')}"
                )
        if one.name == model.REPLANNING and one.parameters:
            errors.error(
                f"{one.name} is done before every new plan: it is about no action", one.place, "forall box: ..."
            )
    known = {one.name: one for one in declared.recoveries}
    for name, place, names in _uses(found, sorts):
        if name not in known:
            errors.error(f"there is no recovery {name}", place, nearest(name, known) or f"#recovery {name}")
            continue
        for parameter in known[name].parameters:
            if parameter.name not in names:
                repair = f"names here: {', '.join(names) or 'none'}"
                errors.error(f"{name} is about {parameter.name}, and there is none here", place, repair)


def check_located(
    located: Iterable[model.Application], bound: dict[str, str | None], sorts: SortChecker, errors: ErrorCollector
) -> None:
    """Check that located terms are features of objects."""
    for term in located:
        sorts.sort(term, bound)
        if not isinstance(term, model.Application) or term.name not in sorts.features:
            errors.error("what is located is a feature of an object", term.place, ":locate xpos(box), ypos(box)")


def _uses(found: Declarations, sorts: SortChecker) -> Iterator[tuple[str, Place, list[str]]]:
    """Each recovery that is named, where, and the names that it may be about."""
    for operator in found.operators:
        names = [one.name for one in operator.parameters]
        used = [(operator.recovery, operator.place), *((one.recovery, one.place) for one in operator.monitors)]
        yield from ((name, place, names) for name, place in used if name is not None)
    for monitor in found.monitors:
        if monitor.recovery is not None:
            variables = (*sorts.free(monitor.formula), *model.outer_variables(monitor.formula))
            yield monitor.recovery, monitor.place, [one.name for one in variables]
