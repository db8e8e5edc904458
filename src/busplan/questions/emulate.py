"""`busplan.emulate`: the recording that the planned machine would give, for software that is tried before it exists."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from types import MappingProxyType

from busplan import __version__
from busplan.buses import kind_named, kind_names
from busplan.buses.emulation import TIMES, Emulation, Emulator, Fault
from busplan.buses.network import Network
from busplan.english import did_you_mean, listed, plural
from busplan.errors import ArgumentError, BusplanError
from busplan.forms.blocks import Code, Report, Sentence
from busplan.progress import ignored
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import ProfileLike, finite, load_network, whole_number, with_its_constants
from busplan.questions.base.sentences import document, fields, with_profile
from busplan.questions.fit.network import bus_of
from busplan.sections.base import MAX_COUNT
from busplan.sections.profile import Profile

_CYCLES = 1000
"""Cycles of a recording by default."""


@dataclass(frozen=True, repr=False)
class EmulateAnswer(Answer):
    """Answer of `emulate`: a synthetic recording, which `save` writes."""

    profile: Profile
    """The plan."""
    content: bytes
    """Recording in the format of its kind of bus."""
    endings: tuple[str, ...]
    """Endings of the name of a file with the recording."""
    cycles: int
    """Length of the recording [cycles]; for messages alone, periods of the fastest one."""
    duration_us: float
    """Length of the recording [us]."""
    seed: int
    """Seed of the random numbers."""
    faults: Mapping[str, float]
    """Value of each fault by name: its number in the recording, or its delay [us]."""
    described: tuple[Fault, ...]
    """Behaviour of the machine at each fault, and the figure that shows it."""
    inside: tuple[str, ...]
    """Faults inside the plan, so that `measured` finds nothing beyond it."""
    unsure: tuple[str, ...]
    """Faults beyond the plan by less than its uncertainty, so that `measured` does not show them."""

    def _contents(self) -> Mapping[str, Callable[[], str | bytes]]:
        recordings = dict.fromkeys(self.endings, lambda: self.content)
        return {**super()._contents(), **recordings}

    def report(self) -> Report:
        """Contents of the recording."""
        name = self.profile.name
        length = f"{plural(self.cycles, 'cycle')}, {_decimal(self.duration_us / 1e6)} s, seed {self.seed}"
        lines = [Sentence(("Synthetic recording of ", Code(name), f": {length}. It is not a measurement."))]
        records = []
        for fault, value in zip(self.described, self.faults.values(), strict=True):
            often = plural(int(value), "time") if fault.unit == "1" else f"{TIMES} times, {_decimal(value)} us"
            is_inside = fault.name in self.inside
            shown = f"measured shows {fault.shown_as}"
            if is_inside:
                shown = f"the plan allows this, so {fault.shown_as} is within"
            elif fault.name in self.unsure:
                shown = f"smaller than the plan's uncertainty, so measured cannot show {fault.shown_as} as outside"
            lines.append(Sentence((f"{fault.name}: {fault.words}, {often}; {shown}.",)))
            records.append({"value": value, "is_inside_plan": is_inside, **fields(fault, "name", "unit", "shown_as")})
        content = document("emulate", profile=name, **fields(self, "cycles", "duration_us", "seed"), faults=records)
        return Report(Sentence(("Emulated ", Code(name))), lines, content, with_profile(name, records))


@with_its_constants
def emulate(
    profile: ProfileLike,
    *,
    cycles: int | None = None,
    duration_us: float | None = None,
    seed: int = 1,
    fault: Mapping[str, float | None] | None = None,
) -> EmulateAnswer:
    """Emulate the planned machine: the recording that it would give. `busplan emulate`.

    EtherCAT gives a capture of the master's port (pcapng), CAN a log of candump. The file says that it is synthetic.

    Parameters
    ----------
    profile
        The plan: a `Profile`, a path or a shipped name.
    cycles
        Cycles of the recording, by default 1,000; for messages alone, periods of the fastest one.
    duration_us
        Length of the recording, instead of cycles [us].
    seed
        Seed of the random numbers. The same seed gives the same bytes.
    fault
        Faults of the machine by name, each with its value: number in the recording, or delay [us]; None for its
        default.

    Raises
    ------
    BusplanError
        Not a profile, a kind of bus without recordings, an unknown fault, one that has no place, or too many frames.

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.emulate("can-servo-8", cycles=2)
    >>> answer.content[:34]
    b'(0000000000.000051) synthetic 080#'
    """
    network = load_network(profile)
    emulator = emulator_of(network.profile)
    period_us = emulator.period_us(network)
    if cycles is not None and duration_us is not None:
        raise ArgumentError("cycles and duration_us: give one of them")
    if duration_us is not None:
        cycles = ceil(finite(duration_us, name="duration_us") / period_us)
        if not 1 <= cycles <= MAX_COUNT:
            expected = f"a recording of 1 to {MAX_COUNT:,} cycles of {_decimal(period_us)} us"
            raise ArgumentError(f"duration_us {_decimal(duration_us)} us: expected {expected}")
    number = whole_number(_CYCLES if cycles is None else cycles, name="cycles")
    if not isinstance(fault, Mapping | None):
        raise ArgumentError(f'fault {fault!r}: expected values by name, as {{"jitter": 50}}')
    values = {
        name: _value(fault_named(emulator, name), value, period_us, number * period_us)
        for name, value in (fault or {}).items()
    }
    random = Random(whole_number(seed, name="seed"))  # noqa: S311 - jitter and data, no secret
    origin = f"emulated by busplan {__version__} from {network.profile.name}"
    content = emulator.emulated(network, Emulation(number, random, values, origin))
    inside, unsure = _not_found(network, emulator, content, values)
    return EmulateAnswer(
        network.profile,
        content,
        emulator.endings,
        number,
        number * period_us,
        seed,
        MappingProxyType(values),
        tuple(fault_named(emulator, name) for name in values),
        inside,
        unsure,
    )


def _not_found(
    network: Network, emulator: Emulator, content: bytes, faults: Mapping[str, float]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Faults whose recorded figure is within the plan, and those whose figure is not shown to be outside."""
    if not faults:
        return (), ()
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"recording{emulator.endings[0]}"
        path.write_bytes(content)
        recorded = network.bus.recorded(network, path, share=1.0, channel=None, progress=ignored)
    verdicts = {figure.quantity: figure.verdict for figure in recorded.figures}
    found = {name: verdicts.get(fault_named(emulator, name).shown_as) for name in faults}
    inside, unsure = (tuple(name for name in faults if found[name] == word) for word in ("within", "not shown"))
    return inside, unsure


