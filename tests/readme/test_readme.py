"""The README and the manual say what the program does: output blocks, tables, keys and links are checked."""

import json
import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from subprocess import CompletedProcess
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import pytest
from pydantic import BaseModel
from typer.testing import CliRunner

import busplan
from busplan.buses import kind_named, kind_names
from busplan.buses.figure import Figure
from busplan.cli import app
from busplan.forms.markdown import code, table
from busplan.manual import FOLDER, topics
from busplan.profile.document import decode, validate
from busplan.profile.kinds import models_of
from busplan.profile.sources import load
from busplan.questions.circle import CIRCLE_BY_KEY
from busplan.questions.explain.derivation import constant_rows, equation_rows, figures_of
from busplan.sections.machine import AxisOverride
from busplan.sourced import short
from tests.registers import COMMANDS

Run = Callable[..., CompletedProcess[str]]

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
PAGES = {path: path.read_text(encoding="utf-8") for path in (README, *sorted(FOLDER.glob("*.md")))}
CONSOLE = re.compile(r"^```console\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")
MAX_WIDTH = 130
MOST_README_BYTES = 8_192
GALLERY = FOLDER / "commands.md"
MOST_PICTURE_BYTES = 150_000
"""They ship with the package."""


@pytest.fixture(autouse=True)
def one_processor(monkeypatch: pytest.MonkeyPatch) -> None:
    """No worker processes: their start takes longer than any example, and their rows are the same."""
    monkeypatch.setattr("busplan.cli.workers.available_processors", lambda: 1)


def shown_runs() -> Iterator[tuple[str, str]]:
    """Each `$ busplan ...` of all pages with the output printed below it."""
    for block in (one for text in PAGES.values() for one in CONSOLE.findall(text)):
        for run in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, _, output = run.partition("\n")
            if command.startswith("busplan"):
                yield command, output


@pytest.mark.parametrize(("command", "output"), list(shown_runs()), ids=lambda text: text[:40])
def test_output_blocks_are_the_programs_own(shell: Run, command: str, output: str, tmp_path: Path) -> None:
    run = shell(command, cwd=tmp_path)
    assert run.stdout + run.stderr == output


def pictures() -> dict[str, str]:
    """The command that draws each picture of the gallery, by the picture's file name."""
    commands = re.findall(r"^(busplan .* (\S+\.svg))$", PAGES[GALLERY], re.MULTILINE)
    return {name: command for command, name in commands}


def test_the_readme_is_short_and_shows_a_picture_of_the_gallery() -> None:
    assert len(PAGES[README].encode()) <= MOST_README_BYTES
    (picture,) = re.findall(r'<img src="([^"]+)"', PAGES[README])
    assert (ROOT / picture).parent == FOLDER
    assert f"`{pictures()[Path(picture).name]}`" in PAGES[README]


@pytest.mark.parametrize(("name", "command"), pictures().items())
def test_a_picture_is_what_its_command_draws(shell: Run, name: str, command: str, tmp_path: Path) -> None:
    shell(command, cwd=tmp_path)
    assert (tmp_path / name).read_bytes() == (FOLDER / name).read_bytes()


def test_the_gallery_shows_every_picture_in_words_too_and_all_are_small() -> None:
    shown = re.findall(r'^<img src="(\S+)" width="100%" alt="[^"]{20,}">$', PAGES[GALLERY], re.MULTILINE)
    assert shown == list(pictures())
    assert sorted(shown) == sorted(path.name for path in FOLDER.glob("*.svg"))
    assert sum((FOLDER / name).stat().st_size for name in shown) <= MOST_PICTURE_BYTES


def test_the_commands_for_a_machine_run_as_they_stand(shell: Run, tmp_path: Path) -> None:
    section = PAGES[README].partition("\n## My machine\n")[2]
    commands = re.findall(
        r"^(busplan .*?)(?: +#.*)?$", section.partition("```sh\n")[2].partition("```")[0], re.MULTILINE
    )
    assert len(commands) >= 8
    for command in commands:
        assert shell(command, cwd=tmp_path).returncode == 0, command


def test_the_python_of_the_readme_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = re.findall(r"^```python\n(.*?)^```$", PAGES[README], re.MULTILINE | re.DOTALL)
    exec(compile(block, "README.md", "exec"), {})
    assert capsys.readouterr().out == "fits 4\n"


