"""Files of road networks, as options and settings name them."""

import os
from pathlib import Path

from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.kpl.linking.roads import APART_M
from dyknow.model.errors import WrongCall
from dyknow.navigation.cameras.rig import CameraRig
from dyknow.proxies.files.named_files import opened_file


def read_bytes(file: Path, option: str) -> bytes:
    """The bytes of a file of roads, at most one more than is allowed; raises WrongCall."""
    from dyknow.anchoring.roads.files.problems import MOST_BYTES

    try:
        with opened_file(file) as text:
            size = os.fstat(text.fileno()).st_size
            found = b"" if size > MOST_BYTES else text.read(MOST_BYTES + 1)
    except OSError as error:
        raise WrongCall(
            f"{option}: {file} cannot be read ({error.strerror}); roads are a file of GeoJSON, OpenStreetMap or SUMO."
        ) from None
    if size > MOST_BYTES:
        raise WrongCall(
            f"{option}: {file} is longer than {MOST_BYTES >> 20} MB, the most that is read; cut the network."
        )
    return found


def read_roads(file: Path) -> RoadNetwork:
    """The road network of a file; raises WrongCall and RoadsError."""
    from dyknow.anchoring.roads.files.formats import survey_any

    return survey_any(read_bytes(file, "--roads")).required(str(file))


def check_place(file: Path | None, roads: RoadNetwork | None, cameras: CameraRig | None) -> None:
    """Check that roads and cameras of a platform count metres from one place; raises WrongCall.

    A local map does not say where it is.
    """
    if roads is None or cameras is None:
        return
    at = cameras.frame
    if (apart_m := roads.apart_m(at.latitude_deg, at.longitude_deg)) > APART_M:
        raise WrongCall(
            f"--roads: x and y of {file or 'the roads'} are 0 at a place {apart_m:.0f} m from that of the cameras; give the file "
            f'"origin": [{at.longitude_deg:.7f}, {at.latitude_deg:.7f}], longitude and latitude.'
        )
