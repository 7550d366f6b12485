"""The knowledge process factory: prototypes by name, and the processes made from them (thesis 5.4.1)."""

from collections.abc import Mapping, Sequence

from dyknow.errors import PolicyNotSupported, PrototypeExists, UnknownLabel, UnknownPrototype, WrongNumberOfInputs
from dyknow.generator import Generator
from dyknow.labels import Label
from dyknow.network import Network
from dyknow.policy import Policy
from dyknow.processes import Input, OnDemand, Reader, Refinement
from dyknow.prototypes import Prototype, SourcePrototype, UnitPrototype
from dyknow.values import Sort


class ProcessFactory:
    """Makes processes in one network, which is their stream generator manager (5.4.2).

    Args:
        sorts: sorts whose values are checked; any other name is a sort of unchecked values.
    """

    def __init__(self, network: Network, sorts: Mapping[str, Sort] | None = None) -> None:
        self._network, self._sorts = network, sorts or {}
        self._prototypes: dict[str, Prototype] = {}
        self._made: dict[Label, Generator] = {}

    def add_prototype(self, prototype: Prototype) -> None:
        """Offer a prototype under its name.

        Raises:
            PrototypeExists: the name is taken.
        """
        if prototype.name in self._prototypes:
            raise PrototypeExists(prototype.name)
        self._prototypes[prototype.name] = prototype

    def remove_prototype(self, name: str) -> None:
        """Offer it no more; what was made from it goes on.

        Raises:
            UnknownPrototype: there is none.
        """
        if self._prototypes.pop(name, None) is None:
            raise UnknownPrototype(name, tuple(self._prototypes))

    def prototype(self, name: str) -> Prototype:
        """What is offered under a name.

        Raises:
            UnknownPrototype: there is none.
        """
        found = self.find(name)
        if found is None:
            raise UnknownPrototype(name, tuple(self._prototypes))
        return found

    def find(self, name: str) -> Prototype | None:
        """The same; None if nothing is offered under the name."""
        return self._prototypes.get(name)

    def prototypes(self) -> tuple[Prototype, ...]:
        """All that are offered."""
        return tuple(self._prototypes.values())

    def create_knowledge_process(
        self, label: Label, name: str, inputs: Sequence[Input] = (), output_policy: Policy | None = None
    ) -> Generator:
        """A process, and the generator of its output under `label`.

        Raises:
            UnknownPrototype: nothing is offered under `name`.
            WrongNumberOfInputs: it takes another number of streams.
            PolicyNotSupported: its output cannot be provided under `output_policy`.
            LabelAlreadyExists: the label is taken.
        """
        prototype = self.prototype(name)
        arity = len(prototype.inputs) if isinstance(prototype, UnitPrototype) else 0
        if len(inputs) != arity:
            raise WrongNumberOfInputs(name, arity, len(inputs))
        if output_policy is not None and not _supports(prototype, output_policy):
            raise PolicyNotSupported(f"{name} cannot provide its output with {output_policy}")
        sort = self._sorts.get(prototype.sort) or Sort(prototype.sort, is_open=True)
        process = process_of(prototype, inputs, output_policy)
        if process is None:
            made = self._network.add_source(label, sort)
        else:
            made = self._network.add_process(label, sort, process)
        self._made[label] = made
        return made

    def destroy_knowledge_process(self, label: Label) -> None:
        """End a process that was made here, with its generator.

        Raises:
            UnknownLabel: none that was made here carries `label`.
        """
        made = self._made.pop(label, None)
        if made is None or self._network.behind(label) is not made:  # another may carry the label since
            raise UnknownLabel(str(label), tuple(map(str, self._made)))
        self._network.remove(label)


def process_of(
    prototype: Prototype, inputs: Sequence[Input] = (), output_policy: Policy | None = None
) -> OnDemand | None:
    """A process made from a prototype, wherever it runs, not yet attached; None: samples are pushed from outside."""
    if isinstance(prototype, UnitPrototype):
        if prototype.elsewhere is not None:
            return prototype.elsewhere(inputs, output_policy)
        return Refinement(prototype, inputs, output_policy)
    if prototype.elsewhere is not None:
        return prototype.elsewhere()
    return None if prototype.read is None else Reader(prototype)


def _supports(prototype: Prototype, policy: Policy) -> bool:
    if isinstance(prototype, SourcePrototype):
        return policy == Policy()
    return policy.approximation == "none" and prototype.supports(policy)
