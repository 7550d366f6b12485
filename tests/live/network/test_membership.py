"""Who comes, goes, crashes and stands still, among real processes on one host (positions at 10 Hz, one delegated task)."""

from collections.abc import Iterator
from itertools import pairwise

import pytest

from dyknow.federation.messages.contents import ImportCounts, MonitorEntry, Reading, Samples
from tests.live.network.fleet import Fleet, Heard, ms, report

pytestmark = [pytest.mark.live, pytest.mark.timeout(600)]
SECOND_US = 1_000_000
PERIOD_US, MAX_DELAY_US = 100_000, 500_000
LABELS = 3  # position, altitude, velocity: what the two monitors of the task need
MONITORS = 2  # proximity and its warning
LEADER = "0"


@pytest.fixture(
    scope="module",
    params=[4, pytest.param(8, marks=pytest.mark.full)],
    ids=lambda size: f"{size} platforms",
)
def started(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fleet]:
    """Platforms that have found each other and watch their distances."""
    units = [str(number) for number in range(request.param)]
    with Fleet(tmp_path_factory.mktemp("fleet"), request.param + 1) as made:
        made.start(*units)
        made.complete()
        made.observed(units)
        (asked,) = made.ask([LEADER], "(monitor-proximity avoidance: false)", "request", lasting=True)
        assert asked.trouble is None, asked
        yield made


@pytest.fixture
def fleet(started: Fleet) -> Fleet:
    """The same platforms for all tests of a size; whatever a test did before, they are all there and watch."""
    units = list(started.nodes)
    started.monitors_until(units, lambda found: all_fresh(found, units), 20.0)
    return started


def all_fresh(found: list[MonitorEntry], units: list[str]) -> bool:
    """Every pair is watched from both sides, with all that is needed."""
    pairs = {(one.name, one.by, other) for one in found if one.inputs == "fresh" for other in one.units[1:]}
    return len(pairs) == MONITORS * len(units) * (len(units) - 1)


def grown(
    before: dict[tuple[str, str, str], ImportCounts], after: dict[tuple[str, str, str], ImportCounts]
) -> list[int]:
    """How many samples of each stream came meanwhile; fails where a number is lost or missing."""
    assert before, "no streams"
    assert {name: (one.lost, one.missing) for name, one in after.items() if one.lost or one.missing} == {}
    return [after[name].received - one.received for name, one in before.items()]


def settled(fleet: Fleet, units: list[str]) -> dict[tuple[str, str, str], ImportCounts]:
    """The streams when no sample is under way or being asked for again, at the latest after five seconds."""
    until_us = fleet.now_us() + 5 * SECOND_US
    found = fleet.imports(units)
    while any(one.missing for one in found.values()) and fleet.now_us() < until_us:
        fleet.pause()
        found = fleet.imports(units)
    return found


def test_a_silenced_input_is_seen_and_its_return_too(fleet: Fleet) -> None:
    units = list(fleet.nodes)
    silenced = units[1]
    began_us = fleet.now_us()
    (told,) = fleet.ask([silenced], "(fault kind: silence duration: 5.0)", "request")
    assert told.trouble is None, told

    def until(state: str) -> list[MonitorEntry]:
        """The monitors of everybody over the silenced one, when all are in that state."""

        def about(found: list[MonitorEntry]) -> list[MonitorEntry]:
            return [one for one in found if silenced in one.units]

        def all_so(found: list[MonitorEntry]) -> bool:
            return [one.inputs for one in about(found)] == [state] * (2 * MONITORS * (len(units) - 1))

        return about(fleet.monitors_until(units, all_so, 15.0))

    stale, missing, fresh = until("stale"), until("missing"), until("fresh")
    last_us, first_us = silence(fleet, silenced, began_us)
    stale_us = [since(one) - (last_us + PERIOD_US) for one in stale]
    missing_us = [since(one) - (last_us + PERIOD_US) for one in missing]
    fresh_us = [since(one) - first_us for one in fresh]
    report("silence", lasted=f"{(first_us - last_us) / 1e6:.1f} s", monitors=len(stale), stale_after=ms(stale_us))
    report("silence", missing_after=ms(missing_us), fresh_after_return=ms(fresh_us))
    assert {one.shows for one in stale + missing} == {"unknown"}
    assert {"heli-position" in " ".join(one.which) for one in stale + missing} == {True}
    assert max(stale_us) <= MAX_DELAY_US + PERIOD_US
    assert max(missing_us) - max(stale_us) <= 2 * SECOND_US
    assert max(fresh_us) <= 2 * PERIOD_US


def since(one: MonitorEntry) -> int:
    assert one.since_us is not None
    return one.since_us


def silence(fleet: Fleet, unit: str, from_us: int) -> tuple[int, int]:
    """Valid times of the last sample before the longest pause of a platform's position, and of the first after it."""
    (heard,) = fleet.ask(
        [unit], f"(query semantic-label: heli-position op: between from: {from_us} to: {fleet.now_us()})"
    )
    times = [reading.valid_us for said in heard.contents if isinstance(said, Samples) for reading in said.samples]
    return max(pairwise(times), key=lambda pair: pair[1] - pair[0])


