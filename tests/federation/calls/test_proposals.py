from hypothesis import given
from hypothesis import strategies as st

from dyknow.federation.calls.proposals import Proposal, WantedStream, best
from dyknow.federation.members.directory import unit_order

UNITS = st.lists(st.sampled_from(["0", "1", "2", "10", "a", "uav-b"]), unique=True)
PERIODS = st.sampled_from([50_000, 100_000, 200_000, 300_000])
DELAYS = st.sampled_from([0, 100_000, 500_000, 1_000_000])
CERTAINTIES = st.sampled_from([0.0, 0.5, 0.8, 1.0])


@st.composite
def proposals(draw: st.DrawFn) -> list[Proposal]:
    return [
        Proposal(
            unit, 1, f"0-1-{at}.{unit}", draw(st.sampled_from([0.0, 1.0, 2.5])), draw(PERIODS), draw(DELAYS), draw(CERTAINTIES)
        )
        for at, unit in enumerate(draw(UNITS))
    ]  # fmt: skip


@given(proposals(), PERIODS, DELAYS, CERTAINTIES)
def test_the_best_meets_what_is_wanted_and_none_that_does_is_cheaper_or_as_cheap_and_sorts_before_it(
    given_: list[Proposal], period_us: int, delay_us: int, certainty: float
) -> None:
    wanted = WantedStream("gas-level", period_us, delay_us, certainty)
    fitting = [
        each
        for each in given_
        if wanted.period_us % each.period_us == 0 and each.delay_us <= delay_us and each.certainty >= certainty
    ]
    chosen = best(given_, wanted)
    assert [each for each in given_ if not each.lacks(wanted)] == fitting
    assert (chosen is None) == (not fitting)
    if chosen is not None:
        assert chosen in fitting
        assert all(chosen.cost <= each.cost for each in fitting)
        assert all(unit_order(chosen.unit) <= unit_order(each.unit) for each in fitting if each.cost == chosen.cost)


@given(proposals())
def test_what_is_lacking_is_said(given_: list[Proposal]) -> None:
    wanted = WantedStream("gas-level", 100_000, 100_000, 0.9)
    for each in given_:
        assert ("certainty" in each.lacks(wanted)) == (each.certainty < 0.9)
        assert ("delay" in each.lacks(wanted)) == (each.delay_us > 100_000)
