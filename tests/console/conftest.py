import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture
def dyknow(tmp_path: Path) -> Run:
    """Run the command in a process of its own, 80 columns wide, with no variables but those given."""

    def run(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
        kept = {name: value for name, value in os.environ.items() if not name.startswith("DYKNOW_")}
        environment = {**kept, "COLUMNS": "80", "TERM": "dumb", "XDG_RUNTIME_DIR": str(tmp_path), **variables}
        return subprocess.run(
            [sys.executable, "-c", "from console.main import main; main()", *arguments],
            capture_output=True, text=True, env=environment, timeout=60, check=False,
        )  # fmt: skip

    return run
