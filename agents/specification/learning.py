"""Parameters that streams of beliefs have learnt of lasting objects are stored, and restored after a restart.

Times are the node clock.
"""

from typing import Final

from dyknow import US_PER_S, Label
from dyknow.agents.effects import Keep
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.kpl.linking.beliefs import BeliefStream
from dyknow.model.errors import DyknowError

LOOK_US: Final = US_PER_S


class Learning(Part):
    """See the module.

    Args:
        learnt: the stored parameters: text by stream.
    """

    def __init__(self, ports: Ports, _parts: PartRegistry) -> None:
        self._learnt, self._network, self._now_us = dict(ports.config.learnt), ports.network, ports.now_us
        self._emit, self._note = ports.emit, ports.note
        self._streams: dict[Label, tuple[BeliefStream, bool]] = {}
        self._due_us: int | None = None
        ports.network.meet(self._on_label)

    def _on_label(self, label: Label) -> None:
        process = self._network.process(label)
        if not isinstance(process, BeliefStream):
            return
        is_kept = True
        try:
            process.remember(self._learnt.get(str(label), ""), f"learnt parameters of {label}")
        except DyknowError as wrong:
            is_kept = False
            self._note(f"the stored parameters of {label} are not taken, and new ones are not kept:\n{wrong}")
        self._streams[label] = process, is_kept
        self._due_us = self._now_us() + LOOK_US

    @property
    def deadline_us(self) -> int | None:
        return self._due_us

    def on_time(self, now_us: int) -> None:
        """Keep what is new."""
        if self._due_us is None or now_us < self._due_us:
            return
        self._streams = {
            label: known for label, known in self._streams.items() if self._network.process(label) is known[0]
        }
        self._due_us = now_us + LOOK_US if self._streams else None
        for label, (process, is_kept) in self._streams.items():
            text = process.learnt()
            if is_kept and text and text != self._learnt.get(str(label), ""):
                self._learnt[str(label)] = text
                self._emit(Keep(str(label), text))
