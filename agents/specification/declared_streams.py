"""Streams of the instance that others ask for by its own labels, whether they are exported or not."""

from dyknow import Label, Network
from dyknow.agents.exchange.label_agreements import LabelAgreements
from dyknow.agents.hosts.hosted import HostedProcess
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.sharing.translation import Translation
from dyknow.kpl import Instance
from dyknow.kpl.syntax.specification import Import
from dyknow.model.errors import Refused, UnknownLabel


class DeclaredStreams:
    """The streams that a specification makes, those derived on demand or recognised, those of hosts and of the vehicle.

    A stream exported to some units only, or to none, is for these under its own label, too. Imported streams are not
    among them: their owners have them.
    """

    def __init__(
        self, unit: str, network: Network, translation: Translation, agreements: LabelAgreements, instance: Instance
    ) -> None:
        self._unit, self._network, self._translation = unit, network, translation
        self._agreements, self._held, self._chronicles = agreements, instance.parts.held, instance.chronicles

    @classmethod
    def of(cls, ports: Ports, parts: PartRegistry) -> "DeclaredStreams":
        """Build it from the ports and parts of a platform."""
        return cls(ports.unit, ports.network, ports.translation, parts[LabelAgreements], ports.instance())

    def find(self, unit: str, text: str) -> Label:
        """The label of the stream, `self` put in, if `unit` may ask for it.

        Raises:
            TextError: the text is no label.
            UnknownLabel: there is no such stream.
            Refused: it is exported, and not to that unit; or it is another platform's.
        """
        named = Label.parse(text)
        label = named._replace(objects=tuple(self._unit if each == "self" else each for each in named.objects))
        stream = self._network.behind(label)
        carrier = label if stream is None else stream.label
        if self._network.find(label) is None:
            raise self._unknown(text)
        held = self._held.get(carrier)
        if held is not None and isinstance(held.declaration, Import):
            owner = held.declaration.unit
            raise Refused(f"{text} is imported from {owner}: ask {owner} for {held.declaration.semantic}", "imported")
        self._agreements.check_stream(unit, carrier)
        semantic = self._translation.semantic_label(carrier, self._unit)
        if semantic is not None:
            self._agreements.check(unit, semantic)
        elif (
            held is None
            and not self._network.is_implicit(carrier)
            and not isinstance(self._network.process(carrier), HostedProcess)
            and not any(carrier in each.labels for each in self._chronicles.values())
        ):
            raise self._unknown(text)
        return label

    def _unknown(self, text: str) -> UnknownLabel:
        return UnknownLabel(text, tuple(map(str, self._held)))
