from dyknow.adapters import (
    Accept,
    any_change,
    any_order,
    any_update,
    duration,
    max_delay,
    monotone_order,
    on_grid,
    restrict,
    sample_every,
    strict_order,
)
from dyknow.compunits import ComputationalUnit, UnitFunction, latest_valid_us, of_values
from dyknow.errors import (
    DyknowError,
    LabelAlreadyExists,
    PolicyError,
    SortError,
    TextError,
    UnknownLabel,
    ValueNotAvailable,
)
from dyknow.generator import Consumer, Generator, Subscription
from dyknow.history import History
from dyknow.instants import US_PER_MS, US_PER_S, earlier, parse_duration, print_duration, print_span
from dyknow.join import Inputs, Join, available, available_times, join, last_available, previous
from dyknow.labels import Label
from dyknow.network import Network
from dyknow.policy import Approximation, Change, Order, Policy
from dyknow.sample import SURE, Quality, Sample, Value
from dyknow.sampling import PolicyAdapter, interpolate
from dyknow.shared_states import SharedState, SharedSynchronizer, Strand
from dyknow.states import Category, State, StateInput, StatePolicy, Synchronizer
from dyknow.values import NO_VALUE, Field, NoValue, Sort

__all__ = [
    "NO_VALUE",
    "SURE",
    "US_PER_MS",
    "US_PER_S",
    "Accept",
    "Approximation",
    "Category",
    "Change",
    "ComputationalUnit",
    "Consumer",
    "DyknowError",
    "Field",
    "Generator",
    "History",
    "Inputs",
    "Join",
    "Label",
    "LabelAlreadyExists",
    "Network",
    "NoValue",
    "Order",
    "Policy",
    "PolicyAdapter",
    "PolicyError",
    "Quality",
    "Sample",
    "SharedState",
    "SharedSynchronizer",
    "Sort",
    "SortError",
    "State",
    "StateInput",
    "StatePolicy",
    "Strand",
    "Subscription",
    "Synchronizer",
    "TextError",
    "UnitFunction",
    "UnknownLabel",
    "Value",
    "ValueNotAvailable",
    "any_change",
    "any_order",
    "any_update",
    "available",
    "available_times",
    "duration",
    "earlier",
    "interpolate",
    "join",
    "last_available",
    "latest_valid_us",
    "max_delay",
    "monotone_order",
    "of_values",
    "on_grid",
    "parse_duration",
    "previous",
    "print_duration",
    "print_span",
    "restrict",
    "sample_every",
    "strict_order",
]
