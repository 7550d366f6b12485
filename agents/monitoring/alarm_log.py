"""The alarms of a platform: the last thousand, and their subscribers."""

from collections import deque
from collections.abc import Mapping
from itertools import islice
from typing import Any, Final

from dyknow import Value
from dyknow.agents.actions import QUERIED, SUBSCRIBED, Action, Offer, Role
from dyknow.agents.monitoring.reasons import LONGEST_LABEL, reasons, scalar
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.subscribers import Subscribers
from dyknow.agents.tasks.life import TaskLife
from dyknow.federation.members.offers import Service, Visibility
from dyknow.federation.messages.acts import Act
from dyknow.federation.messages.contents import Alarm, AlarmList, Alarms, Content
from dyknow.reasoning import AlarmEvent

KEPT = 1000
ALARMS_A_PAGE = 20
MOST_VALUES = 256
ALARMS: Final = Service("alarms", "alarms", Visibility.PUBLIC)


class AlarmLog(Part):
    """Alarm events as the platform's monitors raise them, newest last."""

    offers = (
        Offer(
            ALARMS,
            (
                Action(Alarms, "on_subscribe", SUBSCRIBED, Role.OBSERVER),
                Action(AlarmList, "on_alarm_list", QUERIED, Role.OBSERVER),
            ),
        ),
    )

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._agent = ports.unit, ports.agent
        self.events: deque[AlarmEvent] = deque(maxlen=KEPT)
        self.subscribers = Subscribers(ports.agent, parts[TaskLife])

    def on_alarm(self, event: AlarmEvent, now_us: int) -> None:
        """Note one opening or closing and inform the subscribers."""
        self.events.append(event)
        if self.subscribers:
            self.subscribers.inform(alarm_content(event, self._unit), now_us)

    def on_subscribe(self, act: Act, _content: Alarms, now_us: int) -> None:
        """`(alarms)`"""
        self.subscribers.add(act, now_us)

    def on_alarm_list(self, act: Act, _content: Content, now_us: int) -> None:
        """`(alarm-list)`"""
        alarms = [alarm_content(event, self._unit) for event in self.events]
        self._agent.answer_pages(
            act, alarms, ALARMS_A_PAGE, lambda page, more: AlarmList(alarms=page, more=more), now_us
        )

    def on_cancel(self, act: Act, _now_us: int) -> bool:
        return self.subscribers.remove(act)

    def on_lost(self, act: Act, _now_us: int) -> bool:
        return self.subscribers.remove(act)


def alarm_content(event: AlarmEvent, by: str) -> Alarm:
    """An alarm as other platforms and users get it."""
    return Alarm(
        id=event.id,
        event=event.event,
        monitor=event.monitor,
        by=by,
        units=event.units,
        valid_us=event.valid_us,
        detected_us=event.detected_us,
        values=_scalars(event.values),
        samples=_scalars(event.samples_us),
        because=reasons(event.because),
        made_us=event.made_us,
    )


def _scalars(values: Mapping[str, Value]) -> dict[str, Any]:
    """As many of the values as an alarm can carry: records and what else is no scalar as text."""
    shown = islice(((label, value) for label, value in values.items() if len(label) <= LONGEST_LABEL), MOST_VALUES)
    return {label: scalar(value) for label, value in shown}
