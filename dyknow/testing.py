"""A deterministic world for tests of specifications, units and parts: many platforms, one process, one seed.

Its names are those of rooms above, as that of `dyknow.connect` is; `testing.pyi` has their types.
"""

from typing import Any

from dyknow.library import loaded

_PLACES = {
    "Dialogue": "federation.messages.dialogue",
    "HomePlace": "sim_uavs.dynamics.settings",
    "PlatformConfig": "agents.config",
    "SessionLink": "sim_uavs.world.sessions",
    "SimulatedVehicle": "sim_uavs.dynamics.vehicles",
    "VehicleConfig": "sim_uavs.dynamics.settings",
    "World": "sim_uavs.world.world",
    "WorldNode": "sim_uavs.world.units",
    "catalogue": "compunits.registry",
    "default_ontology": "federation.sharing.ontology",
}


def __getattr__(name: str) -> Any:
    return loaded(name, _PLACES, __name__)


def __dir__() -> list[str]:
    return [*_PLACES]
