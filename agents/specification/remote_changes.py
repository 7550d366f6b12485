"""The specification of a platform, shown to and changed by other members: declarations come, go, and come back.

A requested change is checked as a whole before anything changes (`dyknow.kpl.running.instance`). A change comes with its text and the
chronicle files that this names; the code of units is never sent: they are named, and must be there.
"""

from collections.abc import Iterable, Sequence

from dyknow import Label, Network
from dyknow.agents.actions import QUERIED, Action, Offer, Role
from dyknow.agents.monitoring.monitors import UnitMonitors
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.specification.specification_part import OWNER, SPECIFICATION, SpecificationPart, read
from dyknow.agents.tasks.requests import RESET
from dyknow.federation.messages import contents
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents.parts import uncontrolled
from dyknow.federation.shares import ActLimits
from dyknow.kpl import Specification, print_declaration, print_specification
from dyknow.kpl.checking.symbols import symbol_of
from dyknow.kpl.introspection.drawings import drawn
from dyknow.kpl.introspection.graph import graph_of
from dyknow.kpl.running.changes import difference
from dyknow.kpl.syntax.specification import Declaration, MonitorDeclaration
from dyknow.model.errors import Refused, SourceText, TextError, did_you_mean

PAGE = 4000
"""Characters of a specification in one answer."""
CHANGES_PER_S, CHANGES_BURST = 1.0, 8.0
"""Changes that one member may ask for: each is read and judged on the thread of the platform."""
_LISTED, _LINE = 20, 300
"""Lines of an answer, and characters of one: an answer is one act."""


