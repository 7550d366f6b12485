"""Figures of a platform: read by Prometheus' own parser, equal to what the platform has, and harmless to ask for."""

import socket
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest

from dyknow.federation.messages.codec import decode_samples, encode_samples
from dyknow.federation.transport import Put, Urgency
from dyknow.model.errors import EndpointFailed, UnitError
from dyknow.runtime.mailbox import Mailbox
from dyknow.runtime.metrics import STANDS_US, PlatformMetrics
from tests.box import Box
from tests.console.commands.recordings.encounter import encounter


@pytest.fixture
def world() -> Box:
    found = encounter()
    found.run(9.0)
    return found


@pytest.fixture
def served(world: Box) -> Iterator[PlatformMetrics]:
    pytest.importorskip("prometheus_client", reason="prometheus-client is not installed")
    mailbox = Mailbox(lambda: world.now_us)
    mailbox.post(object())
    journal = cast("Any", SimpleNamespace(lost=3, failed=None))
    found = PlatformMetrics(world.platform("0"), 0, lambda: world.now_us, mailbox, lambda: journal)
    found.start()
    yield found
    found.close()


def asked(served: PlatformMetrics, path: str, method: str = "GET", **headers: str) -> tuple[int, str]:
    request = urllib.request.Request(f"http://127.0.0.1:{served.port}{path}", method=method, headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=10) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as refused:
        return refused.code, refused.read().decode()


def figures(served: PlatformMetrics) -> dict[tuple[str, ...], float]:
    from prometheus_client.parser import text_string_to_metric_families

    code, text = asked(served, "/metrics")
    assert code == 200
    return {
        (sample.name, *(value for name, value in sorted(sample.labels.items()) if name != "unit")): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def test_prometheus_reads_what_the_platform_has(world: Box, served: PlatformMetrics) -> None:
    found = figures(served)
    imports = {name[1]: each for name, each in world.member("0").imports.streams.items()}
    received = found["dyknow_samples_received_total", "heli-position", "1"]
    assert received == imports["heli-position"].stream.account.received > 50
    assert found["dyknow_samples_lost_total", "heli-position", "1"] == 0
    assert found["dyknow_peers", "alive"] == 2
    assert found["dyknow_monitors", "proximity", "alarm"] == 1
    assert found["dyknow_alarms_open", "proximity"] == 1
    assert found["dyknow_acts_total", "in", "accepted"] > 0
    assert found["dyknow_events_waiting",] == 1
    assert found["dyknow_journal_entries_lost_total",] == 3
    world.run(15.0)
    later = figures(served)
    assert later["dyknow_alarms_open", "proximity"] == 0
    assert later["dyknow_samples_received_total", "heli-position", "1"] > received


def test_samples_of_others_that_no_arithmetic_bears_are_counted(world: Box, served: PlatformMetrics) -> None:
    assert ("dyknow_refused_total", "range") not in figures(served)
    (*_, last) = [each.put for each in world.wire.log if each.put.key.startswith("x/1/heli-position/")]
    boot, (*_, newest), *_ = decode_samples(last.payload)
    hostile = newest._replace(seq=newest.seq + 1, value=(1e12, 0.0))
    world.wire.put("1", Put(last.key, encode_samples(boot, [hostile]), Urgency.STREAM))
    world.run(0.3)
    assert figures(served)["dyknow_refused_total", "range"] == 1


def test_a_thread_that_stands_still_is_not_well(world: Box, served: PlatformMetrics) -> None:
    assert asked(served, "/health") == (200, "well\n")
    served._journal = lambda: cast("Any", SimpleNamespace(lost=3, failed="No space left on device"))
    assert asked(served, "/health") == (503, "the journal has ended: No space left on device\n")
    now_us = world.now_us + 2 * STANDS_US
    served._now_us = lambda: now_us
    code, why = asked(served, "/health")
    assert code == 503
    assert "has not stepped for" in why


def test_everything_else_is_refused(served: PlatformMetrics, capfd: pytest.CaptureFixture[str]) -> None:
    for path in ("/", "/metrics/../etc/passwd", "/metrics?x=1", "/%2e%2e"):
        assert asked(served, path)[0] == 404, path
    for method in ("POST", "PUT", "DELETE", "PATCH", "OPTIONS", "HEAD"):
        assert asked(served, "/metrics", method)[0] == 501, method
    for host in ("evil.example", "evil.example:9100", "127.0.0.1.evil.example", ""):
        assert asked(served, "/metrics", Host=host)[0] == 403, host
    with socket.create_connection(("127.0.0.1", served.port), 5) as slow:
        slow.sendall(b"GET /metrics")
        assert asked(served, "/health")[0] == 200, "one that is slow holds up others for two seconds at most"
    with socket.create_connection(("127.0.0.1", served.port), 5) as long:
        long.sendall(b"GET /" + b"x" * 70_000 + b" HTTP/1.1\r\n\r\n")
        assert b"414" in long.recv(100)
    assert asked(served, "/health")[0] == 200
    assert capfd.readouterr().err == "", "the log has no line of it"


def test_a_port_that_is_taken_and_a_missing_library_are_told(
    world: Box, served: PlatformMetrics, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = world.platform("0"), served.port, lambda: 0, Mailbox(lambda: 0), lambda: None
    with pytest.raises(EndpointFailed, match="choose another port"):
        PlatformMetrics(*given)
    monkeypatch.setitem(sys.modules, "prometheus_client", None)
    with pytest.raises(UnitError, match=r"dyknow-federation\[metrics\]"):
        PlatformMetrics(*given)
