"""Files of road networks, as options and settings name them."""

from pathlib import Path

from anchoring.roads.network import RoadNetwork
from dyknow.model.errors import WrongCall


def read_bytes(file: Path, option: str) -> bytes:
    """The bytes of a file of roads, at most one more than is allowed; raises WrongCall."""
    from anchoring.roads.files.problems import MOST_BYTES

    try:
        with file.open("rb") as text:
            return text.read(MOST_BYTES + 1)
    except OSError as error:
        raise WrongCall(
            f"{option}: {file} cannot be read ({error.strerror}); roads are a file of GeoJSON, OpenStreetMap or SUMO."
        ) from None


def read_roads(file: Path) -> RoadNetwork:
    """The road network of a file; raises WrongCall and RoadsError."""
    from anchoring.roads.files.formats import survey_any

    return survey_any(read_bytes(file, "--roads")).required(str(file))
