"""`busplan init`."""

import re
import shlex
import sys
from collections.abc import Mapping
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeVar

import typer

from busplan.buses import kind_called, kind_named, kind_names, variant_called
from busplan.cli.command import command
from busplan.cli.options import complete_kind, complete_profile, time_us
from busplan.cli.output import message_width, say
from busplan.english import listed
from busplan.errors import BusplanError
from busplan.files import write_file

if TYPE_CHECKING:
    from busplan.profile.starter import Machine, NodeGroup

_Answer = TypeVar("_Answer")
_KIND = "ieee1394"
_NODES = 4
_AXES_PER_NODE = 4
_BIT_RATE = 1000
_BYTES_PER_AXIS = 8
_NO_HOST = "none"
_GROUP: Final = re.compile(
    r"(?P<name>[\w-]{1,40}):(?P<nodes>\d{1,7})x(?P<axes>\d{1,7})(:(?P<read>\d{1,7})/(?P<write>\d{1,7}))?", re.ASCII
)


@command(of="nothing", answers=False)
def init_command(
    name: Annotated[
        str,
        typer.Argument(help="Name of the new profile, or the path of its file; .toml is added where it is missing."),
    ] = "my-machine",
    bus: Annotated[
        str | None,
        typer.Option(
            "--bus",
            metavar="KIND",
            help=f"Kind of bus: {', '.join(kind_names())}, or another name, as firewire, can-fd, profibus or "
            f"dynamixel.  [default: {_KIND}]",
            autocompletion=complete_kind,
        ),
    ] = None,
    nodes: Annotated[
        int | None,
        typer.Option(
            metavar="N", min=1, help="Nodes of the machine, the host not counted.  [default: 4, or as --axes needs]"
        ),
    ] = None,
    axes: Annotated[
        int | None,
        typer.Option(
            metavar="N", min=1, help="Axes of the whole machine.  [default: 4 for each node, 1 for each servo or motor]"
        ),
    ] = None,
    group: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME:NODESxAXES[:READ/WRITE]",
            help="Nodes of the same kind: the axes of one node, and the bytes that it sends and receives, else by "
            "--bytes-per-axis. May be given several times; replaces --nodes and --axes.  [default: one group]",
        ),
    ] = None,
    period: Annotated[
        str | None,
        typer.Option(
            metavar="TIME",
            help="Communication period with its unit, as 1ms or 500us.  [default: a usual one of the bus]",
        ),
    ] = None,
    bytes_per_axis: Annotated[
        int | None,
        typer.Option(metavar="N", min=1, help="Payload of each axis, in either direction [bytes].  [default: 8]"),
    ] = None,
    host: Annotated[
        str | None,
        typer.Option(
            metavar="HOST",
            help="Host, with the assumed times of its own and of its latest wake-up, as others measured them: "
            "hardware (a master in hardware or a kernel driver of its own), tuned (a tuned Linux with its own driver), "
            "real-time (PREEMPT_RT with a stock driver), low-latency (Linux with a low-latency kernel), stock (stock "
            "Linux or Windows). Not every bus knows each."
            "  [default: tuned on EtherCAT, else not said]",
        ),
    ] = None,
    bit_rate: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Bit rate of CAN [kbit/s].  [default: 1000, assumed]")
    ] = None,
    source: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="SHIPPED",
            help="Copy a shipped profile instead, with its comments (see `busplan profiles`).  [default: no copy]",
            autocompletion=complete_profile,
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
) -> None:
    """Write a commented profile of your machine, and say whether it fits.

    Values that are not known yet are assumed, graded so, and have a comment on how to find them. In a terminal the
    command asks for missing values; otherwise it takes the defaults and names them. With --from it copies a shipped
    profile under the new name. Exits 0 when the file is written, whatever the verdict is; an existing file stays,
    unless --force is given. To start from a machine's own files, such as an ENI, use `busplan import`.

    Nodes that differ are groups: --group dual:4x2 --group io:3x0:32/8 are four nodes of two axes each and three without
    axes, which send 32 bytes and receive 8.

    Example: busplan init gantry --nodes 6 --axes 24 --period 1ms
    """
    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    if not path.name.removesuffix(".toml").strip("."):
        raise BusplanError(f"{name!r}: no name for a profile; expected a name or a path, as press-line")
    # A name that begins with a dash would be an option.
    shown = shlex.quote(f"./{path}" if str(path).startswith("-") else str(path))
    given = {
        "--bus": bus,
        "--nodes": nodes,
        "--axes": axes,
        "--group": group,
        "--period": period,
        "--bytes-per-axis": bytes_per_axis,
        "--host": host,
        "--bit-rate": bit_rate,
    }
    values = _Values({name: value for name, value in given.items() if value})
    from busplan.profile.starter import machine_text, starter_text

    if source is None:
        kind, variant = values.kind()
        machine = _machine(kind, variant, values)
        try:
            text = _with_settings(machine_text(machine, kind=kind, name=path.stem, file=shown), name=shown)
        except BusplanError as refused:
            if machine.host and re.match(r"bus\.\w+_us\b", str(refused)):  # a key that nobody wrote
                raise BusplanError(f"--host {machine.host}: {refused}; a longer --period has room") from None
            raise
    else:
        if values.given:
            options = " and ".join(values.given)
            raise BusplanError(f"--from: cannot be used with {options}: a copy has the values of its profile")
        text = starter_text(source, name=path.stem)
    write_file(path, text.encode(), overwrite=force)
    defaults = [f"not given, so taken: {' '.join(values.taken)}"] if values.taken else []
    say(*defaults, f"wrote {path}", *_card(text), f"next: busplan capacity {shown}")


