"""How far other platforms are trusted, in [0, 1]: as the federation's file declares, and less where one contradicts what is believed.

Samples of a platform are as much less certain when they arrive. What it promises in a call, its part in the merged answer of a
query and its say in how an object is called count as much less.
"""

from agents.part import Part, PeerChange
from agents.ports import PartRegistry, Ports
from federation.members.liveness import PlatformAppeared
from kpl.linking.beliefs import trust_in


class PlatformTrust(Part):
    """See the module.

    Args:
        trusted: as declared, by unit; others are trusted wholly.
    """

    def __init__(self, ports: Ports, _parts: PartRegistry) -> None:
        self._trusted, self._network, self._note = ports.config.trusted, ports.network, ports.note

    def declared(self, unit: str) -> float:
        """How far a platform is trusted as declared."""
        return self._trusted.get(unit, 1.0)

    def found(self, unit: str) -> float:
        """How far by what is believed here."""
        return trust_in(self._network, unit)

    def of(self, unit: str) -> float:
        """How far, by both."""
        return self.declared(unit) * self.found(unit)

    def on_peer(self, change: PeerChange, now_us: int) -> None:  # noqa: ARG002  (as all parts)
        """Say how far one that comes is trusted."""
        if isinstance(change, PlatformAppeared) and self.declared(change.unit) < 1.0:
            self._note(f"trust: platform {change.unit} is trusted by {self.declared(change.unit):g}, as declared")
