"""Malformed, truncated, hostile, empty and huge files: a sentence with the place, never a crash, nothing written."""

import random
import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final
from unittest import mock

import pytest

import busplan
from busplan.sections.base import value_at

FILES: Final = Path(__file__).parent / "files"
BESIDE: Final = {"slaves.txt": "pdos.txt", "pdos.txt": "slaves.txt", "ethercat-conf.xml": "pdos.txt"}
"""What a file needs beside it to be a machine; of databases a DCF."""
Run = Callable[..., Any]

BOMB = """<?xml version="1.0"?>
<!DOCTYPE EtherCATConfig [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>
<EtherCATConfig><Config><Slave><Info><Name>&b;</Name></Info></Slave></Config></EtherCATConfig>
"""
OUTSIDE = (
    '<!DOCTYPE masters [<!ENTITY x SYSTEM "file:///etc/passwd">]>\n<masters><master idx="0">&x;</master></masters>\n'
)
REFUSED = {
    "entities": (BOMB, r":2: a document type \(<!DOCTYPE>\) is not read"),
    "entities from outside": (OUTSIDE, r":1: a document type"),
    "entities of a database": (f"{OUTSIDE.splitlines()[0]}<NetworkDefinition/>", r":1: a document type"),
    "deep": ("<masters>" + "<a>" * 100_000, r":1: elements inside each other more than 64 deep"),
    "objects": (
        "[DeviceInfo]\n" + "".join(f"[{number:x}]\n" for number in range(100_000)),
        r":100001: more than 100,000 sections; no such file is a device's",
    ),
    "empty": ("", ": is empty"),
    "blank": ("\ufeff \n\t\n", ": is empty"),
    "none": ("a,b\n1,2\n", r": no format that busplan imports: ENI \(a root <EtherCATConfig>\); LinuxCNC's"),
    "other XML": ("<html/>", r": XML with a root <html>, no format that busplan imports: ENI"),
    "an ESI": ("<EtherCATInfo/>", ": an ESI describes a kind of device and no machine; export the ENI"),
    "binary": ("\0\1\2PNG" * 10, ": binary data, no format that busplan imports"),
    "two in one": (
        "Slave:1\n Name:a\nBO_ 256 Pressure: 8 X\n",
        r": has lines of text of SOEM's .* and DBC \(BO_\); give a",
    ),
    "two masters": ("=== Master 0, Slave 0 ===\n=== Master 1, Slave 0 ===\n", ":2: a second master"),
    "lines before the first device": (
        "SM2: PhysAddr 0x1100, DefaultSize    0\n=== Master 0, Slave 1 ===\n",
        ":1: no line === Master 0, Slave 0 === before",
    ),
    "a slave left out": (
        "Slave:1\n Output size: 8bits\n Input size: 8bits\nSlave:3\n",
        ":4: slave 3 where slave 2 is due",
    ),
    "no masters": ("<masters/>", ":1: 0 masters"),
    "half a root": ("<EtherCATConfig><Config>", r":1:\d+: not valid XML: no element found"),
    "no table": ("BO_ 99 Door\n", ":2:1: not a valid DBC: invalid syntax"),
    "a statement cut off": ("BO_ 1 A: 8 X\n\nVAL_ 1 a\n\nBO_ 2 B: 8 X\n", r":\d+:\d+: not a valid DBC"),
    "an identifier twice": (
        "BO_ 256 A: 8 X\nBO_ 256 B: 8 X\n",
        ":2: message B has the identifier of A: a bus has",
    ),
    "two buses": (
        (
            "<NetworkDefinition xmlns='http://kayak.2codeornot2code.org/1.0'><Document/>"
            "<Bus name='M'><Message id='0x1' name='A'/></Bus>"
            "<Bus name='N'><Message id='0x1' name='A'/></Bus></NetworkDefinition>"
        ),
        ":1: messages of 2 buses, M, N: a profile describes one bus; --bus NAME reads one",
    ),
    "a signal cut off": ("BO_ 256 A: 8 X\n SG_ B : 0|16@1+ (1,", ":2: ends within a signal: cut off"),
    "no PDO": ("[DeviceInfo]\nProductName=x\n", ":1: no PDO is switched on"),
    "no number": (
        "[DeviceInfo]\n[1800sub1]\nDefaultValue=soon\n",
        ":3: defaultvalue 'soon': expected a number, as 384, 0x180",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_hostile_file_is_one_sentence(case: str, tmp_path: Path, run: Run) -> None:
    text, words = REFUSED[case]
    (tmp_path / "machine.in").write_text(text, encoding="utf-8")
    with pytest.raises(busplan.BusplanError, match=rf"machine\.in{words}") as refused:
        busplan.import_profile(tmp_path / "machine.in")
    assert len(refused.value.problems) == 1
    assert len(str(refused.value)) < 800
    if case in ("entities", "empty", "two in one"):
        done = run("import", "machine.in", "-o", "new.toml", cwd=tmp_path)
        assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (2, "", 1)
        assert [path.name for path in tmp_path.iterdir()] == ["machine.in"]


DBC = "BO_ 1 A: 8 X\n"


@pytest.mark.parametrize(
    ("bound", "text", "words"),
    [
        ("xml._MOST_ELEMENTS", "<EtherCATConfig><InitCmds>" + "<a/>\n" * 1000, ":999: more than 1,000 elements;"),
        ("xml._MOST_KEPT", "<masters>" + "<a/>\n" * 1000, ":1000: more than 1,000 elements to read"),
        ("xml._MOST_TAG_BYTES", "<masters " + "\n" * 200_001, ":1: a tag of over 1,000 bytes"),
        ("can_database._MOST_MESSAGES", DBC * 1001, ": has 1,001 messages; of a database at most 1,000 are read"),
        ("can_database._LONGEST_TEXT", f'{DBC}VAL_ 1 "{"x" * 1001}', ": has a text of over 1,000 characters"),
    ],
    ids=lambda text: text[:30],
)
def test_what_would_take_memory_is_bounded(
    bound: str, text: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"busplan.questions.import_.{bound}", 1000)
    (tmp_path / "machine.in").write_text(text, encoding="utf-8")
    with pytest.raises(busplan.BusplanError, match=rf"machine\.in{words}"):
        busplan.import_profile(tmp_path / "machine.in")


def test_a_long_text_between_two_tags_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("busplan.questions.import_.xml._MOST_TAG_BYTES", 1000)
    (tmp_path / "machine.in").write_text(f"<masters>{'x' * 300_000}</masters>", encoding="utf-8")
    with pytest.raises(busplan.BusplanError, match=":1: 0 masters"):
        busplan.import_profile(tmp_path / "machine.in")


MANY: Final = 300_000
LONG = {
    "spaces in a line": "[DeviceInfo]\n" + MANY * " " + "x\n",
    "empty lines": MANY * "\n" + "[DeviceInfo]\n",
    "spaces in a name": "=== Master 0, Slave 0 ===\n  Order number: x" + MANY * " " + "y\n",
    "spaces behind a key": "Slave:1\n Name:x" + MANY * " " + "y\n",
    "comments before a root": "<!---->" * 28 + "x",
    "statements without an end": "BO_ 1 A: 8 X\n" + 30_000 * "VAL_ 1\n",
    "spaces in a message": "BO_ 1 A: 8 X\n" + MANY * " " + "SG_ " + MANY * " " + "x\n",
}


@pytest.mark.parametrize("case", LONG)
def test_no_line_takes_long(case: str, tmp_path: Path) -> None:
    (tmp_path / "machine.in").write_text(LONG[case], encoding="utf-8")
    start_s = time.process_time()
    with pytest.raises(busplan.BusplanError):
        busplan.import_profile(tmp_path / "machine.in")
    assert time.process_time() - start_s < 15  # on an idle machine less than one


def test_a_file_of_100_megabytes_is_refused_unread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("busplan.questions.import_.formats.MOST_BYTES", 320_000)
    path = tmp_path / "machine.xml"
    with path.open("wb") as file:
        file.write(b"<masters>")
        file.truncate(100_000_000)
    with pytest.raises(busplan.BusplanError, match="is larger than 320,000 bytes"):
        busplan.import_profile(path)


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(FILES.iterdir()), ids=lambda path: path.name)
def test_no_cut_and_no_change_of_a_file_crashes(path: Path, tmp_path: Path) -> None:
    """Each beginning of a file, and the file with bytes changed: a profile or a sentence, never another error."""
    chance = random.Random(path.name)
    content = path.read_bytes()
    is_database = path.suffix in (".dbc", ".kcd", ".sym", ".arxml")
    beside = [FILES / "axis-5.dcf"] if is_database else [FILES / BESIDE[path.name]] if path.name in BESIDE else []
    other = tmp_path / path.name
    for number in range(16 if is_database else 40):
        if number % 2:
            changed = bytearray(content[: chance.randrange(len(content))])
        else:
            changed = bytearray(content)
            for _ in range(chance.randint(1, 8)):
                changed[chance.randrange(len(changed))] = chance.choice(b"\0<>&\"'=:0123456789-[]#x \n\xff")
        other.write_bytes(changed)
        try:
            answer = busplan.import_profile([other, *beside])
        except busplan.BusplanError as error:
            problems = error.problems
            assert all(map(str.isprintable, problems))
            assert max(map(len, problems)) < 1000
        else:
            assert answer.profile == busplan.import_profile([other, *beside]).profile


def test_names_of_devices_cannot_write_toml(tmp_path: Path) -> None:
    text = (FILES / "slaveinfo.txt").read_text(encoding="utf-8")
    evil = 'AX" # \x1b[2J\u202e] master_us = 0'
    (tmp_path / "in.txt").write_text(text.replace("Name:AX20", f"Name:{evil}"), encoding="utf-8")
    answer = busplan.import_profile(tmp_path / "in.txt")
    assert value_at(answer.profile, "bus.master_us") == 40
    assert answer.profile.group[-1].name == "AX-2J-master_us-0"
    assert all(line.isprintable() for line in answer.text.splitlines())


def test_utf_16_of_a_windows_console_is_read(tmp_path: Path) -> None:
    text = (FILES / "slaveinfo.txt").read_text(encoding="utf-8")
    (tmp_path / "in.txt").write_text(text.replace("\n", "\r\n"), encoding="utf-16")
    assert busplan.import_profile(tmp_path / "in.txt").profile.group[-1].nodes == 2


def test_without_the_extra_a_sentence_says_what_to_install() -> None:
    def without(name: str) -> object:
        return None if name == "cantools" else find_spec(name)

    with (
        mock.patch("busplan.extras.find_spec", without),
        pytest.raises(busplan.BusplanError, match=r"DBC needs cantools: .* pip install 'busplan\[import\]'"),
    ):
        busplan.import_profile([FILES / "axis-5.dcf", FILES / "machine.dbc"])
    # What needs no library is read without it.
    with mock.patch.dict(sys.modules, {"cantools": None}):
        assert busplan.import_profile([FILES / "slaves.txt", FILES / "pdos.txt"]).profile.bus.kind == "ethercat"
