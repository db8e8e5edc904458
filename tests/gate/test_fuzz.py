"""Whatever a file holds, the gate says something of it, soon, and at a place inside the file.

For many more inputs than in a normal run: pytest --hypothesis-profile=thorough tests/gate/test_fuzz.py
"""

import json
import random
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

import pytest
from hypothesis import event, given
from hypothesis import strategies as st

import busplan
from busplan.gate.formats import FORMATS

LONGEST_S = 20.0
"""CPU time that no file takes [s]: the longest takes a second on an idle machine."""
MOST_BYTES = 120_000
"""A little more than a profile may have, so that the limit is crossed too."""

EXAMPLES = Path(__file__).parent / "examples"
SHIPPED = Path(__file__).resolve().parents[2] / "profiles"
SEEDS = [
    path.read_bytes()
    for folder, pattern in ((SHIPPED, "*.toml"), (EXAMPLES, "*/*.toml"))
    for path in sorted(folder.glob(pattern))
]
KEY = re.compile(rb"^([ \t]*[\w.]+[ \t]*=[ \t]*)([^#\n]*)", re.MULTILINE)
VALUES = [
    *("0", "-1", "1.5", "1e308", "1e999", "-inf", "nan", "9" * 30, "9" * 400, "9" * 5_000, "0x7fffffffffffffff"),
    *("-9223372036854775809", "1_000_000", "1e-320", "0.1", "63", "64", "62", "16", "17", "512", "2048", "1_000_001"),
    *("true", "false", '""', '"S100"', '"optimal"', '"standard"', "'\\'", '"\\u0000"', '"\\U0010ffff"', '"日本"'),
    *('"""\n"""', "'''\n\n'''", '"' + "x" * 3_000 + '"', "1979-05-27", "1979-05-27T07:32:00Z", "07:32:00"),
    *("[]", "[1, 'a', []]", "{}", "{ a = 1 }", "{ kind = 'linear' }", "[{}, {}]", "[4, 3, 2, 1]", "[[1], [2]]"),
    *("[" * 50 + "]" * 50, "[" * 3_000 + "]" * 3_000, "{a=" * 200 + "1" + "}" * 200, "[" * 90_000, "[1," * 20_000),
    *("[" + "1," * 20_000 + "]", "{" + ",".join(f"k{number}=1" for number in range(3_000)) + "}"),
]
LINES = [
    *("[bus]", "[[bus]]", "[bus.extra]", "[node.execution]", "[[node.execution]]", "[servo.x]", "[limits]", "[circle]"),
    *("bus = 1", "a.b.c = 1", "bus.nodes = 3", '"" = 1', '"schema_version" = 1', "= 1", "[", "]", "[]", "[[]]", "{"),
    *("[a]" * 3, "a" * 5_000 + " = 1", "a." * 19 + "a = 1", "a." * 2_000 + "a = 1", "[" + "a." * 2_000 + "a]"),
    *("# busplan: ignore[BP110] why", "# busplan: ignore[", "#" * 3_000, "# busplan: ignore[" + "BP110," * 500 + "] x"),
    *('x = """', "x = '''", 'x = "\\', "\t\t", "\f", "\v", "\x00", "\x7f", "\u2028", "\u0085", "\ufeff", "🙂 = 1"),
    *("min_spare_nodes = 1000000", "max_utilisation = 1e-300", "min_spare_axes = 0", "max_utilisation = 0"),
]

Mutation = Callable[[random.Random, bytes], bytes]


def flip(rng: random.Random, content: bytes) -> bytes:
    at = rng.randrange(len(content) + 1)
    return content[:at] + rng.randbytes(rng.choice((0, 1, 1, 2, 9))) + content[at + rng.randrange(4) :]


def cut(rng: random.Random, content: bytes) -> bytes:
    at = rng.randrange(len(content) + 1)
    return content[:at] if rng.random() < 0.5 else content[at:]


def delete_line(rng: random.Random, content: bytes) -> bytes:
    lines = content.split(b"\n")
    del lines[rng.randrange(len(lines))]
    return b"\n".join(lines)


def double_line(rng: random.Random, content: bytes) -> bytes:
    lines = content.split(b"\n")
    lines.insert(rng.randrange(len(lines)), rng.choice(lines))
    return b"\n".join(lines)


def swap_lines(rng: random.Random, content: bytes) -> bytes:
    lines = content.split(b"\n")
    one, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[one], lines[other] = lines[other], lines[one]
    return b"\n".join(lines)


def insert_line(rng: random.Random, content: bytes) -> bytes:
    lines = content.split(b"\n")
    lines.insert(rng.randrange(len(lines) + 1), rng.choice(LINES).encode())
    return b"\n".join(lines)


def other_value(rng: random.Random, content: bytes) -> bytes:
    found = list(KEY.finditer(content))
    if not found:
        return content
    match = rng.choice(found)
    return content[: match.end(1)] + rng.choice(VALUES).encode() + content[match.end() :]


def other_number(rng: random.Random, content: bytes) -> bytes:
    found = list(re.finditer(rb"(?<![\w.])\d+(?:\.\d+)?", content))
    if not found:
        return content
    match = rng.choice(found)
    number = rng.choice((rng.randrange(100), rng.randrange(2_000_000), rng.random(), 10 ** rng.uniform(-9, 12)))
    return content[: match.start()] + str(number).encode() + content[match.end() :]


