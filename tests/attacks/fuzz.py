"""Random and hostile profiles of every kind of bus, through every command and form, in one process.

    python tests/attacks/fuzz.py 500 --seed 7

Keys, ranges and words come from the schema of profiles, commands and forms from the command line itself: what is added
there is tried here. Each call is held to what every call promises, and the answers on one profile to one story.
"""

import argparse
import copy
import csv
import json
import math
import random
import re
import resource
import signal
import sys
import tempfile
import time
import tomllib
import traceback
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import chdir, contextmanager
from io import BytesIO, StringIO, TextIOWrapper
from pathlib import Path
from typing import Any, Final, NamedTuple, get_args
from unittest import mock

import tomli_w
from typer.main import get_command

import busplan
from busplan.buses import kind_names
from busplan.cli import app, run
from busplan.cli.lazy import COMMANDS
from busplan.errors import BusplanError
from busplan.profile.document import decode, validate
from busplan.profile.kinds import profile_schema
from busplan.profile.starter import Machine, machine_text, shared_out
from busplan.questions.fit.circle_setup import path_steps
from busplan.questions.fit.network import network_of
from busplan.sections.profile import Profile

Data = dict[str, Any]
Schema = Mapping[str, Any]

LONGEST_S: Final = 5.0
"""Of what runs no circle, as the memory; a circle that is asked for takes what it takes, up to a hang."""
HANG_S: Final = 10.0
"""Of processor time, so that a busy machine makes no hang."""
CIRCLES_HANG_S: Final = 120.0
"""The same of a call that asks for circles: each takes a while."""
ASKS_FOR_CIRCLES: Final = frozenset({"circle-test", "--circle", "--circle-steps"})
MOST_MB: Final = 300.0
MOST_BYTES: Final = 4 << 30
"""Of the whole run, so that a call that takes them fails, and not the machine."""
SHORT_STEPS: Final = 50_000
"""Of a circle that is run; the goal of five seconds is for all but circles."""
FILE: Final = "p.toml"

# --- profiles -------------------------------------------------------------------------------------------------------

SCHEMA: Final = profile_schema()
TEXTS: Final = (
    *("x", "Ω µ-Maschine 日本", "\u202eright to left", "a" * 100, "</script>|`*_[a](b)", '"quoted" \\ \'', "=1+1", "-"),
)
PERIODS_US: Final = (62.5, 100.0, 125.0, 250.0, 333.0, 500.0, 1000.0, 2000.0, 4000.0, 10000.0)


def models() -> dict[str, Schema]:
    """The schema of a profile of each kind of bus."""
    chosen = {}
    for one in SCHEMA["allOf"]:
        kind = one["if"]["properties"]["bus"]["properties"]["kind"]["const"]
        chosen[kind] = resolved(one["then"])
    return chosen


def resolved(schema: Schema) -> Schema:
    """The schema behind a reference."""
    return SCHEMA["$defs"][schema["$ref"].rpartition("/")[2]] if "$ref" in schema else schema


