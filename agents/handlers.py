"""Which content goes to which agent of a platform, and which services it therefore offers."""

from typing import TYPE_CHECKING, Any

from agents import services
from agents.effects import InjectFault
from agents.interface import Handler
from agents.services import Offer
from dyknow import US_PER_S
from federation import contents
from federation.acts import Act, Performative
from navigation.vehicle import GoTo, Hold, Land, Order, ReturnHome

if TYPE_CHECKING:
    from agents.config import PlatformConfig
    from agents.platform import Platform

P = Performative


def offers_of(config: "PlatformConfig") -> tuple[Offer, ...]:
    """The services of a platform of that kind."""
    if config.kind != "uav":
        return (services.DIRECTORY, services.ACCOUNT)
    found = [
        services.FEDERATION,
        services.COORDINATION,
        services.ALARMS,
        services.DIRECTORY,
        services.ACCOUNT,
        services.INSTANCE,
        services.SPECIFICATION,
    ]
    if config.vehicle:
        found.append(services.FLIGHT)
    if config.simulated:
        found.append(services.FAULTS)
    return tuple(found)


def handlers_of(platform: "Platform") -> dict[str, Handler]:
    """By head of the content, what does it."""
    p = platform
    found: dict[str, Any] = {
        "create-multicast": p.federation.on_create_multicast,
        "query": p.federation.on_query,
        "stream": p.federation.on_stream,
        "end-stream": p.federation.on_end_stream,
        "import-list": p.bulletin.on_import_list,
        "monitor-proximity": p.coordination.on_monitor_proximity,
        "create-monitor": _then_supply(p, p.coordination.on_create_monitor),
        "alarm": p.coordination.on_told,
        "progress": lambda _act, _content, _now_us: None,
        "avoid": p.giving_way.on_avoid,
        "monitors": p.bulletin.on_monitors,
        "tasks": p.bulletin.on_tasks,
        "check-formula": p.inquiries.checks.on_check,
        "recognise": p.inquiries.recognitions.on_recognise,
        "alarms": p.bulletin.on_alarms,
        "alarm-list": p.bulletin.on_alarm_list,
        "directory": p.bulletin.on_directory,
        "search": p.bulletin.on_search,
        "acts": p.bulletin.on_acts,
        "act-list": p.bulletin.on_act_list,
        "leave": lambda act, _c, now_us: _leave(p, act, now_us),
        "rejoin": _doing(p, p.rejoin),
        "labels": p.bulletin.on_labels,
        "specification": p.declared.on_asked,
        "restore-specification": lambda act, content, now_us: _restore(p, act, content, now_us),
        "goto": lambda act, c, now_us: _fly(p, act, GoTo(c.latitude_deg, c.longitude_deg, c.altitude_m), now_us),
        "hold": lambda act, _c, now_us: _fly(p, act, Hold(), now_us),
        "land": lambda act, _c, now_us: _fly(p, act, Land(), now_us),
        "return-home": lambda act, _c, now_us: _fly(p, act, ReturnHome(), now_us),
        "resume": _doing(p, lambda _now_us: p.fly(p.pilot.resume())),
        "fault": lambda act, content, now_us: _fault(p, act, content, now_us),
    }
    return found


def _then_supply(p: "Platform", handler: Any) -> Handler:
    def handle(act: Act, content: contents.Content, now_us: int) -> None:
        handler(act, content, now_us)
        p.supply.wake(now_us)

    return handle


def _done(p: "Platform", act: Act, now_us: int, text: str | None = None) -> None:
    p.interface.answer(act, P.AGREE, None, now_us)
    p.interface.answer(act, P.INFORM, contents.Done(text=text), now_us)


def _doing(p: "Platform", do: Any) -> Handler:
    def handle(act: Act, _content: contents.Content, now_us: int) -> None:
        do(now_us)
        _done(p, act, now_us)

    return handle


def _leave(p: "Platform", act: Act, now_us: int) -> None:
    """The answer goes before the good-bye: nobody listens to a platform that has left."""
    _done(p, act, now_us)
    p.leave(now_us)


def _restore(p: "Platform", act: Act, content: contents.RestoreSpecification, now_us: int) -> None:
    """What was held before is checked as if it were new. Raises Refused, saying what is wrong with it."""
    p.declared.restore(content.number, p.clock.federation_us(now_us))
    _done(p, act, now_us, f"configuration {content.number} is held again")


def _fly(p: "Platform", act: Act, order: Order, now_us: int) -> None:
    """What is done is the command: how far the vehicle has come, its position tells. Raises Refused, naming the rule."""
    p.fly(p.pilot.order(order))
    _done(p, act, now_us, "commanded")


def _fault(p: "Platform", act: Act, content: contents.Fault, now_us: int) -> None:
    until_us = None
    if content.duration_s is not None:
        until_us = p.clock.federation_us(now_us) + round(content.duration_s * US_PER_S)
    p.emit([InjectFault(content.kind, content.value, until_us)])
    _done(p, act, now_us)
