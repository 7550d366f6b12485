"""WGS-84: a local north-east-down frame through the earth-centred frame, closed form; own code, no projection library.

Degrees and metres. `altitude_m` is put on the ellipsoid as it is: heights above mean sea level and above the ellipsoid
differ by tens of metres, which moves a frame of a few kilometres by parts per million.
"""

import math

SEMI_MAJOR_M = 6_378_137.0
FLATTENING = 1 / 298.257223563
ECCENTRICITY_2 = FLATTENING * (2 - FLATTENING)
SEMI_MINOR_M = SEMI_MAJOR_M * (1 - FLATTENING)
_SECOND_ECCENTRICITY_2 = ECCENTRICITY_2 / (1 - ECCENTRICITY_2)

_STEPS, _NEAR_M = 4, 0.01


def to_ecef(latitude_deg: float, longitude_deg: float, altitude_m: float) -> tuple[float, float, float]:
    """Earth-centred, earth-fixed metres: x through 0 N 0 E, z through the north pole.

    N = a / sqrt(1 - e2 sin2 lat); x = (N + h) cos lat cos lon; y = (N + h) cos lat sin lon; z = (N (1 - e2) + h) sin lat.
    """
    latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
    sine, cosine = math.sin(latitude), math.cos(latitude)
    normal = SEMI_MAJOR_M / math.sqrt(1 - ECCENTRICITY_2 * sine * sine)
    reach = (normal + altitude_m) * cosine
    return (
        reach * math.cos(longitude),
        reach * math.sin(longitude),
        (normal * (1 - ECCENTRICITY_2) + altitude_m) * sine,
    )


def from_ecef(x_m: float, y_m: float, z_m: float) -> tuple[float, float, float]:
    """(latitude_deg, longitude_deg, altitude_m), by Bowring's formula applied twice: under a micrometre below 10 km."""
    reach = math.hypot(x_m, y_m)
    longitude = math.atan2(y_m, x_m)
    tangent = z_m * SEMI_MAJOR_M / (reach * SEMI_MINOR_M) if reach else math.copysign(math.inf, z_m)
    latitude = 0.0
    for _ in range(2):
        parametric = math.atan(tangent)
        latitude = math.atan2(
            z_m + _SECOND_ECCENTRICITY_2 * SEMI_MINOR_M * math.sin(parametric) ** 3,
            reach - ECCENTRICITY_2 * SEMI_MAJOR_M * math.cos(parametric) ** 3,
        )
        tangent = (1 - FLATTENING) * math.tan(latitude)
    sine, cosine = math.sin(latitude), math.cos(latitude)
    altitude = reach * cosine + z_m * sine - SEMI_MAJOR_M * math.sqrt(1 - ECCENTRICITY_2 * sine * sine)
    return math.degrees(latitude), math.degrees(longitude), altitude


class LocalFrame:
    """North, east, down in metres about one point: the tangent plane there, exact both ways at any distance.

    Down is measured along the vertical of the origin, so over `d` metres it differs from the difference of altitudes
    by d^2 / 2R: 8 cm at 1 km, 7.8 m at 10 km.
    """

    __slots__ = ("_origin", "_rows", "altitude_m", "latitude_deg", "longitude_deg")

    def __init__(self, latitude_deg: float, longitude_deg: float, altitude_m: float) -> None:
        self.latitude_deg, self.longitude_deg, self.altitude_m = latitude_deg, longitude_deg, altitude_m
        self._origin = to_ecef(latitude_deg, longitude_deg, altitude_m)
        latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
        sine, cosine = math.sin(latitude), math.cos(latitude)
        sine_lon, cosine_lon = math.sin(longitude), math.cos(longitude)
        self._rows = (
            (-sine * cosine_lon, -sine * sine_lon, cosine),
            (-sine_lon, cosine_lon, 0.0),
            (-cosine * cosine_lon, -cosine * sine_lon, -sine),
        )

    def to_ned(self, latitude_deg: float, longitude_deg: float, altitude_m: float) -> tuple[float, float, float]:
        x, y, z = to_ecef(latitude_deg, longitude_deg, altitude_m)
        x0, y0, z0 = self._origin
        x, y, z = x - x0, y - y0, z - z0
        (a, b, c), (d, e, _), (g, h, i) = self._rows
        return a * x + b * y + c * z, d * x + e * y, g * x + h * y + i * z

    def from_ned(self, north_m: float, east_m: float, down_m: float) -> tuple[float, float, float]:
        """(latitude_deg, longitude_deg, altitude_m) of a point of this frame."""
        (a, b, c), (d, e, f), (g, h, i) = self._rows
        x0, y0, z0 = self._origin
        return from_ecef(
            x0 + a * north_m + d * east_m + g * down_m,
            y0 + b * north_m + e * east_m + h * down_m,
            z0 + c * north_m + f * east_m + i * down_m,
        )

    def level(self, north_m: float, east_m: float, altitude_m: float) -> tuple[float, float]:
        """(latitude_deg, longitude_deg) of a place so far north and east at that altitude: `to_ned` turned round."""
        down_m = self.altitude_m - altitude_m
        for _ in range(_STEPS):
            latitude_deg, longitude_deg, reached_m = self.from_ned(north_m, east_m, down_m)
            if abs(reached_m - altitude_m) < _NEAR_M:
                break
            down_m += reached_m - altitude_m
        return latitude_deg, longitude_deg


def metres_per_degree(latitude_deg: float) -> tuple[float, float]:
    """Of latitude and of longitude, on the ellipsoid: M pi / 180 and N cos(lat) pi / 180; never 0, at a pole either."""
    latitude = math.radians(latitude_deg)
    w = math.sqrt(1 - ECCENTRICITY_2 * math.sin(latitude) ** 2)
    north_m = SEMI_MAJOR_M * (1 - ECCENTRICITY_2) / w**3
    east_m = SEMI_MAJOR_M / w * max(math.cos(latitude), 1e-9)
    return math.radians(north_m), math.radians(east_m)


def distance_m(
    latitude_a_deg: float, longitude_a_deg: float, latitude_b_deg: float, longitude_b_deg: float, up_m: float = 0.0
) -> float:
    """Distance of two points on the ellipsoid, `up_m` apart vertically; within 1 mm of the geodesic up to 10 km.

    Local radii at the middle latitude: M = a (1 - e2) / w^3, N = a / w, w = sqrt(1 - e2 sin2 lat), and Gauss's
    mid-latitude formula, to which meridians converge:
    sqrt((M dlat cos(dlon / 2))^2 + (2 N cos lat sin(dlon / 2))^2 + up^2).
    """
    middle = math.radians((latitude_a_deg + latitude_b_deg) / 2)
    half = math.radians((longitude_b_deg - longitude_a_deg + 180.0) % 360.0 - 180.0) / 2
    w = math.sqrt(1 - ECCENTRICITY_2 * math.sin(middle) ** 2)
    metres = math.radians(latitude_b_deg - latitude_a_deg) * SEMI_MAJOR_M * (1 - ECCENTRICITY_2) / w**3
    north_m = metres * math.cos(half)
    east_m = 2.0 * math.sin(half) * math.cos(middle) * SEMI_MAJOR_M / w
    return math.hypot(north_m, east_m, up_m)
