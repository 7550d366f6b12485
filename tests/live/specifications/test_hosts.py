"""Hosts as operating system processes: killed, frozen, started again; and what a person meets who starts one."""

import os
import signal
import socket
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from dyknow import Sample
from dyknow.federation.hosts.codec import encode
from dyknow.federation.hosts.messages import Register, UnitOffer
from dyknow.proxies.hosts.connection import connect
from tests.live.command_line.command import Dyknow, lines
from tests.live.specifications.hosting import UNITS, Node

pytestmark = pytest.mark.live
SIZES = [pytest.param(10, id="tenth"), pytest.param(100, id="bar", marks=pytest.mark.full)]


def door(dyknow: Dyknow) -> Path:
    return dyknow.directory / "dyknow" / dyknow.federation / "0.hosts"


def module(dyknow: Dyknow, text: str, name: str = "units.py") -> str:
    path = dyknow.directory / name
    path.write_text(text)
    return str(path)


def made(count: int) -> tuple[str, str, list[str]]:
    """A module with so many streams, half of them of units; the specification; the streams' names."""
    sources = count // 2
    text = UNITS.format(sources=sources, units=count - sources, period_us=50_000)
    units = range(count - sources)
    spec = "source number raw\nstrmgen raw = raw\n" + "".join(
        f"compunit number u{i}(number)\nstrmgen made[{i}] = u{i}(raw)\nstream out{i} = made[{i}]\n" for i in units
    )
    return text, spec, [*(f"out{i}" for i in units), *(f"ticks[{i}]" for i in range(sources))]


def sets_up(dyknow: Dyknow, count: int, own: int) -> tuple[Node, str, list[str]]:
    text, spec, names = made(count)
    node = Node(door(dyknow), own, spec)
    for name in names:
        if name.startswith("ticks"):
            node.connect(name)
    return node, module(dyknow, text), names


def flows(node: Node, names: list[str]) -> bool:
    return all(len(node.samples.get(name, ())) >= 5 for name in names)


