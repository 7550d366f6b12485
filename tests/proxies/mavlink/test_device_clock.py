import random
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.proxies.mavlink.device_clock import DeviceClock

BOOTED_US = 1_700_000_000_000_000
DELAYS = st.lists(st.integers(1_000, 400_000), min_size=30, max_size=120)


@given(DELAYS)
def test_valid_time_never_lies_after_the_arrival_and_errs_by_the_smallest_delay(delays) -> None:
    clock = DeviceClock()
    for k, delay_us in enumerate(delays):
        device_us = k * 100_000
        valid_us = clock.valid_us(device_us, BOOTED_US + device_us + delay_us)
        assert valid_us <= BOOTED_US + device_us + min(delays[max(0, k - 35) : k + 1]), "of the last seconds"
        assert valid_us >= BOOTED_US + device_us + min(delays[: k + 1])


@pytest.mark.parametrize("rate", [0.99, 0.992, 1.0, 1.008])
@pytest.mark.parametrize("seed", range(5))
def test_a_clock_that_runs_slow_or_fast_is_followed_by_its_rate(rate, seed) -> None:
    """At 5 m/s 0.3 m are 60 ms."""
    clock, rng, worst_us = DeviceClock(), random.Random(seed), 0
    for k in range(1800):
        device_us = k * 100_000
        true_us = round(device_us / rate)
        valid_us = clock.valid_us(device_us, BOOTED_US + true_us + rng.randint(1_000, 15_000))
        worst_us = max(worst_us, abs(valid_us - BOOTED_US - true_us))
        if k > 400:
            assert abs(valid_us - BOOTED_US - true_us) < 25_000
            assert abs(clock.rate - rate) < 0.0015
    assert worst_us < 60_000


def test_a_clock_that_stands_still_for_half_a_second_is_late_for_some_seconds_only() -> None:
    clock, rng, late = DeviceClock(), random.Random(3), 0
    for k in range(1200):
        true_us = k * 100_000 + (500_000 if k >= 600 else 0)
        valid_us = clock.valid_us(k * 100_000, BOOTED_US + true_us + rng.randint(1_000, 5_000))
        late += abs(valid_us - BOOTED_US - true_us) > 60_000
    assert late <= 45, "four seconds of ten samples"


def test_a_drifting_crystal_is_followed() -> None:
    """100 ppm are 6 ms a minute; after ten minutes the error is still that of one window."""
    clock, rng = DeviceClock(), random.Random(1)
    for k in range(6000):
        true_us = k * 100_000
        device_us = round(true_us * (1 - 100e-6))
        valid_us = clock.valid_us(device_us, BOOTED_US + true_us + rng.randint(1_000, 5_000))
    assert abs(valid_us - BOOTED_US - true_us) < 10_000


def test_without_a_stamp_the_arrival_counts() -> None:
    assert DeviceClock().valid_us(None, 123) == 123


def test_a_reboot_is_believed_at_the_third_stamp_and_a_single_leap_is_not() -> None:
    clock = DeviceClock()
    for k in range(50):
        clock.valid_us(60_000_000 + k * 100_000, BOOTED_US + k * 100_000)
    now_us = BOOTED_US + 5_000_000
    assert clock.valid_us(3_600_000_000, now_us) is None, "a forged stamp, an hour ahead"
    assert clock.valid_us(65_000_000, now_us) == now_us, "and the honest go on"
    assert clock.reboots == 0
    after = [clock.valid_us(500_000 + k * 100_000, now_us + k * 100_000) for k in range(5)]
    assert after == [None, None, *(now_us + k * 100_000 for k in (2, 3, 4))]
    assert clock.reboots == 1


def test_a_packet_that_was_held_up_for_seconds_is_late_and_no_reboot() -> None:
    clock = DeviceClock()
    for k in range(20):
        clock.valid_us(k * 100_000, BOOTED_US + k * 100_000)
    assert clock.valid_us(2_000_000, BOOTED_US + 9_000_000) == BOOTED_US + 2_000_000
    assert clock.reboots == 0


def test_a_driven_vehicle_states_federation_time_and_is_taken_at_its_word() -> None:
    clock = DeviceClock(driven=True)
    assert clock.valid_us(1_000_000, BOOTED_US + 1_030_000) == BOOTED_US + 1_030_000, "until it has said so"
    clock.on_system_time(BOOTED_US + 1_000_000, 1_000_000)
    assert [clock.valid_us(k * 100_000, BOOTED_US + k * 100_000 + 7_000) for k in (11, 12)] == [
        BOOTED_US + 1_100_000,
        BOOTED_US + 1_200_000,
    ]
    assert clock.valid_us(BOOTED_US + 1_300_000, BOOTED_US + 1_310_000) == BOOTED_US + 1_300_000


def test_stamps_since_1970_and_since_boot_are_one_clock() -> None:
    clock = DeviceClock()
    assert clock.valid_us(BOOTED_US + 40_000_000, BOOTED_US) == BOOTED_US, "unknown relation: the arrival"
    clock.on_system_time(0, 1)
    clock.on_system_time(BOOTED_US + 41_000_000, 1_000_000)
    clock.valid_us(1_000_000, BOOTED_US + 1_000_000)
    assert clock.valid_us(BOOTED_US + 41_500_000, BOOTED_US + 1_600_000) == BOOTED_US + 1_500_000


def test_valid_times_of_a_steady_source_increase() -> None:
    clock, rng = DeviceClock(), random.Random(2)
    found = [clock.valid_us(k * 100_000, BOOTED_US + k * 100_000 + rng.randint(500, 90_000)) for k in range(500)]
    assert all(b > a for a, b in pairwise(found))


def test_a_stamp_of_long_ago_is_translated_and_teaches_nothing() -> None:
    clock = DeviceClock()
    assert clock.valid_us(5_000_000, BOOTED_US + 9_000_000, witness=False) == BOOTED_US + 9_000_000
    clock.valid_us(10_000_000, BOOTED_US + 10_000_000)
    for k in range(10):
        now_us = BOOTED_US + 11_000_000 + k * 100_000
        assert clock.valid_us(5_000_000, now_us, witness=False) == BOOTED_US + 5_000_000
    assert clock.reboots == 0
