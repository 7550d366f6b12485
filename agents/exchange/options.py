"""Options of the exchange of streams."""

from typing import Annotated

from pydantic import Field

from dyknow.agents.options import Flag, OptionPath, Options


class TranslationOptions(Options):
    COMMANDS = ("join",)

    translation: Annotated[OptionPath | None, Flag(metavar="FILE.toml")] = Field(
        None, description="Its own labels and units, by semantic label."
    )


class SheddingOptions(Options):
    shedding: bool = Field(
        True, description="Whether it may send its streams less often while its machine has too much to do."
    )


OPTIONS = (TranslationOptions, SheddingOptions)
