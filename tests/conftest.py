"""What tests of several rooms share: a real git repository."""

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

Git = Callable[..., bytes]

# Hundreds of runs of the program compile its modules once, as those of a user do, and not in each run again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


@pytest.fixture
def git(tmp_path: Path) -> Git:
    """Run git in a new repository, untouched by the user's own settings; gives what it writes."""
    folder = tmp_path / "repository"
    folder.mkdir()
    outside = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}
    settings = {"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_NOSYSTEM": "1"}
    author = ("-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "init.defaultBranch=main")

    def call(*arguments: str, cwd: Path = folder) -> bytes:
        return subprocess.run(
            ["git", *author, *arguments], check=True, cwd=cwd, env={**outside, **settings}, capture_output=True
        ).stdout

    call("init", "--quiet")
    return call


@pytest.fixture
def repository(git: Git, tmp_path: Path) -> Path:
    """A repository with two commits: profiles/line.toml at 4 ms, then at 1 ms, tagged v1 and main; and odd files."""
    folder = tmp_path / "repository"
    line = folder / "profiles" / "line.toml"
    line.parent.mkdir()
    line.write_text(LINE, encoding="utf-8")
    (folder / "gone").mkdir()
    (folder / "gone" / "old.toml").write_text(LINE, encoding="utf-8")
    (folder / "link.toml").symlink_to("profiles/line.toml")
    (folder / "lost.toml").symlink_to("nowhere.toml")
    (folder / "out.toml").symlink_to("/etc/passwd")
    (folder / "broken.toml").write_text(LINE.replace("nodes = 2", "nodes = 0"), encoding="utf-8")
    (folder / "large.toml").write_text("#" * 100_001, encoding="utf-8")
    git("add", ".")
    git("commit", "--quiet", "--message", "one")
    git("tag", "v1")
    line.write_text(LINE.replace("4000", "1000"), encoding="utf-8")
    git("rm", "--quiet", "-r", "gone")
    git("commit", "--quiet", "--all", "--message", "two")
    return folder


LINE = """\
schema_version = 1
name = "line"
[bus]
kind = "ieee1394"
speed = "S400"
nodes = 2
[cycle]
period_us = 4000
[payload]
read_bytes = 12
write_bytes = 12
[node]
axes = 4
[node.execution]
kind = "linear"
base_us = 30
per_byte_us = 0.35
"""
