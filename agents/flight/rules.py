"""What the vehicle's state forbids: without control, unheard, disarmed, on the ground, or in a mode that is not ours.

Each rule is a sentence, or None where it forbids nothing. Where the vehicle may be sent is in `agents.flight.places`.
"""

from navigation import vehicle

HEARD_WITHIN_US = 3_000_000
_FOR_MISSIONS = vehicle.InterruptOrder | vehicle.ResumeMissionOrder | vehicle.MissionItemOrder
"""What may be sent to a vehicle in AUTO: to leave its mission, and to continue it."""
_MODE = "the vehicle is in mode {}"


def unready(status: vehicle.StatusReport | None, silent_us: int, *, control: bool) -> str | None:
    """Why no order at all may be sent; `silent_us`: since when nothing has been heard."""
    if not control:
        return "this platform was not given control of its vehicle (join with --control)"
    if status is None:
        return "the vehicle has not said in what state it is"
    if silent_us > HEARD_WITHIN_US:
        return f"no heartbeat for {silent_us / 1e6:.1f} s"
    if not status.armed:
        return "the vehicle is not armed"
    return None if status.airborne else "the vehicle is not airborne"


def unguided(order: vehicle.Order, status: vehicle.StatusReport | None, *, missions: bool) -> str | None:
    """Why the vehicle's mode forbids `order`; `missions`: whether a mission may be interrupted to give way."""
    if status is None or status.guided:
        return None
    if status.mode not in vehicle.MISSION_MODES:
        return _MODE.format(status.mode) + ", which takes no positions; a guided mode is needed"
    if missions:
        only = ": only giving way interrupts a mission"
        return None if isinstance(order, _FOR_MISSIONS) else _MODE.format(status.mode) + only
    remedy = "a guided mode is needed; --control auto lets it be interrupted to give way"
    return f"{_MODE.format(status.mode)}, which takes no positions; {remedy}"


def in_words(order: vehicle.Order) -> str:
    """The order, as users write it."""
    match order:
        case vehicle.GoToOrder() | vehicle.InterruptOrder():
            return f"goto {order.latitude_deg:.6f} {order.longitude_deg:.6f} at {order.altitude_m:.1f} m"
        case _:
            return type(order).__name__.removesuffix("Order").lower()
