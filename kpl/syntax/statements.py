"""KPL specifications from text: the parse tree becomes the tree of specification.py (grammar: kpl.lark).

All errors of a text are reported. Where a text leaves the grammar its statements are read one by one, so that one wrong
statement hides none after it. In `refinement(a with max delay 100, monotone order, b)` the commas of constraints and of
arguments are one list in the parse tree; here each constraint goes to the stream before it.
"""

import re
from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import accumulate
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeAlias, cast

from dyknow.kpl.diagnostics.suggestions import begins_statement
from dyknow.kpl.syntax import specification as spec
from dyknow.kpl.syntax.chronicles import parse_chronicles
from dyknow.kpl.syntax.grammar import LIMIT_CHARACTERS, moved, parse_tree, placed
from dyknow.kpl.syntax.link_options import COMPOSITE_OPTIONS, read_options
from dyknow.kpl.syntax.links import LINKED, read_link
from dyknow.kpl.syntax.named_roads import digest_of, roads_of
from dyknow.kpl.syntax.numbers import parse_number
from dyknow.kpl.syntax.parsing import FormulaReader, blank, line_width, place_of, raise_all, unit_text
from dyknow.kpl.syntax.repairs import MOST_REPAIRED, repaired
from dyknow.model.errors import PolicyError, RoadsError, SourceText, TextError, TextErrors
from dyknow.model.labels import Label
from dyknow.model.semantic_labels import SemanticLabel, definition_errors, sort_errors
from dyknow.model.values import Field, Sort
from dyknow.policies.policy import Policy
from dyknow.reasoning.formulas.evaluation import NoValuePolicy
from dyknow.reasoning.formulas.tree import Place

if TYPE_CHECKING:
    from lark import Token, Tree


_HEADS = "source compunit strmgen stream for sort label export offer import call define monitor chronicle roads want"
_STATEMENT = re.compile(rf"^(?:[ \t]*(?:{_HEADS.replace(' ', '|')})\b|[A-Za-z]\w+)", re.MULTILINE)
ReadFile: TypeAlias = Callable[[str], str]
"""The text of a file that a specification names; raises OSError or UnicodeDecodeError."""
_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
_FREE: Final = frozenset[str]()
_NONE: Final[Mapping[str, str]] = {}
_MONITORED: Final = {"sample_every": "sample every 100", "max_delay": "max delay 1s", "from_to": "from 0"}
"""The states of a monitor, unless it says otherwise."""
MAX_ERRORS: Final = 100
"""Statements that leave the grammar after which reading ends."""


class ReadSpecification(NamedTuple):
    """A text as far as it could be read.

    Attributes:
        specification: the declarations that could be read.
        errors: the errors of the text.
        unread: the words of the statements that could not be read: names in them count as declared.
    """

    specification: spec.Specification
    errors: list[TextError]
    unread: frozenset[str]


def parse_specification(text: str, read_file: ReadFile | None = None) -> spec.Specification:
    """Read a KPL specification, and with `read_file` the files of chronicles and roads it names.

    Raises:
        TextErrors: every error: where the text leaves the grammar, impossible policies, numbers, formulas that read in
            two ways.
        TextError: a limit is passed.
    """
    found = read_specification(text, read_file)
    raise_all(found.errors)
    return found.specification


def read_specification(text: str, read_file: ReadFile | None = None) -> ReadSpecification:
    """The declarations that could be read, and the errors of the text; raises TextError at a limit."""
    reader = _StatementReader(text, read_file)
    try:
        read = reader.declarations(parse_tree(text, "start"))
        return ReadSpecification(read, reader.errors, frozenset(reader.unread))
    except TextError as wrong:
        starts = [found.start() for found in _STATEMENT.finditer(text) if begins_statement(found[0].strip())]
        if len(text) > LIMIT_CHARACTERS or len(starts) < 2:
            raise repaired(wrong, text) from None
        first = wrong
    found: list[spec.Declaration] = []
    unread = reader.unread
    for start, end in zip([0, *starts[1:]], [*starts[1:], len(text)], strict=True):
        lines = text.count("\n", 0, start)
        try:
            found += reader.declarations(moved(parse_tree(text[start:end], "start"), start, lines))
        except TextError as wrong:
            unread.update(_WORD.findall(text[start:end]))
            told = repaired(wrong, text[start:end]) if len(reader.errors) < MOST_REPAIRED else wrong
            reader.errors.append(placed(told, text, lines))
            if len(reader.errors) >= MAX_ERRORS:
                unread.update(_WORD.findall(text[start:]))
                break
    return ReadSpecification(tuple(found), reader.errors or [first], frozenset(unread))


