"""The page on MAVLink names the messages that are read, and its federation's file is one."""

import re
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.proxies.mavlink.endpoints import parse_endpoint
from dyknow.proxies.mavlink.frames import WANTED
from dyknow.runtime.configuration.settings import load
from tests.docs.pages import DOCS, fences

PAGE = DOCS / "mavlink.md"


def test_it_lists_every_message_that_is_read_and_no_other() -> None:
    section = PAGE.read_text(encoding="utf-8").partition("## Messages that are read")[2].partition("\n## ")[0]
    rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    named = {name for row in rows for name in re.findall(r"`([A-Z_]+)`", row)}
    assert named == {mavlink.mavlink_map[number].msgname for number in WANTED}


def test_its_federation_is_one_whose_vehicles_share_a_process(tmp_path: Path) -> None:
    (fence,) = (each for each in fences(PAGE) if each.language == "toml")
    file = tmp_path / "field.toml"
    file.write_text(fence.text, encoding="utf-8")
    units = load({"federation": str(file)}, None).by_unit
    endpoints = {unit.mavlink for unit in units.values()}
    assert len(units) == 2
    assert len(endpoints) == 1
    assert {unit.sysid for unit in units.values()} == {1, 2}


def test_its_endpoints_can_be_read() -> None:
    section = PAGE.read_text(encoding="utf-8").partition("## Endpoints")[2].partition("\n\n`udp:`")[0]
    found = re.findall(r"\| `([a-z]+:[^`]+)`", section)
    assert [str(parse_endpoint(text)) for text in found] == found
    assert {parse_endpoint(text).kind for text in found} == {"udpin", "udpout", "tcp", "serial"}
