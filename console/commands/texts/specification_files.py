"""Specifications and what belongs to them, read from files: text, samples of sources, an instance with its units."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, TypeVar

from dyknow.agents.specification.options import RunOptions, SpecificationOptions
from dyknow.model.errors import SourceText, WrongCall
from dyknow.proxies.files.named_files import bounded_text, opened_file, text_lines

if TYPE_CHECKING:
    from dyknow import Network, Prototype
    from dyknow.kpl import Hooks, Instance, Specification
    from dyknow.proxies.recordings.sample_file import FedSample
    from dyknow.runtime.configuration.settings import UnitFile

Read = TypeVar("Read")
LONGEST_FILE = 1 << 20
STANDARD_INPUT = "-"


def read_text(path: Path) -> SourceText:
    """A specification as it is written; raises WrongCall."""
    try:
        return SourceText(bounded_text(path, LONGEST_FILE), str(path))
    except OSError as error:
        raise WrongCall(f"{path} cannot be read ({error.strerror}); it is a text file.") from None


def read_lines(path: Path, read: "Callable[[Iterable[str], str], Read]", option: str, what: str) -> "Read":
    """The result of `read` for the lines of a file and its name.

    Raises:
        WrongCall: it cannot be read; `option` named it, and `what` says what it should be.
        TextErrors: from `read`.
    """
    with opened(path, option, what) as lines:
        return read(lines, str(path))


@contextmanager
def opened(path: Path, option: str, what: str) -> Iterator[Iterator[str]]:
    """The lines of a file, one by one; raises WrongCall where it cannot be read: `option` named it, `what` says what it is."""
    from dyknow.documents.json_lines import LIMIT_LINE

    def unreadable(error: OSError) -> WrongCall:
        return WrongCall(f"{option}: {path} cannot be read ({error.strerror}); {what}.")

    def lines(file: BinaryIO) -> Iterator[str]:
        try:
            yield from text_lines(file, LIMIT_LINE)
        except OSError as error:
            raise unreadable(error) from None

    try:
        opened = opened_file(path)
    except OSError as error:
        raise unreadable(error) from None
    with opened:
        yield lines(opened)


@contextmanager
def recorded_lines(path: Path, option: str, what: str) -> Iterator[Iterator[bytes]]:
    """The lines of a file, or of standard input if that is called `-`, one by one; raises WrongCall as `opened`."""
    from dyknow.documents.json_lines import LIMIT_LINE
    from dyknow.proxies.files.piped_lines import limited_lines

    if str(path) == STANDARD_INPUT:
        yield limited_lines(sys.stdin.buffer, LIMIT_LINE)
        return
    try:
        file = opened_file(path)
    except OSError as error:
        raise WrongCall(f"{option}: {path} cannot be read ({error.strerror}); {what}.") from None
    with file:
        yield limited_lines(file, LIMIT_LINE)


def read_samples(path: Path) -> "list[FedSample]":
    """The samples of a feed; raises WrongCall and TextErrors."""
    from dyknow.proxies.recordings.sample_file import read_feed

    return read_lines(path, read_feed, "--feed", "a feed is a text of JSON lines")


def check_specified(own: "UnitFile") -> None:
    """Whether what a platform is to run can be read; raises WrongCall, TextErrors and RoadsError."""
    from dyknow.runtime.configuration.road_files import read_roads

    spec, run = own[SpecificationOptions].spec, own[RunOptions]
    if spec is not None:
        from dyknow.kpl import parse_specification
        from dyknow.proxies.files.named_files import beside

        parse_specification(read_text(spec), beside(spec))
    elif run.feed is not None:
        raise WrongCall("--feed: samples are for the sources of a specification; give it with --spec FILE.kpl.")
    if run.feed is not None:
        read_samples(run.feed)
    if run.roads is not None:
        read_roads(run.roads)


def instance_of(
    network: "Network",
    hooks: "Hooks",
    modules: Iterable[str],
    unit: str,
    *,
    reads: bool = True,
    labels: Path | None = None,
    roads: Path | None = None,
) -> "Instance":
    """An empty instance that finds units in modules, the library and installed distributions.

    With `reads` false sources are not read: their samples are pushed. `labels` is a file of semantic labels, `roads` one of
    those on which linked objects are.
    """
    from dyknow.compunits import catalogue
    from dyknow.federation.keys import unit as unit_name
    from dyknow.kpl import Instance
    from dyknow.runtime.configuration.ontologies import ontology_of
    from dyknow.runtime.configuration.road_files import read_roads

    there = catalogue(modules)

    def found(name: str) -> "Prototype | None":
        from dataclasses import replace

        from dyknow import SourcePrototype

        prototype = there.offered(name)
        if isinstance(prototype, SourcePrototype) and not reads:
            return replace(prototype, read=None)
        return prototype

    ontology = ontology_of(file=labels)
    return Instance(
        network,
        unit=unit_name(unit),
        sorts=ontology.sorts(),
        semantic={label.name: label for label in ontology.definitions()},
        catalogue=found,
        offered=there.names,
        hooks=hooks,
        roads=None if roads is None else read_roads(roads),
    )


def add_streams_of_platforms(specification: "Specification", instance: "Instance", labels: Path | None) -> list[str]:
    """Streams that a specification takes from its platform, `heli-position[self]`; their labels."""
    from dyknow import Label
    from dyknow.kpl.checking.symbols import SELF, symbol_of
    from dyknow.runtime.configuration.ontologies import ontology_of

    offered = {each.name: each for each in ontology_of(file=labels).definitions()}
    symbols = [symbol_of(each) for each in specification]
    made = {each.label for each in symbols}
    taken = {need.term.label: None for each in symbols for need in each.needs}
    found = [each for each in taken if each.objects == (SELF,) and each.feature in offered and each not in made]
    for each in found:
        instance.network.add_source(Label(each.feature, (instance.unit,)), offered[each.feature].sort)
    return [str(each) for each in found]
