"""CAN networks from their sections, and what the public functions say of them."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import tomli_w

import busplan

WORST = "worst-stuffing"


def loaded(data: dict[str, Any], **changes: Any) -> busplan.Profile:
    """The profile of some sections, with other values by dotted key, __ for the dot."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "network.toml"
        path.write_text(tomli_w.dumps(data), encoding="utf-8")
        return busplan.load_profile(path, changes={key.replace("__", "."): value for key, value in changes.items()})


def text_of(profile: busplan.Profile) -> str:
    """A profile as TOML."""
    return tomli_w.dumps(profile.model_dump(exclude_unset=True, exclude_none=True))


def figures(profile: Any, model: str = WORST) -> Any:
    """Capacity under a timing model."""
    (result,) = busplan.capacity(profile, timing_model=[model]).figures
    return result


def terms(profile: Any, model: str = WORST) -> dict[str, float]:
    """Terms of the cycle by name [us]."""
    return {term.name: term.us for term in figures(profile, model).terms}


def phases(profile: Any) -> dict[str, Any]:
    """Figures of each latency by its label, in the worst case."""
    answers = busplan.latency(profile, timing_model=[WORST]).transactions
    return {f"{answer.group} {answer.transaction}".strip(): answer.phases for answer in answers}


def responses(profile: Any) -> dict[str, float | None]:
    """Worst-case response of each latency by its label [us]."""
    return {label: each["worst_response_us"] for label, each in phases(profile).items()}


def last_frames(profile: Any) -> list[tuple[str, int, int]]:
    """Label, identifier and data of the last frame of SYNC, of each group's PDOs and of each message."""
    return [
        (label, each["identifier"], each["data_bytes"]) for label, each in phases(profile).items() if label != "loop"
    ]
