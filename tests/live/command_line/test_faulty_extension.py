"""A real process with a part that raises in everything: it stays up, flies, answers, and says that it is impaired."""

import time
from urllib.request import urlopen

import pytest

from tests.live.command_line.command import Dyknow, free_tcp_ports

pytestmark = pytest.mark.live
NAME = "tests.live.command_line.faulty"


def test_a_part_that_raises_in_everything_ends_no_process_and_is_shown(dyknow: Dyknow) -> None:
    port = free_tcp_ports(2)
    options = ("--scenario", "hover", "--extension", NAME, "--metrics", str(port), "--detach")
    [ready] = dyknow.run("up", "2", *options)
    assert ready["event"] == "ready"
    dyknow.until("query", "battery", "--unit", "0", unit=0)
    began_s = time.monotonic()
    while True:
        found = {line["unit"]: line for line in dyknow.run("ls") if "unit" in line}
        said = [each["text"] for unit in (0, 1) for each in found.get(unit, {}).get("conditions", ())]
        if sum("Faulty.fail: RuntimeError: made to fail" in text for text in said) >= 2:
            break
        assert time.monotonic() < began_s + 30, found
    assert [found[unit]["state"] for unit in (0, 1)] == ["alive", "alive"]
    [refused] = dyknow.run("delegate", "fail-here", "--to", "0", "--wait", "--extension", NAME, code=None)
    assert "failed" in str(refused)
    agreed, *_ = dyknow.run("delegate", "hold", "--to", "0", "--wait")
    assert agreed["performative"] == "agree"
    with urlopen(f"http://127.0.0.1:{port}/metrics") as page:
        figures = page.read().decode()
    assert 'dyknow_failures_total{place="Faulty.fail",unit="0"}' in figures
    assert 'dyknow_impaired{out="true",unit="0"} 1.0' in figures
    [down] = dyknow.run("down")
    assert not down.get("ended_before"), down
