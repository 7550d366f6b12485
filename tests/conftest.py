import os

from hypothesis import HealthCheck, settings

from dyknow.sim_uavs.world.world import World

# Properties are judged by what they find, not by how busy the machine is.
settings.register_profile("normal", deadline=None, max_examples=25, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("full", settings.get_profile("normal"), max_examples=1_000)
settings.load_profile("full" if os.environ.get("DYKNOW_FULL") else "normal")


World.raises = True  # a fault in a simulated world fails its test; tests of containment ask for a world that contains
