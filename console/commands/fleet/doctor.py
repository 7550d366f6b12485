"""`dyknow doctor`: dependencies that this machine lacks, and how to get them."""

import contextlib
import os
import queue
import re
import shutil
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Annotated, Literal, NamedTuple, TypeAlias

import typer

from dyknow.console.command import Call, command
from dyknow.console.errors import DONE, NO
from dyknow.console.output.shown import Shown, line, styled
from dyknow.console.processes.launch import mavlink_vehicle
from dyknow.model.errors import EndpointFailed, did_you_mean
from dyknow.runtime.configuration.config import EndpointOptions, MavlinkOptions, MavlinkVehicle
from dyknow.runtime.configuration.run_directory import run_directory
from dyknow.runtime.configuration.settings import UnitFile

DISTRIBUTION = "dyknow-federation"
LEAST_MB = 100
OLDEST_PYTHON = (3, 11)
MULTICAST_GROUP = "224.0.0.224"
GROUND_STATION_PORT = 14550
LISTENS_S = 5.0

State: TypeAlias = Literal["ok", "missing", "optional"]


class Finding(NamedTuple):
    """One thing looked at; `optional` is missing but only some jobs need it."""

    finding: str
    state: State
    detail: str
    remedy: str = ""


@command(example="dyknow doctor --mavlink udpin:127.0.0.1:14550")
def doctor(
    call: Call,
    *,
    mavlink: Annotated[
        str | None, typer.Option(metavar="ENDPOINT", help="Also listen here for 5 s: is a vehicle heard, or why not?")
    ] = None,
    sysid: Annotated[int | None, typer.Option(metavar="S", min=1, max=255, help="Which vehicle.")] = None,
    compid: Annotated[int | None, typer.Option(metavar="C", min=0, max=255, help="Which component of it.")] = None,
    signing_key: Annotated[Path | None, typer.Option(metavar="FILE", help="Key of MAVLink 2 signing.")] = None,
) -> int:
    """Missing dependencies of this machine, and how to get them; exit 1 if a required one is missing."""
    findings = list(findings_here())
    if mavlink is not None:
        link = MavlinkOptions(sysid=sysid, compid=compid, signing_key=signing_key)
        own = UnitFile().having(EndpointOptions(mavlink=mavlink), link)
        with call.out.waiting(f"listening at {mavlink}"):
            findings.append(vehicle_heard(mavlink_vehicle(own, place="--mavlink")))
    if call.out.json_lines:
        for found in findings:
            call.out.line(found._asdict())
    else:
        shown = {"ok": "green", "missing": "red", "optional": "yellow"}
        call.out.table(
            "",
            ("", "what", "found"),
            [(styled(f.state, shown[f.state]), f.finding, line(f.detail, _remedy(f.remedy))) for f in findings],
            wraps=("found",),
        )
    return NO if any(found.state == "missing" for found in findings) else DONE


def _remedy(remedy: str) -> Shown:
    return styled(f"\n{remedy}", "bold") if remedy else ""


def findings_here() -> Iterator[Finding]:
    """Every check of this machine, one finding each."""
    yield _python()
    yield from _packages()
    yield from _names()
    yield _space()
    yield _multicast()
    yield _port("tcp", socket.SOCK_STREAM, 0)
    yield _port("udp", socket.SOCK_DGRAM, GROUND_STATION_PORT)
    yield _tool("ip", "iproute2", "network namespaces: tests of loss and partitions", "apt-get install iproute2")
    yield _compose()
    yield from _variables()


def _python() -> Finding:
    version = sys.version_info
    shown = ".".join(str(part) for part in version[:3])
    if version >= OLDEST_PYTHON:
        return Finding("python", "ok", shown)
    return Finding("python", "missing", shown, "install Python 3.11 or newer, then: make clean demo")


def _packages() -> Iterator[Finding]:
    """Each declared dependency, installed and new enough."""
    try:
        wanted = [text for text in metadata.requires(DISTRIBUTION) or [] if "extra ==" not in text]
    except metadata.PackageNotFoundError:
        yield Finding(
            "packages", "missing", f"{DISTRIBUTION} is not installed here", "run: make demo, or pip install -e ."
        )
        return
    lacking = []
    for text in wanted:
        name = re.split(r"[<>=!~\[; ]", text, maxsplit=1)[0]
        least = bound[1] if (bound := re.search(r">=\s*([0-9.]+)", text)) else "0"
        try:
            found = metadata.version(name)
        except metadata.PackageNotFoundError:
            found = ""
        if not found or _numbers(found) < _numbers(least):
            lacking.append(text)
            yield Finding(f"package {name}", "missing", found or "not installed", f"pip install '{text}'")
    if not lacking:
        yield Finding("packages", "ok", f"all {len(wanted)} are here")


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split(".") if part.isdigit())


def _names() -> Iterator[Finding]:
    """Of two distributions with files in one package, each overwrites the other's."""
    others = sorted(set(metadata.packages_distributions().get("dyknow", ())) - {DISTRIBUTION})
    if others:
        yield Finding(
            "package dyknow", "missing", f"another 'dyknow' is in the way: {', '.join(others)}",
            f"pip uninstall {' '.join(others)}, then: pip install --force-reinstall {DISTRIBUTION}",
        )  # fmt: skip
    else:
        yield Finding("our package", "ok", "dyknow is ours")


