"""`busplan init`."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from busplan.buses import kind_named, kind_names
from busplan.cli.options import complete_profile, option, time_us
from busplan.cli.output import say
from busplan.errors import BusplanError
from busplan.files import write_file

if TYPE_CHECKING:
    from busplan.profile.starter import Machine

_Answer = TypeVar("_Answer")
_KIND = "ieee1394"
_NODES = 4
_AXES_PER_NODE = 4
_BYTES_PER_AXIS = 8


def init_command(
    name: Annotated[
        str,
        typer.Argument(help="Name of the new profile, or the path of its file; .toml is added where it is missing."),
    ] = "my-machine",
    bus: Annotated[
        str | None,
        option(
            "--bus KIND",
            f"Kind of bus: {' or '.join(kind_names())}.  [default: {_KIND}]",
            autocompletion=lambda incomplete: [kind for kind in kind_names() if kind.startswith(incomplete)],
        ),
    ] = None,
    nodes: Annotated[
        int | None, option("--nodes N", "Nodes of the machine, the host not counted.  [default: 4]", min=1)
    ] = None,
    axes: Annotated[
        int | None, option("--axes N", "Axes of the whole machine.  [default: 4 for each node]", min=1)
    ] = None,
    period: Annotated[
        str | None,
        option(
            "--period TIME", "Communication period with its unit, as 1ms or 500us.  [default: a usual one of the bus]"
        ),
    ] = None,
    bytes_per_axis: Annotated[
        int | None,
        option("--bytes-per-axis N", "Payload of each axis, in either direction [bytes].  [default: 8]", min=1),
    ] = None,
    host: Annotated[
        str | None,
        option(
            "--host HOST",
            "Kind of host, from which its own time is assumed; for EtherCAT hardware, tuned, real-time or stock.  "
            "[default: tuned]",
        ),
    ] = None,
    source: Annotated[
        str | None,
        option(
            "--from SHIPPED",
            "Copy a shipped profile instead, with its comments (see `busplan profiles`).  [default: no copy]",
            autocompletion=complete_profile,
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file that is already there.")] = False,
) -> None:
    """Write a commented profile of your machine, and say whether it fits.

    Values that are not known yet are assumed, graded so, and have a comment on how to find them. In a terminal the
    command asks for missing values; otherwise it takes the defaults and names them. With --from it copies a shipped
    profile under the new name. Exits 0 when the file is written, whatever the verdict is; a file that is already there
    stays as it is, unless --force is given. To start from a machine's own files, such as an ENI, use `busplan import`.

    Example: busplan init gantry --nodes 6 --axes 24 --period 1ms
    """
    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    if not path.name.removesuffix(".toml").strip("."):
        raise BusplanError(f"{name!r}: no name for a profile; expected a name or a path, as press-line")
    # A name that begins with a dash would be an option.
    shown = shlex.quote(f"./{path}" if str(path).startswith("-") else str(path))
    asked = {
        "--bus": bus,
        "--nodes": nodes,
        "--axes": axes,
        "--period": period,
        "--bytes-per-axis": bytes_per_axis,
        "--host": host,
    }
    from busplan.profile.starter import machine_text, starter_text

    if bus not in (None, *kind_names()):
        raise BusplanError(f"--bus {bus}: no kind of bus; there are {', '.join(kind_names())}")
    if source is None:
        kind = bus or _KIND
        machine, taken = _machine(kind, nodes=nodes, axes=axes, period=period, bytes_per_axis=bytes_per_axis, host=host)
        text = _with_settings(machine_text(machine, kind=kind, name=path.stem, file=shown), name=shown)
    else:
        given = [option for option, value in asked.items() if value is not None]
        if given:
            raise BusplanError(f"--from: goes without {' and '.join(given)}: a copy has the values of its profile")
        text, taken = starter_text(source, name=path.stem), []
    write_file(path, text.encode(), overwrite=force)
    defaults = [f"not given, so taken: {' '.join(taken)}"] if taken else []
    say(*defaults, f"wrote {path}", *_card(text), f"next: busplan capacity {shown}")


def _with_settings(text: str, *, name: str) -> str:
    """The same profile with a setting of the bus that its machine needs."""
    from busplan.profile.edit import edited_file
    from busplan.profile.toml import decode, validate
    from busplan.profile.write import value_text
    from busplan.questions.plan import needed_settings

    needed = needed_settings(validate(decode(text.encode(), name=name)))
    if not needed:
        return text
    text = edited_file(text.encode(), needed, name=name).decode()
    for key, value in needed.items():
        line = f"{key.rpartition('.')[2]} = {value_text(value)}"
        text = text.replace(f"{line}\n", f"{line:26} # assumed: without it no period carries the machine\n")
    return text


def _machine(
    kind: str,
    *,
    nodes: int | None,
    axes: int | None,
    period: str | None,
    bytes_per_axis: int | None,
    host: str | None,
) -> "tuple[Machine, list[str]]":
    """Take what is given, ask for the rest in a terminal, and take defaults elsewhere, which come second."""
    from busplan.profile.starter import Machine
    from busplan.sections.base import MAX_TIME_US, MIN_STEP_US

    starter = kind_named(kind).starter
    usual_period = starter.period
    asks = sys.stdin.isatty() and sys.stderr.isatty()
    taken: list[str] = []

    def number(given: int | None, option: str, words: str, default: int) -> int:
        if given is not None:
            return given
        while asks:
            answer = _asked(words, default)
            if answer > 0:
                return answer
            say("must be 1 or more")
        taken.append(f"{option} {default}")
        return default

    count = number(nodes, "--nodes", "Nodes, the host not counted", _NODES)
    total = number(axes, "--axes", "Axes of all nodes", _AXES_PER_NODE * count)
    if period is None and asks:
        period = _asked("Communication period, with its unit", usual_period)
    if period is None:
        taken.append(f"--period {usual_period}")
    period_us = time_us(period or usual_period, option="--period")
    if not MIN_STEP_US <= period_us <= MAX_TIME_US:
        raise BusplanError(f"--period {period}: must be between {MIN_STEP_US:g} and {MAX_TIME_US:g} us")
    size = number(bytes_per_axis, "--bytes-per-axis", "Bytes for each axis, in either direction", _BYTES_PER_AXIS)
    if host is None and starter.hosts:
        if asks:
            host = _asked(f"Host of the master: {', '.join(starter.hosts)}", starter.host)
        else:
            taken.append(f"--host {starter.host}")
    _require_host(kind, host)
    return Machine(count, total, period_us, size, host), taken


def _require_host(kind: str, host: str | None) -> None:
    known = kind_named(kind).starter.hosts
    if host is not None and host not in known:
        there = f"there are {', '.join(known)}" if known else f"a new profile of kind {kind} has no host"
        raise BusplanError(f"--host {host}: {there}")


def _asked(words: str, default: _Answer) -> _Answer:
    """Ask in the terminal; Ctrl-C interrupts as everywhere, and an input that ends is no answer."""
    try:
        answer: _Answer = typer.prompt(words, default=default, type=type(default), err=True)
    except typer.Abort as stopped:
        if isinstance(stopped.__context__, KeyboardInterrupt):
            raise KeyboardInterrupt from None
        raise BusplanError("no answer: give --nodes, --axes, --period, --bytes-per-axis and --host") from None
    return answer


def _card(text: str) -> list[str]:
    """The card of a new profile, in lines."""
    from busplan.profile.toml import decode, validate
    from busplan.questions.capacity import capacity

    report = str(capacity(validate(decode(text.encode(), name="profile"))))
    return report.partition("\n\n")[0].splitlines()
