"""Checks of chronicles beyond their grammar: each error at its place, with a repair (thesis 8.3).

Names of attributes and messages are checked once a file declares any: a file without declarations leaves all of them open.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

from dyknow.kpl.diagnostics.collector import nearest
from dyknow.kpl.syntax.chronicle_reading import ChronicleReader, Mention, ReadChronicle
from dyknow.model.errors import ChronicleError
from dyknow.reasoning.chronicles.definition import model
from dyknow.reasoning.chronicles.definition.compilation import compile_chronicle
from dyknow.reasoning.chronicles.definition.domains import Domain, SymbolSet, symbol_set, symbol_text
from dyknow.reasoning.chronicles.definition.expansion import LIMIT_STATEMENTS, expand
from dyknow.reasoning.chronicles.definition.times import ComplexConstraint
from dyknow.reasoning.formulas.tree import Place

_SHOWN = 8
_MOST_WORK = 20_000_000
_WORK_PER_STATEMENT, _WORK_PER_DECLARATION = 1_000, 20
_EVENTS = (model.Attribute, model.Message, model.Chronicle)
_KINDS: Mapping[type, str] = {
    model.DomainDefinition: "domain",
    model.NamedConstraint: "constraint",
    ComplexConstraint: "constraint on instants",
    model.Attribute: "attribute",
    model.Message: "message",
    model.Chronicle: "chronicle",
}


def check_chronicles(found: Sequence[ReadChronicle], reader: ChronicleReader, broken: Collection[str] = ()) -> None:
    """Add the errors in the declarations that were read to the reader's; those in `broken` are incomplete, and get
    none.
    """
    _Checker(found, reader, broken).check()


class _Checker:
    def __init__(self, found: Sequence[ReadChronicle], reader: ChronicleReader, broken: Collection[str]) -> None:
        self._found, self._reader, self._error, self._broken = found, reader, reader.error, broken
        self._events = self._table(*_EVENTS)
        self._chronicles: dict[str, Any] = self._table(model.Chronicle)
        self._timings, self._conditions = self._table(ComplexConstraint), self._table(model.NamedConstraint)
        self._domains: dict[str, Domain] = {
            name: one.domain for name, one in self._table(model.DomainDefinition).items()
        }
        self._is_closed = any(isinstance(one.declaration, model.Attribute | model.Message) for one in found)
        self._sets: dict[str, SymbolSet] = {}

    def _table(self, *kinds: type) -> dict[str, Any]:
        """Declarations by name; of several with one name the first."""
        some = [one.declaration for one in reversed(self._found) if isinstance(one.declaration, kinds)]
        return {one.name: one for one in some}

    def check(self) -> None:
        self._duplicates()
        for one in self._found:
            if one.declaration.name in self._broken:
                continue
            for mention in one.mentions:
                if self._reader.is_full:
                    return
                self._mentioned(mention)
            match one.declaration:
                case model.DomainDefinition(_, domain):
                    self._symbols(domain, one.place)
                case model.Attribute() | model.Message() | model.NamedConstraint():
                    self._declared(one)
                case ComplexConstraint(_, parameters, _) if parameters:
                    self._only(one, "instant", parameters, "an instant of the constraint")
                case model.Chronicle() as chronicle:
                    self._chronicle(one, chronicle)
        if not self._broken:
            self._circles()
        if not self._broken and not self._reader.errors:
            self._compiled()

    def _compiled(self) -> None:
        """Times that contradict each other, and whatever else cannot be recognised; files of huge chronicles in part."""
        file = model.ChronicleFile(tuple([one.declaration for one in self._found]))
        budget = _MOST_WORK
        for one in self._found:
            if not isinstance(one.declaration, model.Chronicle):
                continue
            budget -= len(self._found) * _WORK_PER_DECLARATION
            if budget < 0:
                return
            try:
                expanded = expand(one.declaration, file)
                budget -= expanded.statements * _WORK_PER_STATEMENT
                budget -= len(expanded.instants) ** 2 * len(expanded.differences)
                compile_chronicle(one.declaration, file)
            except ChronicleError as error:
                budget -= LIMIT_STATEMENTS * _WORK_PER_STATEMENT
                said = str(error).removeprefix(f"chronicle {one.declaration.name}: ")
                places = [place for statement, place in one.statements if str(statement) in said]
                self._error(said, max(places, key=lambda place: place.start, default=one.place))

    def _duplicates(self) -> None:
        seen: dict[tuple[str, str], str] = {}
        for one in self._found:
            kind = _KINDS[type(one.declaration)]
            key = ("event" if isinstance(one.declaration, _EVENTS) else kind, one.declaration.name)
            if key in seen:
                self._error(
                    f"{one.declaration.name} is declared already, as {seen[key]}",
                    one.place,
                    "another name, or one of them",
                )
            seen.setdefault(key, f"{_a(kind)} in line {one.place.line}")

    # Names

    def _mentioned(self, mention: Mention) -> None:
        what, place = mention.what, mention.place
        match mention.kind:
            case "domain" if what.name not in self._domains:
                self._unknown("domain", what.name, self._domains, place, f"domain {what.name} = {{...}}")
            case "event":
                self._event(what, place)
            case "part":
                self._part(what, place)
            case "conditions":
                self._use("constraint", what.name, what.arguments, self._conditions, place)
            case "timing":
                self._use("constraint on instants", what.name, what.points, self._timings, place)

    def _unknown(self, kind: str, name: str, known: Iterable[str], place: Place, otherwise: str) -> None:
        if name in self._broken:
            return
        repair = nearest(name, [*known, *self._broken], f"declare it: {otherwise}")
        self._error(f"there is no {kind} {name}", place, repair)

    def _use(self, kind: str, name: str, given: Sequence[object], known: Mapping[str, Any], place: Place) -> None:
        if name not in known:
            between = "[?a, ?b] { ?a != ?b }" if kind == "constraint" else "(t1, t2) { t1 < t2 }"
            self._unknown(kind, name, known, place, f"constraint {name}{between}")
        else:
            self._arity(kind, name, given, known[name].parameters, place)

    def _arity(self, kind: str, name: str, given: Sequence[object], wanted: Sequence[object], place: Place) -> None:
        if len(given) != len(wanted):
            shown = ", ".join(map(str, wanted))
            form = f"{name}({shown})" if kind == "constraint on instants" else f"{name}[{shown}]" if wanted else name
            self._error(f"the {kind} {name} takes {len(wanted)}, here are {len(given)}", place, form)

    def _event(self, type_: model.EventType, place: Place) -> None:
        known = self._events.get(type_.name)
        if known is None:
            if self._is_closed:
                shown = str(
                    model.EventType(
                        type_.name, tuple(model.ChronicleVariable(f"x{at + 1}") for at in range(len(type_.arguments)))
                    )
                )
                kind = "attribute" if type_.change else "message"
                self._unknown(kind, type_.name, self._events, place, f"{kind} {shown}")
            return
        kind = _KINDS[type(known)]
        self._arity(kind, type_.name, type_.arguments, known.parameters, place)
        if isinstance(known, model.Attribute) and type_.change is None:
            bare = str(model.EventType(type_.name, type_.arguments))
            self._error(f"{type_.name} is an attribute, whose events are changes", place, f"{bare}:(?, true)")
        elif not isinstance(known, model.Attribute) and type_.change is not None:
            bare = str(model.EventType(type_.name, type_.arguments))
            self._error(f"{type_.name} is a {kind}, which has no value", place, bare)
        elif not isinstance(known, model.Chronicle):
            self._values(known, type_, place)

    def _values(self, known: model.Attribute | model.Message, type_: model.EventType, place: Place) -> None:
        """Symbols of an event outside the domains that its declaration gives."""
        pairs = [
            *zip(known.parameters, type_.arguments, strict=False),
            *((model.VALUE, one) for one in type_.change or ()),
        ]
        for variable, given in pairs:
            if not isinstance(given, str):
                continue
            if isinstance(variable, str) and given != variable:
                self._error(f"{symbol_text(given)} is no value here: it is declared as {variable}", place, variable)
            for domain in self._domains_of(known.constraints, variable):
                inside = self._symbols(domain, None)
                if inside is not None and given not in inside:
                    some = ", ".join(sorted(inside.symbols)[:8])
                    here = "all but " if inside.all_but else ""
                    self._error(
                        f"{symbol_text(given)} is outside the domain of {variable}: {here}{some or 'nothing'}",
                        place,
                        "" if inside.all_but else nearest(given, sorted(inside.symbols)),
                    )

    @staticmethod
    def _domains_of(constraints: Iterable[object], variable: model.Parameter) -> list[Domain]:
        """The domains that constraints give to a variable outright."""
        return [
            one.domain
            for one in constraints
            if isinstance(one, model.MemberOf) and one.inside and one.variable == variable
        ]

    def _symbols(self, domain: Domain, place: Place | None) -> SymbolSet | None:
        """The symbols in a domain; None, and an error, if it names itself; unknown names are reported elsewhere."""
        key = str(domain)
        if key not in self._sets:
            try:
                self._sets[key] = symbol_set(domain, self._domains)
            except ChronicleError as error:
                if place is not None and "no domain is called" not in str(error):
                    self._error(str(error), place, "domain D = {a, b}")
                return None
        return self._sets[key]

    # Declarations

    def _declared(self, found: ReadChronicle) -> None:
        """Constraints of a declaration are on its parameters, and on the value of an attribute."""
        declaration = found.declaration
        parameters = {one for one in getattr(declaration, "parameters", ()) if isinstance(one, model.ChronicleVariable)}
        own = {model.VALUE} if isinstance(declaration, model.Attribute) else set[model.ChronicleVariable]()
        self._only(found, "variable", parameters | own, f"in the brackets of {declaration.name}")
        for mention in found.mentions:
            if mention.kind == "condition" and isinstance(mention.what, model.MemberOf):
                self._something(mention.what.domain, mention.what.variable, mention.what.inside, mention.place)

    def _only(self, found: ReadChronicle, kind: str, allowed: Iterable[object], where: str) -> None:
        known = set(allowed)
        for mention in found.mentions:
            if mention.kind == kind and mention.what not in known and str(mention.what) not in "?*":
                self._error(f"{mention.what} is not {where}", mention.place, nearest(str(mention.what), known))

    def _something(self, domain: Domain, variable: model.ChronicleVariable, inside: bool, place: Place) -> None:
        found = self._symbols(domain, place)
        nothing = SymbolSet() if inside else SymbolSet(all_but=True)
        if found == nothing:
            self._error(f"{variable} can have no value: {domain} holds {'nothing' if inside else 'everything'}", place)

    def _chronicle(self, found: ReadChronicle, chronicle: model.Chronicle) -> None:
        events = [one for one in found.mentions if one.kind == "event"]
        parts = [one for one in found.mentions if one.kind == "part"]
        if not parts and not any(one.needed for one in events):
            self._error(
                f"chronicle {chronicle.name} asks for no event, so that nothing could be recognised",
                found.place,
                "event(...) or occurs(1, oo, ...)",
            )
        standing = {
            one for mention in events for one in mention.what.parameters if isinstance(one, model.ChronicleVariable)
        }
        standing |= {
            one for mention in parts for one in mention.what.arguments if isinstance(one, model.ChronicleVariable)
        }
        self._variables(found, standing)
        self._instants(found, chronicle)
        for statement, place in found.statements:
            if isinstance(statement, model.MemberOf):
                self._something(statement.domain, statement.variable, statement.inside, place)
            elif isinstance(statement, model.Variables) and statement.domain is not None:
                self._something(statement.domain, statement.variables[0], inside=True, place=place)
        self._empty(found)

    def _variables(self, found: ReadChronicle, standing: set[model.ChronicleVariable]) -> None:
        """A variable means something only where an event or a part has it."""
        told: set[model.ChronicleVariable] = set()
        for mention in found.mentions:
            variable = mention.what
            if mention.kind != "variable" or not variable.name or variable in standing or variable in told:
                continue
            told.add(variable)
            repair = nearest(str(variable), [one for one in standing if one.name], f"event(...[{variable}], t1)")
            if variable == model.VALUE:
                repair = "the value of an attribute is named in its event: event(a[?x]:(?, ?new), t1)"
            self._error(f"{variable} is not bound: it stands in no event and in no part", mention.place, repair)

    def _instants(self, found: ReadChronicle, chronicle: model.Chronicle) -> None:
        """An instant that is only compared is a mistyped one, unless it is declared."""
        happens = {one.what for one in found.mentions if one.kind == "instant" and one.needed} | {"start", "end"}
        told: set[str] = set()
        compared = [(one.what, one.place) for one in found.mentions if one.kind == "instant"]
        for one in found.mentions:
            if one.kind == "timing":
                compared += [(name, one.place) for name in self._instants_of(one.what.name, set())]
        for what, place in compared:
            if what not in happens | told:
                told.add(what)
                repair = nearest(what, sorted(happens), f"instant {what}")
                self._error(f"nothing happens at {what}: it is only compared", place, repair)
        seen: set[str] = set()
        for name in chronicle.instants:
            if name in seen or name in {"start", "end"}:
                self._error(f"the instant {name} is there already", found.place, "another name")
            seen.add(name)

    def _instants_of(self, timing: str, seen: set[str]) -> Iterator[str]:
        """The instants that a constraint without parameters takes from where it is used."""
        if timing in seen or timing not in self._timings or self._timings[timing].parameters:
            return
        seen.add(timing)
        found = next(one for one in self._found if one.declaration is self._timings[timing])
        for mention in found.mentions:
            if mention.kind == "instant":
                yield mention.what
            elif mention.kind == "timing":
                yield from self._instants_of(mention.what.name, seen)

    def _empty(self, found: ReadChronicle) -> None:
        """Domains of one variable that have nothing in common."""
        inside: dict[model.ChronicleVariable, SymbolSet] = {}
        for statement, place in found.statements:
            given: list[tuple[model.ChronicleVariable, Domain]] = []
            if isinstance(statement, model.MemberOf) and statement.inside:
                given = [(statement.variable, statement.domain)]
            elif isinstance(statement, model.Variables) and statement.domain is not None:
                given = [(one, statement.domain) for one in statement.variables]
            for variable, domain in given:
                symbols = self._symbols(domain, None)
                if symbols is None:
                    continue
                before = inside.get(variable)
                inside[variable] = symbols if before is None else before & symbols
                if before and before.symbols and symbols.symbols and inside[variable] == SymbolSet():
                    self._error(f"{variable} can have no value: its domains have nothing in common", place)

    # Parts

    def _part(self, part: model.Inclusion, place: Place) -> None:
        known = self._chronicles.get(part.name)
        if known is None:
            self._unknown("chronicle", part.name, self._chronicles, place, f"chronicle {part.name}[...] {{ ... }}")
            return
        if part.arguments:
            self._arity("chronicle", part.name, part.arguments, known.parameters, place)
        unnamed = sum(label is None for label, _ in part.points)
        if unnamed > len(known.instants):
            self._error(
                f"chronicle {part.name} gives {len(known.instants)} instants by place, here are {unnamed}",
                place,
                f"name them: chronicle {part.name}[...](start = t1, end = t2)",
            )
        labels = [label for label, _ in part.points if label is not None]
        inside = {"start", "end", *known.instants}
        for label in labels:
            if label not in inside:
                repair = nearest(label, sorted(inside), f"start, end, or chronicle {part.name}[...]({label}) {{ ... }}")
                self._error(f"chronicle {part.name} gives no instant {label}", place, repair)

    def _circles(self) -> None:
        """Chronicles that are parts or events of themselves, constraints that use themselves."""
        for kinds, table in (
            (("part", "event"), self._chronicles),
            (("timing",), self._timings),
            (("conditions",), self._conditions),
        ):
            uses = {
                one.declaration.name: [each for each in one.mentions if each.kind in kinds and each.what.name in table]
                for one in self._found
                if table.get(one.declaration.name) is one.declaration
            }
            done: set[str] = set()
            for name in uses:
                self._circle(name, uses, done)

    def _circle(self, first: str, uses: Mapping[str, Sequence[Mention]], done: set[str]) -> None:
        """Depth first, without recursion: a name that is met on the way to itself is reported once."""
        path: list[tuple[str, int]] = [(first, 0)] if first not in done else []
        on_path = {first}
        while path:
            name, at = path.pop()
            if at >= len(uses[name]):
                on_path.discard(name)
                done.add(name)
                continue
            path.append((name, at + 1))
            mention = uses[name][at]
            if mention.what.name in on_path:
                way = [each for each, _ in path]
                circle = [*way[way.index(mention.what.name) :], mention.what.name]
                shown = circle if len(circle) <= _SHOWN else [*circle[: _SHOWN - 2], "...", circle[-1]]
                self._error(f"{' stands on '.join(shown)}: nothing can stand on itself", mention.place, "leave it out")
            elif mention.what.name not in done:
                path.append((mention.what.name, 0))
                on_path.add(mention.what.name)


def _a(kind: str) -> str:
    return f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}"
