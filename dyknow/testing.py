"""A deterministic world for tests of specifications, units and parts: many platforms, one process, one seed.

Its names are those of rooms above, as that of `dyknow.connect` is; `testing.pyi` has their types.
"""

from typing import Any

from dyknow.library import loaded

_PLACES = {
    "Dialogue": "dyknow.federation.messages.dialogue",
    "HomePlace": "dyknow.sim_uavs.dynamics.settings",
    "PlatformConfig": "dyknow.agents.config",
    "SessionLink": "dyknow.sim_uavs.world.sessions",
    "SimulatedVehicle": "dyknow.sim_uavs.dynamics.vehicles",
    "VehicleConfig": "dyknow.sim_uavs.dynamics.settings",
    "World": "dyknow.sim_uavs.world.world",
    "WorldNode": "dyknow.sim_uavs.world.units",
    "catalogue": "dyknow.compunits.registry",
    "default_ontology": "dyknow.federation.sharing.ontology",
}


def __getattr__(name: str) -> Any:
    return loaded(name, _PLACES, __name__)


def __dir__() -> list[str]:
    return [*_PLACES]
