"""What the table of actions says of some of them, asked of a real process with a real roster by members of each role."""

import secrets
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from hashlib import sha256
from pathlib import Path
from queue import SimpleQueue

import pytest

from dyknow.agents.actions import QUERIED, Action, Role
from dyknow.agents.extensions import own_parts
from dyknow.federation.members.command_centre import CommandCentre
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Reason, read
from dyknow.federation.security.trust import Roster, RosterMember, Signer, Trust
from dyknow.federation.transport import WireEvent
from dyknow.proxies.zenoh.configuration import ZenohOptions
from dyknow.proxies.zenoh.edge import ZenohEdge
from dyknow.runtime.client import Client, ClientPorts
from dyknow.runtime.clock import NodeClock
from dyknow.runtime.configuration.config import NodeConfig, SimulatedVehicleConfig, TrustConfig, WireConfig
from tests.federation.expressions import parse_expr

pytestmark = pytest.mark.live
PATIENCE_S = 30.0
ROLES = {"eye": Role.OBSERVER, "1": Role.DELEGATE, "cc": Role.COMMAND_CENTRE}
ROSTER_ROLES = {"0": "uav", "1": "uav", "cc": "command-centre", "eye": "observer"}
ASKED = (
    "(tasks)",
    "(search service: alarms)",
    "(query semantic-label: heli-position)",
    "(act-list)",
    "(specification)",
    '(check-formula text: "altitude[self] > 0" timeout: 1.0)',
    "(create-monitor name: energy)",
    "(create-multicast semantic-labels: (sequence battery) sample-period: 1.0 delay: 1.0 to-units: (sequence 1))",
    "(hold)",
    "(restore-specification number: 0)",
    '(add-declarations text: "stream s = altitude[self]")',
    "(remove-declarations names: (sequence s))",
)
ACTIONS = {action.head: action for part in own_parts() for offer in part.offers for action in offer.actions}


def seed(unit: str) -> bytes:
    return sha256(unit.encode()).digest()


class Members:
    """A platform process 0, and one client for each role."""

    def __init__(self, directory: Path, stack: ExitStack) -> None:
        self.federation = f"roles-{secrets.token_hex(4)}"
        self.roster = Roster(
            {
                unit: RosterMember(unit, Signer(seed(unit), self.federation).public_key, role)  # type: ignore[arg-type]
                for unit, role in ROSTER_ROLES.items()
            }
        )
        (directory / "roster.toml").write_text(str(self.roster))
        (directory / "0.seed").touch(mode=0o600)
        (directory / "0.seed").write_text(seed("0").hex())
        config = NodeConfig(
            unit="0",
            wire=WireConfig(federation=self.federation),
            vehicle=SimulatedVehicleConfig(),
            trust=TrustConfig(roster=directory / "roster.toml", key=directory / "0.seed"),
        )
        (directory / "0.json").write_text(config.model_dump_json())
        process = subprocess.Popen(
            [sys.executable, "-m", "dyknow.runtime.node", "--vehicles", "dyknow.sim_uavs.simulated", "--config", str(directory / "0.json")],
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        stack.callback(process.wait, 10)
        stack.callback(process.terminate)
        self.clients = {unit: stack.enter_context(self._client(unit)) for unit in ROLES}
        self.step_until(
            lambda: all("0" in {seen.unit for seen in one.centre.platforms()} for one in self.clients.values())
        )

    def step_until(self, condition: Callable[[], bool]) -> None:
        """Let all clients live until then."""
        until = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < until
            for client in self.clients.values():
                client.step(0.01)

    def _client(self, unit: str) -> Client:
        inbox: SimpleQueue[WireEvent] = SimpleQueue()

        def opened(post: object, now_us: object) -> ZenohEdge:
            edge = ZenohEdge(ZenohOptions(self.federation), post, now_us)  # type: ignore[arg-type]
            edge.open()
            return edge

        def centre(zid: str, now_us: int) -> CommandCentre:
            trust = Trust.of(self.roster, seed(unit), self.federation, now_us)
            return CommandCentre(unit, now_us, zid=zid, trust=trust)

        return Client(ClientPorts(inbox, NodeClock().now_us, opened), centre, self.federation)

    def code(self, by: str, text: str, action: Action) -> str | None:
        """The code of the refusal, None if it was not refused."""
        client = self.clients[by]
        performative = Performative.QUERY_REF if action.performatives == QUERIED else Performative.REQUEST
        dialogue = client.say("0", performative, read(parse_expr(text)), within_s=PATIENCE_S, standing=action.lasting)
        self.step_until(lambda: dialogue.over or dialogue.agreed)
        reasons = [content for _, content in dialogue.said if isinstance(content, Reason)]
        return reasons[0].code if reasons else None


@pytest.fixture(scope="module")
def members(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Members]:
    with ExitStack() as stack:
        yield Members(tmp_path_factory.mktemp("roles"), stack)


@pytest.mark.parametrize("text", ASKED)
def test_actions_are_answered_as_the_table_says(members: Members, text: str) -> None:
    action = ACTIONS[parse_expr(text).head]
    for by, role in ROLES.items():
        refused = members.code(by, text, action) == "role"
        assert refused is (role < action.role), f"{text} asked by {by}"
