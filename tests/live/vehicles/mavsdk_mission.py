"""Run as a program: MAVSDK flies every vehicle it meets on one port, all at once, and writes what it saw as JSON.

A process of its own, since MAVSDK keeps threads of its own that a test should be able to end.
"""

import asyncio
import json
import sys
import time
from itertools import pairwise
from statistics import median

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mission import MissionAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.exceptions import MavsdkError
from mavsdk.plugins.mission import MissionItem, MissionPlan

ATTEMPTS = 6
ARRIVED_M = 2.0


async def until(stream, holds):
    """The first item of a stream for which `holds`."""
    try:
        async for item in stream:
            if holds(item):
                return item
    finally:
        await stream.aclose()
    raise RuntimeError("the stream ended")


async def insist(ask, *arguments):
    """What a person does on a bad link: ask again. Returns how often it took."""
    for attempt in range(1, ATTEMPTS + 1):
        try:
            await ask(*arguments)
        except MavsdkError as refusal:
            if attempt == ATTEMPTS or "TIMEOUT" not in str(refusal).upper():
                raise
        else:
            return attempt
    raise RuntimeError("unreachable")


def step(report, what):
    """Say how far it came, for the one who reads why it did not come further."""
    print(f"{time.monotonic():.1f} {report['system']} {what}", file=sys.stderr, flush=True)


async def position_rate_hz(telemetry, seconds):
    """Median rate of position updates over so many seconds."""
    arrivals = []
    stream = telemetry.subscribe_position()
    end = time.monotonic() + seconds
    try:
        async for _ in stream:
            arrivals.append(time.monotonic())
            if arrivals[-1] >= end:
                break
    finally:
        await stream.aclose()
    return 1.0 / median(b - a for a, b in pairwise(arrivals))


async def fly(system, take_off_m, seconds, north_deg, speed):
    action, telemetry = ActionAsync(system), TelemetryAsync(system)
    report = {"system": await system.get_system_id(), "autopilot": str(await system.autopilot_type())}
    step(report, "meets it")
    await until(telemetry.subscribe_health_all_ok(), bool)
    step(report, "waits for a position")
    start = await until(telemetry.subscribe_position(), lambda p: p.latitude_deg == p.latitude_deg)
    step(report, "arms")
    await insist(action.set_takeoff_altitude, take_off_m)
    report["arm"] = await insist(action.arm)
    step(report, "takes off")
    report["take_off"] = await insist(action.takeoff)
    step(report, "waits for it to be in the air")
    await until(telemetry.subscribe_in_air(), bool)
    step(report, "waits for the altitude")
    await until(telemetry.subscribe_position(), lambda p: p.relative_altitude_m > take_off_m - 1.0)
    step(report, "sends it north")
    there = (start.latitude_deg + north_deg, start.longitude_deg, start.absolute_altitude_m + take_off_m + 2.0)
    report["go_to"] = await insist(action.goto_location, *there, 0.0)

    def arrived(p):
        return (
            abs(p.latitude_deg - there[0]) * 111_000 < ARRIVED_M and abs(p.absolute_altitude_m - there[2]) < ARRIVED_M
        )

    step(report, "waits for it to arrive")
    await until(telemetry.subscribe_position(), arrived)
    step(report, "counts positions")
    report["rate_hz"] = await position_rate_hz(telemetry, seconds) / speed
    step(report, "lands")
    report["land"] = await insist(action.land)
    step(report, "waits for it to land")
    await until(telemetry.subscribe_in_air(), lambda in_air: not in_air)
    step(report, "waits for it to disarm")
    await until(telemetry.subscribe_armed(), lambda armed: not armed)
    step(report, "is done")
    return report


async def fly_mission(system, take_off_m, seconds, north_deg, speed):
    """Upload two places, read them back, fly them, hold, come home."""
    action, telemetry, mission = ActionAsync(system), TelemetryAsync(system), MissionAsync(system)
    await until(telemetry.subscribe_health_all_ok(), bool)
    start = await until(telemetry.subscribe_position(), lambda p: p.latitude_deg == p.latitude_deg)
    report = {"system": await system.get_system_id(), "parameters": len(await float_parameters(system))}
    items = [
        MissionItem(start.latitude_deg + north_deg * leg, start.longitude_deg, take_off_m, 5.0, is_fly_through=True)
        for leg in (1, 2)
    ]
    await mission.upload_mission(MissionPlan(items))
    report["items"] = len((await mission.download_mission()).mission_items)
    await insist(action.set_takeoff_altitude, take_off_m)
    await action.arm()
    await action.takeoff()
    await until(telemetry.subscribe_position(), lambda p: p.relative_altitude_m > take_off_m - 1.0)
    await mission.start_mission()
    await until(mission.subscribe_mission_progress(), lambda progress: progress.current == progress.total == 2)
    await action.hold()
    end = await until(telemetry.subscribe_position(), bool)
    report["north_deg"] = end.latitude_deg - start.latitude_deg
    await action.return_to_launch()
    await until(telemetry.subscribe_armed(), lambda armed: not armed)
    return report


async def float_parameters(system):
    return (await ParamAsync(system).get_all_params()).float_params


TASKS = {"fly": fly, "mission": fly_mission}


async def main(task, port, count, take_off_m, seconds, north_deg, speed):
    async with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
        appearing = mavsdk.on_new_system()
        first = asyncio.ensure_future(anext(appearing))  # subscribes before anything can appear
        await mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        await first
        while len(systems := [s for s in await mavsdk.get_systems() if await s.has_autopilot()]) < count:
            await anext(appearing)
        reports = await asyncio.gather(*(TASKS[task](s, take_off_m, seconds, north_deg, speed) for s in systems))
    sys.stdout.write(json.dumps(sorted(reports, key=lambda report: report["system"])) + "\n")


if __name__ == "__main__":
    asyncio.run(main(**json.loads(sys.argv[1])))