def _space() -> Finding:
    """Room for the records of platforms: without it they fly on, unrecorded."""
    place = next(path for path in (run_directory("default"), *run_directory("default").parents) if path.exists())
    free_mb = shutil.disk_usage(place).free // 1_000_000
    detail = f"{free_mb} MB at {place}"
    if free_mb >= LEAST_MB:
        return Finding("disk", "ok", detail)
    return Finding("disk", "missing", detail, f"free {LEAST_MB} MB: records and journals are lost on a full disk")


def _multicast() -> Finding:
    """Send one datagram to the scouting group over loopback and receive it."""
    name = "multicast on lo"
    remedy = "use explicit endpoints instead: --listen tcp/127.0.0.1:7447 and --connect tcp/127.0.0.1:7447"
    try:
        with (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as heard,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as said,
        ):
            heard.bind((MULTICAST_GROUP, 0))
            loopback = socket.inet_aton("127.0.0.1")
            heard.setsockopt(
                socket.IPPROTO_IP,
                socket.IP_ADD_MEMBERSHIP,
                struct.pack("4s4s", socket.inet_aton(MULTICAST_GROUP), loopback),
            )
            heard.settimeout(1.0)
            said.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, loopback)
            said.sendto(b"dyknow", (MULTICAST_GROUP, heard.getsockname()[1]))
            heard.recvfrom(64)
    except OSError as error:
        return Finding(name, "missing", f"nothing came back ({error})", remedy)
    return Finding(name, "ok", "platforms on this machine can find each other")


def _port(kind: str, family: int, number: int) -> Finding:
    name = f"{kind} port" + (f" {number}" if number else "s")
    try:
        with socket.socket(socket.AF_INET, family) as probe:
            probe.bind(("127.0.0.1", number))
    except OSError as error:
        if number:
            return Finding(
                name, "optional", f"in use ({error.strerror}), by a ground station perhaps",
                "fine for --gcs; join a vehicle on another port: --mavlink udpin:127.0.0.1:14560",
            )  # fmt: skip
        return Finding(name, "missing", f"cannot listen on 127.0.0.1 ({error.strerror})", "allow listening on loopback")
    return Finding(name, "ok", "can be listened on at 127.0.0.1")


def vehicle_heard(vehicle: MavlinkVehicle, within_s: float = LISTENS_S) -> Finding:
    """Whether a vehicle speaks there, as a platform would hear it; it is asked for its messages, and not commanded."""
    from dyknow.navigation.vehicle import LinkReport, Report
    from dyknow.proxies.mavlink.feed import MavlinkFeed
    from dyknow.proxies.mavlink.port import MavlinkPort
    from dyknow.proxies.mavlink.signing import read_key

    name = f"mavlink {vehicle.endpoint}"
    key = None if vehicle.signing_key is None else read_key(vehicle.signing_key)
    reports: queue.Queue[Report] = queue.Queue()
    try:
        port = MavlinkPort(vehicle.endpoint, key=key)
    except EndpointFailed as error:
        return Finding(name, "missing", str(error), "a platform that has it says in dyknow ls what it hears")
    feed = MavlinkFeed(port, vehicle.sysid, reports.put, lambda: time.time_ns() // 1000, compid=vehicle.compid)
    found, until_s = LinkReport(0, False, f"waiting for a HEARTBEAT at {vehicle.endpoint}"), time.monotonic() + within_s
    feed.start()
    try:
        while not found.ok and (left_s := until_s - time.monotonic()) > 0:
            with contextlib.suppress(queue.Empty):
                report = reports.get(timeout=left_s)
                found = report if isinstance(report, LinkReport) else found
    finally:
        feed.stop()
    remedy = "docs/mavlink.md has the parameters of ArduPilot and PX4, and routers next to a ground station"
    return Finding(name, "ok" if found.ok else "missing", found.text, "" if found.ok else remedy)


def _tool(program: str, package: str, purpose: str, remedy: str) -> Finding:
    found = shutil.which(program)
    return (
        Finding(package, "ok", found)
        if found
        else Finding(package, "optional", f"not here; wanted for {purpose}", remedy)
    )


def _compose() -> Finding:
    name, purpose = "docker compose", "wanted for compose/docker-compose.yml only"
    if not (docker := shutil.which("docker")):
        return Finding(name, "optional", f"not here; {purpose}", "see https://docs.docker.com/engine/install/")
    asked = subprocess.run(  # noqa: S603 - a fixed command
        [docker, "compose", "version", "--short"], capture_output=True, text=True, check=False, timeout=10
    )
    if asked.returncode:
        return Finding(
            name, "optional", f"docker is here, compose is not; {purpose}", "apt-get install docker-compose-plugin"
        )
    return Finding(name, "ok", asked.stdout.strip())


def _variables() -> Iterator[Finding]:
    """`DYKNOW_*` variables that nothing reads are misspelt, most likely."""
    from dyknow.runtime.configuration.settings import VARIABLES

    known = [*VARIABLES.values(), "DYKNOW_CONFIG", "DYKNOW_FULL", "DYKNOW_FLIGHT_DATA", "DYKNOW_SITL"]
    for name in sorted(os.environ):
        if name.startswith("DYKNOW_") and name not in known:
            yield Finding(f"variable {name}", "missing", "nothing reads it", f"unset it.{did_you_mean(name, known)}")