class SpecificationChanges(Part):
    """Shows and changes the specification for other members, by their roles (`dyknow.agents.actions.Role`).

    Args:
        monitors: a declaration that a task needs is not taken back.
        declared: (unit, label as text) -> the stream of the instance that the unit may ask for.
        note: takes words for the operator of the platform; every change is noted.
    """

    offers = (
        Offer(
            SPECIFICATION,
            (
                Action(contents.Specification, "on_asked", QUERIED),
                Action(contents.AddDeclarations, "on_add", role=Role.COMMAND_CENTRE),
                Action(contents.RemoveDeclarations, "on_remove", role=Role.COMMAND_CENTRE),
                Action(contents.LoadSpecification, "on_load", role=Role.COMMAND_CENTRE),
                Action(contents.RestoreSpecification, "on_restore", role=Role.COMMAND_CENTRE),
                RESET,
            ),
        ),
    )
    answers = (contents.SpecificationText, contents.SpecificationChanged)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._network, self._declared = ports.network, ports.declared()
        self._agent, self._clock, self._monitors = ports.agent, ports.clock, parts[UnitMonitors.of]
        self._note = ports.note
        self._specified, self._instance = parts[SpecificationPart], parts[SpecificationPart].instance
        self._limits = ActLimits(CHANGES_PER_S, CHANGES_BURST)

    def on_asked(self, act: Act, content: contents.Specification, now_us: int) -> None:
        """Print back what is held, or was.

        Raises:
            Refused: there is none of that number.
        """
        held = self._instance.configurations
        number = len(held) - 1 if content.number is None else content.number
        if not 0 <= number < len(held):
            raise Refused(
                f"there is no configuration {number}; {len(held)} are kept, counted from 0" if held
                else "this platform was given no specification", "unknown-number"
            )  # fmt: skip
        if content.form == "kpl":
            text = print_specification(held[number].specification)
        else:
            text = drawn(graph_of(self._instance), content.form)
        at_us, last = held[number].at_us, len(held) - 1

        def page(part: Iterable[str], more: bool) -> contents.SpecificationText:
            return contents.SpecificationText(
                text=uncontrolled("".join(part)), number=number, last=last, at_us=at_us, more=more
            )

        self._agent.answer_pages(act, text, PAGE, page, now_us)

    def on_add(self, act: Act, content: contents.AddDeclarations, now_us: int) -> None:
        """`(add-declarations text: "stream s = alt[self]")`: declare that, too. Node clock.

        Raises:
            Refused: as `_check_pace`, `_read` and `_change`.
        """
        self._check_pace(act, now_us)
        text, added = self._read(act, content)
        self._change(act, (*self._instance.specification, *added), text, now_us)

    def on_load(self, act: Act, content: contents.LoadSpecification, now_us: int) -> None:
        """`(load-specification text: ...)`: replace the whole specification by that. Node clock.

        Raises:
            Refused: as `_check_pace`, `_read` and `_change`.
        """
        self._check_pace(act, now_us)
        text, loaded = self._read(act, content)
        self._change(act, loaded, text, now_us)
        self._specified.not_taken = None

    def on_remove(self, act: Act, content: contents.RemoveDeclarations, now_us: int) -> None:
        """`(remove-declarations names: (sequence speed))`: declare that no more. Node clock.

        Raises:
            Refused: as `_change`, or nothing, or more than one kind of thing, is called so.
        """
        self._check_pace(act, now_us)
        held = self._instance.specification
        gone = {id(each) for name in content.names for each in _called(name, held)}
        text = SourceText("", "the remaining specification")
        self._change(act, tuple(each for each in held if id(each) not in gone), text, now_us)

    def on_restore(self, act: Act, content: contents.RestoreSpecification, now_us: int) -> None:
        """`(restore-specification number: 0)`: hold again what was held then, checked as if it were new. Node clock.

        Raises:
            Refused: there is none of that number, or as `_change`.
        """
        self._check_pace(act, now_us)
        number, held = content.number, self._instance.configurations
        if number >= len(held):
            raise Refused(
                f"configuration: expected a number from 0 to {len(held) - 1}, got {number}"
                if held
                else "this platform was given no specification",
                "unknown-number",
            )
        text = SourceText("", f"configuration {number}")
        self._change(act, held[number].specification, text, now_us)

    def on_reset(self, act: Act, content: contents.Reset, now_us: int) -> None:
        """`(reset stream: "speed[self]")`: forget its samples. Node clock.

        It is for members that may replace the declaration, which forgets as well. Streams of the vehicle, imports and
        streams derived on demand keep theirs: other members count on them. Monitors, chronicles and units are not
        affected: they take samples as they come.

        Raises:
            Refused: as `_check_pace`; the requester may not see the stream; `not-declared`: it is none of the
                specification.
            TextError, UnknownLabel: there is no such stream.
        """
        self._check_pace(act, now_us)
        label = self._declared(act.sender.unit, content.stream)
        if label not in self._instance.parts.held:
            raise Refused(
                f"{content.stream} is not declared by the specification of {self._agent.unit}: its samples stay, since "
                "other members ask for them",
                "not-declared",
            )
        count = _forget(self._network, label)
        self._note(f"{act.sender.unit} had the history of {label} forgotten ({act.conversation_id}): {count} samples")
        self._agent.done(act, now_us, f"{count} samples of {label} are forgotten")

    def _check_pace(self, act: Act, now_us: int) -> None:
        """Before a text is read, which is what costs time; raises Refused."""
        sender = act.sender.unit
        if not self._limits.admit(sender, now_us):
            text = f"{sender} changes this specification too often; once a second is possible"
            raise Refused(text, "too-many-changes")

    @staticmethod
    def _read(
        act: Act, content: contents.AddDeclarations | contents.LoadSpecification
    ) -> tuple[SourceText, Specification]:
        """The text, with its name for errors, and its declarations; raises Refused, `text`: it is not valid."""
        text = SourceText(content.text, uncontrolled(content.file) or f"declarations of {act.sender.unit}")
        try:
            return text, read(text, tuple((each.path, each.text) for each in content.files))
        except TextError as wrong:
            raise Refused(str(wrong), "text") from None

    def _change(self, act: Act, wanted: Specification, text: SourceText, now_us: int) -> None:
        """Hold this from now on, answer what that changes, and tell the operator.

        Raises:
            Refused: with the code `in-use`: a task needs what would go; `text`: something is wrong with it. All is as it
                was then.
        """
        sender, instance = act.sender.unit, self._instance
        self._check_unused(wanted)
        federation_us, before = self._clock.federation_us(now_us), instance.specification
        if not instance.configurations:
            instance.change((), federation_us)  # so that it can be restored
        try:
            instance.change(wanted, federation_us, text)
        except TextError as wrong:
            raise Refused(str(wrong), "text") from None
        now = instance.specification
        added, removed = _missing_from(before, now), _missing_from(now, before)
        number = len(instance.configurations) - 1
        self._note(f"{sender} changed the specification ({act.conversation_id}): {_summary(added, removed)}")
        self._agent.answer(act, Performative.AGREE, None, now_us)
        lines = _lines(added), _lines(removed)
        changed = contents.SpecificationChanged(
            number=number,
            added=lines[0][:_LISTED],
            removed=lines[1][:_LISTED],
            more=sum(max(0, len(each) - _LISTED) for each in lines),
            warnings=tuple(uncontrolled(each)[:_LINE] for each in self._warnings(text, federation_us)[:4]),
        )
        self._agent.answer(act, Performative.INFORM, changed, now_us)

    def _warnings(self, text: SourceText, now_us: int) -> list[str]:
        lacking = ", ".join(self._instance.lacking)
        waiting = (
            f"nothing here offers {lacking}: the code of units is not sent; offer it with dyknow host MODULE --unit "
            f"{self._agent.unit}, or start the platform with --units MODULE"
        )
        return [*([waiting] if lacking else []), *(each.message for each in self._specified.warn(text, now_us))]

    def _check_unused(self, wanted: Specification) -> None:
        """Raises Refused if a task needs a monitor that would go, or become another."""
        for each in difference(self._instance.specification, wanted).gone:
            if not isinstance(each, MonitorDeclaration):
                continue
            named = self._monitors.named.get(each.name)
            if named is not None and (tasks := sorted(named.owners - {OWNER})):
                raise Refused(
                    f"monitor {each.name} belongs to task {', '.join(tasks)}, which would lose it; "
                    f"cancel that first (dyknow cancel {tasks[0]})",
                    "in-use",
                )


