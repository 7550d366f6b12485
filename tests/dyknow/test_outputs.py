"""Processes with more than one output (thesis 3.3.2): one computation for all of them, and none for nobody."""

import pytest

from dyknow import NO_VALUE, Label, LabelAlreadyExists, Network, Policy, Sort, prototypes_in, value_unit
from dyknow.outputs import NO_OUTPUT, add_outputs
from dyknow.processes import Input

RAW, BOTH, EVEN, HALF = (Label(name) for name in ("raw", "both", "even", "half"))
NUMBER = Sort("number")


@pytest.fixture
def calls():
    return []


@pytest.fixture
def network(calls):
    @value_unit("parts", "number")
    def parts(value):
        calls.append(value)
        return (value if value % 2 == 0 else NO_OUTPUT, value / 2)

    found = Network()
    found.add_source(RAW, NUMBER)
    add_outputs(found, BOTH, [(EVEN, NUMBER), (HALF, NUMBER)], prototypes_in([parts])[0], [Input(RAW)])
    return found


def test_each_output_has_a_generator_and_the_work_is_done_once(network, calls):
    got = {name: [] for name in (EVEN, HALF)}
    proxies = [network.connect(name, Policy(), got[name].append) for name in got]
    for i in range(4):
        network.push(RAW, i, i, 10 + i)
    assert [(s.valid_us, s.value) for s in got[EVEN]] == [(0, 0), (2, 2)]
    assert [(s.valid_us, s.value) for s in got[HALF]] == [(0, 0.0), (1, 0.5), (2, 1.0), (3, 1.5)]
    assert calls == [0, 1, 2, 3]
    for proxy in proxies:
        proxy.cancel()
    network.push(RAW, 4, 4, 14)
    assert len(calls) == 4, "nobody wants it"


def test_no_value_is_a_value_and_a_wrong_tuple_is_told(network):
    faults, got = [], []
    network.on_fault = lambda label, said: faults.append((label, said))
    network.connect(HALF, Policy(), got.append)
    network.push(RAW, 0, NO_VALUE, 1)
    assert got == []
    assert faults[0][0] == HALF


def test_a_label_that_is_taken_adds_nothing(network):
    before = network.labels()
    prototype = network.process(BOTH).prototype
    with pytest.raises(LabelAlreadyExists):
        add_outputs(network, Label("new"), [(Label("fine"), NUMBER), (RAW, NUMBER)], prototype, [Input(RAW)])
    assert network.labels() == before
