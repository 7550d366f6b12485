"""Questions about the monitors of a platform: verdicts, inputs, what their states are made of."""

from agents.actions import COORDINATION, QUERIED, Action, Offer, Role
from agents.interface import InterfaceAgent
from agents.monitoring.monitor_plans import states_declaration
from agents.monitoring.monitors import UnitMonitors
from agents.part import Part
from federation.messages.acts import Act
from federation.messages.contents import MAX_LIST, Content, MonitorEntry, MonitorList, Monitors
from federation.sharing.ontology import Translation
from kpl import Instance, print_specification
from kpl.checking.error_collector import shortened
from reasoning import Monitor

MONITORS_A_PAGE = 40
LONGEST_STATES = 1000


class MonitorQueries(Part):
    """Lists the monitors over units, and those of the specification.

    Args:
        instance: has the monitors that the specification declares over its streams.
    """

    offers = (Offer(COORDINATION, (Action(Monitors, "on_monitors", QUERIED, Role.OBSERVER),)),)
    answers = (MonitorList,)

    def __init__(
        self,
        unit: str,
        agent: InterfaceAgent,
        monitors: UnitMonitors,
        translation: Translation,
        instance: Instance,
    ) -> None:
        self._unit, self._agent, self._translation = unit, agent, translation
        self._monitors, self._instance = monitors, instance

    def on_monitors(self, act: Act, _content: Content, now_us: int) -> None:
        """`(monitors)`: those over units, then those that the specification declares over its streams."""
        of_plans = (
            (named.plan.name, each.monitor, states_declaration(named.plan, each.maker, self._translation))
            for named in self._monitors.named.values()
            for each in named.instances.values()
        )
        specified = ((each.monitor.name, each.monitor, each.states) for each in self._instance.monitors.values())
        own = ((name, monitor, states.declarations(name)) for name, monitor, states in specified)
        entries = [
            self._entry(name, monitor, print_specification(declared)) for name, monitor, declared in (*of_plans, *own)
        ]
        self._agent.answer_pages(
            act, entries, MONITORS_A_PAGE, lambda page, more: MonitorList(monitors=page, more=more), now_us
        )

    def _entry(self, name: str, monitor: Monitor, states: str) -> MonitorEntry:
        return MonitorEntry(
            by=self._unit,
            name=name,
            units=monitor.key,
            verdict=monitor.verdict,
            inputs=monitor.inputs,
            shows=monitor.shows,
            since_us=monitor.inputs_since_us,
            which=tuple(shortened(name) for name in monitor.missing_inputs[:MAX_LIST]),
            states=states if len(states) <= LONGEST_STATES else "",
            counted=dict(monitor.counted),
        )
