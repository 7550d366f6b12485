"""Faults that simulated UAVs are started with: from options to configurations."""

from collections.abc import Iterable, Sequence

from dyknow.model.errors import TextError, WrongCall, did_you_mean
from dyknow.runtime.configuration.config import NodeConfig, SimulatedVehicleConfig


def with_faults(configs: Sequence[NodeConfig], texts: Iterable[str], seed: int | None) -> list[NodeConfig]:
    """The platforms with the faults of their vehicles: the written ones, and one each that is drawn from the seed.

    Raises:
        WrongCall: a text is no fault of a schedule, or of no simulated UAV that is to be started.
    """
    from dyknow.sim_uavs.dynamics.faults import drawn, parse_scheduled

    faults: dict[str, list[str]] = {
        each.unit: [] if seed is None else [str(drawn(seed, each.vehicle.index))]
        for each in configs
        if isinstance(each.vehicle, SimulatedVehicleConfig)
    }
    for text in texts:
        try:
            unit, fault = parse_scheduled(text)
        except TextError as error:
            raise WrongCall(f"--fault: {error.message}; write e.g. {error.repair}.") from None
        if unit not in faults:
            raise WrongCall(f"--fault: no simulated UAV {unit!r} is to be started.{did_you_mean(unit, tuple(faults))}")
        faults[unit].append(str(fault))
    return [
        each.model_copy(update={"vehicle": each.vehicle.model_copy(update={"faults": tuple(faults[each.unit])})})
        if faults.get(each.unit)
        else each
        for each in configs
    ]
