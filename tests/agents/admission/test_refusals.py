"""What refusals cost: a member is answered so many times a second, whatever it sends and under how many names."""

import os
from random import Random
from time import process_time

import pytest

from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Goto, Query, Search
from dyknow.federation.messages.receipts import RECEIPT_AGENT
from dyknow.federation.messages.refusals import REFUSALS_BURST, REFUSALS_PER_S
from tests.agents.admission.test_floods import Flooder
from tests.agents.rosters import trust
from tests.box import Box, Vehicle

P = Performative
ACTS = 10_000 if os.environ.get("DYKNOW_FULL") == "1" else 600
KINDS = ("over quota", "role", "not understood", "name of another's conversation", "open")


def say(flooder: Flooder, kind: str) -> None:
    match kind:
        case "over quota":
            flooder.say(P.QUERY_REF, Search(service=flooder.word()))
        case "role":
            flooder.say(P.REQUEST, Goto(latitude_deg=58.0, longitude_deg=15.0, altitude_m=60.0))
        case "not understood":
            flooder.say(P.PROXY, Search(service=flooder.word()))
        case "open":
            flooder.say(P.QUERY_REF, Query(semantic_label=f"{flooder.word()}"))
        case _:
            flooder.say(P.QUERY_REF, Search(service="flight"), "cc-5f-1.0")


@pytest.mark.parametrize("names", [1, 4, ACTS], ids=["one name", "four names", "a name for each act"])
@pytest.mark.parametrize("kind", [*KINDS, "all"])
def test_a_flood_costs_few_answers_and_is_shown(kind: str, names: int) -> None:
    random = Random(f"{kind} {names}")
    box = Box(5)
    box.join("0", Vehicle(), trust=trust("0"), control=True)
    box.centre("cc", trust=trust("cc"))
    box.run(2)
    flooder = Flooder(box, random, trust("obs"))
    box.run(0.5)
    box.wire.log.clear()
    begun_us, begun_s = box.now_us, process_time()
    for _ in range(ACTS):
        flooder.unit = f"obs-{random.randrange(names)}"
        say(flooder, random.choice(KINDS) if kind == "all" else kind)
        if random.random() < 0.2:
            box.run(0.005)
    box.run(1.0)
    print(f"{(process_time() - begun_s) / ACTS * 1e3:.2f} ms an act")
    lasted_s = (box.now_us - begun_us) / 1e6
    puts = [each.put.key for each in box.wire.log if each.sender == "0" and each.put.key.startswith("acl/obs-")]
    acts = len({act.seq for act in box.acts("0") if act.receiver.unit.startswith("obs-")})
    assert acts <= 2 * (REFUSALS_BURST + REFUSALS_PER_S * lasted_s), "those that are admitted, and refusals"
    assert sum(f"/{RECEIPT_AGENT}" not in key for key in puts) <= 5 * acts
    platform = box.platform("0")
    silent = platform.ports.agent.conversations.refusals.unanswered["obs"].count
    assert silent >= ACTS - 2 * (REFUSALS_BURST + REFUSALS_PER_S * lasted_s)
    assert platform.ports.agent.audit_log.refused["not answered"] == silent
    entry = box.member("cc").directory.entry("0")
    assert entry is not None
    assert any(each.text.startswith("too much is refused to obs") for each in entry.conditions)
    assert box.asked("cc", "0", Search(service="flight"), P.QUERY_REF).performatives == [P.INFORM]