def test_there_are_blocks_to_check() -> None:
    commands = {command.split()[1] for command, _ in shown_runs()}
    assert commands >= {"capacity", "latency", "explain", "paper", "init", "rule"}


def sections(annotation: Any) -> list[type[BaseModel]]:
    """Models inside an annotation: the section itself, or each member of a union of sections."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if get_origin(annotation) in (Union, UnionType, Annotated):
        return [model for part in get_args(annotation) for model in sections(part)]
    return []


def reference(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """A row for every key of the profile, from the schema itself."""
    for name, field in model.model_fields.items():
        key = f"{prefix}{name}"
        inner = sections(field.annotation)
        if name == "message":
            (message,) = models_of(field.annotation)
            yield from (reference_row(message, own, f"message.NAME.{own}") for own in message.model_fields)
        elif name == "group":
            (group,) = models_of(field.annotation)
            owns = [one for one in ("name", "nodes", "axes", "hops") if one in group.model_fields]
            yield from (reference_row(group, own, f"group.NAME.{own}") for own in owns)
            yield "| `group.NAME` | any other key of `[payload]` and `[node]` | As there, for its nodes |"
        elif name == "grades":
            yield f"| `{key}.KEY` | {grades(inner[0])} | How servo.KEY is known, where not as servo.grade says |"
        elif inner == [AxisOverride]:
            yield f"| `{key}` | any key of one axis | {field.description} |"
        elif inner:
            for one in inner:
                yield from reference(one, f"{key}.")
        else:
            yield reference_row(model, name, key)


def grades(model: type[BaseModel]) -> str:
    """What each key of a section of grades takes; all take the same."""
    (values,) = {allowed(schema) for schema in properties(model).values()}
    return values


def reference_row(model: type[BaseModel], name: str, key: str) -> str:
    """One row of the reference, without the unit that the key ends in."""
    field = model.model_fields[name]
    values = allowed(properties(model)[name])
    if key == "bus.nodes":
        values = f"{values}, required without groups"
    elif field.is_required():
        values = f"{values}, required"
    elif (default := field.get_default(call_default_factory=True)) is not None:
        values = f"{values} ({json.dumps(default)})"
    meaning = re.sub(r" \[[^]]*\]$", "", field.description or "")
    return f"| `{key}` | {values} | {meaning} |"


@cache
def properties(model: type[BaseModel]) -> dict[str, Any]:
    """JSON Schema of each key of a section."""
    found: dict[str, Any] = model.model_json_schema()["properties"]
    return found


def allowed(schema: dict[str, Any]) -> str:
    """Type and range of a key in words, from its JSON Schema."""
    if "anyOf" in schema:
        return " or ".join(allowed(one) for one in schema["anyOf"] if one.get("type") != "null")
    if "enum" in schema or "const" in schema:
        return ", ".join(str(one) for one in schema.get("enum", [schema.get("const")]))
    if schema["type"] == "boolean":
        return "true, false"
    if schema["type"] == "array":
        return f"list of {allowed(schema['items'])}"
    if schema["type"] == "string":
        letters = " of letters, digits, - and _" if schema.get("pattern", "").startswith("^[A-Za-z]") else ""
        return f"text up to {schema['maxLength']} characters{letters}"
    return number(schema)


MOST = 1_000_000
"""Largest values from here on are left to the JSON Schema."""


def number(schema: dict[str, Any]) -> str:
    """Range of a number in words."""
    whole = "whole " if schema["type"] == "integer" else ""
    if schema.get("minimum", 0) <= -MOST:
        return f"{whole}number"
    is_open = schema["maximum"] >= MOST
    if "exclusiveMinimum" in schema:
        least = f"over {schema['exclusiveMinimum']:g}"
        return f"{whole}{least}" if is_open else f"{whole}{least}, to {schema['maximum']:g}"
    return f"{whole}{schema['minimum']:g} " + ("or more" if is_open else f"to {schema['maximum']:g}")


SHOWN_FIRST = "ieee1394"
"""The kind whose keys and figures the pages show; the page of a further kind shows what keys it has beside them."""


def constants_table(kind: str) -> list[str]:
    """Constants of a kind that nobody has published; `explain` has all of them, with their sources."""
    cells = [
        [code(row["name"]), f"{short(row['value'])} {row['unit']}".removesuffix(" 1"), row["grade"], row["meaning"]]
        for row in constant_rows(kind_named(kind))
        if row["grade"] != "published"
    ]
    return table([f"constant of `{kind}`", "value", "grade", "meaning"], cells, left=4)


def figure_table(head: str, figures: Iterable[Figure]) -> list[str]:
    """What figures mean; their keys end in the unit, and `explain` shows their symbols."""
    cells = ([code(figure.key), figure.meaning, figure.reference] for figure in figures)
    return table([head, "meaning", "reference"], cells, left=3)


def further_tables(kind: str) -> Iterator[list[str]]:
    """What a further kind of bus has of its own: keys and constants; `explain` lists its figures."""
    known = set(reference(kind_named("ieee1394").profile_model()))
    own = [row for row in dict.fromkeys(reference(kind_named(kind).profile_model())) if row not in known]
    yield [f"| key of `{kind}` | values (default) | meaning |", "|---|---|---|", *own]
    yield constants_table(kind)


OTHER_FIGURE = "other figure"


@cache
def explained_keys() -> frozenset[str]:
    """Figures of the page's kind that `explain` lists, with their meaning."""
    return frozenset(figure.key for _, figure in busplan.explain("paper-4ms").figures)


