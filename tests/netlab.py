"""Machines that are network namespaces on one switch, whose cables a test can cut, unplug and make lossy.

    with lab_of(3) as lab:
        process = lab.hosts[0].start([sys.executable, "-m", "dyknow.runtime.node"])
        lab.lose(0.05)                   # 5 % of all frames
        lab.cut(src=0, dst=1)            # what 0 sends to 1 is lost; what 1 sends arrives
        lab.partition({0, 1}, {2})
        lab.heal()
        lab.unplug(2); lab.plug(2)

Every host has `eth0` with an address, loopback, and a route for multicast; none has a way out. Frames are dropped where
the switch hands them to the receiving host, by a classic BPF program that looks at the sender's hardware address: this
needs neither netem nor nftables. Needs Linux, root, `ip` and `tc`; where they are not, `lab_of` skips the test.
"""

import contextlib
import os
import re
import shutil
import subprocess
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pytest

_PREFIX = "dyk"
_SUBNET = "10.83.0"
_MAC = "02:64:79:6b:00"
_END_S = 10.0

Pair = tuple[int, int]


class LabFailed(Exception):
    """A command of the lab did not work."""


def _command(*words: object) -> str:
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False)
    if done.returncode:
        raise LabFailed(f"{' '.join(map(str, words))}: {done.stderr.strip()}")
    return done.stdout


@cache
def why_not() -> str | None:
    """Why there can be no lab here, or None: found by building the smallest one."""
    missing = [tool for tool in ("ip", "tc") if shutil.which(tool) is None]
    if os.geteuid() or missing:
        return "network namespaces need root" if os.geteuid() else f"{' and '.join(missing)} not installed (iproute2)"
    try:
        with Lab(2, name="try") as lab:
            lab.lose(0.5)
    except LabFailed as failed:
        return f"no network namespaces here: {failed}"
    return None


def lab_of(size: int) -> "Lab":
    """A lab, or the test is skipped with the reason."""
    reason = why_not()
    if reason:
        pytest.skip(reason)
    return Lab(size)


@dataclass
class Host:
    namespace: str
    address: str
    started: list[subprocess.Popen[Any]] = field(default_factory=list)

    def start(self, argv: Sequence[object], **options: Any) -> subprocess.Popen[Any]:
        """Run a command here; its process id is the command's own, so that signals reach it."""
        words = ["ip", "netns", "exec", self.namespace, *map(str, argv)]
        self.started.append(subprocess.Popen(words, **options))
        return self.started[-1]