def _with_settings(text: str, *, name: str) -> str:
    """The same profile with a setting of the bus that its machine needs."""
    from busplan.profile.document import decode, validate
    from busplan.profile.edit import edited_file, value_text
    from busplan.questions.plan import needed_settings

    needed = needed_settings(validate(decode(text.encode(), name=name)))
    if not needed:
        return text
    text = edited_file(text.encode(), needed, name=name).decode()
    for key, value in needed.items():
        line = f"{key.rpartition('.')[2]} = {value_text(value)}"
        text = text.replace(f"{line}\n", f"{line:26} # assumed: without it no period carries the machine\n")
    return text


def _groups(texts: list[str]) -> "tuple[NodeGroup, ...]":
    """Groups of nodes, as `--group` has them."""
    from busplan.profile.starter import NodeGroup

    groups = {}
    for text in texts:
        match = _GROUP.fullmatch(text)
        if match is None:
            raise BusplanError(
                f"--group {text}: expected NAME:NODESxAXES or NAME:NODESxAXES:READ/WRITE, as dual:4x2 or io:3x0:32/8"
            )
        name, nodes, axes, read, write = match.group("name", "nodes", "axes", "read", "write")
        if name in groups:
            raise BusplanError(f"--group {text}: there is a group {name} already; give it another name")
        if not int(nodes):
            raise BusplanError(f"--group {text}: must have 1 node or more")
        sizes = (int(read), int(write)) if read else (None, None)
        groups[name] = NodeGroup(name, int(nodes), int(axes), *sizes)
    return tuple(groups.values())


class _Values:
    """Values of options: given, asked for in a terminal, or defaults that are taken and named."""

    def __init__(self, given: dict[str, Any]) -> None:
        self.given = given
        """Value of each option that is given."""
        self.asks = all(stream is not None and stream.isatty() for stream in (sys.stdin, sys.stderr))
        self.taken: list[str] = []
        """Defaults that nobody was asked about, as options."""

    def value(self, option: str, question: str, default: _Answer) -> _Answer:
        """The given value, or the answer in the terminal; Ctrl-C interrupts, and an input that ends is no answer."""
        if option in self.given:
            value: _Answer = self.given[option]
        elif self.asks:
            try:
                value = typer.prompt(question, default=default, type=type(default), err=True)
            except typer.Abort as stopped:
                if isinstance(stopped.__context__, KeyboardInterrupt):
                    raise KeyboardInterrupt from None
                options = "--bus, --nodes, --axes, --period, --bytes-per-axis and --host"
                raise BusplanError(f"no answer: give {options}") from None
        else:
            value = default
            self.taken.append(f"{option} {default}")
        return value

    def number(self, option: str, question: str, default: int) -> int:
        """A number, which the option itself checks."""
        while (number := self.value(option, question, default)) < 1:
            say("must be 1 or more")
        return number

    def kind(self) -> tuple[str, str]:
        """Kind of bus and its variant; a word that is no kind is asked for again."""
        while True:
            word = self.value("--bus", f"Kind of bus: {', '.join(kind_names())}", _KIND)
            try:
                return kind_called(word, option="--bus" if "--bus" in self.given else ""), variant_called(word)
            except BusplanError as refused:
                if "--bus" in self.given:
                    raise
                say(str(refused))

    def period_us(self, default: str) -> float:
        """The communication period [us]."""
        from busplan.sections.base import MAX_TIME_US, MIN_STEP_US

        text = self.value("--period", "Communication period, with its unit", default)
        period_us = time_us(text, option="--period")
        if not MIN_STEP_US <= period_us <= MAX_TIME_US:
            raise BusplanError(f"--period {text}: must be between {MIN_STEP_US:g} and {MAX_TIME_US:g} us")
        return period_us


