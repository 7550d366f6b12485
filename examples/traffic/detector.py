"""A detector of your own in the place of the simulated cameras: `dyknow host examples/traffic/detector.py --unit 0`.

Whatever finds things in images belongs into `images`: here two cars are made up, which drive along one street.
"""

import time
from collections.abc import Iterator

from dyknow import Field, Sort, Value, source

PERCEPT = Sort(
    "camera-percept",
    (
        Field("symbol", "text"), Field("x_m", "m"), Field("y_m", "m"), Field("sd_m", "m"), Field("colour", "text"),
        Field("end", "bool"),
    ),
)  # fmt: skip
"""The sort of the semantic label `vision-percepts`: one record for each track and image, metres east and north."""
PERIOD_S = 0.1


def images() -> Iterator[list[Value]]:
    """What is followed in each image: the track's name, where it is, how wrong that may be; `end` when it is lost."""
    number = 0
    while True:
        time.sleep(PERIOD_S)  # a camera is waited for
        along_m = number * PERIOD_S * 9.0 % 120.0
        lap = int(number * PERIOD_S * 9.0 // 120.0)
        yield [
            (f"track{lap}", along_m - 40.0, -1.75, 0.5, "red", False),
            (f"other{lap}", 80.0 - along_m, 1.75, 0.5, "white", False),
        ]
        number += 1


@source(PERCEPT, label="vision-percepts[self]")
def detector(_from_us: int) -> Iterator[tuple[None, list[Value]]]:
    """All percepts of one image are one reading; its time is when it is read, unless the camera knows better."""
    for percepts in images():
        yield None, percepts
