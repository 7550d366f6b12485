"""The experiments of section 5.5: their specifications, and who gets what; `bench/` measures the delays."""

from xml.etree import ElementTree as ET

import pytest

from bench.figures.thesis import picture
from bench.streams.experiments import EXPERIMENTS, ByCalls, InInstance, of_one_source, of_sources, of_units
from dyknow.kpl import parse_specification

FIRST_US = 1_000_000


def test_5_5_the_specification_of_n_streams_is_as_printed() -> None:
    printed = """
        source int src
        strmgen gen = src
        stream strm1 = gen with sample every 100
        stream strm2 = gen with sample every 100
    """
    assert parse_specification(of_one_source(2)) == parse_specification(printed)


def test_5_5_the_specification_of_n_sources_and_m_streams_is_as_printed() -> None:
    printed = """
        source int src1
        strmgen gen1 = src1
        source int src2
        strmgen gen2 = src2
        stream strm1 = gen1 with sample every 100
        stream strm2 = gen2 with sample every 100
        stream strm3 = gen1 with sample every 100
    """
    assert parse_specification(of_sources(2, 3)) == parse_specification(printed)


def test_5_5_the_specification_of_n_units_and_m_streams_is_as_printed() -> None:
    printed = """
        source int src
        compunit int CU(int)
        strmgen gen = src
        strmgen gen1 = CU(gen with sample every 100)
        strmgen gen2 = CU(gen with sample every 100)
        stream strm1 = gen1 with sample every 100
        stream strm2 = gen2 with sample every 100
        stream strm3 = gen1 with sample every 100
    """
    assert parse_specification(of_units(2, 5)) == parse_specification(printed)


@pytest.mark.parametrize(
    ("text", "streams"),
    [(of_one_source(50), 50), (of_sources(19), 19), (of_sources(1), 19), (of_units(1), 29), (of_units(15), 15)],
)
def test_5_5_every_stream_gets_every_sample_and_so_it_does_from_plain_calls(text: str, streams: int) -> None:
    found = []
    for each in (InInstance(text), ByCalls(text)):
        for number in range(5):
            each.put(FIRST_US + number * 100_000)
        found.append(sorted((got.stream, got.valid_us) for got in each.found()))
    assert found[0] == found[1]
    assert len(found[0]) == len(set(found[0])) == 5 * streams


@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda each: each.figure)
def test_figures_5_7_5_9_and_5_11_are_drawn_from_measurements(experiment) -> None:
    figure = experiment.figure
    measured = {f"{kind}_{figure}_n{n}_us": 20.0 + n for kind in ("total", "channel") for n in experiment.points}
    row = {"figures": {"ours": [measured] * 3, "calls": [measured] * 3}}
    drawn = picture(experiment, {"b04": row})
    ET.fromstring(drawn)
    assert f"Figure {figure}" in drawn
    assert "20 us + 1.00 us per" in drawn
