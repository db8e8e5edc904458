"""Old names of parameters: they work for one more release, with a warning."""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar
from warnings import warn

Parameters = ParamSpec("Parameters")
Returned = TypeVar("Returned")


def renamed(**new_names: str) -> Callable[[Callable[Parameters, Returned]], Callable[Parameters, Returned]]:
    """Make a function take parameters by their old names, too.

    Parameters
    ----------
    new_names
        New name by old name.

    Examples
    --------
    >>> from warnings import catch_warnings, simplefilter
    >>> @renamed(periods_us="period_us")
    ... def twice(*, period_us):
    ...     return 2 * period_us
    >>> with catch_warnings():
    ...     simplefilter("ignore", DeprecationWarning)
    ...     twice(periods_us=500)
    1000
    """

    def taking(function: Callable[Parameters, Returned]) -> Callable[Parameters, Returned]:
        @wraps(function)
        def call(*arguments: Parameters.args, **named: Parameters.kwargs) -> Returned:
            for old, new in new_names.items():
                if old in named:
                    if new in named:
                        raise TypeError(f"{function.__name__}() got {new} twice, once by its old name {old}")
                    warn(
                        f"{old} of busplan.{function.__name__} is now called {new}; the old name goes with the next "
                        "release",
                        DeprecationWarning,
                        stacklevel=2,
                    )
                    named[new] = named.pop(old)
            return function(*arguments, **named)

        return call

    return taking
