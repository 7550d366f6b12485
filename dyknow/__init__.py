"""Fluent streams: labels, samples, policies, stream generators, states; and the way into a federation.

A program in a federation needs two functions (docs/python.md has a page on them):

* `with dyknow.connect() as fed` asks a federation: `fed.query`, `fed.watch`, `fed.alarms`, `fed.delegate`, `fed.ls`;
  `async with dyknow.connect() as fed` is the same for an event loop;
* `with dyknow.join("7") as me` adds a platform of one's own: `me.push`, `me.declare`, `me.export`, `me.monitor`.

`help(dyknow.FederationClient)` and `help(dyknow.OwnPlatform)` have every method, with its arguments and errors. The other
names below are the local instance: labels, samples, policies, sources, computational units and their network.

Its exceptions are one tree, `dyknow.DyknowError`, drawn in `dyknow.model.errors`. Instants and durations are integer
microseconds, `_us`; texts may be given instead, `"-5s"` or `"200ms"`.
"""

import typing

from dyknow.model.errors import (
    ChronicleError,
    DyknowError,
    FederationFailed,
    LabelAlreadyExists,
    NameRefused,
    NothingFound,
    PolicyError,
    PolicyNotSupported,
    PrototypeExists,
    Refused,
    RosterError,
    SessionFailed,
    SortError,
    SpecificationFailed,
    TextError,
    TextErrors,
    TooEarly,
    UnitError,
    UnknownLabel,
    UnknownPrototype,
    ValueNotAvailable,
    WrongCall,
    WrongNumberOfInputs,
)
from dyknow.model.instants import US_PER_MS, US_PER_S, earlier, parse_duration, print_duration, print_span
from dyknow.model.labels import Label
from dyknow.model.sample import SURE, Predicted, Quality, Sample, Value, independent
from dyknow.model.values import NO_VALUE, Field, NoValue, Sort, as_json, of_json
from dyknow.network.computational_unit import (
    ComputationalUnit,
    Inputs,
    UnitFunction,
    of_values,
)
from dyknow.network.generator import Generator
from dyknow.network.history import History
from dyknow.network.network import Network
from dyknow.network.prototypes import (
    Prototype,
    Reading,
    SourcePrototype,
    UnitPrototype,
    computational_unit,
    prototypes_in,
    source,
    value_unit,
    variant,
)
from dyknow.network.stream_proxy import StreamProxy
from dyknow.policies.policy import Policy
from dyknow.policies.sampling import PolicyAdapter
from dyknow.states.shared import SharedState, SharedSynchronizer, Strand
from dyknow.states.synchronization import State, StateInput, StatePolicy, Synchronizer

if typing.TYPE_CHECKING:
    from dyknow.library import (
        AsyncFederationClient,
        FederationClient,
        Feed,
        OwnPlatform,
        QueryResult,
        UnitSample,
        connect,
        join,
    )

__all__ = [
    "NO_VALUE",
    "SURE",
    "US_PER_MS",
    "US_PER_S",
    "AsyncFederationClient",
    "ChronicleError",
    "ComputationalUnit",
    "DyknowError",
    "FederationClient",
    "FederationFailed",
    "Feed",
    "Field",
    "Generator",
    "History",
    "Inputs",
    "Label",
    "LabelAlreadyExists",
    "NameRefused",
    "Network",
    "NoValue",
    "NothingFound",
    "OwnPlatform",
    "Policy",
    "PolicyAdapter",
    "PolicyError",
    "PolicyNotSupported",
    "Predicted",
    "Prototype",
    "PrototypeExists",
    "Quality",
    "QueryResult",
    "Reading",
    "Refused",
    "RosterError",
    "Sample",
    "SessionFailed",
    "SharedState",
    "SharedSynchronizer",
    "Sort",
    "SortError",
    "SourcePrototype",
    "SpecificationFailed",
    "State",
    "StateInput",
    "StatePolicy",
    "Strand",
    "StreamProxy",
    "Synchronizer",
    "TextError",
    "TextErrors",
    "TooEarly",
    "UnitError",
    "UnitFunction",
    "UnitPrototype",
    "UnitSample",
    "UnknownLabel",
    "UnknownPrototype",
    "Value",
    "ValueNotAvailable",
    "WrongCall",
    "WrongNumberOfInputs",
    "as_json",
    "computational_unit",
    "connect",
    "earlier",
    "independent",
    "join",
    "of_json",
    "of_values",
    "parse_duration",
    "print_duration",
    "print_span",
    "prototypes_in",
    "source",
    "value_unit",
    "variant",
]


def __getattr__(name: str) -> typing.Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("dyknow-federation")
    from dyknow.library import loaded

    return loaded(name)


def __dir__() -> list[str]:
    return __all__