class _StatementReader(FormulaReader):
    """Reads declarations; offsets of the parse tree are those of the whole text."""

    def __init__(self, text: str, read_file: ReadFile | None) -> None:
        super().__init__(text)
        self._read_file = read_file
        self.unread = set[str]()

    def declarations(self, tree: "Tree[Token]") -> tuple[spec.Declaration, ...]:
        found = []
        for node in tree.children:
            try:
                found.append(self.declaration(node))
            except RecursionError:
                self.error("nested too deep for where this is read", place_of(node, self.text), "nest less")
        return tuple(found)

    def declaration(self, node: Any) -> spec.Declaration:
        """One declaration; each rule of the grammar has its method."""
        read: Callable[[Any, Place], spec.Declaration] = getattr(self, f"_{node.data}")
        return read(node, place_of(node, self.text))

    # Declarations

    def _source(self, node: Any, place: Place) -> spec.Declaration:
        sort, name = map(_name, node.children)
        return spec.SourceDeclaration(sort, name, place=place)

    def _compunit(self, node: Any, place: Place) -> spec.Declaration:
        sort, name, *inputs = map(_name, node.children)
        return spec.UnitDeclaration(sort, name, tuple(inputs), place=place)

    def _strmgen(self, node: Any, place: Place) -> spec.GeneratorDeclaration:
        label, _equals, made = node.children
        return spec.GeneratorDeclaration(self.label(label), self._made(made, place_of(made, self.text)), place=place)

    def _made(self, node: Any, place: Place) -> spec.Making:
        parts = node.children
        match node.data:
            case "from_source":
                return spec.FromSource(str(parts[0]), place=place)
            case "refine":
                inputs, policy = self._constrained(parts[1:])
                return spec.Refinement(str(parts[0]), inputs, policy, place=place)
            case "state":
                return spec.StateStream(*self._constrained(parts), place=place)
            case "first_of":
                return spec.FirstOf(self._terms(parts), place=place)
            case "believe":
                return self._belief(parts, place)
            case "link":
                return read_link(self, self.label(parts[0]), _name(parts[1]), parts[2:], place)
            case "composite":
                together, stays = (self.read(condition, LINKED) for condition in parts[1:3])
                more = read_options(self, parts[3:], COMPOSITE_OPTIONS)
                return spec.Composite(self.label(parts[0]), together, stays, **more, place=place)
        member, variable, domain = parts
        make = spec.Select if node.data == "select" else spec.Merge
        return make(self._member(member), _name(variable), self._member(domain), place=place)

    def _belief(self, parts: Sequence[Any], place: Place) -> spec.Making:
        from dyknow.anchoring.belief.files.described import read_world

        *others, last = parts
        wanted = last.children[0] if last.data == "task" else None
        task = "" if wanted is None else wanted[1:-1] if isinstance(wanted, str) else self.label(wanted)
        sources = [each for each in (*others, last) if getattr(each, "data", "") == "observing"]
        paths = tuple(str(each)[1:-1] for each in others if isinstance(each, str))
        made = spec.Belief(paths, tuple(map(self._observing, sources)), task, place=place)
        try:
            world = (
                None if self._read_file is None else read_world(tuple((each, self._read_file(each)) for each in paths))
            )
            return made if world is None else replace(made, digest=world.digest, world=world)
        except TextErrors as wrong:
            self.errors += wrong.errors
        except (OSError, UnicodeDecodeError) as wrong:
            self.error(f"{', '.join(paths)} cannot be read: {wrong}", place, "the paths, from where this file lies")
        return made

    def _observing(self, node: Any) -> spec.Observing:
        label, sensor, *more = node.children
        options, place = {each.data: each.children[0] for each in more}, place_of(node, self.text)
        view = self.label(options["in_view"]) if "in_view" in options else None
        trust = self.attempt(lambda: float(parse_number(str(options.get("trust", 1)))), place, 1.0)
        if not 0.0 <= trust <= 1.0:
            self.error("trust is from 0, not at all, to 1", place, "trust 0.8")
        return spec.Observing(self.label(label), _name(sensor), view, trust, place=place)

    def _constrained(self, parts: Sequence[Any]) -> tuple[tuple[spec.StreamTerm, ...], Policy]:
        """The input streams, and the policy of the output."""
        constrained = parts[-1].data == "policy"
        policy = self._policy(parts[-1].children) if constrained else spec.ANY_UPDATE
        return self._terms(parts[:-1] if constrained else parts), policy

    def _stream(self, node: Any, place: Place) -> spec.Declaration:
        name, _equals, label, *policy = node.children
        return spec.StreamDeclaration(_name(name), self._term(label, policy), place=place)

    def _for_each(self, node: Any, place: Place) -> spec.Declaration:
        *variables, domain, body = (each for each in node.children if each.data != "left_out")
        left_out = next((each.children for each in node.children if each.data == "left_out"), ())
        names, at = tuple(map(_name, variables)), place_of(body, self.text)
        if len(set(names)) < len(names):
            self.error(
                "each object of a member has a name of its own", place, f"for a, b in ..., not {', '.join(names)}"
            )
        if body.data == "monitor":
            inside = self._monitor(body, at, frozenset(names))
        else:
            inside = cast("Any", self.declaration(body))
        return spec.ForEach(
            names, self._member(domain), inside, tuple(str(self.object(each, _FREE)) for each in left_out), place=place
        )

    def _sort_(self, node: Any, place: Place) -> spec.Declaration:
        name, *shape = node.children
        sort = self._shaped(_name(name), shape)
        self._refuse(sort_errors(sort), place)
        return spec.SortDeclaration(sort, place=place)

    def _label_(self, node: Any, place: Place) -> spec.Declaration:
        name, sort, *shape, meaning = node.children
        shaped = self._shaped(_name(sort), shape)
        label = SemanticLabel(_name(name), shaped, str(meaning)[1:-1])
        tried = label if shape else replace(label, sort=Sort(shaped.name, unit="1"))
        self._refuse(definition_errors(tried), place)
        return spec.LabelDeclaration(label.name, shaped, label.meaning, place=place)

    def _shaped(self, name: str, shape: Sequence[Any]) -> Sort:
        """The sort of that name; an open one without a unit or fields."""
        if not shape:
            return Sort(name, is_open=True)
        if shape[0].data == "in_unit":
            return Sort(name, unit=unit_text(shape[0].children[0]))
        return Sort(
            name, tuple(Field(_name(part.children[0]), "".join(map(unit_text, part.children[1:]))) for part in shape)
        )

    def _refuse(self, wrong: Iterable[tuple[str, str]], place: Place) -> None:
        for message, repair in wrong:
            self.error(message, place, repair)

    def _export(self, node: Any, place: Place) -> spec.Declaration:
        visibility: spec.ExportVisibility = "public"
        parts = list(node.children)
        if parts[0].data == "visibility":
            visibility = cast("spec.ExportVisibility", str(parts.pop(0).children[0]))
        semantic, _equals, label, *others = parts
        receivers = [
            str(self.object(each, _FREE)) for part in others if part.data == "receivers" for each in part.children
        ]
        policy = [part for part in others if part.data == "policy"]
        if visibility == "private" and receivers:
            self.error(
                "what is private goes to no other platform",
                place,
                f"export {_name(semantic)} = ... to {', '.join(receivers)}",
            )
        return spec.Export(
            _name(semantic), self._term(label, policy), visibility, tuple(dict.fromkeys(receivers)), place=place
        )

    def _offer(self, node: Any, place: Place) -> spec.Declaration:
        semantic, _equals, label, cost, *others = node.children
        receivers = [
            str(self.object(each, _FREE)) for part in others if part.data == "receivers" for each in part.children
        ]
        amount = self.attempt(lambda: float(parse_number(str(cost))), place_of(cost, self.text), 0.0)
        if amount > 1e12:
            self.error("the cost is too high", place_of(cost, self.text), "at most 1e12")
        term = self._term(label, [part for part in others if part.data == "policy"])
        return spec.Export(_name(semantic), term, "public", tuple(dict.fromkeys(receivers)), amount, place=place)

    def _call(self, node: Any, place: Place) -> spec.Declaration:
        semantic, label, *policy = node.children
        return spec.Import(_name(semantic), spec.CALLED, self._term(label, policy), place=place)

    def _import_(self, node: Any, place: Place) -> spec.Declaration:
        semantic, unit, label, *policy = node.children
        return spec.Import(_name(semantic), str(self.object(unit, _FREE)), self._term(label, policy), place=place)

    def _define(self, node: Any, place: Place) -> spec.Declaration:
        label, _equals, formula = node.children
        feature = self.feature(label, _FREE)
        if len(set(feature.objects)) < len(feature.objects):
            repair = f"{feature.name}[{', '.join(dict.fromkeys(map(str, feature.objects)))}]"
            self.error("each parameter of a definition has a name of its own", feature.place, repair)
        return spec.Define(feature, self.read(formula, frozenset(map(str, feature.objects))), place=place)

    def _monitor(self, node: Any, place: Place, bound: frozenset[str] = _FREE) -> spec.MonitorDeclaration:
        name, _equals, formula, *options = node.children
        no_value: NoValuePolicy = "undecided"
        close_after, constraints = 2, []
        seen = set[str]()
        for option in options:
            if option.data in seen and option.data in {"no_value", "close_after", "avoidance"}:
                self.error("a monitor has one such option", place_of(option, self.text), "leave one out")
            seen.add(option.data)
            if option.data == "no_value":
                no_value = cast("NoValuePolicy", str(option.children[-1]))
            elif option.data == "close_after":
                close_after = self.states(option.children[0])
            elif option.data == "avoidance":
                pass  # that it is there is all it says
            else:
                constraints.append(option)
        inside, policy = self.read(formula, bound), self._policy(constraints, _MONITORED)
        return spec.MonitorDeclaration(
            _name(name), inside, policy, no_value, close_after, "avoidance" in seen, place=place
        )

    def _chronicle_file(self, node: Any, place: Place) -> spec.Declaration:
        quoted, *options = node.children
        path, content = str(quoted)[1:-1], None
        kinds = [option.data for option in options]
        for kind in ("max_age", "since_ever"):
            if kinds.count(kind) > 1:
                again = options[-1 - kinds[::-1].index(kind)]
                self.error("a file of chronicles has one such option", place_of(again, self.text), "leave one out")
        own = {each.data: each for each in options if each.data in {"max_age", "since_ever"}}
        policy = self._policy([each for each in options if each.data not in own])
        if self._read_file is not None:
            try:
                content = parse_chronicles(SourceText(self._read_file(path), path))
            except TextErrors as wrong:
                self.errors += wrong.errors
            except (TextError, OSError, UnicodeDecodeError) as wrong:
                self.error(f"{path} cannot be read: {wrong}", place, "the path, from where this file lies")
            if content is None:
                self.unread.update((spec.RECOGNISED, spec.PARTIAL))
        max_age_us = self.age(own["max_age"]) if "max_age" in own else None
        since_ever = "since_ever" in own and (tuple(map(_name, own["since_ever"].children)) or True)
        return spec.ChronicleDeclaration(path, policy, content, max_age_us, since_ever, place=place)

    def _roads(self, node: Any, place: Place) -> spec.Declaration:
        path = str(node.children[0])[1:-1]
        if self._read_file is None:
            return spec.RoadsDeclaration(path, place=place)
        try:
            text = self._read_file(path)
            return spec.RoadsDeclaration(path, digest_of(text), roads_of(text, path), place=place)
        except RoadsError as wrong:
            self.error(str(wrong), place, f"dyknow roads check {path}")
        except (OSError, UnicodeDecodeError) as wrong:
            self.error(f"{path} cannot be read: {wrong}", place, "the path, from where this file lies")
        return spec.RoadsDeclaration(path, place=place)

    def _want(self, node: Any, place: Place) -> spec.Declaration:
        name, stream, _equals, description = node.children
        symbol = _name(name)
        return spec.WantDeclaration(
            symbol, self.label(stream), self.read(description, frozenset({symbol})), place=place
        )

    # Labels, terms and policies

    def label(self, node: Any) -> Label:
        feature = self.feature(node, _FREE)
        return Label(feature.stem, tuple(map(str, feature.objects)))

    def _term(self, label: Any, policy: Sequence[Any]) -> spec.StreamTerm:
        """A label, and the constraints of an optional policy."""
        constraints = policy[0].children if policy else ()
        return spec.StreamTerm(self.label(label), self._policy(constraints), place=place_of(label, self.text))

    def _member(self, node: Any) -> spec.StreamTerm:
        label, *policy = node.children
        return self._term(label, policy)

    def _terms(self, flat: Iterable[Any]) -> tuple[spec.StreamTerm, ...]:
        """Streams and the constraints of those before them, as they come."""
        grouped: list[tuple[Any, list[Any]]] = []
        for node in flat:
            if node.data == "label_with":
                label, *first = node.children
                grouped.append((label, first))
            elif grouped[-1][1]:
                grouped[-1][1].append(node)
            else:
                self.error("constraints follow a label and `with`", place_of(node, self.text), "pos[car1] with ...")
        return tuple(
            spec.StreamTerm(self.label(label), self._policy(constraints), place=place_of(label, self.text))
            for label, constraints in grouped
        )

    def _policy(self, constraints: Sequence[Any], usual: Mapping[str, str] = _NONE) -> Policy:
        """One reader for policies wherever they stand: here it gets the words of the constraints, without comments.

        `usual` has the constraints of those not given where the most recent value is used.
        """
        if not constraints:
            return spec.ANY_UPDATE
        places = [place_of(constraint, self.text) for constraint in constraints]
        words = [blank(self.text[place.start : place.end]) for place in places]
        kinds = {each.data for each in constraints}
        if "use_most_recent" in kinds:
            words += [each for kind, each in usual.items() if kind not in kinds]
        try:
            return Policy.parse(", ".join(words))
        except TextError as wrong:
            starts = [0, *accumulate(len(each) + 2 for each in words[:-1])]
            self.error(
                wrong.message, places[min(len(places), bisect_right(starts, wrong.column - 1)) - 1], wrong.repair
            )
        except PolicyError as wrong:
            whole = places[0]._replace(width=line_width(self.text, places[0].start, places[-1].end))
            self.error(str(wrong), whole, wrong.repair)
        return spec.ANY_UPDATE


def _name(node: Any) -> str:
    return str(node.children[0])
