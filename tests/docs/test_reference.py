"""docs/reference.md lists everything: tasks with their keys, profiles, faults, settings, keys of JSON lines."""

import json
import re
from collections.abc import Iterator
from typing import Any

from dyknow.agents.capabilities.capability import typed_requests
from dyknow.federation.sharing.ontology import default_ontology
from dyknow.reasoning import builtin_profiles
from dyknow.runtime.configuration.settings import OPTION_KEYS, VARIABLES, UnitFile
from dyknow.sim_uavs.dynamics.faults import KINDS
from tests.docs.pages import DOCS, ROOT

TEXT = (DOCS / "reference.md").read_text(encoding="utf-8")


def section(title: str) -> str:
    return TEXT.partition(f"\n## {title}\n")[2].partition("\n## ")[0]


def words(text: str) -> set[str]:
    """What stands in backticks."""
    return {found.strip("[]") for found in re.findall(r"`([^`\n]+)`", text)}


def test_every_task_and_every_key_of_it_is_listed() -> None:
    rows = {
        name: row for row in section("Tasks").splitlines() for name in words(row.split("|")[1] if "|" in row else "")
    }
    assert [action.head for action in typed_requests().values() if action.head not in rows] == []
    for action in typed_requests().values():
        fields = action.content.model_fields.items()
        keys = {field.alias or name for name, field in fields if name not in action.inner}
        assert keys <= words(rows[action.head]), action.head


def test_every_profile_and_every_fault_is_listed() -> None:
    assert set(builtin_profiles()) <= words(section("Profiles"))
    assert set(KINDS) <= words(section("Faults"))


def test_every_label_that_all_platforms_know_is_listed() -> None:
    assert {each.name for each in default_ontology().definitions()} <= words(section("Labels"))


def test_every_setting_is_listed() -> None:
    found = words(section("Settings"))
    assert {*OPTION_KEYS, *VARIABLES.values()} - {"unit"} <= found
    assert {field.alias or name for name, field in UnitFile.model_fields.items()} <= found


def _recorded() -> Iterator[tuple[str, dict[str, Any]]]:
    for path in sorted((ROOT / "tests" / "console" / "transcripts").glob("*.json")):
        for session in json.loads(path.read_text(encoding="utf-8")):
            for step in session["steps"]:
                for line in step.get("lines", ()):
                    run = step["run"]
                    yield " ".join(run[: 2 if run[0] in {"kpl", "mission", "ontology", "roads"} else 1]), line


def test_every_key_of_every_recorded_json_line_is_listed_with_its_command() -> None:
    rows = {
        name: row for row in section("JSON").splitlines() for name in words(row.split("|")[1] if "|" in row else "")
    }
    rows["roster"] = rows["roster ..."]
    recorded = list(_recorded())
    assert len(recorded) > 50
    for command, line in recorded:
        graph = words(rows["kpl graph"]) if command == "kpl run" else set()
        assert line.keys() <= words(rows[command]) | graph, command
