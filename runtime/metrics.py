"""Figures of a platform for Prometheus, and whether it is well: HTTP on this machine, read from its own thread.

`/metrics` has the figures, `/health` answers 200 while the node thread steps and the platform is in its federation, 503
otherwise. Nothing can be changed there. The figures are copied in one step of the interpreter, so that the node thread,
which continues to write, is not disturbed.
"""

import threading
from collections import Counter
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import Any, Final

from dyknow import __version__
from dyknow.agents.exchange.import_proxy import ImportProxy
from dyknow.agents.monitoring.alarm_log import AlarmLog
from dyknow.agents.platform import Platform
from dyknow.model.errors import EndpointFailed, UnitError
from dyknow.runtime.configuration.config import NodeConfig
from dyknow.runtime.journal.journal import Journal
from dyknow.runtime.mailbox import Mailbox

HOST: Final = "127.0.0.1"
STANDS_US: Final = 5_000_000
"""A node thread that has not stepped for this long stands still."""
_NAMES = {HOST, "localhost"}
_PATIENCE_S = 2.0
_PROMETHEUS = "text/plain; version=0.0.4; charset=utf-8"


class PlatformMetrics:
    """The server of one platform, from `start` to `close`.

    Args:
        port: 0 for any that is free.
        mailbox: of its node thread.
        journal: the platform's, if it has one by now; its losses are counted.

    Raises:
        UnitError: prometheus-client is not installed.
        EndpointFailed: the port is taken.
    """

    def __init__(
        self,
        platform: Platform,
        port: int,
        now_us: Callable[[], int],
        mailbox: Mailbox,
        journal: Callable[[], Journal | None],
    ) -> None:
        try:
            from prometheus_client import CollectorRegistry
        except ImportError:
            raise UnitError(
                "--metrics needs prometheus-client, which is not installed; install the extra: "
                "pip install 'dyknow-federation[metrics]'"
            ) from None
        self._platform, self._now_us, self._mailbox, self._journal = platform, now_us, mailbox, journal
        registry: Any = CollectorRegistry()
        registry.register(self)
        try:
            self._server = _QuietServer((HOST, port), _handler(registry, self.trouble))
        except OSError as taken:
            raise EndpointFailed(
                f"metrics: port {port} cannot be used: {taken.strerror}; choose another port."
            ) from None
        self._thread = threading.Thread(target=self._server.serve_forever, name="metrics", daemon=True)

    @property
    def port(self) -> int:
        """Where it listens."""
        return int(self._server.server_address[1])

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        """Listen no longer."""
        self._server.shutdown()
        self._server.server_close()

    def trouble(self) -> str:
        """Why the platform is not well; empty if it is."""
        stands_us = self._now_us() - self._platform.ports.now_us()
        if stands_us > STANDS_US:
            return f"the node thread has not stepped for {stands_us / 1e6:.0f} s"
        journal = self._journal()
        return "" if journal is None or journal.failed is None else f"the journal has ended: {journal.failed}"

    def collect(self) -> Iterator[Any]:
        """The figures, as prometheus-client asks for them."""
        from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, InfoMetricFamily

        platform, unit = self._platform, self._platform.unit
        yield InfoMetricFamily("dyknow_platform", "The platform.", {"unit": unit, "version": __version__})
        waiting = GaugeMetricFamily("dyknow_events_waiting", "Events that wait for the node thread.", labels=["unit"])
        waiting.add_metric([unit], len(self._mailbox))
        yield waiting
        peers = GaugeMetricFamily("dyknow_peers", "Other members in its directory, by state.", labels=["unit", "state"])
        states = Counter(entry.state.value for entry in platform.member.directory.entries() if entry.unit != unit)
        for state, count in states.items():
            peers.add_metric([unit, state], count)
        yield peers
        yield from self._streams()
        acts = CounterMetricFamily("dyknow_acts", "Speech acts by outcome.", labels=["unit", "direction", "outcome"])
        for (direction, outcome), count in platform.ports.agent.audit_log.counts.copy().items():
            acts.add_metric([unit, direction, outcome], count)
        yield acts
        refused = CounterMetricFamily("dyknow_refused", "Events that were dropped.", labels=["unit", "reason"])
        dropped = [each.refused.copy() for each in (platform, platform.member, platform.part(ImportProxy))]
        for reason, count in sum(dropped, Counter[str]()).items():
            refused.add_metric([unit, reason], count)
        yield refused
        yield from self._alarms()
        yield from self._failures()
        lost = CounterMetricFamily(
            "dyknow_journal_entries_lost", "Entries the journal could not keep.", labels=["unit"]
        )
        lost.add_metric([unit], 0 if (journal := self._journal()) is None else journal.lost)
        yield lost

    def _streams(self) -> Iterator[Any]:
        """Samples of imported streams: received, late, missing and lost ones."""
        from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily

        names, unit = ["unit", "owner", "label"], self._platform.unit
        counted = {
            kind: CounterMetricFamily(f"dyknow_samples_{kind}", f"Samples of imported streams: {kind}.", labels=names)
            for kind in ("received", "recovered", "duplicates", "lost")
        }
        missing = GaugeMetricFamily("dyknow_samples_missing", "Samples that are asked for.", labels=names)
        sums: dict[tuple[str, str], Counter[str]] = {}
        for (owner, label, _), record in self._platform.member.imports.streams.copy().items():
            account, found = record.stream.account, sums.setdefault((owner, label), Counter())
            found.update({kind: getattr(account, kind) for kind in counted}, missing=record.stream.missing)
        for (owner, label), found in sums.items():
            for kind, family in counted.items():
                family.add_metric([unit, owner, label], found[kind])
            missing.add_metric([unit, owner, label], found["missing"])
        yield from counted.values()
        yield missing

    def _failures(self) -> Iterator[Any]:
        """Exceptions of parts, by place and by the member over whose messages; how many places are impaired now."""
        from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily

        unit, contain = self._platform.unit, self._platform.containment
        raised = CounterMetricFamily("dyknow_failures", "What parts raised, by place.", labels=["unit", "place"])
        for place, count in contain.failures.copy().items():
            raised.add_metric([unit, place], count)
        yield raised
        over = CounterMetricFamily(
            "dyknow_failures_over", "What parts raised over what a member sent.", labels=["unit", "sender"]
        )
        for sender, count in contain.senders.copy().items():
            over.add_metric([unit, sender], count)
        yield over
        about = "Places that are impaired; out: left out, tried again each minute with the state that they have."
        impaired = GaugeMetricFamily("dyknow_impaired", about, labels=["unit", "out"])
        found = Counter(each.is_out for each in contain.impaired.copy().values())
        for is_out in (False, True):
            impaired.add_metric([unit, str(is_out).lower()], found[is_out])
        yield impaired

    def _alarms(self) -> Iterator[Any]:
        """Alarms that are open, among the last thousand edges, and monitors by their state."""
        from prometheus_client.core import GaugeMetricFamily

        unit = self._platform.unit
        monitors = GaugeMetricFamily(
            "dyknow_monitors", "Monitors, by what they show.", labels=["unit", "monitor", "shows"]
        )
        shown: Counter[tuple[str, str]] = Counter()
        for named in self._platform.built.monitors.named.copy().values():
            shown.update((named.plan.name, each.monitor.shows) for each in named.instances.copy().values())
        for (monitor, shows), count in shown.items():
            monitors.add_metric([unit, monitor, shows], count)
        yield monitors
        alarms = GaugeMetricFamily(
            "dyknow_alarms_open", "Alarms that are open, by monitor.", labels=["unit", "monitor"]
        )
        newest = {event.id: event for event in self._platform.part(AlarmLog).events.copy()}
        still = Counter(event.monitor for event in newest.values() if event.event == "opened")
        for monitor in {event.monitor for event in newest.values()}:
            alarms.add_metric([unit, monitor], still[monitor])
        yield alarms