class Maker:
    """Makes profiles of a kind: from a likely machine, with some keys at values that are anything the schema allows.

    Parameters
    ----------
    rng
        Source of all choices.
    kind
        Kind of bus.
    """

    def __init__(self, rng: random.Random, kind: str) -> None:
        self.rng = rng
        self.kind = kind
        self.hostility = rng.choice((0.0, 0.05, 0.3, 0.9))
        self.length = rng.choice((1, 2, 3, 8))
        """Of every array of a profile, for those that belong together have one length."""
        self.names = 0

    def profile(self) -> Data:
        """A profile that loads, but for one in eight."""
        rng, data = self.rng, self.machine()
        if rng.random() < 0.5:
            for section in ("servo", "circle"):
                data.pop(section, None)
        for _ in range(rng.choice((0, 1, 3, 10, 30))):
            changed = self.changed(data)
            if is_valid(changed):
                data = changed
        return self.changed(data) if rng.random() < 1 / 8 else data

    def machine(self) -> Data:
        """A new profile, as `init` writes it."""
        rng = self.rng
        nodes = rng.choice((1, 2, 3, 5, 8, 16, 19, 40))
        axes = nodes * rng.choice((1, 2, 4)) + rng.choice((0, 0, 1))
        machine = Machine(shared_out(axes, nodes=nodes), rng.choice(PERIODS_US), rng.choice((1, 2, 4, 8, 12)))
        data = tomllib.loads(machine_text(machine, kind=self.kind, name="a machine", file=FILE))
        return self.messages_alone(data) if self.kind == "can" and rng.random() < 0.25 else data

    def messages_alone(self, data: Data) -> Data:
        """A network of messages alone, with the bus of a machine."""
        bus = {key: data["bus"][key] for key in ("kind", "bit_rate_kbit_s")}
        messages = [
            {"name": f"m{number}", "identifier": number, "payload_bytes": 8, "period_us": 10_000 * number}
            for number in range(1, self.rng.choice((2, 4, 30, 70)))
        ]
        return {key: data[key] for key in ("schema_version", "name")} | {"bus": bus, "message": messages}

    def changed(self, data: Data) -> Data:
        """A copy with another value somewhere."""
        found = copy.deepcopy(data)
        self._change(found, models()[self.kind])
        return found

    def _change(self, table: Data, schema: Schema) -> None:
        """Change a key of a table, in it or below it."""
        rng = self.rng
        key = rng.choice(list(schema["properties"]))
        inner = self.member(schema["properties"][key], table.get(key))
        if inner.get("type") == "object" and isinstance(table.get(key), dict) and rng.random() < 0.9:
            self._change(table[key], inner)
        elif inner.get("type") == "object" and rng.random() < 0.5:
            table[key] = {}
            self._change(table[key], inner)
        elif inner.get("type") == "array" and self.is_tables(inner):
            tables = table.setdefault(key, [])
            if tables and rng.random() < 0.7:
                self._change(rng.choice(tables), resolved(inner["items"]))
            else:
                more = rng.choice((1, 1, 2, 5, 11, 40, 200) if self.is_hostile() else (1, 1, 2))
                tables += [self.value(inner["items"]) for _ in range(more)]
        elif key in table and key not in schema.get("required", ()) and rng.random() < 0.1:
            del table[key]
        else:
            table[key] = self.value(inner)

    def is_tables(self, schema: Schema) -> bool:
        """Whether an array is one of tables."""
        return resolved(schema["items"]).get("type") == "object"

    def is_hostile(self) -> bool:
        """Whether the next choice is one that nobody would make."""
        return self.rng.random() < self.hostility

    def member(self, schema: Schema, value: object = None) -> Schema:
        """One member of a union, but for null: that of a value, where it has one."""
        schema = resolved(schema)
        members = [resolved(one) for one in schema.get("anyOf", schema.get("oneOf", ()))]
        members = [one for one in members if one.get("type") != "null"]
        if not members:
            return schema
        kind = value.get("kind") if isinstance(value, dict) else None
        own = [one for one in members if one.get("properties", {}).get("kind", {}).get("const") == kind]
        found = self.rng.choice(own or members)
        # The example of a union stands beside its members.
        return {**found, **{key: schema[key] for key in ("examples", "default") if key in schema}}

    def value(self, schema: Schema) -> Any:
        """Anything that a schema allows."""
        schema = self.member(schema)
        if "const" in schema:
            return schema["const"]
        if "enum" in schema:
            return self.rng.choice(schema["enum"])
        make: dict[str, Callable[[Schema], Any]] = {
            "object": self._table,
            "array": self._array,
            "string": self._text,
            "boolean": lambda _: self.rng.random() < 0.5,
            "integer": lambda own: round(self._number(own)),
            "number": self._number,
        }
        return make[schema["type"]](schema)

    def _table(self, schema: Schema) -> Data:
        share = self.rng.choice((0.0, 0.2, 0.9))
        required = schema.get("required", ())
        return {
            key: self.value(inner)
            for key, inner in schema["properties"].items()
            if key in required or self.rng.random() < share
        }

    def _array(self, schema: Schema) -> list[Any]:
        if self.is_tables(schema):
            return [self.value(schema["items"])]
        return sorted(self.value(schema["items"]) for _ in range(self.length))

    def _text(self, schema: Schema) -> str:
        if "pattern" in schema and schema["pattern"] != r"\S":
            self.names += 1
            return f"n{self.names}"
        return self.rng.choice(TEXTS)

    def _number(self, schema: Schema) -> float:
        rng = self.rng
        least = schema.get("minimum", schema.get("exclusiveMinimum", -1e9))
        most = schema.get("maximum", schema.get("exclusiveMaximum", 1e9))
        example = next((one for one in schema.get("examples", ()) if isinstance(one, int | float)), None)
        usual = [one for one in (example, schema.get("default")) if isinstance(one, int | float)]
        if usual and not self.is_hostile():
            found = rng.choice(usual) * rng.choice((1, 1, 0.5, 2, 10 ** rng.uniform(-1, 1)))
        elif rng.random() < 0.5:
            found = rng.choice((least, most, 0, 1, 1e-9, 1e9, math.nextafter(least, math.inf), most * (1 - 1e-12)))
        else:
            found = math.exp(rng.uniform(math.log(max(least, 1e-9)), math.log(max(most, 1e-9))))
        return float(min(max(found, least), most))


