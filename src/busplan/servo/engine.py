"""Compiled by numba where that helps, plain Python where it does not."""

from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from typing import Any, Literal

from busplan.errors import BusplanError

Engine = Literal["auto", "python", "numba"]


def is_compiled(engine: Engine) -> bool:
    """Whether that engine would run compiled code here.

    Parameters
    ----------
    engine
        "auto" takes numba when it is installed.

    Returns
    -------
    bool
        True for numba.

    Raises
    ------
    BusplanError
        numba is asked for and not installed.

    Examples
    --------
    >>> is_compiled("python")
    False
    """
    installed = find_spec("numba") is not None
    if engine == "numba" and not installed:
        raise BusplanError("engine 'numba': numba is not installed; install busplan[fast] or use 'python'")
    return installed and engine != "python"


@cache
def compiled(function: Callable[..., Any], signature: str) -> Callable[..., Any] | None:
    """Compile a function with numba, once a machine: the machine code is cached on disk.

    Parameters
    ----------
    function
        A module-level function that numba can compile.
    signature
        Its numba signature: compiling for it at once keeps all that can go wrong in this one place.

    Returns
    -------
    callable or None
        The compiled function; None without a numba that works, and where no cache can be read or written:
        compiling anew at each start takes as long as plain Python takes for a whole circle.

    Examples
    --------
    >>> double = compiled(lambda x: 2 * x, "float64(float64)")  # no file to keep a cache for
    >>> double is None
    True
    """
    try:
        import numba  # noqa: PLC0415 - an optional extra that takes a fifth of a second to load
    except Exception:  # noqa: BLE001 - a broken installation fails in many ways, and nothing depends on it
        return None
    try:
        return numba.njit(signature, cache=True)(function)
    except Exception:  # noqa: BLE001 - a damaged cache raises whatever unpickling garbage raises
        return None