class _QuietServer(HTTPServer):
    """A requester that goes away in the middle is no news for the log."""

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Continue with the next request."""


def metrics_of(
    config: NodeConfig,
    platform: Platform,
    now_us: Callable[[], int],
    mailbox: Mailbox,
    journal: Callable[[], Journal | None],
) -> PlatformMetrics | None:
    """The server of a platform, started; None where no port is configured. Raises as `PlatformMetrics`."""
    if config.metrics is None:
        return None
    found = PlatformMetrics(platform, config.metrics, now_us, mailbox, journal)
    found.start()
    return found


def _handler(registry: Any, trouble: Callable[[], str]) -> type[BaseHTTPRequestHandler]:
    """Answers GET of the two pages to programs of this machine."""

    class Handler(BaseHTTPRequestHandler):
        timeout = _PATIENCE_S
        server_version, sys_version = "dyknow", ""

        def do_GET(self) -> None:
            host = self.headers.get("Host", "").rpartition(":")[0] or self.headers.get("Host", "")
            if host not in _NAMES:  # a page of elsewhere whose name leads here
                self._answer(403, "this is read by its address on this machine\n")
            elif self.path == "/metrics":
                from prometheus_client import generate_latest

                self._answer(200, generate_latest(registry).decode(), _PROMETHEUS)
            elif self.path == "/health":
                why = trouble()
                self._answer(503 if why else 200, f"{why or 'well'}\n")
            else:
                self._answer(404, "there are /metrics and /health\n")

        def _answer(self, code: int, text: str, kind: str = "text/plain; charset=utf-8") -> None:
            body = text.encode()
            self.send_response(code)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: Any) -> None:  # noqa: A002  (as http.server calls it)
            """A request is no news."""

    return Handler