def _machine(kind: str, variant: str, values: _Values) -> "Machine":
    """The machine of the options; values that they leave open are asked for, or defaults."""
    from busplan.profile.starter import Machine, shared_out

    starter, groups = kind_named(kind).starter, _groups(values.given.get("--group", []))
    if groups and values.given.keys() & {"--nodes", "--axes"}:
        raise BusplanError("--group: cannot be used with --nodes or --axes: each group says its own")
    if not groups:
        per_node = 1 if variant in starter.servos else _AXES_PER_NODE
        usual = ceil(values.given["--axes"] / per_node) if "--axes" in values.given else _NODES
        nodes = values.number("--nodes", "Nodes, the host not counted", usual)
        axes = values.number("--axes", "Axes of all nodes", per_node * nodes)
        groups = shared_out(axes, nodes=nodes)
    if variant in starter.servos and "--bytes-per-axis" not in values.given:
        groups = tuple(_with_servo_data(group, starter.servos[variant]) for group in groups)
    period_us = values.period_us(starter.period)
    size = _BYTES_PER_AXIS
    if any(group.read_bytes is None for group in groups):
        size = values.number("--bytes-per-axis", "Bytes for each axis, in either direction", size)
    elif "--bytes-per-axis" in values.given:
        raise BusplanError("--bytes-per-axis: nothing takes it: each --group says the bytes of its nodes")
    host = _host(kind, variant, values)
    return Machine(groups, period_us, size, host, variant, rate=_rate(kind, values))


def _host(kind: str, variant: str, values: _Values) -> str | None:
    """The host that is given or answered; None for the usual one, or for none where the kind has no usual one."""
    known, usual, host = kind_named(kind).hosts(variant), kind_named(kind).starter.host, values.given.get("--host")
    if known and host is None and (usual or values.asks):
        if values.asks:
            say(*(f"{name}: {host.meaning}" for name, host in known.items()))
        names = ", ".join((*known, *([] if usual else [_NO_HOST])))
        host = values.value("--host", f"Host: {names}", usual or _NO_HOST)
    if host == _NO_HOST and not usual:
        return None
    if host is not None and host not in known:
        kinds = listed([name for name in kind_names() if kind_named(name).hosts()], "or")
        why = f"{kind} has {', '.join(known)}" if known else f"only for --bus {kinds}, not for {variant or kind}"
        raise BusplanError(f"--host {host}: {why}")
    return host


def _with_servo_data(group: "NodeGroup", data: Mapping[str, tuple[int, str]]) -> "NodeGroup":
    """The group with the usual data of its servos, where it does not say its own."""
    if group.axes != 1 or group.read_bytes is not None:
        return group
    (read_bytes, read), (write_bytes, write) = data["read"], data["write"]
    return group._replace(
        read_bytes=read_bytes, write_bytes=write_bytes, data=(f"assumed: {read}", f"assumed: {write}")
    )


def _rate(kind: str, values: _Values) -> int | None:
    """The bit rate that is given or answered; None for the usual one, which is assumed."""
    key, rate = kind_named(kind).starter.rate, values.given.get("--bit-rate")
    if not key:
        if rate is not None:
            raise BusplanError(f"--bit-rate {rate}: a profile of kind {kind} says its rate elsewhere")
        return None
    if rate is None and values.asks:
        return values.number("--bit-rate", "Bit rate, in kbit/s", _BIT_RATE)
    if rate is None:
        values.taken.append(f"--bit-rate {_BIT_RATE}")
    return rate


def _card(text: str) -> list[str]:
    """The card of a new profile, in lines as wide as the terminal."""
    from busplan.forms.terminal import block_lines
    from busplan.profile.document import decode, validate
    from busplan.questions.capacity import capacity

    card, *_ = capacity(validate(decode(text.encode(), name="profile"))).report().blocks
    return [line.text for line in block_lines([card], width=message_width())]