def tables() -> Iterator[list[str]]:
    """Every table of the program's own data, by its lines; the first of them is in one page alone."""
    yield [
        "| key | values (default) | meaning |",
        "|---|---|---|",
        *dict.fromkeys(reference(kind_named("ieee1394").profile_model())),
    ]
    equations = (
        [row["reference"], code(row["formula"]), re.sub("Paper, section |, equations? [^;]*", "", row["source"])]
        for row in equation_rows()
    )
    yield table(["equation", "formula", "section of the paper"], equations, left=3)
    yield constants_table(SHOWN_FIRST)
    explained = explained_keys()
    figures = {
        figure.key: figure
        for register in figures_of(kind_named(SHOWN_FIRST)).values()
        for figure in register.values()
        if figure.key not in explained
    }
    yield figure_table(OTHER_FIGURE, figures.values())
    yield figure_table("`circle-test`", CIRCLE_BY_KEY.values())
    for kind in kind_names():
        if kind != SHOWN_FIRST:
            yield from further_tables(kind)


def shown_table(head: str, page: str) -> str:
    """A page's table whose first line begins with the same cell; empty where it has none."""
    cell = head.split("|")[1]
    found = re.search(f"^\\|{re.escape(cell)}\\|.*\n\\| ?:?-.*\n(?:\\|.*\n)*", page, re.MULTILINE)
    return found[0] if found else ""


def test_tables_are_those_of_the_program() -> None:
    for lines in tables():
        (found,) = filter(None, (shown_table(lines[0], text) for text in PAGES.values()))
        assert found.splitlines() == lines


def test_the_command_that_a_page_names_has_all_constants_and_the_kind_s_own_figures() -> None:
    named = [re.findall(r"`busplan explain (\S+) --format json`", text) for text in PAGES.values()]
    first = figures_of(kind_named(SHOWN_FIRST))
    kinds = []
    for name in (name for names in named for name in names):
        document = json.loads(CliRunner().invoke(app, ["explain", name, "--format", "json"]).stdout)
        kinds.append(load(name).profile.bus.kind)
        assert document["constants"] == constant_rows(kind_named(kinds[-1]))
        listed = {(row["command"], row["figure"]) for row in document["figures"]}
        for command, figures in figures_of(kind_named(kinds[-1])).items():
            assert {(command, key) for key, figure in figures.items() if figure != first[command].get(key)} <= listed
    assert sorted(kinds) == sorted(kind_names())


def test_the_groups_shown_are_those_of_the_shipped_profile() -> None:
    (groups,) = re.findall(r"^```toml\n(.*?)^```$", PAGES[FOLDER / "profile.md"], re.MULTILINE | re.DOTALL)
    above, _, _ = load("gantry-24").document.text.partition("# The groups stand")
    assert [group.name for group in validate(decode(f"{above}{groups}".encode(), name="page")).group] == [
        "drives",
        "io",
    ]


