"""Lossy, pulled and cut networks between real platforms, each in a network namespace of its own."""

from collections import Counter
from collections.abc import Iterator

import pytest

from dyknow.federation.messages.acts import parse_act
from dyknow.federation.messages.contents import ActList, ImportCounts, MonitorEntry
from tests.live.network.fleet import Fleet, Node, Place, ms, report
from tests.netlab import Lab, lab_of

pytestmark = [pytest.mark.live, pytest.mark.timeout(900)]
SECOND_US = 1_000_000
PERIOD_US = 100_000
PORT = 7447
UNDER_WAY = 10  # samples that may be on their way when the account is asked for
UNITS = ["0", "1", "2", "3"]
SIDES = {"0", "1"}, {"2", "3"}
NEAR, FAR = "cc-1", "cc-2"  # observers: one on the side of platform 0, one on the other

Streams = dict[tuple[str, str, str], ImportCounts]


class Network:
    """A federation with a cable for everybody; the higher unit dials the lower, observers dial all."""

    def __init__(self, lab: Lab, fleet: Fleet) -> None:
        self.lab, self.fleet = lab, fleet
        self.hosts = {name: number for number, name in enumerate([*UNITS, NEAR, FAR])}

    def sides(self) -> tuple[set[int], set[int]]:
        return tuple({self.hosts[name] for name in [*side, cc]} for side, cc in zip(SIDES, (NEAR, FAR), strict=True))


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Network]:
    """Four platforms that have found each other and watch their distances."""
    names = [*UNITS, NEAR, FAR]
    with lab_of(len(names)) as lab:

        def place(name: str) -> Place:
            name = name if name in names else NEAR
            host = lab.hosts[names.index(name)]
            dialled = [unit for unit in UNITS if name not in UNITS or int(unit) < int(name)]
            connect = tuple(f"tcp/{lab.hosts[int(unit)].address}:{PORT}" for unit in dialled)
            listen = (f"tcp/{host.address}:{PORT}",) if name in UNITS else ()
            return Place(("ip", "netns", "exec", host.namespace), listen, connect)

        with Fleet(tmp_path_factory.mktemp("fleet"), len(UNITS), place) as fleet:
            fleet.start(*UNITS)
            fleet.complete()
            for observer in (NEAR, FAR):
                fleet.observed(UNITS, observer)
            (asked,) = fleet.ask(["0"], "(monitor-proximity avoidance: false)", "request", lasting=True)
            assert asked.trouble is None, asked
            yield Network(lab, fleet)


@pytest.fixture
def fleet(network: Network) -> Iterator[Fleet]:
    """Whatever a test did before: all are there, and every pair is watched. Afterwards no act was carried out twice."""
    network.fleet.monitors_until(UNITS, all_fresh, 30.0)
    yield network.fleet
    network.lab.heal()
    network.lab.lose(0.0)
    network.lab.plug(network.hosts["2"])
    network.fleet.monitors_until(UNITS, all_fresh, 30.0)
    assert twice(network.fleet) == {}


def all_fresh(found: list[MonitorEntry]) -> bool:
    fresh = {(one.name, one.units) for one in found if one.inputs == "fresh"}
    return len(fresh) == 2 * len(UNITS) * (len(UNITS) - 1)


def twice(fleet: Fleet) -> dict[tuple[str, str, int, int], int]:
    """The acts that a platform took more than once, by (receiver, sender, boot, number)."""
    taken: Counter[tuple[str, str, int, int]] = Counter()
    for heard in fleet.ask(UNITS, "(act-list)"):
        assert heard.trouble is None, heard
        for log in (log for said in heard.contents if isinstance(said, ActList) for log in said.acts or ()):
            if log.direction == "in" and log.outcome != "duplicate" and log.act is not None:
                act = parse_act(log.act)
                taken[heard.unit, act.sender.unit, act.boot, act.seq] += 1
    assert taken
    return {name: count for name, count in taken.items() if count > 1}


def mended(fleet: Fleet, before: Streams, since_us: int) -> str:
    """Wait until every stream has all that was sent; fails where a sample is lost, or does not come."""
    until_us = fleet.now_us() + 15 * SECOND_US
    while True:
        after, sent = fleet.imports(UNITS), (fleet.now_us() - since_us) // PERIOD_US
        came = {name: after[name].received - one.received for name, one in before.items() if name in after}
        gaps = {name: (one.lost, one.missing) for name, one in after.items() if one.lost or one.missing}
        if not gaps and came.keys() == before.keys() and min(came.values()) >= sent - UNDER_WAY:
            recovered = sum(after[name].recovered - one.recovered for name, one in before.items())
            least, most = min(came.values()), max(came.values())
            return f"{len(came)} streams, {least}..{most} of {sent} samples, {recovered} late or asked for"
        ended = before.keys() - after.keys()
        assert fleet.now_us() < until_us, (
            f"of {sent} came {came}, gaps {gaps}, no longer imported: {ended}, {fleet.notes(since_us)}"
        )
        fleet.pause()


def agreed_after(fleet: Fleet, since_us: int, within_s: float) -> dict[str, int]:
    """How long after `since_us` each platform had found all, for good or once more."""
    everybody = set(UNITS)
    fleet.wait(lambda: all(node.found == everybody for node in fleet.nodes.values()), within_s)
    late = {unit: sorted(node.found) for unit, node in fleet.nodes.items() if node.found != everybody}
    assert not late, f"after {within_s} s {late}"
    return {unit: max(0, last_change_us(node) - since_us) for unit, node in fleet.nodes.items()}


