"""Options of a specification, and of what runs with it."""

from typing import Annotated, Final, Literal

from pydantic import Field

from dyknow.agents.options import DURATION_TEXT, Flag, Modules, OptionPath, Options, read_duration

GOVERN_MOST_US: Final = 60_000_000


class SpecificationOptions(Options):
    spec: Annotated[OptionPath | None, Flag(metavar="FILE.kpl")] = Field(
        None, description="Its streams, exports, imports and monitors; read again on change."
    )
    learnt: OptionPath | None = Field(
        None, description="Directory in which it keeps what its streams of beliefs learn."
    )


class RunOptions(Options):
    """A specification runs with these, on a platform or alone."""

    modules: Annotated[Modules, Flag(metavar="MODULE")] = Field(
        (), alias="units", description="A module or file.py with sources and computational units (repeatable)."
    )
    feed: Annotated[OptionPath | None, Flag(metavar="FILE.jsonl")] = Field(
        None, description="Samples of the specification's sources, one instant a line."
    )
    roads: Annotated[OptionPath | None, Flag(metavar="FILE")] = Field(
        None, description="Roads on which linked objects are, where the specification names none."
    )
    govern_us: Annotated[
        int | None, read_duration(GOVERN_MOST_US), DURATION_TEXT, Flag(metavar="TIME", typed=str | None)
    ] = Field(
        None, alias="govern", description="Lengthen the least important periods while delays are longer than this."
    )
    admit: Annotated[Literal["refuse", "longer"], Flag()] = Field(
        "refuse", description="Declarations that there is no time for are refused, or served less often."
    )


OPTIONS = (SpecificationOptions, RunOptions)
