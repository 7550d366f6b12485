"""The specifications of the experiments of 5.5, as text of any size: every client gets every sample of every source."""

from itertools import pairwise
from pathlib import Path

import pytest

from dyknow import Network, Sample
from dyknow.compunits import load_module, prototypes_of
from dyknow.kpl import Hooks, Instance, parse_specification

EXPERIMENTS = Path(__file__).parents[3] / "examples" / "experiments"
PERIOD_US = 100_000
SAMPLES = 600


def streams(n: int) -> str:
    """n streams from one source."""
    named = [f"stream strm{i} = gen with sample every 100" for i in range(1, n + 1)]
    return "\n".join(["source int src", "strmgen gen = src", *named, ""])


def sources(n: int, m: int) -> str:
    """m streams from n sources."""
    made = [line for i in range(1, n + 1) for line in (f"source int src{i}", f"strmgen gen{i} = src{i}")]
    named = [f"stream strm{i} = gen{(i - 1) % n + 1} with sample every 100" for i in range(1, m + 1)]
    return "\n".join([*made, *named, ""])


def units(n: int, m: int) -> str:
    """n units with an input each, and m - n streams from them."""
    made = [f"strmgen gen{i} = CU(gen with sample every 100)" for i in range(1, n + 1)]
    named = [f"stream strm{i} = gen{(i - 1) % n + 1} with sample every 100" for i in range(1, m - n + 1)]
    return "\n".join(["source int src", "compunit int CU(int)", "strmgen gen = src", *made, *named, ""])


def delivered(text: str, samples: int = SAMPLES) -> dict[str, list[int]]:
    """What each stream got of that many samples of every source, a sample each 100 ms; values are their numbers."""
    found: dict[str, list[int]] = {}
    times: dict[str, list[int]] = {}

    def keep(name: str, sample) -> None:
        found.setdefault(name, []).append(sample.value)
        times.setdefault(name, []).append(sample.valid_us)

    copying = prototypes_of(load_module(str(EXPERIMENTS / "copying.py"))).values()
    instance = Instance(Network(), prototypes=copying, hooks=Hooks(keep))
    instance.add(parse_specification(text), 0, text)
    for number in range(samples):
        for source in instance.sources():
            instance.push(source, Sample(number * PERIOD_US, number * PERIOD_US, number))
    assert all(b - a == PERIOD_US for each in times.values() for a, b in pairwise(each))
    return found


@pytest.mark.parametrize("n", range(5, 51, 5))
def test_5_5_every_one_of_n_streams_gets_every_sample_of_one_source(n: int) -> None:
    assert delivered(streams(n)) == {f"strm{i}": list(range(SAMPLES)) for i in range(1, n + 1)}


@pytest.mark.parametrize("n", range(1, 20, 2))
def test_5_5_every_one_of_19_streams_gets_every_sample_of_its_source(n: int) -> None:
    assert delivered(sources(n, 19)) == {f"strm{i}": list(range(SAMPLES)) for i in range(1, 20)}


@pytest.mark.parametrize("n", range(1, 16, 2))
def test_5_5_every_stream_of_n_computational_units_gets_every_sample(n: int) -> None:
    assert delivered(units(n, 30)) == {f"strm{i}": list(range(SAMPLES)) for i in range(1, 31 - n)}


@pytest.mark.parametrize(
    ("name", "text"), [("streams", streams(5)), ("sources", sources(3, 5)), ("units", units(2, 6))]
)
def test_5_5_the_examples_are_these_specifications(name: str, text: str) -> None:
    written = (EXPERIMENTS / f"{name}.kpl").read_text(encoding="utf-8")
    assert parse_specification(written) == parse_specification(text)
