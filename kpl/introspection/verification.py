"""Does a recorded run satisfy its specification (thesis 4.5)? If not, which sample broke which constraint.

Two things are looked at. Every stream has to satisfy its policy, constraint by constraint (Def. 4.5.11). And every
generator and stream has to be what the specification makes of the samples of the sources: it is run again on those.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import groupby
from operator import itemgetter
from typing import NamedTuple

from dyknow import Label, Network, Policy, Sample, Sort
from dyknow.kpl.running.instance import Instance
from dyknow.kpl.running.ports import Hooks
from dyknow.kpl.syntax.specification import Specification, StreamDeclaration
from dyknow.model.errors import TextErrors
from dyknow.model.instants import print_duration

MAX_VIOLATIONS = 100
MAX_HISTORY = 4096
Streams = Mapping[str, Sequence[Sample]]


class Violation(NamedTuple):
    """A violation: the stream, the sample, and the reason."""

    name: str
    sample: Sample | None
    said: str

    def __str__(self) -> str:
        if self.sample is None:
            return f"{self.name}: {self.said}"
        at = print_duration(self.sample.valid_us)
        available = print_duration(self.sample.available_us)
        return f"{self.name}: the sample valid at {at}, available at {available}: {self.said}"


def verify(
    specification: Specification, labels: Streams, streams: Streams, make: Callable[[Network, Hooks], Instance]
) -> list[Violation]:
    """All violations of a specification, at most MAX_VIOLATIONS of each kind.

    Args:
        specification: the one that was run.
        labels: the recorded samples of generators, by label, by available time.
        streams: those of declared streams, by name.
        make: an empty instance with the units that were used, over this network.
    """
    return broken_streams(specification, streams) + rerun(specification, labels, streams, make)[:MAX_VIOLATIONS]


def broken_streams(specification: Specification, streams: Streams) -> list[Violation]:
    """Which samples break which constraints of the declared streams, at most MAX_VIOLATIONS."""
    broken = [
        violation
        for declaration in specification
        if isinstance(declaration, StreamDeclaration)
        for violation in broken_constraints(
            declaration.name, declaration.term.policy, streams.get(declaration.name, ())
        )
    ]
    return broken[:MAX_VIOLATIONS]


def broken_constraints(name: str, policy: Policy, samples: Iterable[Sample]) -> list[Violation]:
    """Each sample that breaks a constraint of the policy, with the constraint (Def. 4.5.11, as read with P1 and P2)."""
    found: list[Violation] = []
    last: Sample | None = None
    for sample in samples:
        if last is not None and sample.available_us <= last.available_us:
            found.append(Violation(name, sample, "it is not available later than the one before (Def. 4.3.5)"))
        found += [
            Violation(name, sample, f"it breaks `{constraint}`")
            for constraint, accept in policy.named_constraints()
            if not accept(sample, last)
        ]
        last = sample
    return found


def rerun(
    specification: Specification, labels: Streams, streams: Streams, make: Callable[[Network, Hooks], Instance]
) -> list[Violation]:
    """Violations where the record differs from the output of the specification for the recorded source samples."""
    made: dict[str, list[Sample]] = {}
    network = Network(MAX_HISTORY)
    instance = make(network, Hooks(lambda name, sample: made.setdefault(name, []).append(sample)))
    try:
        instance.add(specification, 0)
    except TextErrors as wrong:
        return [Violation("the specification", None, str(wrong))]
    given = _given(instance, labels)
    kept: dict[str, list[Sample]] = {}
    watched = set[Label]()
    pushes = sorted((sample.available_us, i, name, sample) for i, name in enumerate(given) for sample in labels[name])
    for at_us, together in groupby(pushes, itemgetter(0)):
        _watch(network, watched, kept)
        _advance(network, at_us - 1)
        network.now_us = at_us
        with network.instant.whole():
            for _, _, name, sample in together:
                network.generator(Label.parse(name)).push(sample.available_at(at_us))
    _watch(network, watched, kept)
    _advance(network, max((each[-1].available_us for each in (*labels.values(), *streams.values()) if each), default=0))
    found: list[Violation] = []
    for name in labels:
        if name not in given:
            found += differences(name, labels[name], kept.get(name, []))
    for name in streams:
        found += differences(name, streams[name], made.get(name, []))
    return found


def differences(name: str, recorded: Sequence[Sample], made: Sequence[Sample]) -> list[Violation]:
    """The first difference between a record and the expected samples; a timer may have gone off late."""
    for old, new in zip(recorded, made, strict=False):
        if old[1:] != new[1:]:
            said = f"the specification makes {new.value!r}, valid at {print_duration(new.valid_us)}, of its inputs"
            return [Violation(name, old, said)]
        if old.available_us < new.available_us:
            return [Violation(name, old, f"it cannot be available before {print_duration(new.available_us)}")]
    if len(recorded) < len(made):
        return [Violation(name, made[len(recorded)], "it is missing in the record")]
    if len(recorded) > len(made):
        return [Violation(name, recorded[len(made)], "nothing makes it")]
    return []


def _given(instance: Instance, labels: Streams) -> list[str]:
    """The recorded generators that are taken as they are: sources, imports, what units made that are not known here."""
    network = instance.network
    given = []
    for name in labels:
        label = Label.parse(name)
        if not network.has(label):
            network.add_source(label, Sort(label.feature, is_open=True))
            given.append(name)
        elif network.process(label) is None:
            given.append(name)
    return given


def _advance(network: Network, until_us: int) -> None:
    while (due_us := network.deadline_us) is not None and due_us <= until_us:
        network.on_time(due_us)


def _watch(network: Network, watched: set[Label], kept: dict[str, list[Sample]]) -> None:
    """Have all generators computed, since the record holds them."""
    for label in network.labels():
        if label not in watched:
            watched.add(label)
            network.connect(label, Policy(), kept.setdefault(str(label), []).append)
