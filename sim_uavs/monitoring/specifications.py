"""Ready specifications, by scenario."""

from pathlib import Path
from typing import Final, NamedTuple


class ReadySpecification(NamedTuple):
    """A specification and the modules with its units."""

    file: Path
    modules: tuple[str, ...]


READY: Final = {
    "emergency": ReadySpecification(Path(__file__).with_name("emergency.kpl"), ()),
    "logistics": ReadySpecification(Path(__file__).with_name("logistics.kpl"), ()),
    "traffic": ReadySpecification(Path(__file__).with_name("traffic.kpl"), ("dyknow.sim_uavs.monitoring.units",)),
}
