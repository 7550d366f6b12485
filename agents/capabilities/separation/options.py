"""Options of keeping apart."""

from typing import Annotated

from pydantic import Field

from dyknow.agents.options import Everywhere, OptionPath, Options


class EncounterOptions(Options):
    encounters: Annotated[OptionPath | None, Everywhere()] = Field(
        None, description="Directory in which it keeps a record of each encounter, as `<unit>-<other>-<time>.mcap`."
    )


OPTIONS = (EncounterOptions,)