DOCUMENTS = {
    "latency": "paper-4ms",
    "capacity": "paper-1ms --period 600us --sensitivity",
    "circle-test": "paper-4ms --period 4ms --period 100us --contributions",
    "explain": "paper-4ms required_us",
    "report": "paper-4ms --no-circle",
    "check": "paper-optimal-gap nowhere.toml --no-circle",
    "rule": "BP101",
    "diff": "paper-1ms paper-optimal-gap",
    "plan": "paper-1ms --axes 400",
    "sweep": "paper-4ms --vary bus.nodes=1:2 --circle --jobs 1",
    "calibrate": "paper-two-node table-1.csv",
    "measured": f"ethercat-servo-8 {ROOT}/tests/questions/measured/files/capture.pcapng --quantile 0.9",
    "timeline": "paper-4ms",
    "map": "paper-4ms --x axes=4,6",
    "explore": "paper-4ms --x axes=4,6 --y cycle.period_us=500",
    "compare": "paper-4ms",
    "evidence": "ieee1394",
    "paper": "",
    "profiles": "",
}
FREE = {"changes", "smallest_period_with", "measured", "recommended_changes", "varied", "execution", "notes", "answers"}
"""What holds keys of a profile, or others that are not the document's own."""


def keys_of(document: object) -> Iterator[str]:
    """Every key of a document but those of what is free."""
    if isinstance(document, list):
        for one in document:
            yield from keys_of(one)
    elif isinstance(document, dict):
        for key, value in document.items():
            yield key
            if key not in FREE or isinstance(value, list):
                yield from keys_of(value)


def figure_keys() -> str:
    """Keys of figures, which mean the same in every document: those of `explain`, and first cells of the tables."""
    tables_of_figures = (
        shown_table(f"| {OTHER_FIGURE} |", PAGES[FOLDER / "models.md"]),
        shown_table("| `circle-test` |", PAGES[FOLDER / "circle.md"]),
    )
    rows = (row for shown in tables_of_figures for row in shown.splitlines())
    return "".join(row.split("|")[1] for row in rows) + "".join(map("`{}`".format, explained_keys()))


def json_section(command: str) -> str:
    """What the page says of a command's document."""
    return PAGES[FOLDER / "json.md"].partition(f"\n### {command}\n")[2].partition("\n### ")[0]


@pytest.mark.parametrize("command", DOCUMENTS)
def test_every_json_key_is_listed(command: str) -> None:
    done = CliRunner().invoke(app, [command, *DOCUMENTS[command].split(), "--format", "json"])
    _, _, documents = PAGES[FOLDER / "json.md"].partition("\n## Documents\n")
    everywhere = documents.partition("\n### ")[0] + figure_keys()
    own = json_section(command)
    said = everywhere + own + "".join(json_section(name) for name in re.findall(r"as in `(\w+)`", own))
    keys = set(keys_of(json.loads(done.stdout))) - {"schema", "command", "bus.nodes", "payload.read_bytes"}
    assert len(keys) >= 2 - (command in {"rule", "report"})
    assert [key for key in sorted(keys) if f"`{key}`" not in said] == []


def test_every_command_with_a_document_is_listed() -> None:
    listed = re.findall(r"^### (.*)$", PAGES[FOLDER / "json.md"], re.MULTILINE)
    assert listed == list(DOCUMENTS)
    assert set(COMMANDS) - set(listed) == {"schema", "manual", "init", "import", "emulate"}


def test_every_link_resolves() -> None:
    for path, link in ((path, link) for path, text in PAGES.items() for link in LINK.findall(text)):
        if link.startswith("https://"):
            continue
        name, _, anchor = link.partition("#")
        target = (path.parent / name).resolve() if name else path
        assert target.is_file(), (path, link)
        assert not anchor or anchor in anchors(target.read_text(encoding="utf-8")), (path, link)


def anchors(text: str) -> set[str]:
    """Anchors that GitHub gives the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_the_readme_links_to_every_topic() -> None:
    assert [topic for topic in topics() if f"(src/busplan/manual/{topic}.md" not in PAGES[README]] == []


def test_a_page_is_plain_ascii_with_one_title_and_short_lines() -> None:
    for topic in topics():
        text = PAGES[FOLDER / f"{topic}.md"]
        assert text.isascii(), topic
        prose = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
        assert re.findall(r"^# .*$", prose, re.MULTILINE) == [text.splitlines()[0]]
        assert [line for line in prose.splitlines() if len(line) > MAX_WIDTH and not line.startswith("|")] == []
