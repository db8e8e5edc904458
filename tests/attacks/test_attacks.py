"""Every script beside this file is an attack that once did harm: it must end as its first lines say.

A script is bash, run in an empty folder that holds `p.toml`, a copy of the shipped paper-1ms. Its first comment says
what it tries. `# exits: N` is its exit code, which is that of its last command. Each `# says: REGEX` must be found in
its standard error. What a script checks beyond that, it checks itself, with `cmp`, `grep` or `test`.
"""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPTS = sorted(Path(__file__).parent.glob("*.sh"))
PROFILE = Path(__file__).parents[2] / "profiles" / "paper-1ms.toml"


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_an_attack_does_no_harm(script: Path, tmp_path: Path, program: Path) -> None:
    text = script.read_text(encoding="utf-8")
    (code,) = re.findall(r"^# exits: (\d+)$", text, re.MULTILINE)
    shutil.copy(PROFILE, tmp_path / "p.toml")
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("BUSPLAN_", "GIT_", "PYTHONIO"))}
    done = subprocess.run(
        ["bash", "-u", script],
        check=False,
        capture_output=True,
        cwd=tmp_path,
        env={**kept, "PATH": f"{program.parent}{os.pathsep}{kept['PATH']}", "LANG": "C.UTF-8"},
        stdin=subprocess.DEVNULL,
        timeout=300,
    )
    said = done.stderr.decode(errors="backslashreplace")
    assert done.returncode == int(code), said
    assert "Traceback" not in said
    for words in re.findall(r"^# says: (.+)$", text, re.MULTILINE):
        assert re.search(words, said), said
