"""Action language and problems as text, as "Have another look" prints them, section 4.2.

    (ptl-action
     :name (look-at ?y)
     :precond ( ((?p) (robot-at = ?p)) ((?y) (perceived-object ?y)) )
     :results (cond
       ((and (mark ?y = t) (mark-visible-from ?y = ?p)) (obs (mark! ?y = t)))
       ((not (and (mark ?y = t) (mark-visible-from ?y = ?p))) (obs (mark! ?y = f))))
     :cost 1
     :execute ((aiming-at me ?y)))
    (known (robot-at = r1_1) (perceived-object po-4))
    (hypothesis 1.0 (mark po-4 = t) (mark-visible-from po-4 = r1_2) (anchor b1 = po-4))
    (hypothesis 0.5 (anchor b1 = f))
    (goal (?x) (anchored b1 = ?x))

A fluent without `=` is `t`, one that is not mentioned is `f`. A precondition has variables and a condition on them that
has to be known; so has the goal. Comments begin with `;`.
"""

import re
from math import isfinite
from typing import Final, NamedTuple, TypeAlias

from dyknow.model.errors import TextError, did_you_mean
from dyknow.planning.epistemic.actions import ActionResult, EpistemicAction, EpistemicProblem, KnownCondition
from dyknow.planning.epistemic.conditions import (
    AllOf,
    AnyOf,
    Fluent,
    Holds,
    NotSo,
    World,
    WorldCondition,
    is_variable,
    variables_of,
)

LONGEST: Final = 256 * 1024
MOST_HYPOTHESES: Final = 4096
_DEEPEST: Final = 32
_HIGHEST_COST: Final = 1000
_TOKEN = re.compile(r";[^\n]*|[()]|[^\s();]+")
_STATEMENTS: Final = ("ptl-action", "known", "hypothesis", "goal")
_PARTS: Final = (":name", ":precond", ":results", ":cost", ":execute")


class _Word(NamedTuple):
    text: str
    offset: int


class _List(NamedTuple):
    items: "tuple[_Word | _List, ...]"
    offset: int


_Item: TypeAlias = _Word | _List


def read_epistemic(text: str, file: str = "") -> EpistemicProblem:
    """The problem.

    Raises:
        TextError: at the first thing that is wrong.
    """
    return _ProblemReader(text, file).problem()