def is_valid(data: Data) -> bool:
    """Whether a profile loads."""
    try:
        validate(decode(text_of(data).encode(), name=FILE))
    except BusplanError:
        return False
    return True


def has_short_circle(text: str) -> bool:
    """Whether a circle of a profile takes no time to speak of, or cannot be run."""
    try:
        return path_steps(network_of(validate(decode(text.encode(), name=FILE)))) < SHORT_STEPS
    except BusplanError:
        return True


def text_of(data: Data) -> str:
    """A profile as TOML."""
    return tomli_w.dumps(data)


# --- calls ----------------------------------------------------------------------------------------------------------


class HangError(BaseException):
    """A call that took too long; what catches every Exception does not catch it."""


class Call(NamedTuple):
    """One run of the program."""

    arguments: tuple[str, ...]
    code: int
    out: bytes
    err: str
    seconds: float
    grown_mb: float
    """How much more memory it had at its peak than before."""


def call(*arguments: str) -> Call:
    """Run the program in this process, in the working folder."""
    out, err = TextIOWrapper(BytesIO(), encoding="utf-8"), TextIOWrapper(BytesIO(), encoding="utf-8")
    before_mb = memory_mb("VmRSS", reset=True)
    start = time.process_time()
    try:
        with (
            alarm(CIRCLES_HANG_S if asks_for_circles(arguments) else HANG_S),
            mock.patch.multiple(sys, argv=["busplan", *arguments], stdin=StringIO(), stdout=out, stderr=err),
        ):
            run()
    except SystemExit as leaving:
        code = leaving.code if isinstance(leaving.code, int) else 0
    except HangError as hang:
        code = -1
        err.write(f"hangs: {''.join(traceback.format_tb(hang.__traceback__)[-4:])}")
    seconds = time.process_time() - start
    grown_mb = memory_mb("VmHWM") - before_mb
    for stream in (out, err):
        stream.flush()
    written, said = (stream.buffer.getvalue() for stream in (out, err))
    return Call(arguments, code, written, said.decode(), seconds, grown_mb)


def asks_for_circles(arguments: tuple[str, ...]) -> bool:
    """Whether a call asks for circles."""
    return not ASKS_FOR_CIRCLES.isdisjoint(arguments)


@contextmanager
def alarm(seconds: float) -> Iterator[None]:
    """Stop what takes more processor time than that."""

    def ring(_number: int, _frame: object) -> None:
        raise HangError

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def memory_mb(key: str, *, reset: bool = False) -> float:
    """Memory of this process, now or at its peak; 0 where no Linux says it."""
    status = Path("/proc/self/status")
    if not status.exists():
        return 0.0
    if reset:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    found = re.search(rf"^{key}:\s+(\d+) kB", status.read_text(encoding="utf-8"), re.MULTILINE)
    return int(found[1]) / 1024 if found else 0.0


class Command(NamedTuple):
    """A command that takes a profile."""

    name: str
    forms: tuple[str, ...]
    has_circle: bool
    """Whether --no-circle leaves a circle out, which stands there for a long one."""
    has_period: bool


