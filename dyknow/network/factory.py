"""The knowledge process factory: prototypes by name, and the processes made from them (thesis 5.3.1, 5.4.1)."""

from collections.abc import Iterable, Sequence

from dyknow.model.errors import PolicyNotSupported, PrototypeExists, UnknownPrototype, WrongNumberOfInputs
from dyknow.network.process import Input, Process
from dyknow.network.processes import SourceReader
from dyknow.network.prototypes import Prototype, SourcePrototype, UnitPrototype
from dyknow.network.refinement import RefinementProcess
from dyknow.policies.policy import Policy


class Prototypes:
    """Prototypes by name (the registry of the knowledge process factory, thesis 5.4.1)."""

    def __init__(self, prototypes: Iterable[Prototype] = ()) -> None:
        self._by_name: dict[str, Prototype] = {}
        for prototype in prototypes:
            self.add(prototype)

    def add(self, prototype: Prototype) -> None:
        """Register a prototype.

        Raises:
            PrototypeExists: the name is taken.
        """
        if prototype.name in self._by_name:
            raise PrototypeExists(prototype.name)
        self._by_name[prototype.name] = prototype

    def remove(self, name: str) -> Prototype:
        """Remove a prototype; processes made from it keep running.

        Raises:
            UnknownPrototype: no prototype has the name.
        """
        if name not in self._by_name:
            raise UnknownPrototype(name, tuple(self._by_name))
        return self._by_name.pop(name)

    def find(self, name: str) -> Prototype | None:
        """The prototype of that name, or None."""
        return self._by_name.get(name)

    def all(self) -> tuple[Prototype, ...]:
        """All prototypes, in the order in which they were added."""
        return tuple(self._by_name.values())


def process_of(
    prototype: Prototype, inputs: Sequence[Input] = (), output_policy: Policy | None = None
) -> Process | None:
    """A process made from a prototype, on whichever host it runs; None: its samples are pushed from outside.

    Raises:
        WrongNumberOfInputs: the prototype takes another number of streams.
        PolicyNotSupported: it cannot provide its output under `output_policy`.
    """
    arity = len(prototype.inputs) if isinstance(prototype, UnitPrototype) else 0
    if len(inputs) != arity:
        raise WrongNumberOfInputs(prototype.name, arity, len(inputs))
    if output_policy is not None:
        check_output(prototype, output_policy)
    if isinstance(prototype, UnitPrototype):
        if prototype.elsewhere is not None:
            return prototype.elsewhere(inputs, output_policy)
        return RefinementProcess(prototype, inputs, output_policy)
    if prototype.elsewhere is not None:
        return prototype.elsewhere()
    return None if prototype.read is None else SourceReader(prototype)


def check_output(prototype: Prototype, policy: Policy) -> None:
    """Refuse an output policy that a process of this prototype cannot keep: sources keep none, units do not approximate.

    Raises:
        PolicyNotSupported: it cannot.
    """
    if isinstance(prototype, SourcePrototype):
        supported = policy == Policy()
    else:
        supported = policy.approximation == "none" and prototype.supports(policy)
    if not supported:
        raise PolicyNotSupported(f"{prototype.name} cannot provide its output with {policy}")
