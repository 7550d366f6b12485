"""What holds of every linkage after every tick: who holds whom, both ways."""

from math import isnan

from dyknow.anchoring.links.processes import LinkProcess
from dyknow.anchoring.links.structures import LinkOutcome, ObjectLinkage


def check(linkage: ObjectLinkage, outcome: LinkOutcome) -> None:
    """Of all objects, links, candidates and what is available; and that the states of a tick are of live objects."""
    composites = {each.name for each in linkage.composites.values()}
    for objects in linkage._objects.values():
        for symbol, one in objects.items():
            assert one.symbol == symbol
            for name, link in one.outgoing.items():
                assert link.source is one, f"{link.source.symbol} is not {symbol}"
                assert linkage._objects[link.target.type].get(link.target.symbol) is link.target, (
                    "it links to a live object"
                )
                held = link.target.incoming.get(name)
                assert held is link, (
                    f"{symbol} links to {link.target.symbol}, and that to {held and held.source.symbol}"
                )
                assert 0.0 < link.weight <= 1.0 + 1e-9, link.weight
            for link in one.incoming.values():
                assert link.target is one
                assert linkage._objects[link.source.type].get(link.source.symbol) is link.source
                if link.process.name not in composites:
                    assert link.source.outgoing.get(link.process.name) is link
            _one_of_each_group(one.outgoing.values())
    for processes in linkage.into.values():
        for process in processes:
            _check_process(linkage, process)
    for record in outcome.states:
        assert not any(map(isnan, record.state[1:5])), f"{record.symbol} is nowhere"


def _one_of_each_group(links) -> None:  # type: ignore[no-untyped-def]
    groups = [each.process.specification.exclusive for each in links if each.process.specification.exclusive]
    assert len(groups) == len(set(groups)), "exclusive links exclude each other"


def _check_process(linkage: ObjectLinkage, process: LinkProcess) -> None:
    sources = linkage._objects[process.specification.source]
    targets = linkage._objects[process.specification.target]
    linked = {symbol for symbol, one in sources.items() if process.name in one.outgoing}
    held = {symbol for symbol, one in targets.items() if process.name in one.incoming}
    assert not linked & process.unlinked.keys(), "what is linked does not wait to be"
    assert process.unlinked.keys() <= sources.keys()
    assert process.available.keys() == targets.keys() - held, "an object is available unless it is held"
    assert process.candidates.keys() <= linked
    assert process.trials.by_source.keys() <= linked - process.candidates.keys(), "what is on trial is linked to one"
    for symbol, candidates in process.candidates.items():
        assert candidates.chosen == sources[symbol].outgoing[process.name].target.symbol
        assert not candidates.is_decided
        assert abs(sum(candidates.of(each).weight for each in (candidates.chosen, *candidates.others())) - 1.0) < 1e-6
        for other in candidates.others():
            assert targets.get(other) is candidates.of(other).target, "a candidate is a live object"
