"""Write what the program prints today into the README: output blocks, references, the example profile.

    python tests/readme/refresh.py

Looks at nothing but the README's own commands; whoever runs it reads the difference before committing it.
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


def checks() -> ModuleType:
    """The tests of the README, which know what belongs into it."""
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


def refreshed(readme: str) -> str:
    """The README with everything that is checked brought up to date."""
    tests = checks()

    def block(match: re.Match[str]) -> str:
        commands = re.findall(r"^\$ (.*)$", match[1], re.MULTILINE)
        return "```console\n" + "".join(f"$ {command}\n{output_of(command)}" for command in commands) + "```"

    readme = re.sub(r"^```console\n(.*?)^```$", block, readme, flags=re.MULTILINE | re.DOTALL)
    rows = "\n".join(dict.fromkeys(tests.reference(tests.Ieee1394Profile)))
    head = "| key | values | default | meaning |\n|---|---|---|---|\n"
    readme = re.sub(re.escape(head) + r"(?:\|.*\n)*", lambda _: f"{head}{rows}\n", readme)
    for lines in tests.registry_tables():
        new = "".join(f"{line}\n" for line in lines)
        old = re.search(re.escape(lines[0]) + r"\n(?:\|.*\n)*", readme)
        assert old is not None
        readme = readme.replace(old[0], new)
    example = (ROOT / "profiles" / "paper-4ms.toml").read_text(encoding="utf-8")
    first = re.compile(r"(`paper-4ms`, as it ships:\n\n```toml\n).*?(^```$)", re.MULTILINE | re.DOTALL)
    return str(first.sub(lambda match: f"{match[1]}{example}{match[2]}", readme))


if __name__ == "__main__":
    path = ROOT / "README.md"
    path.write_text(refreshed(path.read_text(encoding="utf-8")), encoding="utf-8")
