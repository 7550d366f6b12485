"""Random chronicle files of the whole language of thesis 8.3, such as the parser could have made."""

from hypothesis import strategies as st

from dyknow.reasoning.chronicles.definition.domains import Combination, Complement, NamedDomain, Symbols
from dyknow.reasoning.chronicles.definition.model import (
    Attribute,
    Choice,
    Chronicle,
    ChronicleFile,
    ChronicleVariable,
    Conjunction,
    Disjunction,
    DomainDefinition,
    Equal,
    Event,
    EventType,
    Iff,
    Implication,
    Inclusion,
    Instants,
    MemberOf,
    Message,
    NamedConstraint,
    Negation,
    NoEvent,
    Occurs,
    Use,
    Variables,
)
from dyknow.reasoning.chronicles.definition.times import (
    ZERO,
    ComplexConstraint,
    ConstraintUse,
    Distance,
    Interval,
    TimeOrder,
    TimePoint,
)

SYMBOLS = ["a", "car_1", "X9", "time", "_", "true", "no_link", "end", "value", "state", "oo_"]
names = st.sampled_from(SYMBOLS)
labels = names | st.sampled_from(["heli-position", "car_relations.behind", "cars.link", "a-1.b-c"])
symbols = labels.filter(lambda name: "." not in name) | st.sampled_from(
    ["0", "42", "-7", "1.5", "two words", "?x", "", "in", "5ms"]
)
named_variables = st.builds(ChronicleVariable, names, star=st.booleans())
variables = named_variables | st.builds(ChronicleVariable, star=st.booleans())
parameters = variables | symbols
arguments = st.lists(parameters, max_size=3).map(tuple)
milliseconds = st.integers(-(10**12), 10**12) | st.sampled_from([0, 1, -1, 2**53, -(2**53)])


@st.composite
def intervals(draw):
    low, high = draw(st.none() | milliseconds), draw(st.none() | milliseconds)
    return Interval(high, low) if low is not None and high is not None and low > high else Interval(low, high)


points = st.builds(TimePoint, names, st.just(ZERO) | intervals())
operators = st.sampled_from(["<", "<=", "=", ">=", ">"])


@st.composite
def orders(draw):
    count = draw(st.integers(1, 3))
    some, between = (
        st.lists(points, min_size=count + 1, max_size=count + 1),
        st.lists(operators, min_size=count, max_size=count),
    )
    return TimeOrder(tuple(draw(some)), tuple(draw(between)))


@st.composite
def distances(draw):
    to, from_ = draw(names), draw(st.none() | names)
    return Distance(to, "middle" if from_ == to else from_, draw(intervals()))


timings = orders() | distances() | st.builds(ConstraintUse, names, st.lists(points, max_size=3).map(tuple))
domains = st.recursive(
    st.builds(NamedDomain, names) | st.builds(Symbols, st.lists(symbols, max_size=3).map(tuple)),
    lambda inner: st.builds(Complement, inner) | st.builds(Combination, st.sampled_from(["|", "&", "-"]), inner, inner),
    max_leaves=4,
)
_atoms = (
    st.builds(MemberOf, named_variables, domains, st.booleans())
    | st.builds(Equal, named_variables, parameters, st.booleans())
    | st.builds(Use, names, arguments)
)
_inner = st.recursive(
    _atoms,
    lambda inner: (
        st.builds(Negation, inner)
        | st.lists(inner, min_size=2, max_size=3)
        .map(tuple)
        .flatmap(lambda some: st.sampled_from([Conjunction(some), Disjunction(some)]))
    ),
    max_leaves=4,
)
conditions = (
    _inner
    | st.builds(Implication, _inner, _inner)
    | st.builds(Iff, _inner, _inner)
    | st.builds(Choice, _inner, _inner, _inner)
)
event_types = st.builds(EventType, labels, arguments, st.none() | st.tuples(parameters, parameters))


@st.composite
def counted(draw):
    least, most = draw(st.integers(0, 5)), draw(st.none() | st.integers(0, 1_000_000))
    return Occurs(least, most if most is None else least + most // 2, draw(event_types), draw(points), draw(points))


some_names = st.lists(names, min_size=1, max_size=3).map(tuple)
statements = (
    st.builds(Event, event_types, points)
    | st.builds(NoEvent, event_types, points, points)
    | counted()
    | conditions
    | timings
    | st.builds(Variables, st.lists(named_variables, min_size=1, max_size=3).map(tuple), st.none() | domains)
    | st.builds(Instants, some_names)
    | st.builds(Inclusion, names, arguments, st.lists(st.tuples(st.none() | names, points), max_size=3).map(tuple))
)
bodies = st.lists(conditions, max_size=3).map(tuple)
declarations = (
    st.builds(DomainDefinition, names, domains)
    | st.builds(Attribute, labels, arguments, bodies)
    | st.builds(Message, labels, arguments, bodies)
    | st.builds(NamedConstraint, names, arguments, bodies)
    | st.builds(
        ComplexConstraint, names, st.lists(names, max_size=3).map(tuple), st.lists(timings, max_size=3).map(tuple)
    )
    | st.builds(
        Chronicle, names, arguments, st.lists(names, max_size=2).map(tuple), st.lists(statements, max_size=6).map(tuple)
    )
)
files = st.builds(ChronicleFile, st.lists(declarations, max_size=4).map(tuple))
