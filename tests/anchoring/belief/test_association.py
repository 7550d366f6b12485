"""Association and existence are what sums over all existences and associations give."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dyknow.anchoring.belief.association.scans import associate
from dyknow.anchoring.belief.association.single import OtherSources, by_event, by_share
from tests.anchoring.belief import enumeration

READINGS = {"event": by_event, "share": by_share}
LIKELIHOOD = st.floats(-30.0, 10.0)


@st.composite
def cases(draw: st.DrawFn, largest: int = 6) -> dict:
    count = draw(st.integers(0, largest))
    lists = {
        name: draw(st.lists(values, min_size=count, max_size=count))
        for name, values in (
            ("r", st.just(0.0) | st.floats(1e-9, 0.999)),
            ("log_l", LIKELIHOOD),
            ("p_e", st.floats(1e-3, 0.999)),
            ("p_f", st.just(0.0) | st.floats(1e-9, 0.5)),
        )
    }
    return {
        **{name: np.array(values, dtype=float) for name, values in lists.items()},
        "others": OtherSources(
            draw(st.floats(1e-3, 3.0)), draw(LIKELIHOOD), draw(st.just(0.0) | st.floats(1e-9, 3.0)), draw(LIKELIHOOD)
        ),
    }


def enumerated(reading: str, case: dict) -> enumeration.Enumerated:
    others = case["others"]
    return enumeration.single(
        reading, case["r"], np.exp(case["log_l"]), case["p_e"], case["p_f"],
        others.births, np.exp(others.log_birth), others.clutter, np.exp(others.log_clutter),
    )  # fmt: skip


FAINT = {
    "r": np.array([0.0, 0.5]), "log_l": np.array([0.0, -21.0]), "p_e": np.array([0.5, 0.5]), "p_f": np.array([0.0, 0.5]),
    "others": OtherSources(1.0, -24.0, 0.0, 3.0),
}  # fmt: skip
"""What exists with a probability of 1e-10 after it, and yet gave the observation if it does."""


@pytest.mark.parametrize("reading", READINGS)
@given(case=cases())
@example(case=FAINT)
def test_a_single_observation_is_associated_as_enumeration_does(reading: str, case: dict) -> None:
    found = READINGS[reading](case["r"], case["log_l"], case["p_e"], case["p_f"], case["others"])
    expected = enumerated(reading, case)
    assert found is not None
    for one, other in zip(found[:4], expected[:4], strict=True):
        assert one == pytest.approx(other, abs=1e-9)
    assert found.weights * found.existence == pytest.approx(expected.weights * expected.existence, abs=1e-9)
    assert found.weights == pytest.approx(expected.weights, abs=1e-6)
    assert found.instances.sum() + found.birth + found.clutter == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("reading", READINGS)
@given(case=cases(), seed=st.integers(0, 9))
def test_the_order_of_instances_does_not_matter(reading: str, case: dict, seed: int) -> None:
    order = np.random.default_rng(seed).permutation(len(case["r"]))
    found = READINGS[reading](case["r"], case["log_l"], case["p_e"], case["p_f"], case["others"])
    turned = READINGS[reading](*(case[each][order] for each in ("r", "log_l", "p_e", "p_f")), case["others"])
    assert found is not None
    assert turned is not None
    assert turned.existence == pytest.approx(found.existence[order], abs=1e-12)
    assert turned.birth == pytest.approx(found.birth, abs=1e-12)


def test_certain_instances_of_a_perfect_sensor_are_associated_by_their_likelihoods_alone() -> None:
    likelihood = np.array([0.2, 0.5, 0.1])
    found = by_event(np.ones(3), np.log(likelihood), np.full(3, 1.0), np.zeros(3), OtherSources(0.0, 0.0, 0.0, 0.0))
    assert found is not None
    assert found.instances == pytest.approx(likelihood / likelihood.sum(), abs=1e-6)


def test_by_share_an_observation_of_another_lowers_existence_by_a_part_of_one_in_n_and_by_event_by_odds() -> None:
    count, p_e, p_f, r = 10, 0.9, 0.1, 0.5
    log_l = np.full(count, -50.0)
    log_l[0] = 0.0
    case = (np.full(count, r), log_l, np.full(count, p_e), np.full(count, p_f), OtherSources(1e-9, -50.0, 1e-9, -50.0))
    shared, event = by_share(*case), by_event(*case)
    assert shared is not None
    assert event is not None
    odds = (event.existence[1] / (1.0 - event.existence[1])) / (r / (1.0 - r))
    assert odds == pytest.approx((1.0 - p_e) / (1.0 - p_f), abs=1e-9)
    assert 0.8 * r < shared.existence[1] < r


@pytest.mark.parametrize("reading", READINGS)
def test_what_nothing_can_have_given_is_associated_with_nothing(reading: str) -> None:
    impossible = OtherSources(0.1, -np.inf, 0.0, -np.inf)
    case = (np.array([0.5]), np.array([-np.inf]), np.array([0.9]), np.array([0.1]), impossible)
    assert READINGS[reading](*case) is None
    assert READINGS[reading](*(np.zeros(0) for _ in range(4)), impossible) is None


@pytest.mark.parametrize("reading", READINGS)
def test_contradictory_certainties_stay_finite(reading: str) -> None:
    ones = np.ones(2)
    found = READINGS[reading](ones, np.zeros(2), ones, ones, OtherSources(1.0, 0.0, 1.0, 0.0))
    assert found is not None
    assert np.isfinite(found.existence).all()
    assert ((found.existence >= 0.0) & (found.existence <= 1.0)).all()


def test_share_agrees_with_enumeration_where_memory_asks_for_chunks() -> None:
    rng = np.random.default_rng(4)
    count = 3000
    case = (rng.random(count), rng.normal(-3, 2, count), np.full(count, 0.7), np.full(count, 0.01))
    found = by_share(*case, OtherSources(0.1, -5.0, 0.1, -5.0))
    assert found is not None
    assert found.instances.sum() + found.birth + found.clutter == pytest.approx(1.0, abs=1e-9)
    assert found.existence.sum() == pytest.approx(case[0].sum(), rel=0.01)


@st.composite
def scans(draw: st.DrawFn) -> tuple[np.ndarray, ...]:
    count, observed = draw(st.integers(1, 4)), draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    present = rng.random((count, observed)) < draw(st.floats(0.2, 1.0))
    return (
        rng.uniform(0.01, 0.999, count), rng.uniform(0.01, 0.99, count), rng.exponential(2.0, (count, observed)) * present,
        rng.uniform(0.0, 1.0, observed), rng.uniform(0.01, 1.0, observed),
    )  # fmt: skip


def pairs_of(r: np.ndarray, detection: np.ndarray, likelihood: np.ndarray, other: np.ndarray) -> tuple:
    rows, cols = np.nonzero(likelihood)
    seen = r * detection
    return rows, cols, seen[rows] * likelihood[rows, cols] / ((1.0 - seen[rows]) * other[cols])


@given(scans())
def test_a_scan_is_associated_as_enumeration_does(case: tuple[np.ndarray, ...]) -> None:
    r, detection, likelihood, births, clutter = case
    rows, cols, psi = pairs_of(r, detection, likelihood, births + clutter)
    found = associate(rows, cols, psi, *likelihood.shape)
    pairs, existence, born = enumeration.scan(*case)
    assert found.is_exact
    assert found.pairs == pytest.approx(pairs[rows, cols], abs=1e-9)
    after = np.bincount(rows, found.pairs, len(r)) + found.none * r * (1.0 - detection) / (1.0 - r * detection)
    assert after == pytest.approx(existence, abs=1e-9)
    assert found.unclaimed * births / (births + clutter) == pytest.approx(born, abs=1e-9)


@given(scans())
def test_what_is_called_exact_without_sums_over_cycles_is(case: tuple[np.ndarray, ...]) -> None:
    r, detection, likelihood, births, clutter = case
    rows, cols, psi = pairs_of(r, detection, likelihood, births + clutter)
    found = associate(rows, cols, psi, *likelihood.shape, exact_instances=0)
    pairs, _, _ = enumeration.scan(*case)
    assert found.pairs == pytest.approx(pairs[rows, cols], abs=1e-9 if found.is_exact else 0.25)
    assert (np.bincount(cols, found.pairs) <= 1.0 + 1e-3).all()


@given(seed=st.integers(0, 2**32), is_exact=st.booleans())
def test_extreme_odds_lose_no_ratios(seed: int, is_exact: bool) -> None:
    """Trees and cycles with weights from 1e-100 to 1e100, against sums with rational arithmetic."""
    from fractions import Fraction
    from itertools import product

    rng = np.random.default_rng(seed)
    rows, cols = np.nonzero(rng.random((3, 3)) < 0.6)
    psi = 10.0 ** rng.uniform(-100, 100, len(rows))
    found = associate(rows, cols, psi, 3, 3, exact_instances=8 if is_exact else 0)
    weights = {(i, j): Fraction(value) for i, j, value in zip(rows.tolist(), cols.tolist(), psi.tolist(), strict=True)}
    total, pairs = Fraction(0), dict.fromkeys(weights, Fraction(0))
    for d in product(range(-1, 3), repeat=3):
        used = [(i, j) for i, j in enumerate(d) if j >= 0]
        if all(each in weights for each in used) and len({j for _, j in used}) == len(used):
            weight = Fraction(1)
            for each in used:
                weight *= weights[each]
            total += weight
            for each in used:
                pairs[each] += weight
    if found.is_exact:
        assert found.pairs == pytest.approx([float(each / total) for each in pairs.values()], abs=1e-9)
    assert np.isfinite(found.pairs).all()


def test_a_part_with_cycles_that_is_too_large_is_left_to_propagation_and_called_inexact() -> None:
    count = 40
    rows, cols = (each.ravel() for each in np.indices((count, count)))
    found = associate(rows, cols, np.ones(count * count), count, count)
    assert not found.is_exact
    assert found.pairs.sum() + found.none.sum() == pytest.approx(count, abs=1e-9)


@pytest.mark.parametrize(("count", "observed"), [(8, 2), (2, 8), (8, 8), (3, 12), (12, 3)])
def test_what_cannot_be_clutter_is_shared_out_among_all_that_may_have_given_it(count: int, observed: int) -> None:
    """Weights far beyond what products of them can hold."""
    rows, cols = (each.ravel() for each in np.indices((count, observed)))
    found = associate(rows, cols, np.full(count * observed, 1e200), count, observed)
    assert found.is_exact
    assert found.pairs == pytest.approx(1.0 / max(count, observed), abs=1e-9)


@given(
    st.integers(1, 5).flatmap(
        lambda count: st.tuples(st.just(count), st.integers(1, 2 if count > 3 else 5), st.integers(0, 2**32))
    )
)
def test_sums_are_exact_whichever_side_is_the_smaller(case: tuple[int, int, int]) -> None:
    count, observed, seed = case
    rng = np.random.default_rng(seed)
    psi = rng.exponential(2.0, (count, observed)) * (rng.random((count, observed)) < 0.7)
    rows, cols = np.nonzero(psi)
    found = associate(rows, cols, psi[rows, cols], count, observed)
    r, detection = np.full(count, 0.5), np.full(count, 0.5)
    pairs, _, _ = enumeration.scan(r, detection, psi * 3.0, np.zeros(observed), np.ones(observed))
    assert found.is_exact
    assert found.pairs == pytest.approx(pairs[rows, cols], abs=1e-9)


@given(r=st.floats(0.05, 0.95), p_d=st.floats(0.05, 0.95), log_l=LIKELIHOOD, odds=st.floats(0.01, 2.0))
@example(r=0.5, p_d=0.9, log_l=0.0, odds=1.0)
def test_a_scan_of_one_observation_is_the_event_reading_without_false_alarms(
    r: float, p_d: float, log_l: float, odds: float
) -> None:
    births, clutter = 0.4 * odds, 0.6 * odds
    single = by_event(
        np.array([r]), np.array([log_l]), np.array([p_d]), np.zeros(1), OtherSources(births, -1.0, clutter, -2.0)
    )
    assert single is not None
    lam_b, lam_c = births * np.exp(-1.0), clutter * np.exp(-2.0)
    psi = r * p_d * np.exp(log_l) / ((1.0 - r * p_d) * (lam_b + lam_c))
    found = associate(np.zeros(1, dtype=int), np.zeros(1, dtype=int), np.array([psi]), 1, 1)
    assert found.pairs == pytest.approx(single.instances, abs=1e-9)
    assert found.unclaimed[0] * lam_b / (lam_b + lam_c) == pytest.approx(single.birth, abs=1e-9)
