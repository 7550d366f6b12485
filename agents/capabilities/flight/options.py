"""Options of commanded flight: its limits, and whether it gives way."""

from typing import Annotated

from pydantic import Field

from dyknow.agents.options import Everywhere, Flag, OptionPath, Options


class FlightOptions(Options):
    COMMANDS = ("join",)

    floor_m: Annotated[float, Flag("--floor", metavar="M")] = Field(
        10.0, allow_inf_nan=False, description="It is sent no lower above home, in metres."
    )
    ceiling_m: Annotated[float, Flag("--ceiling", metavar="M")] = Field(
        120.0, allow_inf_nan=False, description="Nor higher."
    )
    range_m: Annotated[float, Flag("--range", metavar="M")] = Field(
        1000.0, gt=0, allow_inf_nan=False, description="Nor farther from home."
    )
    elevation: Annotated[OptionPath | None, Flag(metavar="FILE")] = Field(
        None, description="The floor is above this ground, too: .hgt, a directory of them, or .asc."
    )


class AvoidanceOptions(Options):
    avoidance: Annotated[bool, Flag(), Everywhere()] = Field(
        True, description="Whether UAVs may give way to each other."
    )


OPTIONS = (FlightOptions, AvoidanceOptions)
