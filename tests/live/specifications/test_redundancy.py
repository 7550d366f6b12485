"""A stream with producers on two platforms: when the active one is killed the other takes over, which is reported."""

from pathlib import Path

import pytest

from tests.live.command_line.command import Dyknow, lines

pytestmark = pytest.mark.live
EXAMPLES = Path(__file__).parents[3] / "examples" / "labels"
EITHER = """
import gas-level from 7 as gas[a] with sample every 500, max delay 500
import gas-level from 8 as gas[b] with sample every 500, max delay 500
strmgen best = first of gas[a] with sample every 500, max delay 500, gas[b] with sample every 500, max delay 500
stream gas = best
stream who = producer[best]
"""


def test_a_platform_that_is_killed_is_replaced_by_the_other_until_it_is_back(dyknow: Dyknow, tmp_path: Path) -> None:
    spec = tmp_path / "either.kpl"
    spec.write_text(EITHER, encoding="utf-8")
    sniffs = ("--spec", str(EXAMPLES / "gas.kpl"), "--units", str(EXAMPLES / "sniffer.py"), "--json")
    first, *others = (dyknow.start("join", "--unit", unit, *sniffs) for unit in ("7", "8", "6"))
    for platform in (first, *others):
        assert next(line for line in lines(platform) if line["event"] == "specified")
    receiver = lines(
        dyknow.start("join", "--unit", "9", "--spec", str(spec), "--ontology", str(EXAMPLES / "gas.toml"), "--json")
    )
    assert next(line["of"] for line in receiver if line.get("stream") == "gas" and line["event"] == "sample")

    def until_from(producer: str) -> list[str]:
        """The reported producers, up to this one and its first sample."""
        told = []
        for line in receiver:
            if line["event"] == "producer":
                told.append(line["of"])
            if line.get("stream") == "gas" and line["event"] == "sample" and line["of"] == producer:
                return told
        raise AssertionError("the platform has ended")

    until_from("gas[a]")
    first.kill()
    assert until_from("gas[b]")[-1] == "gas[b]"
    [graph] = dyknow.run("kpl", "graph", "--unit", "9")
    [node] = [each for each in graph["nodes"] if each["name"] == "best"]
    assert (node["kind"], node["note"]) == ("first of", ["from gas[b]; silent: gas[a]"])
    [asked] = dyknow.run("query", "producer[best]", "--unit", "9")
    assert asked["value"]["value"] == "gas[b]"
    dyknow.start("join", "--unit", "7", *sniffs)
    assert until_from("gas[a]")[-1] == "gas[a]"
