"""The lab does what it says, and edges in it find each other again after everything it can do to them."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from queue import Empty, SimpleQueue
from typing import Any

import pytest

from tests.netlab import Lab, lab_of

pytestmark = pytest.mark.live
AGAIN_S = {"dialling": 5.0, "scouting": 12.0}  # Zenoh scouts every 8 s once it has been open for a while
PATIENCE_S = 30.0

SENDER = """
import socket, sys, time
out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
for number in range(int(sys.argv[2])):
    out.sendto(b"%d" % number, (sys.argv[1], 9000))
    if number % 20 == 0:
        time.sleep(0.002)
for _ in range(20):
    out.sendto(b"end", (sys.argv[1], 9001))
    time.sleep(0.005)
"""
RECEIVER = """
import select, socket
data, end = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
data.bind(("0.0.0.0", 9000)); end.bind(("0.0.0.0", 9001))
data.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4_000_000)
print("ready", flush=True)
count = 0
while True:
    for ready in select.select([data, end], [], [], 2.0)[0] or [end]:
        if ready is end:
            while select.select([data], [], [], 0)[0]:
                data.recv(100); count += 1
            print(count, flush=True)
            raise SystemExit
        data.recv(100); count += 1
"""


def received(lab: Lab, src: int, dst: int, count: int) -> int:
    """How many of `count` datagrams from one host arrive at another."""
    receiver = lab.hosts[dst].start([sys.executable, "-c", RECEIVER], stdout=subprocess.PIPE, text=True)
    assert receiver.stdout is not None
    assert receiver.stdout.readline() == "ready\n"
    lab.hosts[src].start([sys.executable, "-c", SENDER, lab.hosts[dst].address, count]).wait(PATIENCE_S)
    return int(receiver.stdout.readline())


@pytest.fixture
def lab() -> Iterator[Lab]:
    with lab_of(3) as found:
        yield found


def test_frames_are_lost_in_the_share_and_the_direction_asked_for(lab: Lab) -> None:
    assert received(lab, 0, 1, 500) == 500
    lab.lose(0.3, src=0, dst=1)
    assert 1250 < received(lab, 0, 1, 2000) < 1550
    assert received(lab, 1, 0, 500) == 500
    lab.lose(0)
    assert received(lab, 0, 1, 500) == 500


def test_cuts_have_a_direction_partitions_have_none_and_both_heal(lab: Lab) -> None:
    received(lab, 0, 1, 10)
    lab.cut(src=0, dst=1)
    assert received(lab, 0, 1, 50) == 0
    assert received(lab, 0, 2, 50) == 50
    lab.partition({0}, {1, 2})
    assert received(lab, 2, 0, 50) == 0
    assert received(lab, 1, 2, 50) == 50
    lab.heal()
    assert received(lab, 0, 1, 50) == 50


def test_a_lab_leaves_nothing_behind() -> None:
    with lab_of(2) as lab:
        process = lab.hosts[0].start(["sleep", "1000"])
        names = [host.namespace for host in lab.hosts]
    assert process.poll() is not None
    listed = subprocess.run(["ip", "netns", "list"], capture_output=True, text=True, check=True).stdout
    assert not any(name in listed for name in names)


class Edges:
    """One edge per host, and what each printed."""

    def __init__(self, lab: Lab, options: Callable[[int], dict[str, Any]]) -> None:
        self.lab, self.lines = lab, SimpleQueue[tuple[int, dict[str, Any]]]()
        self.present: dict[int, set[str]] = {}
        self.beats: dict[tuple[int, str], int] = {}
        self.newest: dict[str, int] = {}
        self.processes = [self._started(number, options(number)) for number in range(len(lab.hosts))]

    def _started(self, number: int, options: dict[str, Any]) -> subprocess.Popen[str]:
        self.present[number] = set()
        said = {"federation": "lab", "interface": "eth0", **options}
        process = self.lab.hosts[number].start(
            [sys.executable, "-m", "tests.live.network.wire_peer", number, json.dumps(said)],
            stdout=subprocess.PIPE,
            text=True,
        )

        def read() -> None:
            assert process.stdout is not None
            for line in process.stdout:
                self.lines.put((number, json.loads(line)))

        threading.Thread(target=read, daemon=True).start()
        return process

    def until(self, enough: Callable[[], bool], wait_s: float = PATIENCE_S) -> float:
        """Seconds until it is enough."""
        began = time.monotonic()
        while not enough():
            left_s = began + wait_s - time.monotonic()
            assert left_s > 0, f"not in {wait_s} s: {self.present} {self.beats}"
            try:
                host, line = self.lines.get(timeout=left_s)
            except Empty:
                continue
            if "token" in line:
                (self.present[host].add if line["alive"] else self.present[host].discard)(line["token"])
            else:
                self.beats[host, line["beat"]] = line["number"]
                self.newest[line["beat"]] = max(self.newest.get(line["beat"], 0), line["number"])
        return time.monotonic() - began

    def everybody_knows(self, *units: int) -> bool:
        return all({str(unit) for unit in units} <= self.present[host] for host in units)

    def everybody_hears(self, *units: int) -> Callable[[], bool]:
        """Each of them heard, of each other one, something newer than anybody has heard by now."""
        known = dict(self.newest)
        return lambda: all(
            self.beats.get((host, str(unit)), 0) > known.get(str(unit), 0)
            for host in units
            for unit in units
            if unit != host
        )


def scouting(_number: int) -> dict[str, Any]:
    return {}


def dialling(lab: Lab) -> Callable[[int], dict[str, Any]]:
    """The higher number dials the lower ones."""
    endpoints = [f"tcp/{host.address}:7447" for host in lab.hosts]
    return lambda number: {
        "listen": endpoints[number : number + 1],
        "connect": endpoints[:number],
        "discover": "none",
        "gossip": False,
    }


@pytest.mark.parametrize("topology", ["scouting", "dialling"])
def test_edges_find_each_other_again_after_a_partition_a_pulled_cable_and_a_one_way_cut(
    lab: Lab, topology: str
) -> None:
    again_s = AGAIN_S[topology]
    edges = Edges(lab, scouting if topology == "scouting" else dialling(lab))
    edges.until(lambda: edges.everybody_knows(0, 1, 2))
    edges.until(edges.everybody_hears(0, 1, 2))

    lab.partition({0}, {1, 2})
    edges.until(lambda: "0" not in edges.present[1] and not {"1", "2"} & edges.present[0])
    edges.until(edges.everybody_hears(1, 2), 1.0)
    lab.heal()
    edges.until(edges.everybody_hears(0, 1, 2), again_s)
    edges.until(lambda: edges.everybody_knows(0, 1, 2), again_s)

    lab.unplug(2)
    edges.until(lambda: "2" not in edges.present[0])
    lab.plug(2)
    edges.until(edges.everybody_hears(0, 1, 2), again_s)
    edges.until(lambda: edges.everybody_knows(0, 1, 2), again_s)

    lab.cut(src=1, dst=0)
    edges.until(lambda: "1" not in edges.present[0])
    lab.heal()
    edges.until(edges.everybody_hears(0, 1, 2), again_s)
    edges.until(lambda: edges.everybody_knows(0, 1, 2), again_s)