def commands() -> list[Command]:
    """Every command that takes a profile, with its forms."""
    found = []
    command_line: Any = get_command(app)
    for name in COMMANDS:
        command = command_line.get_command(None, name)
        options = {option: one for one in command.params for option in (*one.opts, *one.secondary_opts)}
        arguments = {one.metavar for one in command.params if one.param_type_name == "argument"}
        if not arguments & {"PROFILE", "PATH", "A"} or "MEASUREMENTS" in arguments:
            continue
        forms = tuple(words_of(options["--format"].type_descriptor.annotation))
        found.append(Command(name, forms, "--no-circle" in options, "--period" in options))
    return found


def words_of(annotation: Any) -> Iterator[str]:
    """The words among what an option may be."""
    for one in get_args(annotation):
        yield from (one,) if isinstance(one, str) else words_of(one)


VARIED: Final = (
    *("cycle.period_us=100,1000,1e9", "cycle.slice_ratio=0.1:1:0.1", "limits.reserve=0,0.5"),
    "bus.bit_rate_kbit_s=20,125,500",
)
NEEDED: Final[Mapping[str, Callable[[random.Random], tuple[str, ...]]]] = {
    "sweep": lambda rng: ("--vary", rng.choice(VARIED)),
    "diff": lambda rng: (rng.choice((FILE, "paper-1ms", "can-servo-8")),),
}
"""What a command needs beside a profile and a form."""
FIGURES: Final = ("required_us", "margin_us", "uncertainty_us", "arbitration", "latency.nodes", "verdict")
CIRCLES: Final[Mapping[str, tuple[str, ...]]] = {
    "check": ("--circle-steps", "20000"),
    "map": ("--circle", "--jobs", "1", "--x", "cycle.period_us=100,1000", "--y", "cycle.slice_ratio=0.5,1"),
    "sweep": ("--circle", "--jobs", "1"),
}
"""What asks for short circles, and for few."""
MORE: Final[Mapping[str, Callable[[random.Random], tuple[str, ...]]]] = {
    "capacity": lambda _: ("--sensitivity",),
    "explain": lambda rng: (rng.choice(FIGURES),),
    "map": lambda _: ("--x", "cycle.slice_ratio=0.2:1:0.2"),
    "plan": lambda rng: ("--free", rng.choice(("period", "slice_ratio,nodes", "payload,period"))),
}
"""What a command may be asked, too."""


def arguments_of(rng: random.Random, command: Command, form: str, *, is_short: bool) -> tuple[str, ...]:
    """A command line on the profile; circles are asked for where the profile's own is short."""
    found = [command.name, FILE, *(NEEDED[command.name](rng) if command.name in NEEDED else ()), "--format", form]
    if is_short and rng.random() < 0.3:
        found += CIRCLES.get(command.name, ())
    elif command.has_circle:
        found.append("--no-circle")
    elif command.name in MORE and rng.random() < 0.3:
        found += MORE[command.name](rng)
    if command.has_period and rng.random() < 0.15:
        found += ["--period", rng.choice(("1us", "250us", "4ms", "1000s"))]
    if rng.random() < 0.15:
        found += ["--set", rng.choice(("cycle.slice_ratio=1e-6", "cycle.nonperiodic_us=50", "limits.reserve=0.9"))]
    return tuple(found)


# --- what every call promises -----------------------------------------------------------------------------------------


def broken_promises(done: Call, form: str) -> Iterator[str]:
    """Say what a call does not hold."""
    if done.code not in {0, 1, 2}:
        yield f"exit code {done.code}: {done.err}"
        return
    if "busplan itself failed" in done.err or "Traceback" in done.err:
        yield done.err
    if done.code == 2 and not done.err:
        yield "exit code 2 without a word"
    is_asked = asks_for_circles(done.arguments)
    if done.seconds > LONGEST_S and not is_asked:
        yield f"takes {done.seconds:.1f} s"
    if done.grown_mb > MOST_MB and not is_asked:
        yield f"takes {done.grown_mb:.0f} MB"
    if done.out:
        yield from badly_formed(done.out, form)
    elif done.code == 0 and done.arguments[0] != "check":
        yield "says nothing"