class _ProblemReader:
    def __init__(self, text: str, file: str) -> None:
        self._text, self._file = text, file
        self._actions: list[EpistemicAction] = []
        self._known: list[tuple[Fluent, str]] = []
        self._hypotheses: list[tuple[float, list[tuple[Fluent, str]]]] = []
        self._goal: KnownCondition | None = None

    def problem(self) -> EpistemicProblem:
        if len(self._text) > LONGEST:
            raise self._error(0, f"more than {LONGEST} characters, the most that is read", "a smaller problem")
        for item in self._items():
            self._statement(item)
        if self._goal is None:
            raise self._error(0, "there is no goal", "(goal (?x) (anchored b1 = ?x))")
        if not self._actions:
            raise self._error(0, "there are no actions", "(ptl-action :name (move ?q) ...)")
        hypotheses = self._hypotheses or [(1.0, [])]
        if len(hypotheses) > MOST_HYPOTHESES:
            raise self._error(0, f"more than {MOST_HYPOTHESES} hypotheses", "those that are most possible")
        worlds = tuple(_world([*self._known, *facts]) for _, facts in hypotheses)
        return EpistemicProblem(tuple(self._actions), worlds, tuple(each for each, _ in hypotheses), self._goal)

    def _items(self) -> tuple[_Item, ...]:
        stack: list[tuple[list[_Item], int]] = [([], 0)]
        for token in _TOKEN.finditer(self._text):
            word, at = token[0], token.start()
            if word == "(":
                if len(stack) > _DEEPEST:
                    raise self._error(at, f"nested deeper than {_DEEPEST}", "a flatter condition")
                stack.append(([], at))
            elif word == ")":
                if len(stack) == 1:
                    raise self._error(at, "a bracket is closed that was not opened", "as many ( as )")
                items, begun = stack.pop()
                stack[-1][0].append(_List(tuple(items), begun))
            elif not word.startswith(";"):
                stack[-1][0].append(_Word(word, at))
        if len(stack) > 1:
            raise self._error(stack[-1][1], "a bracket is opened and not closed", "as many ( as )")
        return tuple(stack[0][0])

    def _statement(self, item: _Item) -> None:
        head = self._head(item, "a statement", f"({' ...), ('.join(_STATEMENTS)} ...)")
        items = item.items[1:] if isinstance(item, _List) else ()
        match head:
            case "ptl-action":
                self._actions.append(self._action(item, items))
            case "known":
                self._known += [self._fact(each) for each in items]
            case "hypothesis" if items:
                self._hypotheses.append((self._degree(items[0]), [self._fact(each) for each in items[1:]]))
            case "goal" if len(items) == 2:
                self._goal = KnownCondition(self._variables(items[0]), self._condition(items[1]))
            case "goal" | "hypothesis":
                example = "(goal (?x) (anchored b1 = ?x))" if head == "goal" else "(hypothesis 1.0 (mark po1 = t))"
                raise self._error(item.offset, f"a {head} that is not complete", example)
            case _:
                hint = did_you_mean(head, _STATEMENTS)
                raise self._error(item.offset, f"unknown statement {head!r}.{hint}", "(known (robot-at = r1_1))")

    def _action(self, item: _Item, items: tuple[_Item, ...]) -> EpistemicAction:
        parts: dict[str, _Item] = {}
        for key, value in zip(items[::2], items[1::2], strict=False):
            part = key.text if isinstance(key, _Word) else ""
            if part not in _PARTS or part in parts:
                what = "stands twice" if part in parts else f"is no part of an action.{did_you_mean(part, _PARTS)}"
                raise self._error(
                    key.offset, f"{part or '('} {what}", "(ptl-action :name (move ?q) :results ((at = ?q)))"
                )
            parts[part] = value
        if len(items) % 2 or not {":name", ":results"} <= set(parts):
            raise self._error(item.offset, "an action has :name and :results", "(ptl-action :name (move ?q) ...)")
        name = tuple(self._word(each) for each in self._list(parts[":name"]))
        conditions = (
            tuple(self._precondition(each) for each in self._list(parts[":precond"])) if ":precond" in parts else ()
        )
        cost = self._cost(parts[":cost"]) if ":cost" in parts else 1
        bound = {variable for each in conditions for variable in each.variables}
        if not name or any(is_variable(word) and word not in bound for word in name):
            message = "every variable of a name is bound in :precond"
            raise self._error(parts[":name"].offset, message, ":precond (((?q) (place ?q)))")
        results = self._results(parts[":results"])
        hook = self._text[parts[":execute"].offset : parts[":execute"].offset + 200] if ":execute" in parts else ""
        return EpistemicAction(name, conditions, results, cost, hook)

    def _precondition(self, item: _Item) -> KnownCondition:
        items = self._list(item)
        if len(items) != 2:
            raise self._error(item.offset, "a precondition has variables and a condition", "((?p) (robot-at = ?p))")
        found = KnownCondition(self._variables(items[0]), self._condition(items[1]))
        free = [each for each in found.variables if each not in variables_of(found.condition)]
        if free:
            message = f"{', '.join(free)} does not occur in the condition, so that nothing binds it"
            raise self._error(items[0].offset, message, "() where there is no variable")
        return found

    def _results(self, item: _Item) -> tuple[ActionResult, ...]:
        items = self._list(item)
        if items and isinstance(items[0], _Word) and items[0].text == "cond":
            clauses = [self._list(each) for each in items[1:]]
            if not all(clauses):
                raise self._error(item.offset, "a clause without condition", "((mark ?y = t) (obs (mark! ?y = t)))")
            return tuple(self._result(self._condition(first), effects) for first, *effects in clauses)
        return (self._result(None, list(items)),)

    def _result(self, condition: WorldCondition | None, items: list[_Item]) -> ActionResult:
        effects, observations = [], []
        for item in items:
            parts = self._list(item)
            if parts and isinstance(parts[0], _Word) and parts[0].text == "obs":
                observations += [self._fact(each) for each in parts[1:]]
            else:
                effects.append(self._fact(item))
        return ActionResult(condition, tuple(effects), tuple(observations))

    def _condition(self, item: _Item) -> WorldCondition:
        head = self._head(item, "a condition", "(mark ?y = t)")
        items = self._list(item)
        if head == "and":
            return AllOf(tuple(self._condition(each) for each in items[1:]))
        if head == "or":
            return AnyOf(tuple(self._condition(each) for each in items[1:]))
        if head == "not" and len(items) == 2:
            return NotSo(self._condition(items[1]))
        return Holds(*self._fact(item))

    def _fact(self, item: _Item) -> tuple[Fluent, str]:
        words = [self._word(each) for each in self._list(item)]
        if "=" not in words and words:
            return tuple(words), "t"
        if len(words) < 3 or words.index("=") != len(words) - 2:
            raise self._error(item.offset, "a fluent has one value", "(mark po-4 = t)")
        return tuple(words[:-2]), words[-1]

    def _variables(self, item: _Item) -> tuple[str, ...]:
        names = tuple(self._word(each) for each in self._list(item))
        if not all(map(is_variable, names)):
            raise self._error(item.offset, "variables begin with ?", "(?x)")
        return names

    def _degree(self, item: _Item) -> float:
        value = self._number(item)
        if not 0.0 < value <= 1.0:
            raise self._error(item.offset, "a possibility is above 0 and at most 1", "(hypothesis 1.0 (mark po1 = t))")
        return value

    def _cost(self, item: _Item) -> int:
        value = self._number(item)
        if value != int(value) or not 1 <= value <= _HIGHEST_COST:
            raise self._error(item.offset, f"a cost is a whole number from 1 to {_HIGHEST_COST}", ":cost 1")
        return int(value)

    def _number(self, item: _Item) -> float:
        try:
            value = float(self._word(item))
        except ValueError:
            value = float("nan")
        if not isfinite(value):
            raise self._error(item.offset, "a number is expected", "1.0")
        return value

    def _head(self, item: _Item, what: str, example: str) -> str:
        if not isinstance(item, _List) or not item.items or not isinstance(item.items[0], _Word):
            raise self._error(item.offset, f"{what} is a list that begins with a word", example)
        return item.items[0].text

    def _list(self, item: _Item) -> tuple[_Item, ...]:
        if not isinstance(item, _List):
            raise self._error(item.offset, f"a list is expected, got {item.text}", "( ... )")
        return item.items

    def _word(self, item: _Item) -> str:
        if not isinstance(item, _Word):
            raise self._error(item.offset, "a word is expected, got a list", "r1_2")
        return item.text

    def _error(self, offset: int, message: str, repair: str) -> TextError:
        return TextError.at_offset(self._text, offset, message, repair=repair, file=self._file)


def _world(facts: list[tuple[Fluent, str]]) -> World:
    values = dict(facts)
    return frozenset(each for each in values.items() if each[1] != "f")
