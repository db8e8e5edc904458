"""TOML text: of a value, and of a whole profile for a file that is not there yet."""

import json
import math
from collections.abc import Sequence

from busplan.printable import printable
from busplan.sections.profile import Profile


def value_text(value: object) -> str:
    r"""Write a value as TOML, in one line that commands no terminal.

    Raises
    ------
    TypeError
        No boolean, number, text or sequence of them.
    ValueError
        A number that is not finite.

    Examples
    --------
    >>> print(value_text([4, 2.5, "two\nlines"]))
    [4, 2.5, "two\nlines"]
    """
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        return str(int(value))
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{value} is not finite")
        return repr(float(value))
    if isinstance(value, str):
        # JSON's escapes are TOML's, but for what is not printable.
        return printable(json.dumps(value, ensure_ascii=False), write=lambda one: f"\\U{ord(one):08x}")
    if isinstance(value, Sequence):
        return f"[{', '.join(map(value_text, value))}]"
    raise TypeError(f"{value!r} is no value of a profile")


def profile_text(profile: Profile) -> str:
    """Write a profile: what it says, and nothing that it leaves to its default.

    Parameters
    ----------
    profile
        Any profile.

    Returns
    -------
    str
        TOML that reads to the same profile. Comments are not part of a profile: to keep those of a file, edit it.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> profile_text(load("paper-4ms").profile).splitlines()[0]
    'schema_version = 1'
    """
    import tomli_w  # noqa: PLC0415 - only who writes a whole profile pays for it

    # TOML has no null: a key that is None is a key that is left out.
    data = profile.model_dump(exclude_unset=True, exclude_none=True)
    return tomli_w.dumps(data, multiline_strings=True)