def emulator_of(profile: Profile) -> Emulator:
    """Emulator of a profile's kind of bus; a kind without one raises BusplanError."""
    emulator = bus_of(profile).emulator()
    if emulator is None:
        kinds = listed([name for name in kind_names() if kind_named(name).emulator()], "and")
        raise BusplanError(f"bus.kind {profile.bus.kind} cannot be emulated; only {kinds} are")
    return emulator


def fault_named(emulator: Emulator, name: str) -> Fault:
    """Fault of an emulator by name; an unknown one raises BusplanError."""
    faults = {fault.name: fault for fault in emulator.faults}
    if name not in faults:
        hints = "; ".join(filter(None, (f"there are {', '.join(faults)}", did_you_mean(str(name), faults))))
        raise ArgumentError(f"fault {name}: no such fault of this kind of bus; {hints}")
    return faults[name]


def _value(fault: Fault, value: object, period_us: float, duration_us: float) -> float:
    """Value of a fault: its number in the recording, or its delay [us]."""
    name = f"fault {fault.name}"
    if fault.unit == "1":
        return whole_number(int(fault.default) if value is None else value, name=name)
    late_us = fault.default * period_us if value is None else finite(value, name=name)
    if late_us <= 0:
        raise ArgumentError(f"{name}: {late_us:g}; expected a time above zero")
    if late_us >= duration_us:
        late, whole = _decimal(late_us), _decimal(duration_us)
        raise ArgumentError(f"{name}: {late} us; expected a time below that of the recording, {whole} us")
    return late_us


def _decimal(number: float) -> str:
    """A number with up to six decimals, never in powers of ten."""
    return f"{number:.6f}".rstrip("0").rstrip(".")