def badly_formed(out: bytes, form: str) -> Iterator[str]:
    """Say why an answer is none of its form."""
    try:
        if form in {"json", "gitlab", "sarif"}:
            json.loads(out, parse_constant=no_number)
        elif form == "csv":
            rows = list(csv.reader(StringIO(out.decode(), newline=""), strict=True))
            if len({len(row) for row in rows}) != 1:
                yield "rows of unlike lengths"
        elif form in {"svg", "junit"}:
            ET.XML(out)
        elif form not in {"png", "parquet"}:
            out.decode()
    except (ValueError, csv.Error, ET.ParseError) as error:
        yield f"is no {form}: {error}"


def no_number(text: str) -> float:
    """Refuse NaN and Infinity, which are no JSON."""
    raise ValueError(text)


# --- one story ------------------------------------------------------------------------------------------------------

TOLD: Final = (
    *("verdict", "fits", "exceeded", "margin_corrected_us", "uncertainty_us"),
    *("required_us", "available_us", "safe_nodes", "safe_axes", "safe_limited_by"),
)
"""What every answer that tells it tells alike."""
TELLERS: Final[Mapping[tuple[str, ...], Callable[[Any], Data]]] = {
    ("capacity",): lambda said: said["verdicts"][0],
    ("timeline",): lambda said: said if said["verdict"] is not None else {},
    ("plan",): lambda said: said["options"][0],
    ("report", "--no-circle"): lambda said: said["profiles"][0]["answers"]["capacity"]["verdicts"][0],
    ("map", "--x", "cycle.slice_ratio={ratio}", "--y", "limits.reserve={reserve}"): lambda said: said["design"],
    ("sweep", "--vary", "cycle.slice_ratio={ratio}"): lambda said: deciding(said["rows"]),
    ("compare", "--buses", "{kind}"): lambda said: said["buses"][0],
    ("check", "--no-circle"): lambda said: said["files"][0],
    ("diff", FILE): lambda said: said["a"],
}
"""Commands with a verdict, and where their documents tell it."""


GATE_CODES: Final = ("BP103", "BP104", "BP105", "BP203")
"""Findings on what capacity tells beside the verdict."""


def deciding(rows: list[Data]) -> Data:
    """The row of the timing model that decides."""
    return next(row for row in rows if row["verdict"] is not None)


def disagreements(profile: Profile) -> Iterator[tuple[tuple[str, ...], str]]:
    """Commands that do not tell of a profile what capacity tells, and what they tell."""
    values = {"ratio": profile.cycle.slice_ratio, "reserve": profile.limits.reserve, "kind": profile.bus.kind}
    own: Data = {}
    for (name, *options), find in TELLERS.items():
        done = call(name, FILE, *(one.format(**values) for one in options), "--format", "json")
        if done.out:
            said = json.loads(done.out)
            if not own:
                own = {**deciding(said["results"]), **find(said)}
                yield from (
                    (done.arguments, one) for one in others(find(said), deciding(said["results"]), "its figures")
                )
            told = (*others(find(said), own, "capacity"), *unlike(name, find(said), own))
        else:  # as a timeline of too many events
            told = (*broken_promises(done, "json"),)
        yield from ((done.arguments, one) for one in told)
        if not own:
            return
    yield from ((("capacity", FILE), one) for one in otherwise_in_forms(profile, own))


def unlike(name: str, said: Data, own: Data) -> Iterator[str]:
    """What a gate or a plan says that does not go with the capacity."""
    is_well = own["verdict"] == "fits" and not own["missed_limits"]
    if name == "plan" and said["held_by"] is None and not is_well:
        yield f"is held by {said['held_by']}, and capacity is {own['verdict']}, {own['missed_limits']}"
    if name != "check":
        return
    keys = {code: {one["key"] for one in said["findings"] if one["code"] == code} for code in GATE_CODES}
    if not is_well and said["status"] == "ok":
        yield f"has no finding, and capacity is {own['verdict']}, {own['missed_limits']}"
    if keys.pop("BP203") and call("circle-test", FILE).code != 2:
        yield f"has {said['findings']}, and the circle test runs"
    if own["verdict"] == "fits" and set().union(*keys.values()) != set(own["missed_limits"]):
        yield f"has {keys}, and capacity {own['missed_limits']}"