def _forget(network: Network, label: Label) -> int:
    """Forget the samples of a stream and of its attributes; how many the stream had."""
    for each in network.labels():
        if each.objects == label.objects and each.feature.startswith(f"{label.feature}."):
            network.generator(each).history.forget()
    return network.generator(label).history.forget()


def _called(name: str, held: Specification) -> list[Declaration]:
    """The declarations of that name, `speed`, or of that kind and name, `stream speed`.

    Raises:
        Refused: there is none, or there are several kinds of it.
    """
    sought = "".join(name.split())
    named = [(each, _kind(each), _names(each)) for each in held]
    found = [(each, kind) for each, kind, names in named if sought in names or sought in [kind + one for one in names]]
    if not found:
        known = dict.fromkeys(one for _, _, names in named for one in names)
        raise Refused(f"nothing is declared as {name}.{did_you_mean(name, list(known))}", "unknown-name")
    kinds = sorted({kind for _, kind in found})
    if len(kinds) > 1:
        raise Refused(f"{name} is a {' and a '.join(kinds)}; write: '{kinds[0]} {name}'", "ambiguous-name")
    return [each for each, _ in found]


def _kind(declaration: Declaration) -> str:
    return print_declaration(declaration).split(maxsplit=1)[0]


def _names(declaration: Declaration) -> list[str]:
    """The names of a declaration, without blanks."""
    names = (one[0] if type(one) is tuple else one for one in symbol_of(declaration).names)
    return ["".join(str(one).split()) for one in names]


def _missing_from(some: Iterable[Declaration], more: Iterable[Declaration]) -> list[Declaration]:
    """The declarations of `more` that are not in `some`."""
    there = set(some)
    return [each for each in more if each not in there]


def _lines(declarations: Iterable[Declaration]) -> tuple[str, ...]:
    return tuple(uncontrolled(print_declaration(each))[:_LINE] for each in declarations)


def _summary(added: Sequence[Declaration], removed: Sequence[Declaration]) -> str:
    parts = [f"{sign} {line[:80]}" for sign, some in (("+", added), ("-", removed)) for line in _lines(some[:4])]
    more = len(added) + len(removed) - len(parts)
    return ("; ".join(parts) or "as it was") + (f"; and {more} more" if more else "")
