"""Write what the program prints today into the README and the manual: output blocks and pictures.

    python tests/readme/refresh.py

Looks at nothing but the pages' own commands; whoever runs it reads the difference before committing it.
"""

import importlib.util
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))


def checks() -> ModuleType:
    """The tests of the pages, which know what belongs into them."""
    spec = importlib.util.spec_from_file_location("test_readme", Path(__file__).with_name("test_readme.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def output_of(command: str) -> str:
    """What a command prints in an empty folder."""
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    environment.pop("FORCE_COLOR", None)
    with tempfile.TemporaryDirectory() as folder:
        run = subprocess.run(
            ["bash", "-c", command], capture_output=True, text=True, cwd=folder, env=environment, check=False
        )
    return run.stdout + run.stderr


def refreshed(page: str) -> str:
    """A page with everything that is checked brought up to date."""

    def block(match: re.Match[str]) -> str:
        commands = re.findall(r"^\$ (.*)$", match[1], re.MULTILINE)
        return "```console\n" + "".join(f"$ {command}\n{output_of(command)}" for command in commands) + "```"

    return re.sub(r"^```console\n(.*?)^```$", block, page, flags=re.MULTILINE | re.DOTALL)


if __name__ == "__main__":
    tests = checks()
    for path, page in tests.PAGES.items():
        path.write_text(refreshed(page), encoding="utf-8")
    for name, command in tests.pictures().items():
        output_of(command.replace(name, str(tests.FOLDER / name)))
