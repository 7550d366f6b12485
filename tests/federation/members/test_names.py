"""Names that strangers and members make up do not push out those who belong to the federation."""

from random import Random

import pytest

from dyknow.federation.keys import heartbeat, token_platform
from dyknow.federation.members.liveness import NAMES, PLATFORMS
from dyknow.federation.messages.codec import Heartbeat, encode_heartbeat
from dyknow.federation.messages.descriptions import LabelEntry
from dyknow.federation.transport import DeclareToken
from tests.agents.rosters import trust
from tests.box import Box, Vehicle
from tests.federation.directories import FEDERATION, Directories


def flood(box: Box, names: list[str], random: Random, *, with_tokens: bool) -> None:
    zid = "abcdef"
    box.wire.open("stranger", zid, lambda _event: None, lambda: box.now_us)
    for number, name in enumerate(names):
        box.put(heartbeat(name), encode_heartbeat(Heartbeat(name, random.randrange(1, 2**40), 1, box.now_us, 1)))
        if with_tokens and number < 300:
            box.wire.perform("stranger", DeclareToken(token_platform(zid, name, "uav", 1)))
        if number % 50 == 0:
            box.run(0.01)
    box.run(0.5)


@pytest.mark.parametrize("seed", range(2))
def test_with_a_roster_only_its_members_names_are_kept(seed: int) -> None:
    box, random = Box(seed), Random(seed)
    box.join("0", Vehicle(), trust=trust("0"))
    box.centre("cc", trust=trust("cc"))
    box.run(2)
    names = [random.choice([f"n{number}", f"cc-{number}", f"uav-{number}"]) for number in range(1500)]
    flood(box, names, random, with_tokens=True)
    directory = box.member("0").directory
    assert len(directory._peers) <= len(trust("0").roster.members) + NAMES
    box.join("1", Vehicle(north_m=500.0), trust=trust("1"))
    box.run(4)
    assert directory.is_present("1")
    assert directory.is_present("cc")
    assert not any(name.startswith("n") for name in directory._peers)


def test_without_a_roster_a_flood_of_names_is_bounded_and_a_platform_still_comes_in() -> None:
    box = Box(1)
    box.join("0", Vehicle())
    box.run(1)
    flood(box, [f"n{number}" for number in range(1500)], Random(1), with_tokens=False)
    box.join("7", Vehicle(north_m=500.0))
    box.run(4)
    directory = box.member("0").directory
    assert len(directory._peers) <= PLATFORMS
    assert directory.is_present("7")


def test_descriptions_that_change_too_often_are_read_at_a_rate_and_the_last_one_in_the_end() -> None:
    box = Directories()
    for unit in ("0", "1"):
        box.enter(unit)
    box.run(2)
    replicas = box.directory("0")._replicas
    for number in range(200):
        box.declare("1", (FEDERATION,), (LabelEntry(label=f"l-{number}", sort="x", type_hash="0" * 8),))
        box.run(0.02)
    assert replicas.refused["descriptions too often"] > 100
    box.run(6)
    entry = box.directory("0").entry("1")
    assert entry is not None
    assert [label.label for label in entry.labels] == ["l-199"]