def test_a_latecomer_is_known_within_a_second_and_watched_within_another(fleet: Fleet) -> None:
    units = list(fleet.nodes)
    newcomer = str(len(units))
    fleet.start(newcomer)
    everybody = [*units, newcomer]
    assert fleet.wait(lambda: fleet.nodes[newcomer].joined_us is not None)
    joined_us = fleet.nodes[newcomer].joined_us
    assert joined_us is not None
    known = fleet.seen_after(fleet.nodes.values(), everybody, 0, 20.0)
    known = {unit: at_us - joined_us for unit, at_us in known.items()}
    found = fleet.monitors_until(everybody, lambda found: all_fresh(found, everybody), 20.0)
    about = [one for one in found if newcomer in one.units]
    fresh = [one.since_us - joined_us for one in about if one.since_us is not None]
    report("latecomer", known_to_all_after=ms(known.values()), monitors_fresh_after=ms(fresh), monitors=len(about))
    assert fleet.ls() == dict.fromkeys(everybody, "alive")
    assert max(known.values()) <= SECOND_US
    assert max(fresh) <= 2 * SECOND_US


def test_one_frozen_platform_delays_no_answer_of_the_others_and_is_named(fleet: Fleet) -> None:
    units = list(fleet.nodes)
    frozen, others = units[2], {unit for unit in units if unit != units[2]}
    at_us = fleet.now_us() // PERIOD_US * PERIOD_US - 3 * PERIOD_US
    with fleet.frozen(frozen):
        for op in ("", f" op: at at: {at_us}", f" op: between from: {at_us - 2 * PERIOD_US} to: {at_us}"):
            say = f"(query semantic-label: heli-position{op})"
            heard = {one.unit: one for one in fleet.ask(units, say, within_s=1.0)}
            answered = {unit: len(readings(one)) for unit, one in heard.items() if one.trouble is None}
            slowest = max(heard[unit].us for unit in answered)
            report("query", op=op[:12] or "latest", slowest_answer=ms([slowest]), missing=heard[frozen].trouble)
            assert answered == dict.fromkeys(others, 3 if "between" in op else 1)
            assert heard[frozen].trouble
            assert slowest <= SECOND_US // 2
    fleet.monitors_until(units, lambda found: all_fresh(found, units), 30.0)
    with fleet.frozen(frozen):
        lines = fleet.dyknow("query", "heli-position", "--timeout", "1s")
    assert {str(line["unit"]) for line in lines if "value" in line} == others
    assert [str(line["unit"]) for line in lines if "error" in line] == [frozen], lines


def readings(heard: Heard) -> list[Reading]:
    return [reading for said in heard.contents if isinstance(said, Samples) for reading in said.samples]


def test_what_cannot_be_answered_is_refused_for_its_reason(fleet: Fleet) -> None:
    units = list(fleet.nodes)
    ahead = list(
        fleet.ask(units, f"(query semantic-label: heli-position op: at at: {fleet.now_us() + 60 * SECOND_US})")
    )
    before = list(fleet.ask(units, "(query semantic-label: heli-position op: at at: 1000000)"))
    assert all("s in the future" in str(heard.trouble) for heard in ahead), ahead
    assert all("before the first heli-position that is held" in str(heard.trouble) for heard in before), before


def test_crashes_and_freezes_are_seen_by_all_and_cost_the_others_no_sample(fleet: Fleet) -> None:
    units = list(fleet.nodes)
    crashed, frozen = units[-1], units[-2]
    staying = [unit for unit in units if unit not in {crashed, frozen}]
    streams = LABELS * len(staying) * (len(units) - 1)
    assert fleet.wait(lambda: len(fleet.imports(staying)) >= streams, 20.0), "a unit that was frozen before is back"
    before, began_us = fleet.imports(staying), fleet.now_us()
    assert fleet.ls() == dict.fromkeys(units, "alive")

    killed_us = fleet.kill(crashed)
    left = [unit for unit in units if unit != crashed]
    crash = fleet.seen_after(fleet.others(crashed), left, killed_us, 10.0)
    assert fleet.ls() == {**dict.fromkeys(left, "alive"), crashed: "gone"}

    with fleet.frozen(frozen) as frozen_us:
        freeze = fleet.seen_after(fleet.others(crashed, frozen), staying, frozen_us, 10.0)
        listed = fleet.ls()
        thawed_us = fleet.now_us()
    thaw = fleet.seen_after(fleet.others(crashed, frozen), left, thawed_us, 20.0)
    assert fleet.wait(lambda: fleet.nodes[frozen].found == set(left), 10.0), "who was frozen must find all others, too"
    fleet.monitors_until(left, lambda found: all_fresh(of(found, left), left), 20.0)
    fresh_us = fleet.now_us()
    assert fleet.ls() == {**dict.fromkeys(left, "alive"), crashed: "gone"}

    after, ended_us = settled(fleet, staying), fleet.now_us()
    among = {name: one for name, one in before.items() if {name[0], name[1]} <= set(staying)}
    counts = grown(among, {name: after[name] for name in among})
    due = (ended_us - began_us) // PERIOD_US
    mended = sum(after[name].recovered - one.recovered for name, one in among.items())
    report("crash", others_know_after=ms(crash.values()))
    report("freeze", others_know_after=ms(freeze.values()), ls=listed)
    report("thaw", all_know_after=ms(thaw.values()), all_monitors_fresh_after=f"{(fresh_us - thawed_us) / 1e6:.1f} s")
    report("streams", count=len(among), samples=f"{min(counts)}..{max(counts)} of {due}", mended=mended)
    assert max(crash.values()) <= SECOND_US
    assert max(freeze.values()) <= 3 * SECOND_US
    assert listed.pop(frozen) in {"suspect", "gone"}
    assert listed == {**dict.fromkeys(staying, "alive"), crashed: "gone"}
    assert len(among) == LABELS * len(staying) * (len(staying) - 1)
    assert min(counts) >= 0.9 * due


def of(found: list[MonitorEntry], units: list[str]) -> list[MonitorEntry]:
    return [one for one in found if set(one.units) <= set(units)]
