"""`dyknow link`: which percepts of a recording are the same objects."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dyknow.console.arguments import UnitModules
from dyknow.console.command import Call, command
from dyknow.console.commands.texts.specification_files import STANDARD_INPUT, read_text, recorded_lines
from dyknow.console.errors import DONE, WRONG
from dyknow.model.errors import TextError, WrongCall
from dyknow.proxies.files.named_files import beside
from dyknow.runtime.configuration.road_files import read_bytes

if TYPE_CHECKING:
    from dyknow import UnitPrototype
    from dyknow.anchoring.links.structures import AnySpecification
    from dyknow.anchoring.roads.network import RoadNetwork
    from dyknow.kpl.linking.offline import OfflineConditions
    from dyknow.kpl.linking.wants import Wanted
    from dyknow.navigation import LocalFrame

_MOST_NOTES, _MOST_LEFT_OUT = 20, 10_000


@command(example="dyknow link --percepts percepts.jsonl --roads town.geojson")
def link(
    call: Call,
    file: Annotated[
        Path | None,
        typer.Argument(metavar="[FILE.kpl]", help="Link declarations; without it vision percepts are linked."),
    ] = None,
    *,
    percepts: Annotated[
        Path | None,
        typer.Option(
            "--percepts", metavar="FILE", help="Percepts, JSON lines or a MOTChallenge text; - for standard input."
        ),
    ] = None,
    roads: Annotated[
        Path | None, typer.Option("--roads", metavar="FILE.geojson", help="Roads on which objects are.")
    ] = None,
    since_seen: Annotated[
        bool,
        typer.Option(
            "--since-seen/--no-since-seen", help="Once an object is established also its states from before that (yes)."
        ),
    ] = True,
    fps: Annotated[
        float | None,
        typer.Option("--fps", metavar="N", min=0.001, max=1e6, help="Frames a second of a MOTChallenge text."),
    ] = None,
    m_per_pixel: Annotated[
        float | None,
        typer.Option(
            "--m-per-pixel",
            metavar="M",
            min=1e-6,
            max=1e3,
            help="Metres a pixel of one that has no places on the ground.",
        ),
    ] = None,
    modules: UnitModules = None,
) -> int:
    """Which percepts are the same objects: one symbol for each, also through gaps; exit 2 if lines had to be left out."""
    from dyknow.anchoring.links.beginnings import ObjectBeginnings
    from dyknow.anchoring.links.structures import ObjectLinkage
    from dyknow.anchoring.percepts.reading import PerceptReader
    from dyknow.console.commands.objects.link_output import LinkOutput
    from dyknow.console.commands.objects.percept_texts import numbered_lines

    if percepts is None:
        raise WrongCall("give the recorded percepts: --percepts FILE.jsonl.")
    network = None if roads is None else _network(call, roads)
    specifications, network, frame, wanted, conditions = _specifications(call, file, network, modules or ())
    linkage = ObjectLinkage(specifications)
    for each in wanted:
        linkage.want(each.symbol, each.type, each.description)
    output, problems = LinkOutput(call), LeftOutLines(call)
    beginnings = ObjectBeginnings(linkage, specifications)
    is_piped = str(percepts) == STANDARD_INPUT
    name = "standard input" if is_piped else str(percepts)
    with recorded_lines(percepts, "--percepts", "recorded percepts are a text of JSON lines") as lines:
        is_local = True if network is not None and network.frame is None else None
        reader = PerceptReader(
            name, linkage.percept_types, problems.on_error, frame, is_local=is_local, is_piped=is_piped
        )
        numbered = numbered_lines(lines, name, problems.on_error, fps, m_per_pixel)
        for tick in reader.numbered_ticks(numbered):
            output.on_frame(reader.frame)
            if conditions is not None:
                for one in tick.percepts:
                    conditions.on_attributes(() if one.state is None else one.state.attributes)
            outcome = linkage.on_percepts(*tick)
            output.on_outcome(beginnings.completed(tick.percepts, outcome) if since_seen else outcome)
    output.end(linkage)
    for type_ in reader.unnamed:
        call.out.note(f"percepts of the type {type_} have no names: each line has that of what was expected there")
    for symbol in linkage.wanted:
        call.out.note(f"{symbol} was not found: nothing was as it is described, to the end.", style="yellow")
    has_failed = _tell_failures(call, specifications)
    mistyped = conditions.errors() if conditions is not None else []
    for error in mistyped:
        call.out.note(error.drawn(), style="yellow")
    return problems.end(name) or (WRONG if has_failed or mistyped else DONE)


def _specifications(
    call: Call, file: Path | None, network: "RoadNetwork | None", modules: Sequence[str]
) -> (
    "tuple[tuple[AnySpecification, ...], RoadNetwork | None, LocalFrame | None, list[Wanted], OfflineConditions | None]"
):
    """The link specifications of a file, or those that are ready, their roads and frame, what is looked for, what is declared."""
    from dyknow.anchoring.ready import ready_specification

    if file is None:
        return ready_specification(network), network, None if network is None else network.frame, [], None
    from dyknow.kpl import parse_specification
    from dyknow.kpl.checking.symbols import Known, SymbolTable
    from dyknow.kpl.linking.declarations import link_specifications, linkage_key, links_in
    from dyknow.kpl.linking.offline import OfflineConditions, check_conditions
    from dyknow.kpl.linking.roads import says_on_road
    from dyknow.kpl.linking.units import unit_finder
    from dyknow.kpl.linking.wants import wants_in
    from dyknow.kpl.syntax.specification import Link
    from dyknow.navigation import LocalFrame

    text = read_text(file)
    declarations = parse_specification(text, beside(file))
    links = links_in(declarations)
    if not links:
        raise WrongCall(
            f"{file}: there is no link declaration, as in strmgen world = link(vision_percept, WorldObject, e, r, m)."
        )
    symbols = SymbolTable(declarations)
    if network is not None and symbols.roads() is not None:
        raise WrongCall(f"--roads: {file} declares its roads already; leave one out.")
    prototypes = _prototypes(modules, (made.unit for _, made in links if isinstance(made, Link)))
    symbols.known = Known(
        roads=network,
        units={each.name: (each.sort, each.inputs) for each in prototypes.values()},
        values={shape.name: shape for each in prototypes.values() for shape in each.checked_sorts},
    )
    check_conditions(links, symbols, text)
    try:
        key = linkage_key(links, symbols)
        frame = None if key.origin is None else LocalFrame(*key.origin, 0.0)
        specifications = link_specifications(key, unit_finder(symbols, prototypes, frame))
        wanted = wants_in(declarations, symbols, text)
    except TextError as error:
        raise error.but(text=text) from None
    conditions = OfflineConditions(key.links, symbols, text)
    if key.roads is None and any(isinstance(made, Link) and says_on_road(made) for _, made in key.links):
        call.out.note("on_road: there are no roads (--roads FILE), so that percepts have to say it", style="yellow")
    return specifications, key.roads, frame, wanted, conditions


def _prototypes(modules: Sequence[str], names: Iterable[str]) -> "dict[str, UnitPrototype]":
    """The units that links name, of modules, the library and installed distributions."""
    from dyknow import UnitPrototype
    from dyknow.compunits import catalogue

    there = catalogue(modules)
    found = ((name, there.offered(name)) for name in names)
    return {name: prototype for name, prototype in found if isinstance(prototype, UnitPrototype)}


def _tell_failures(call: Call, specifications: "Sequence[AnySpecification]") -> bool:
    """What units of users raised; whether there was something."""
    from dyknow.kpl.linking.units import LinkedUnit

    units = [unit for each in specifications if isinstance(unit := getattr(each, "unit", None), LinkedUnit)]
    for unit in units:
        for said in unit.take_faults()[:1]:
            call.out.note(f"{unit.prototype.name} has failed {unit.failed} times, at first: {said}", style="yellow")
    return any(unit.failed for unit in units)


def _network(call: Call, file: Path) -> "RoadNetwork":
    """The roads of a file; its warnings are reported, the first of them."""
    from dyknow.anchoring.roads.files.formats import survey_any

    survey = survey_any(read_bytes(file, "--roads"))
    network = survey.required(str(file))
    for problem in survey.problems[:_MOST_NOTES]:
        call.out.note(f"{file}: {problem.drawn}", style="yellow")
    if len(survey.problems) > _MOST_NOTES:
        call.out.note(f"all {len(survey.problems)} warnings: dyknow roads check {file}")
    return network


class LeftOutLines:
    """Lines that were left out: the first are reported, the others counted, and a file of them is refused."""

    def __init__(self, call: Call) -> None:
        self._out, self._count = call.out, 0

    def on_error(self, error: TextError) -> None:
        self._count += 1
        if self._count <= _MOST_NOTES:
            self._out.note(f"left out: {error}", style="yellow")
        if self._count > _MOST_LEFT_OUT:
            raise WrongCall(
                f"{error.file}:{error.line}: more than {_MOST_LEFT_OUT} lines are wrong, the rest is not read; is it the right file?"
            )

    def end(self, file: str) -> int:
        if self._count > _MOST_NOTES:
            self._out.note(f"left out: {self._count - _MOST_NOTES} more lines of {file}", style="yellow")
        return WRONG if self._count else DONE