def nothing_was_lost(node: Node) -> None:
    """The streams that no host makes: every number, and no later than a machine with other work may make them."""
    for label in node.own:
        samples = node.samples[str(label)]
        assert [each.value for each in samples] == list(range(1, len(samples) + 1))
        delays_us = sorted(each.delay_us for each in samples)
        assert delays_us[len(delays_us) * 9 // 10] < 500_000
        assert delays_us[-1] < 2_000_000


@pytest.mark.parametrize("count", SIZES)
def test_a_host_is_killed_and_started_again_under_many_streams(dyknow: Dyknow, count: int) -> None:
    node, path, names = sets_up(dyknow, count, count)
    try:
        first = dyknow.start("host", path, "--unit", "0", "--json")
        node.until(lambda: flows(node, names))
        os.kill(first.pid, signal.SIGKILL)
        node.until(lambda: all(node.links[name][-1] is False for name in names), within_s=2.0)
        node.samples = {name: found for name, found in node.samples.items() if name.startswith("own")}
        node.step_for(0.5)
        assert not [name for name in names if name in node.samples]
        dyknow.start("host", path, "--unit", "0", "--json")
        node.until(lambda: flows(node, names))
        assert {tuple(node.links[name]) for name in names} <= {(False, True, False, True), (True, False, True)}
        nothing_was_lost(node)
        assert [note for note in node.notes if "gone" in note]
    finally:
        node.close()


def test_a_frozen_host_is_missed_and_taken_back(dyknow: Dyknow) -> None:
    node, path, names = sets_up(dyknow, 10, 10)
    try:
        host = dyknow.start("host", path, "--unit", "0", "--json")
        node.until(lambda: flows(node, names))
        os.kill(host.pid, signal.SIGSTOP)
        try:
            node.until(lambda: all(node.links[name][-1] is False for name in names), within_s=4.0)
            node.samples = {name: found for name, found in node.samples.items() if name.startswith("own")}
        finally:
            os.kill(host.pid, signal.SIGCONT)
        node.until(lambda: flows(node, names))
        nothing_was_lost(node)
    finally:
        node.close()


def test_a_host_waits_for_its_platform_and_registers_again(dyknow: Dyknow) -> None:
    node, path, names = sets_up(dyknow, 4, 0)
    host = dyknow.start("host", path, "--unit", "0", "--json")
    said = lines(host)
    node.until(lambda: flows(node, names))
    registered = next(said)
    assert registered == {"event": "registered", "prototypes": ["u0", "u1"], "labels": ["ticks[0]", "ticks[1]"]}
    node.close()
    assert next(said) == {"event": "lost"}
    again, _path, names = sets_up(dyknow, 4, 0)
    try:
        again.until(lambda: flows(again, names))
        assert next(said) == registered
    finally:
        again.close()


def test_who_registers_and_never_reads_stalls_nobody(dyknow: Dyknow) -> None:
    spec = "source number raw\nstrmgen raw = raw\ncompunit number slow(number)\nstrmgen s = slow(raw)\nstream out = s\n"
    node = Node(door(dyknow), 5, spec)
    try:
        with connect(door(dyknow)) as idle:
            idle.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            offer = UnitOffer("slow", "number", ("number",), False, 0, "", 0)
            said = encode(Register(1, "idle", False, (offer,), ()))
            idle.sendall(len(said).to_bytes(4) + said)
            node.until(lambda: node.links.get("out") == [True])
            for number in range(15_000):
                node.instance.push("raw", Sample(node.clock.now_us(), node.clock.now_us(), number))
                if number % 1000 == 0:
                    node.step_for(0.001)
            (host,) = node.desk.hosts
            assert host.dropped > 10_000
            node.until(lambda: node.links["out"] == [True, False], within_s=5.0)
        node.until(lambda: not node.desk.hosts)
        nothing_was_lost(node)
    finally:
        node.close()


SENSOR = """
print("a module that talks")
from dyknow import source, value_unit

@source("line", label="line[self]")
def sensor(_from_us):
    with open({fifo!r}) as pipe:
        for line in pipe:
            yield None, line.strip()

@value_unit("number", "line")
def length(line):
    if line == "wrong":
        raise RuntimeError("no such line")
    print("a unit that talks", flush=True)
    return len(line)
"""


def test_a_sensor_may_be_waited_for_and_what_is_wrong_is_told_on_both_sides(dyknow: Dyknow) -> None:
    fifo = dyknow.directory / "sensor"
    os.mkfifo(fifo)
    node = Node(door(dyknow), 5)
    try:
        host = dyknow.start("host", module(dyknow, SENSOR.format(fifo=str(fifo))), "--unit", "0", "--json")
        node.until(lambda: bool(node.desk.hosts))
        said = lines(host)
        next(said)
        spec = "compunit number length(line)\nstrmgen l = length(line[0])\nstream out = l\n"
        from dyknow.kpl import parse_specification

        node.instance.change(parse_specification(spec), node.clock.now_us(), spec)
        node.step_for(0.1)
        with fifo.open("w") as pipe:
            for line in ("a", "wrong", "abc"):
                print(line, file=pipe, flush=True)
                before = node.clock.now_us()
                node.step_for(0.1)
            node.until(lambda: len(node.samples.get("out", ())) == 2)
        first, last = node.samples["out"]
        assert (first.value, last.value) == (1, 3)
        assert before - 50_000 <= last.valid_us <= last.available_us
        fault = next(said)
        assert (fault["event"], fault["label"]) == ("fault", "l")
        assert "RuntimeError" in fault["said"]
        assert any("RuntimeError" in note for note in node.notes)
        nothing_was_lost(node)
    finally:
        node.close()


def test_priorities_decide_who_is_first_when_there_is_too_much_to_do(dyknow: Dyknow) -> None:
    text = """
import time
from dyknow import value_unit

def busy(value):
    time.sleep(0.2)
    return value

urgent = value_unit("number", "number", name="urgent", priority=5)(lambda value: value)
heavy = value_unit("number", "number", name="heavy")(lambda value: busy(value))
"""
    spec = (
        "source number raw\nstrmgen raw = raw\ncompunit number urgent(number)\ncompunit number heavy(number)\n"
        "strmgen h = heavy(raw)\nstrmgen u = urgent(raw)\nstream outh = h\nstream outu = u\n"
    )
    node = Node(door(dyknow), 0, spec)
    try:
        dyknow.start("host", module(dyknow, text), "--unit", "0")
        node.until(lambda: "outh" in node.samples and node.samples["outh"][-1].delay_us > 1_500_000)
        assert len(node.samples["outh"]) < len(node.samples["outu"])
        assert max(each.delay_us for each in node.samples["outu"][-5:]) < 1_000_000
    finally:
        node.close()


CHAIN = """
from dyknow import value_unit
first = value_unit("number", "number", name="first")(lambda value: 2 * value)
second = value_unit("number", "number", name="second")(lambda value: value + 1)
third = value_unit("number", "number", name="third")(lambda value: -value)
"""


@pytest.mark.parametrize("options", [(), ("--train",), ("--batch", "4"), ("--batch", "4", "--train")], ids=" ".join)
def test_however_it_takes_turns_a_host_makes_the_same(dyknow: Dyknow, options: tuple[str, ...]) -> None:
    spec = (
        "source number raw\ncompunit number first(number)\ncompunit number second(number)\ncompunit number third(number)\n"
        "strmgen raw = raw\nstrmgen a = first(raw)\nstrmgen b = second(a)\nstrmgen c = third(b)\n"
        "stream middle = b\nstream out = c\n"
    )
    node = Node(door(dyknow), 0, spec)
    try:
        dyknow.start("host", module(dyknow, CHAIN), "--unit", "0", *options)
        node.until(lambda: len(node.samples.get("out", ())) >= 8)
        middle = [each.value for each in node.samples["middle"]]
        assert middle == list(range(middle[0], middle[0] + 2 * len(middle), 2))
        out = [each.value for each in node.samples["out"]]
        assert out == [-each for each in middle[: len(out)]]
    finally:
        node.close()


def refused(dyknow: Dyknow, *arguments: str, code: int = 2) -> str:
    out, err = dyknow.raw("host", *arguments, code=code)
    assert not out
    return err


def test_each_mistake_is_told_with_its_remedy(dyknow: Dyknow) -> None:
    path = module(dyknow, "from dyknow import value_unit\n@value_unit('n', 'n')\ndef twice(n):\n    return 2 * n\n")
    assert "no such file" in refused(dyknow, "nothere.py", "--unit", "0")
    assert "there is no module" in refused(dyknow, "no.such.module", "--unit", "0")
    assert "@value_unit" in refused(dyknow, module(dyknow, "x = 1\n", "empty.py"), "--unit", "0")
    assert "broken.py:2" in refused(dyknow, module(dyknow, "x = 1\n1 / 0\n", "broken.py"), "--unit", "0")
    absent = refused(dyknow, path, "--unit", "7", code=1)
    assert "no platform 7" in absent
    assert "dyknow join --unit 7" in absent
    bad = module(dyknow, "from dyknow import value_unit\nf = value_unit('n', 'n', name='a b')(lambda n: n)\n", "bad.py")
    node = Node(door(dyknow))
    try:
        assert "running here: 0" in refused(dyknow, path, "--unit", "7", code=1)
        assert "cannot be registered" in refused(dyknow, bad, "--unit", "0")
        first = dyknow.start("host", path, "--unit", "0", "--json")
        node.until(lambda: bool(node.desk.hosts))
        assert next(lines(first))["prototypes"] == ["twice"]
        second = dyknow.start("host", path, "--unit", "0")
        node.until(lambda: second.poll() is not None)
        assert second.returncode == 2
        assert second.stderr is not None
        assert f"'twice' is offered by host {first.pid} (units.py) already" in second.stderr.read()
        first.send_signal(signal.SIGINT)
        node.until(lambda: first.poll() is not None)
        assert first.returncode == 130
        node.until(lambda: not node.desk.hosts)
    finally:
        node.close()


def test_only_the_own_user_may_come_in(dyknow: Dyknow) -> None:
    from dyknow.model.errors import EndpointFailed
    from dyknow.proxies.hosts.connection import listen

    path = door(dyknow)
    listen(path).close()
    assert path.stat().st_mode & 0o777 == 0o600
    assert path.parent.stat().st_mode & 0o777 == 0o700
    with (
        listen(path),
        pytest.raises(EndpointFailed, match="another platform"),
    ):  # the one that was closed left it behind
        listen(path)
    path.parent.chmod(0o755)
    with pytest.raises(EndpointFailed, match="chmod 700"):
        listen(path)


def test_a_door_far_down_in_the_directories_opens(tmp_path: Path) -> None:
    from dyknow.proxies.hosts.connection import listen

    path = tmp_path.joinpath(*["d" * 60] * 3) / "0.hosts"
    with listen(path) as opened, connect(path) as client:
        accepted, _ = opened.accept()
        with accepted:
            client.sendall(b"x")
            assert accepted.recv(1) == b"x"


TWICE = "from dyknow import value_unit\n@value_unit('number', 'number')\ndef twice(n):\n    return 2 * n\n"
SPEC = """source number raw
compunit number twice(number)
strmgen raw = raw
strmgen t = twice(raw)
stream out = t
stream own = raw
"""


def test_a_platform_takes_a_host(dyknow: Dyknow) -> None:
    """All of it: `dyknow join` with a specification, `dyknow host`, killed and started again."""
    spec, feed = module(dyknow, SPEC, "mission.kpl"), dyknow.directory / "feed.jsonl"
    feed.write_text("".join(f'{{"t_ms": {100 * n}, "raw": {n}}}\n' for n in range(1, 600)))
    path = module(dyknow, TWICE)
    said = lines(dyknow.start("join", "--unit", "0", "--spec", spec, "--feed", str(feed), "--json"))
    own: list[float] = []

    def until(**wanted: object) -> dict[str, Any]:
        for line in said:
            if line.get("stream") == "own" and line["event"] == "sample":
                own.append(line["value"])
            if all(line.get(name) == value for name, value in wanted.items()):
                return line
        raise AssertionError(f"never {wanted}")

    until(event="sample", stream="own")
    host = dyknow.start("host", path, "--unit", "0")
    until(event="stream", stream="out", linked=True)
    before = until(event="sample", stream="out")
    assert before["value"] % 2 == 0
    host.kill()
    until(event="stream", stream="out", linked=False)
    dyknow.start("host", path, "--unit", "0")
    until(event="stream", stream="out", linked=True)
    assert until(event="sample", stream="out")["value"] > before["value"]
    assert all(later - earlier == 1 for earlier, later in pairwise(own))


def test_a_platform_waits_for_the_host_whose_own_stream_it_lives_on(dyknow: Dyknow) -> None:
    """Without a vehicle it has nothing else to do, and is there for the host to register at."""
    spec = module(dyknow, "stream seen = cam[self]\n", "seen.kpl")
    path = module(
        dyknow,
        "import itertools\nfrom dyknow import source\n\n"
        '@source("picture", label="cam[self]")\n'
        "def cam(now_us):\n    for i in itertools.count():\n        yield now_us + 100_000 * i, i\n",
        "cam.py",
    )
    said = lines(dyknow.start("join", "--unit", "0", "--spec", spec, "--json"))
    assert next(each for each in said if each["event"] == "joined")
    dyknow.start("host", path, "--unit", "0")
    assert next(each for each in said if each.get("stream") == "seen" and each["event"] == "sample")["value"] >= 0