class Lab:
    """`size` hosts; close it, or use it in a `with`, and everything it made and started is gone."""

    def __init__(self, size: int, name: str = "lab") -> None:
        _forget_the_dead()
        self._stem = f"{_PREFIX}-{os.getpid()}-{name}"
        self._switch = f"{self._stem}-sw"
        self._lost: dict[Pair, float] = {}
        self._cut: set[Pair] = set()
        self.hosts = [Host(f"{self._stem}-{i}", f"{_SUBNET}.{i + 1}") for i in range(size)]
        try:
            self._build()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End what was started here, then take the network away."""
        for host in self.hosts:
            for process in host.started:
                process.kill()
                process.wait(_END_S)
        for namespace in (self._switch, *(host.namespace for host in self.hosts)):
            with contextlib.suppress(LabFailed):
                _command("ip", "netns", "del", namespace)

    def lose(self, share: float, *, src: int | None = None, dst: int | None = None) -> None:
        """Lose that share of the frames from `src` to `dst`, None being every host; 0 loses none."""
        for pair in self._pairs(src, dst):
            self._lost[pair] = share
        self._apply()

    def cut(self, *, src: int, dst: int) -> None:
        """Lose everything in one direction."""
        self._cut.add((src, dst))
        self._apply()

    def partition(self, *groups: Iterable[int]) -> None:
        """Only hosts of one group reach each other; those that no group names are one more."""
        named = [set(group) for group in groups]
        rest = set(range(len(self.hosts))) - set[int]().union(*named)
        together = [*named, rest]
        self._cut = {pair for pair in self._pairs() if not any(set(pair) <= group for group in together)}
        self._apply()

    def heal(self) -> None:
        """End cuts and partitions; loss stays."""
        self._cut.clear()
        self._apply()

    def unplug(self, host: int) -> None:
        """Pull the cable: the host loses its carrier and keeps its address."""
        _command("ip", "-n", self._switch, "link", "set", f"port{host}", "down")

    def plug(self, host: int) -> None:
        _command("ip", "-n", self._switch, "link", "set", f"port{host}", "up")

    def _pairs(self, src: int | None = None, dst: int | None = None) -> list[Pair]:
        every = range(len(self.hosts))
        senders, receivers = (every if src is None else [src]), (every if dst is None else [dst])
        return [(a, b) for a in senders for b in receivers if a != b]

    def _build(self) -> None:
        _command("ip", "netns", "add", self._switch)
        _command(
            "ip", "-n", self._switch, "link", "add", "switch", "type", "bridge", "mcast_snooping", 0, "stp_state", 0
        )
        _command("ip", "-n", self._switch, "link", "set", "switch", "up")
        for number, host in enumerate(self.hosts):
            port, inside = f"port{number}", ("ip", "-n", host.namespace)
            _command("ip", "netns", "add", host.namespace)
            cable = ("link", "add", port, "type", "veth", "peer", "name", "eth0", "netns", host.namespace)
            _command("ip", "-n", self._switch, *cable)
            _command("ip", "-n", self._switch, "link", "set", port, "master", "switch", "up")
            _command("tc", "-n", self._switch, "qdisc", "add", "dev", port, "clsact")
            _command(*inside, "link", "set", "lo", "up")
            _command(*inside, "link", "set", "eth0", "address", f"{_MAC}:{number:02x}", "up")
            _command(*inside, "address", "add", f"{host.address}/24", "dev", "eth0")
            _command(*inside, "route", "add", "224.0.0.0/4", "dev", "eth0")

    def _apply(self) -> None:
        """Give every port the program for what its host is to lose."""
        for receiver in range(len(self.hosts)):
            shares = {
                sender: 1.0 if (sender, receiver) in self._cut else self._lost.get((sender, receiver), 0.0)
                for sender in range(len(self.hosts))
                if sender != receiver
            }
            program = _dropping({sender: share for sender, share in shares.items() if share})
            where = ("dev", f"port{receiver}", "egress", "protocol", "all", "prio", 1, "handle", 1)
            _command("tc", "-n", self._switch, "filter", "replace", *where, "bpf", "da", "bytecode", program)


def _dropping(shares: dict[int, float]) -> str:
    """A program of classic BPF, as `tc` takes it: drop that share of the frames of each sender.

    Instructions are (opcode, jump if true, jump if false, operand); jumps count instructions to pass over.
    """
    load_half, load_word, if_equal, if_at_least, verdict = 0x28, 0x20, 0x15, 0x35, 0x06
    random_word, drop, deliver = 0xFFFFF038, 2, 0xFFFFFFFF
    last_byte_of_sender, any_number = 10, 2**32
    code = [(load_half, 0, 0, last_byte_of_sender)]
    for sender, share in sorted(shares.items()):
        if share >= 1:
            code += [(if_equal, 0, 1, sender), (verdict, 0, 0, drop)]
        else:
            code += [
                (if_equal, 0, 4, sender),
                (load_word, 0, 0, random_word),
                (if_at_least, 1, 0, int(share * any_number)),
                (verdict, 0, 0, drop),
                (verdict, 0, 0, deliver),
            ]
    code.append((verdict, 0, 0, deliver))
    return ",".join([str(len(code)), *(" ".join(map(str, instruction)) for instruction in code)])


def _forget_the_dead() -> None:
    """Take away the networks of test runs that were killed."""
    with contextlib.suppress(LabFailed, FileNotFoundError):
        for namespace, owner in re.findall(rf"^({_PREFIX}-(\d+)-\S+)", _command("ip", "netns", "list"), re.MULTILINE):
            if not Path(f"/proc/{owner}").exists():
                with contextlib.suppress(LabFailed):
                    _command("ip", "netns", "del", namespace)
