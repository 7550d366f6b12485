"""The objects that are there, in the streams of object states of one platform, for others who ask (thesis 8.5.1)."""

from collections.abc import Iterator

from agents.actions import QUERIED, Action, Offer, Role
from agents.exchange.label_agreements import LabelAgreements
from agents.interface import InterfaceAgent
from agents.part import Part
from agents.specification.specification_part import SPECIFICATION
from dyknow.model.errors import Refused
from dyknow.model.values import without_nan
from dyknow.objects.object_table import ObjectTable
from federation.messages.acts import Act
from federation.messages.contents import ObjectEntry, ObjectList
from kpl import Instance

OBJECTS_A_PAGE = 40
LONGEST_TEXT = 200
"""Characters of an attribute in an answer."""


class ObjectQueries(Part):
    """Lists the objects of the streams that the requester may see, each with its newest state."""

    offers = (Offer(SPECIFICATION, (Action(ObjectList, "on_object_list", QUERIED, Role.OBSERVER),)),)

    def __init__(self, agent: InterfaceAgent, agreements: LabelAgreements, instance: Instance) -> None:
        self._agent, self._agreements, self._instance = agent, agreements, instance

    def on_object_list(self, act: Act, content: ObjectList, now_us: int) -> None:
        """`(object-list)`, or `(object-list type: car)`."""
        entries = [
            entry
            for table in self._instance.parts.objects.tables()
            if self._may_see(act.sender.unit, table)
            for entry in _entries(table)
            if content.type in {None, entry.type}
        ]
        self._agent.answer_pages(
            act, entries, OBJECTS_A_PAGE, lambda page, more: ObjectList(objects=page, more=more), now_us
        )

    def _may_see(self, unit: str, table: ObjectTable) -> bool:
        try:
            self._agreements.check_stream(unit, table.label)
        except Refused:
            return False
        return True


def _entries(table: ObjectTable) -> Iterator[ObjectEntry]:
    names = [each.name for each in table.sort.fields]
    for symbol, state in table.read():
        attributes = dict(zip(names, without_nan(state.value), strict=True))
        del attributes[names[0]]
        type_ = str(attributes.pop("type", table.sort.name))[:64] or table.sort.name
        shown = {name: one[:LONGEST_TEXT] if isinstance(one, str) else one for name, one in attributes.items()}
        yield ObjectEntry(
            symbol=symbol[:64], type=type_, stream=str(table.label), valid_us=state.valid_us, attributes=shown
        )
