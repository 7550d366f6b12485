"""Random chronicles of the whole language, small enough to be tried out, and events that they speak of."""

from random import Random

from dyknow.reasoning.chronicles import MINUS_INFINITY
from dyknow.reasoning.chronicles.definition.domains import Complement, NamedDomain, Symbols
from dyknow.reasoning.chronicles.definition.model import (
    Attribute,
    Choice,
    Chronicle,
    ChronicleFile,
    ChronicleVariable,
    Disjunction,
    DomainDefinition,
    Equal,
    Event,
    EventType,
    Implication,
    Inclusion,
    Instants,
    MemberOf,
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
from tests.reasoning.chronicles.definition import Happening

OBJECTS = ("p", "q")
VALUES = ("u", "v")
X, Y, Z, STAR, ANY = (
    ChronicleVariable("x"),
    ChronicleVariable("y"),
    ChronicleVariable("z"),
    ChronicleVariable("w", star=True),
    ChronicleVariable(),
)


class Maker:
    """Makes one file; what it may name grows as it goes."""

    def __init__(self, seed):
        self.rng = Random(seed)
        self.names = ["t1", "t2", "t3"]

    def chance(self, p):
        return self.rng.random() < p

    def file(self):
        declarations = [
            DomainDefinition("Some", Symbols(("p", "u"))),
            NamedConstraint("differ", (X, Y), (Equal(X, Y, same=False),)),
            ComplexConstraint(
                "soon",
                ("a", "b"),
                (TimeOrder((TimePoint("a"), TimePoint("b")), ("<=",)), Distance("b", "a", Interval(None, 4))),
            ),
        ]
        if self.chance(0.2):
            inside = (
                MemberOf(ChronicleVariable("value"), Complement(Symbols(("v",))))
                if self.chance(0.5)
                else MemberOf(X, NamedDomain("Some"))
            )
            declarations.append(Attribute("a", (X,), (inside,)))
        inner = None
        if self.chance(0.3):
            inner = self.chronicle("inner", None, size=2)
            declarations.append(inner)
        declarations.append(self.chronicle("outer", inner, size=4))
        return ChronicleFile(tuple(declarations))

    def chronicle(self, name, inner, size):
        first = Event(self.type(inner), self.point()) if self.chance(0.8) else self.predicate(inner)
        statements = [first, *(self.predicate(inner) for _ in range(self.rng.randint(0, size - 1)))]
        if inner is not None and self.chance(0.6):
            points = (
                ((None, self.point()),) if self.chance(0.6) else (("end", self.point()),) if self.chance(0.3) else ()
            )
            statements.append(Inclusion("inner", (self.rng.choice([X, Y, "p", ANY]),), points))
        statements += [self.timing() for _ in range(self.rng.choice([0, 0, 1, 1, 2, 3]))]
        statements += [self.condition() for _ in range(self.rng.choice([0, 0, 0, 0, 1, 2]))]
        self.rng.shuffle(statements)
        return Chronicle(name, (X,), ("t1",) if name == "inner" else (), tuple(statements))

    def object(self):
        return self.rng.choice([X, X, X, Y, Z, STAR, ANY, *OBJECTS])

    def value(self):
        return self.rng.choice([ANY, ANY, X, Y, Z, STAR, *VALUES, *VALUES])

    def type(self, inner):
        """An event type; a *variable stands in it once, so that a condition knows which value it speaks of."""
        found = self.any_type(inner)
        return found if found.parameters.count(STAR) < 2 else self.type(inner)

    def any_type(self, inner):
        match self.rng.choice("aaabm" + ("i" if inner is not None else "")):
            case "a":
                return EventType("a", (self.object(),), (self.value(), self.value()))
            case "b":
                return EventType("b", (self.object(), self.object()), (self.value(), self.value()))
            case "i":
                return EventType("inner", (self.object(),))
        return EventType("m", (self.object(),))

    def point(self):
        shift = self.rng.choice([ZERO] * 8 + [Interval(1, 1), Interval(-1, -1), Interval(2, 2), Interval(0, 2)])
        return TimePoint(self.rng.choice(self.names), shift)

    def predicate(self, inner):
        type_ = self.type(inner)
        if self.chance(0.5):
            return Event(type_, self.point())
        begin, end = self.point(), self.point()
        if self.chance(0.5):
            return NoEvent(type_, begin, end)
        least = self.rng.choice([0, 1, 1, 2])
        return Occurs(least, self.rng.choice([None, least, least + 1]), type_, begin, end)

    def timing(self):
        first, second, third = (self.point() for _ in range(3))
        operator = self.rng.choice(["<", "<=", "<=", "=", ">", ">="])
        match self.rng.randrange(9):
            case 0 | 1 | 2:
                return TimeOrder((first, second), (operator,))
            case 3:
                return TimeOrder((first, second, third), ("<=", operator))
            case 4 | 5:
                low = self.rng.randint(-3, 3)
                to, from_ = self.rng.sample(self.names, 2)
                return Distance(to, from_, Interval(self.rng.choice([low, None]), low + self.rng.randint(0, 4)))
            case 6:
                return self.rng.choice(
                    [
                        Distance("end", "start", Interval(None, self.rng.randint(1, 7))),
                        Distance("t1", None, Interval(1, 6)),
                    ]
                )
            case 7:
                return ConstraintUse("soon", (first, second))
        return Instants((self.rng.choice(self.names),))

    def condition(self):
        one, other = self.rng.sample([X, Y, Z, STAR], 2)
        symbol = self.rng.choice([*OBJECTS, *VALUES])
        atoms = [
            Equal(one, other, same=self.chance(0.3)),
            Equal(one, symbol, same=self.chance(0.5)),
            MemberOf(
                one,
                self.rng.choice([NamedDomain("Some"), Symbols(("q", "v")), Complement(Symbols((symbol,)))]),
                self.chance(0.7),
            ),
            Use("differ", (one, other)),
        ]
        first, second, third = (self.rng.choice(atoms) for _ in range(3))
        made = [
            first,
            first,
            first,
            first,
            Negation(first),
            Disjunction((first, second)),
            Implication(first, second),
            Choice(first, second, third),
        ]
        if self.chance(0.15):
            return Variables((one,), NamedDomain("Some"))
        return self.rng.choice(made)

    def happenings(self):
        """Some of many kinds, or many of few, of which some may be out of order, or have always been."""
        few = self.chance(0.4)
        clock, found = 0, []
        if self.chance(0.15):
            values = ((MINUS_INFINITY, "a", (one,), (None, self.rng.choice(VALUES))) for one in OBJECTS)
            found = [Happening(*one) for one in values]
        for _ in range(self.rng.randint(6, 14) if few else self.rng.randint(2, 8)):
            clock += self.rng.choice([0, 0, 1, 1, 1, 2, 3])
            at_ms = clock - (self.rng.randint(1, 2) if self.chance(0.05) else 0)
            old, new = (None, *VALUES), VALUES
            change = (
                self.rng.choice([*old, *OBJECTS] if not few else old),
                self.rng.choice(new if few else [*new, *new, *OBJECTS]),
            )
            kind = self.rng.choice("aam" if few else "aaabm")
            arguments = tuple(self.rng.choice(OBJECTS) for _ in range(2 if kind == "b" else 1))
            found.append(Happening(at_ms, kind, arguments, None if kind == "m" else change))
        return found

    def max_age_ms(self):
        return self.rng.choice([None, None, None, None, 3, 6])
