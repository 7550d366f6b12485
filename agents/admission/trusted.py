"""Trust in other platforms, in [0, 1]: declared in the federation's file, reduced where one contradicts beliefs.

It scales the certainty of a platform's samples when they arrive, the weight of its offers in a call, of its readings
in the merged answer of a query, and of its vote on the name of an object.
"""

from dyknow.agents.part import Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.members.liveness import PlatformAppeared
from dyknow.kpl.linking.beliefs import trust_in


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
        """Trust in a platform by the beliefs of this one."""
        return trust_in(self._network, unit)

    def of(self, unit: str) -> float:
        """How far, by both."""
        return self.declared(unit) * self.found(unit)

    def on_peer(self, change: PeerChange, now_us: int) -> None:  # noqa: ARG002  (as all parts)
        """Say how far one that comes is trusted."""
        if isinstance(change, PlatformAppeared) and self.declared(change.unit) < 1.0:
            self._note(f"trust: platform {change.unit} is trusted by {self.declared(change.unit):g}, as declared")
