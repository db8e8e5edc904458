"""Libraries that come with an extra: whether they are there is asked before any work."""

from importlib import import_module
from importlib.util import find_spec

from busplan.errors import BusplanError


def require_extra(library: str, *, extra: str, option: str, module: str) -> None:
    """Refuse to start without a library.

    Parameters
    ----------
    library
        Name of the library.
    extra
        The extra of busplan that it comes with.
    option
        Option that asks for it, for messages.
    module
        Module of the library that is needed.

    Raises
    ------
    BusplanError
        The extra is not installed, or does not load.
    """
    if find_spec(library) is None:
        raise BusplanError(f"{option} needs {library}: install it with the extra, as in pip install 'busplan[{extra}]'")
    try:
        import_module(module)
    except Exception as error:  # noqa: BLE001 - a broken installation fails in many ways
        raise BusplanError(
            f"{option} needs {library}, and the installed one does not load ({type(error).__name__}: {error}); "
            f"install it again, as in pip install --force-reinstall {library}"
        ) from None


def require_resvg(option: str) -> None:
    """Refuse to start if no PNG can be made; as `require_extra`."""
    require_extra("resvg_py", extra="plot", option=option, module="resvg_py")


def require_pyarrow(option: str) -> None:
    """Refuse to start if no Parquet file can be written; as `require_extra`."""
    require_extra("pyarrow", extra="table", option=option, module="pyarrow.parquet")
