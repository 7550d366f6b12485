"""`dyknow kpl verify`: a recorded run compared with its specification."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dyknow.console.arguments import SpecificationFile, UnitModules
from dyknow.console.command import Call, command
from dyknow.console.commands.texts.specification_files import instance_of, read_lines, read_text
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import counted
from dyknow.console.output.shown import line, styled
from dyknow.model.errors import WrongCall
from dyknow.proxies.files.named_files import beside

if TYPE_CHECKING:
    from dyknow import Network, Sample
    from dyknow.kpl import Hooks, Instance


@command(example="dyknow kpl verify cars.kpl --journal run.jsonl")
def verify(
    call: Call,
    file: SpecificationFile,
    journal: Annotated[
        Path,
        typer.Option(metavar="FILE", help="The record of `kpl run --record`, or the journal of a platform, U.mcap."),
    ],
    modules: UnitModules = None,
) -> int:
    """Whether a recorded run satisfies its specification; if not, which sample broke which constraint. Exit 1 then."""
    from dyknow.kpl import parse_specification
    from dyknow.kpl.introspection.verification import broken_streams
    from dyknow.kpl.introspection.verification import verify as violations_of
    from dyknow.kpl.running.changes import resolved
    from dyknow.kpl.syntax.specification import policies_of
    from dyknow.proxies.recordings.sample_file import read_record

    path, units = file, modules or ()
    specification = parse_specification(read_text(path), beside(path))
    labels: dict[str, list[Sample]] = {}
    streams: dict[str, list[Sample]] = {}
    if journal.suffix == ".mcap":
        if any(policy.is_relative for each in specification for _, policy in policies_of(each)):
            raise WrongCall(
                f"{path} has times relative to its declaration, which a journal does not tell; write instants."
            )
        streams = _of_platform(call, journal, units)
        found = broken_streams(specification, streams)
    else:
        about, recorded = read_lines(journal, read_record, "--journal", "`kpl run --record FILE` makes one")
        declared_us = int(about.get("declared_us", 0))
        specification = tuple(resolved(each, declared_us) for each in specification)
        for each in recorded:
            (labels if each.kind == "label" else streams).setdefault(each.name, []).append(each.sample)

        def make(network: "Network", hooks: "Hooks") -> "Instance":
            unit, labels = str(about.get("unit", "0")), call.settings.ontology
            return instance_of(network, hooks, units, unit, reads=False, labels=labels)

        found = violations_of(specification, labels, streams, make)
    for violation in found:
        sample = violation.sample
        call.out.say(
            line(styled("broken", "red"), f" {violation}"),
            event="broken",
            name=violation.name,
            valid_us=None if sample is None else sample.valid_us,
            available_us=None if sample is None else sample.available_us,
            said=violation.said,
        )
    samples = sum(map(len, (*labels.values(), *streams.values())))
    verdict = styled(counted(len(found), "violation"), "red") if found else styled("satisfied", "green")
    looked_at = (
        f"{counted(samples, 'sample')} of {counted(len(labels), 'generator')} and {counted(len(streams), 'stream')}"
    )
    call.out.say(
        line(verdict, f": {looked_at}"), event="verified", satisfied=not found, violations=len(found), samples=samples
    )
    return NO if found else DONE


def _of_platform(call: Call, journal: Path, units: Sequence[str]) -> "dict[str, list[Sample]]":
    """The streams of a platform, from its journal: their constraints can be looked at, not what they are made of."""
    from dyknow.runtime.journal.recorded_runs import recorded_streams

    def tell(unread: object) -> None:
        call.out.note(f"{journal}, {unread}.", style="yellow")

    try:
        return recorded_streams(journal, units, call.settings.extensions, on_unread=tell)
    except OSError as error:
        raise WrongCall(f"--journal: {journal} cannot be read ({error}).") from None
