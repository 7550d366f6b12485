"""Hypothesis strategies that more than one package needs. Times are small, so that they meet often."""

from itertools import accumulate

from hypothesis import strategies as st

from dyknow import SURE, Label, Policy, Quality, Sample
from dyknow.labels import RESERVED

times_us = st.integers(min_value=0, max_value=400)
values = st.sampled_from(["a", "b", "c"])
names = st.from_regex(r"[a-zA-Z_][a-zA-Z0-9_]{0,4}(-[a-zA-Z0-9_]{1,3})?", fullmatch=True).filter(
    lambda n: n not in RESERVED
)
labels = st.builds(Label, names, st.lists(names | st.integers(0, 99).map(str), max_size=3).map(tuple))


qualities = st.sampled_from(
    [SURE, SURE, Quality(0.5), Quality(0.96, ((4.0,),)), Quality(1.0, ((9.0, 1.0), (1.0, 1.0)))]
)


@st.composite
def streams(draw: st.DrawFn, max_size: int = 20, max_delay_us: int = 120, max_lead_us: int = 20) -> list[Sample]:
    """A stream in order of available time, with unique available times; valid times of any order, some predictions."""
    steps = draw(st.lists(st.integers(1, 60), max_size=max_size))
    delays = st.integers(-max_lead_us, max_delay_us)
    return [Sample(at, max(0, at - draw(delays)), draw(values)) for at in accumulate(steps)]


@st.composite
def gridded_streams(draw: st.DrawFn, period_us: int = 20, max_size: int = 20) -> list[Sample]:
    """As above, but valid times are mostly multiples of `period_us`, so that sampled policies find something."""

    def on_grid(sample: Sample) -> Sample:
        shift_us = draw(st.sampled_from([0, 0, 0, 1]))
        return sample._replace(valid_us=sample.valid_us // period_us * period_us + shift_us)

    return [on_grid(s) for s in draw(streams(max_size=max_size))]


@st.composite
def rated_streams(draw: st.DrawFn) -> list[Sample]:
    """As above, of samples that say how good they are."""
    return [sample._replace(quality=draw(qualities)) for sample in draw(gridded_streams())]


@st.composite
def policies(draw: st.DrawFn, period_us: st.SearchStrategy[int] = st.sampled_from([5, 10, 20, 40])) -> Policy:  # noqa: B008
    """Every kind of valid policy."""
    from_us = draw(st.none() | times_us)
    sample_us = draw(st.none() | period_us)
    max_delay_us = draw(st.none() | st.integers(0, 100))
    approximations = ["none"]
    if sample_us is not None:
        approximations += ["linear"] + (["most recent"] if from_us is not None and max_delay_us is not None else [])
    return Policy(
        change=draw(st.sampled_from(["any update", "any change"])) if sample_us is None else "sample",
        sample_us=sample_us,
        max_delay_us=max_delay_us,
        from_us=from_us,
        to_us=draw(st.none() | times_us.map(lambda t: t + (from_us or 0))),
        order=draw(st.sampled_from(["any", "monotone", "strict"])),
        approximation=draw(st.sampled_from(approximations)),
        delay_before_us=draw(st.none() | times_us),
        min_certainty=draw(st.none() | st.sampled_from([0.0, 0.95, 1.0])),
        max_deviation=draw(st.none() | st.sampled_from([0.0, 2.0, 3.0])),
        importance=draw(st.sampled_from([1.0, 0.5, 10.0])),
    )