def other_ends(rng: random.Random, content: bytes) -> bytes:
    return content.replace(b"\n", rng.choice((b"\r\n", b"\r", b"\n\r", b"\n\n", b"\x85", b"")))


def mark(rng: random.Random, content: bytes) -> bytes:
    return rng.choice((b"\xef\xbb\xbf", b"\xff\xfe", b"\xef\xbb\xbf" * 2, b"\xef\xbb")) + content


def other_encoding(rng: random.Random, content: bytes) -> bytes:
    text = content.decode("utf-8", "replace")
    return text.encode(rng.choice(("utf-16", "utf-32-le", "utf-8-sig", "utf-7")), "replace")


def not_utf_8(rng: random.Random, content: bytes) -> bytes:
    at = rng.randrange(len(content) + 1)
    return content[:at] + rng.choice((b"\xff", b"\xc3", b"\xe2\x82", b"\xed\xa0\x80", b"\xf8")) + content[at:]


def repeated(rng: random.Random, content: bytes) -> bytes:
    return content * rng.choice((2, 3, 200))


MUTATIONS: list[Mutation] = [
    *(flip, cut, delete_line, double_line, swap_lines, insert_line, insert_line, other_value, other_value, other_value),
    *(other_number, other_number, other_ends, mark, other_encoding, not_utf_8, repeated),
]


def mutated(seed: int) -> bytes:
    rng = random.Random(seed)
    content = rng.choice(SEEDS)
    for _ in range(rng.choice((1, 1, 2, 3, 8))):
        content = rng.choice(MUTATIONS)(rng, content)[:MOST_BYTES]
    return content


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a baseline: of another profile, so that any key may have changed."""
    folder = tmp_path_factory.mktemp("fuzz")
    recorded = json.loads((EXAMPLES / "BP301" / "baseline.json").read_text(encoding="utf-8"))
    recorded["profiles"] = {"a.toml": {"paper.margin_us": 1e6, "standard.safe_axes": 1e6}}
    recorded["keys"] = {"a.toml": next(iter(recorded["keys"].values()))}
    (folder / "baseline.json").write_text(json.dumps(recorded), encoding="utf-8")
    return folder


def hold(content: bytes, folder: Path) -> Any:
    """What must hold for every file there is."""
    path = folder / "a.toml"
    path.write_bytes(content)
    start = process_time()
    answer = busplan.check(path, circle=False, baseline=folder / "baseline.json")
    assert process_time() - start < LONGEST_S
    (result,) = answer.files
    lines = content.decode("utf-8-sig", "replace").replace("\r\n", "\n").split("\n")
    assert result.status == ("findings" if result.findings else "ok")
    assert result.findings or result.profile is not None
    for finding, source in zip(result.findings, result.source, strict=True):
        assert 1 <= finding.line <= len(lines)
        assert 1 <= finding.column <= len(lines[finding.line - 1]) + 1
        assert 1 <= finding.marked_column < finding.marked_end_column <= len(lines[finding.line - 1]) + 2
        assert source.rstrip("\r") == lines[finding.line - 1].rstrip("\r")
        assert finding.message
        assert re.fullmatch(r"BP[0-9]{3}", finding.code)
    assert list(result.findings) == sorted(result.findings, key=lambda one: (one.line, one.column, one.code))
    for format_ in ("concise", "full", "github", "markdown"):
        assert FORMATS[format_].write(answer).count("\n") >= len(result.findings)
    return result


@given(st.integers(0, 2**63).map(mutated))
def test_a_mutated_profile_is_judged(folder: Path, content: bytes) -> None:
    result = hold(content, folder)
    event(" ".join(sorted({one.code for one in result.findings})) or "ok")


@given(
    st.binary(max_size=300)
    | st.text(max_size=300).map(str.encode)
    | st.text("[]{}=.,\"'#\n\\ a1-", max_size=60).map(str.encode)
)
def test_anything_at_all_is_judged(folder: Path, content: bytes) -> None:
    hold(content, folder)


@pytest.mark.slow
def test_hundreds_of_nasty_files_in_one_call(tmp_path: Path) -> None:
    contents = [mutated(seed) for seed in range(60)]
    contents += [value.encode() for value in (*VALUES, *LINES)] + [b"", b"\n", b"\r\n", b"\xef\xbb\xbf"]
    names = []
    for number, content in enumerate(contents):
        names.append(f"{number}.toml")
        (tmp_path / names[-1]).write_bytes(content)
    run = subprocess.run(
        [sys.executable, "-m", "busplan", "check", "--no-circle", "--format", "json", *names],
        capture_output=True,
        text=True,
        encoding="utf-8",
        cwd=tmp_path,
        check=False,
        timeout=300,
    )
    assert run.returncode == 1
    left = r"\d+ circle tests? not run; \d+ findings? suppressed"
    assert re.fullmatch(rf"checked {len(names)} profiles: \d+ errors, \d+ warnings?; {left}\n", run.stderr)
    document = json.loads(run.stdout)
    assert [one["path"] for one in document["files"]] == names
    # Together they are judged as each alone.
    for number in range(0, len(names), 20):
        (alone,) = busplan.check(tmp_path / names[number], circle=False).files
        assert document["files"][number]["findings"] == [finding.record for finding in alone.findings]