def last_change_us(node: Node) -> int:
    return max(line["at_us"] for line in node.lines if line["event"] == "directory")


@pytest.mark.parametrize("lasts_s", [12.0, pytest.param(60.0, marks=pytest.mark.full)])
def test_five_per_cent_of_loss_cost_no_sample_and_no_platform(network: Network, fleet: Fleet, lasts_s: float) -> None:
    before, began_us = fleet.imports(UNITS), fleet.now_us()
    network.lab.lose(0.05)
    fleet.pause(lasts_s)
    lines = [line for node in fleet.nodes.values() for line in node.lines if line["at_us"] > began_us]
    changes = [line for line in lines if line["event"] == "directory" or "session" in line.get("text", "")]
    network.lab.lose(0.0)
    report("5 % loss", lasted=f"{lasts_s} s", streams=mended(fleet, before, began_us), directory_changes=len(changes))
    agreed_after(fleet, fleet.now_us(), 5.0)
    assert changes == [], "nobody seems to come or go"


def test_a_cable_out_for_two_seconds_costs_no_sample(network: Network, fleet: Fleet) -> None:
    before, began_us = fleet.imports(UNITS), fleet.now_us()
    network.lab.unplug(network.hosts["2"])
    fleet.pause(2.0)
    network.lab.plug(network.hosts["2"])
    plugged_us = fleet.now_us()
    agreed = agreed_after(fleet, plugged_us, 20.0)
    report("cable out", agreed_after=ms(agreed.values()), streams=mended(fleet, before, began_us))
    fleet.monitors_until(UNITS, all_fresh, 10.0)
    assert max(agreed.values()) <= 5 * SECOND_US


@pytest.mark.parametrize("lasts_s", [6.0, pytest.param(15.0, marks=pytest.mark.full)])
def test_a_partition_heals_within_five_seconds_and_costs_no_sample(
    network: Network, fleet: Fleet, lasts_s: float
) -> None:
    before, began_us = fleet.imports(UNITS), fleet.now_us()
    network.lab.partition(*network.sides())
    for side, observer in zip(SIDES, (NEAR, FAR), strict=True):
        fleet.seen_after([fleet.nodes[unit] for unit in side], side, began_us, 5.0)
        fleet.monitors_until(sorted(side), lambda found: all_unknown(found, side), 10.0, observer)  # noqa: B023
    fleet.pause(lasts_s - (fleet.now_us() - began_us) / SECOND_US)
    network.lab.heal()
    healed_us = fleet.now_us()
    agreed = agreed_after(fleet, healed_us, 20.0)
    streams = mended(fleet, before, began_us)
    fleet.monitors_until(UNITS, all_fresh, 20.0)
    fresh_us = fleet.now_us() - healed_us
    report("partition", lasted=f"{(healed_us - began_us) / 1e6:.1f} s", agreed_after=ms(agreed.values()))
    report("partition", streams=streams, all_monitors_fresh_after=f"{fresh_us / 1e6:.1f} s")
    assert max(agreed.values()) <= 5 * SECOND_US
    assert tasks(fleet) == 1


def all_unknown(found: list[MonitorEntry], side: set[str]) -> bool:
    """Whether all monitors of one side over the other show that nothing is known."""
    shown = [(one.inputs, one.shows) for one in found if not set(one.units) <= side]
    return shown == [("missing", "unknown")] * (2 * len(side) * (len(UNITS) - len(side)))


def tasks(fleet: Fleet) -> int:
    """How many platforms lead a task of monitoring."""
    return sum(
        "monitor-proximity" in str(said.expr()) for heard in fleet.ask(UNITS, "(tasks)") for said in heard.contents
    )


@pytest.mark.parametrize("lasts_s", [6.0, pytest.param(15.0, marks=pytest.mark.full)])
def test_a_one_way_cut_leaves_nobody_deaf_and_costs_no_sample(network: Network, fleet: Fleet, lasts_s: float) -> None:
    before, began_us = fleet.imports(UNITS), fleet.now_us()
    network.lab.cut(src=network.hosts["0"], dst=network.hosts["1"])
    fleet.wait(lambda: "1" not in fleet.nodes["0"].found and "0" not in fleet.nodes["1"].found, lasts_s)
    found = {unit: sorted(node.found) for unit, node in fleet.nodes.items()}
    pair = of_pair(fleet.monitors_until(["0", "1"], lambda found: len(of_pair(found)) == 2 * 2, 10.0, FAR))
    fleet.pause(lasts_s - (fleet.now_us() - began_us) / SECOND_US)
    network.lab.heal()
    healed_us = fleet.now_us()
    agreed = agreed_after(fleet, healed_us, 30.0)
    streams = mended(fleet, before, began_us)
    fleet.monitors_until(UNITS, all_fresh, 20.0)
    report("one-way cut", lasted=f"{(healed_us - began_us) / 1e6:.1f} s", found=found, agreed_after=ms(agreed.values()))
    report("one-way cut", streams=streams, pair=Counter((one.inputs, one.shows) for one in pair))
    assert {one.shows for one in pair} == {"unknown"}
    assert max(agreed.values()) <= 5 * SECOND_US


def of_pair(found: list[MonitorEntry]) -> list[MonitorEntry]:
    return [one for one in found if set(one.units) == {"0", "1"}]