def otherwise_in_forms(profile: Profile, own: Data) -> Iterator[str]:
    """What capacity says otherwise as CSV, as text and in Python than as JSON."""
    rows = csv.DictReader(StringIO(call("capacity", FILE, "--format", "csv").out.decode(), newline=""))
    row = next(one for one in rows if one["verdict"])
    for key in ("verdict", "safe_limited_by"):
        if row[key] != (own[key] if isinstance(own[key], str) else " ".join(own[key] or ())):
            yield f"{key} {row[key]} as CSV, and {own[key]} as JSON"
    text = call("capacity", FILE, "--format", "table").out.decode()
    if own["verdict"].upper() not in text.partition("\n  [")[0]:
        yield f"{text[:300]} as text, and {own['verdict']} as JSON"
    figures = busplan.capacity(profile).verdicts[0].deciding
    for key in TOLD:
        value = getattr(figures, key)
        if (list(value) if isinstance(value, tuple) else value) != own[key]:
            yield f"{key} {value} in Python, and {own[key]} as JSON"


def others(one: Data, other: Data, name: str) -> Iterator[str]:
    """What two answers tell otherwise."""
    for key in TOLD:
        # Groups have counts of their own, and only one of them may be counted.
        is_told = key in one and key in other and not (key.startswith("safe_") and None in (one[key], other[key]))
        if is_told and not alike(one[key], other[key]):
            yield f"{key} {one[key]}, and {name} has {other[key]}"


def alike(one: object, other: object) -> bool:
    """Whether two values are the same, but for rounding."""
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=1e-9, abs_tol=1e-6)
    return one == other


# --- the run --------------------------------------------------------------------------------------------------------


class Failure(NamedTuple):
    """A promise that is not held, with what shows it."""

    arguments: tuple[str, ...]
    message: str
    profile: str


def attack(
    rng: random.Random, kind: str, *, asked: list[tuple[Command, str]], counts: Counter[str], story: bool
) -> list[Failure]:
    """Write a profile into the working folder and ask of it; gives what is not held.

    Parameters
    ----------
    rng
        Source of all choices.
    kind
        Kind of bus.
    asked
        Commands and forms.
    counts
        Counts what is done.
    story
        Whether all commands with a verdict are to tell the same of it.
    """
    data = Maker(rng, kind).profile()
    text = text_of(data)
    Path(FILE).write_text(text, encoding="utf-8")
    found = []
    counts[kind] += 1
    loads = is_valid(data)
    counts["loads" if loads else "refused"] += 1
    if loads and story:
        counts["stories"] += 1
        own = validate(decode(text.encode(), name=FILE))
        found += [Failure(arguments, message, text) for arguments, message in disagreements(own)]
    is_short = has_short_circle(text)
    for command, form in asked:
        if command.name == "circle-test" and not is_short:
            continue
        done = call(*arguments_of(rng, command, form, is_short=is_short))
        counts[f"{command.name} {form}"] += 1
        counts[f"exit {done.code}"] += 1
        found += [Failure(done.arguments, message, text) for message in broken_promises(done, form)]
    return found


def main() -> int:
    """Attack with so many profiles, and say what was not held."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("profiles", type=int, help="how many profiles")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--calls", type=int, default=6, help="calls of each profile")
    parser.add_argument("--stories", type=int, default=3, help="one profile in so many is asked of every command")
    parser.add_argument("--quiet", action="store_true", help="failures without their profiles")
    options = parser.parse_args()
    counts, kinds, failures = Counter[str](), kind_names(), 0
    every = [(command, form) for command in commands() for form in command.forms]
    said = set()
    resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        for number in range(options.profiles):
            # A number of its own for each profile, so that one can be made again alone.
            rng = random.Random(f"{options.seed} {number}")
            for one in attack(
                rng,
                kinds[number % len(kinds)],
                asked=rng.sample(every, options.calls),
                counts=counts,
                story=number % options.stories == 0,
            ):
                failures += 1
                print(f"\n{options.seed} {number}: busplan {' '.join(one.arguments)}\n{one.message.strip()}")  # noqa: T201
                key = (one.arguments[0], one.message[:60])
                if not options.quiet and key not in said:
                    print(one.profile)  # noqa: T201
                said.add(key)
                sys.stdout.flush()
    print(f"\nseed {options.seed}: {failures} failures")  # noqa: T201
    for name, count in sorted(counts.items()):
        print(f"{count:8} {name}")  # noqa: T201
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
