"""What one owner announces fills its own share of the imports, never that of others, and is refused aloud."""

from dyknow import Policy
from dyknow.agents.exchange.import_proxy import STREAMS_OF_ONE, ImportProxy


def test_one_owner_has_a_share_of_the_imports_and_the_others_keep_theirs(wire):
    for unit in "012":
        wire.fly(unit, 0.0, 300.0 * int(unit))
    wire.run(1.5)
    platform = wire.platform("0")
    proxy = platform.part(ImportProxy)
    for number in range(2 * STREAMS_OF_ONE):
        proxy.expect("2", "heli-position", f"{number:08x}", Policy(), wire.now_us)
    assert sum(name[0] == "2" for name in proxy.imports.streams) == STREAMS_OF_ONE
    assert proxy.refused["too many streams"] == STREAMS_OF_ONE
    proxy.expect("2", "heli-position", f"{0:08x}", Policy(), wire.now_us)
    proxy.expect("1", "heli-position", "0" * 8, Policy(), wire.now_us)
    assert ("1", "heli-position", "0" * 8) in proxy.imports.streams
    wire.run(0.1)
    notes = [note for note in wire.nodes["0"].notes if "announces more" in note]
    assert len(notes) == 1
    wire.run(2)
    shown = wire.platform("1").member.directory.entry("0").conditions
    assert any(text.text.startswith("2 announces more than 64 streams") for text in shown)
    for number in range(STREAMS_OF_ONE):
        proxy.end("2", "heli-position", f"{number:08x}")
    wire.run(2)
    assert not any("announces more" in text.text for text in wire.platform("1").member.directory.entry("0").conditions)
