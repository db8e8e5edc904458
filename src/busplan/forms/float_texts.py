"""Floats as text, a whole array at once: the characters of `repr`, which read back to the same float.

Python writes one float in about half a microsecond. A table of a million rows has ten million of them, so here the
shortest digits are found with whole numbers, for all floats of an array together. What is left (very large and very
small numbers, powers of two, what is no number) goes through `repr` itself.

References
----------
Steele and White, How to print floating-point numbers accurately, 1990: the shortest digits in the rounding interval.
"""

from math import isnan
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Texts = NDArray[np.bytes_]
"""Text in UTF-8; zero bytes, at any place, are padding: `unpadded` leaves them out."""

_DIGITS: Final = 17
"""As many significant digits tell any two floats apart."""
_FEW: Final = 100
"""Up to this many floats, `repr` is faster."""
_LEAST, _MOST = 0.01, 1e8
"""Numbers between these are written here."""
_FRACTION_BITS: Final = 52
_EXPONENT_OF_ONE: Final = 1023
_SMALLEST_POWER: Final = -2
_TENS: Final = np.array([float(f"1e{power}") for power in range(_SMALLEST_POWER, 10)])
"""Powers of ten, from that of `_LEAST`; those that are no floats are rounded up, so that comparing is exact."""
_POWERS_OF_TEN: Final = 10 ** np.arange(19, dtype=np.int64)
_FLOATS_OF_TEN: Final = _POWERS_OF_TEN.astype(float)
_POWERS_OF_FIVE: Final = 5 ** np.arange(19, dtype=np.int64)
_FOUR: Final = 10_000
_HALF: Final = 5


def _words(texts: list[str]) -> NDArray[np.uint32]:
    return np.array([text.encode() for text in texts], dtype="S4").view(np.uint32)


_FULL: Final = [f"{number:04d}" for number in range(_FOUR)]
_BEFORE: Final = _words([text.lstrip("0").rjust(4, "\0") for text in _FULL] + _FULL)
"""Four digits of a whole part: the first, without leading zeros, and behind others."""
_UNITS: Final = np.concatenate((_words(["\0\0\0000"]), _BEFORE[1:]))
"""The last four, where a single zero stays."""
_BEHIND: Final = _words([text.rstrip("0") for text in _FULL] + _FULL)
"""Four digits of a fraction: the last, without trailing zeros, and before others."""
_TENTHS: Final = np.concatenate((_words(["0"]), _BEHIND[1:]))
"""The first four, where a single zero stays."""
_FRACTION: Final = tuple(f"fraction_{place}" for place in range(4))
"""Fields of a fraction's first sixteen digits."""
_LAYOUT: Final = np.dtype(
    [("sign", "S1"), ("thousands", "u4"), ("units", "u4"), ("point", "S1")]
    + [(name, "u4") for name in _FRACTION]
    + [("last", "u4")]
)


def float_texts(values: NDArray[np.float64], *, missing: bytes = b"nan") -> Texts:
    """Write floats as `repr` does.

    Parameters
    ----------
    values
        Floats, shape (n,).
    missing
        What stands for NaN.

    Returns
    -------
    Texts
        Shape (n,).

    Examples
    --------
    >>> [unpadded(one) for one in float_texts(np.array([0.1 + 0.2, -1250.0, 1e-9, np.nan]), missing=b"")]
    [b'0.30000000000000004', b'-1250.0', b'1e-09', b'']
    """
    if values.size <= _FEW:
        return np.array(_one_by_one(values.tolist(), missing))
    size = np.abs(values)
    bits = size.view(np.int64)
    # A power of two has neighbours at unlike distances.
    usual = (size >= _LEAST) & (size < _MOST) & (bits & ((1 << _FRACTION_BITS) - 1) != 0)
    if usual.all():
        return _written(values, size)
    texts = np.zeros(values.shape, dtype=f"S{_LAYOUT.itemsize}")
    texts[usual] = _written(values[usual], size[usual])
    # By their bits, for 0.0 equals -0.0.
    others, places = np.unique(values[~usual].view(np.int64), return_inverse=True)
    found = np.array(_one_by_one(others.view(float).tolist(), missing), dtype=texts.dtype)
    texts[~usual] = found[places]
    return texts


def _one_by_one(values: list[float], missing: bytes) -> list[bytes]:
    return [missing if isnan(one) else repr(one).encode() for one in values]


def unpadded(texts: bytes) -> bytes:
    """Leave out padding."""
    return texts.translate(None, b"\0")


def _written(values: NDArray[np.float64], size: NDArray[np.float64]) -> Texts:
    """Write floats whose absolute values are usual."""
    digits, power = _shortest(size)
    whole = size.astype(np.int64)
    fraction = (digits - whole * _POWERS_OF_TEN[power]) * _POWERS_OF_TEN[18 - power]
    texts = np.zeros(size.shape, dtype=_LAYOUT)
    texts["sign"][values < 0] = b"-"
    texts["point"] = b"."
    thousands = whole // _FOUR
    texts["thousands"] = _BEFORE[thousands]
    texts["units"] = _UNITS[whole - thousands * _FOUR + _FOUR * (thousands > 0)]
    table, scale = _TENTHS, 10**14
    for name in _FRACTION:
        four = fraction // scale
        fraction = fraction - four * scale
        texts[name] = table[four + _FOUR * (fraction > 0)]
        table, scale = _BEHIND, scale // _FOUR
    texts["last"] = _BEHIND[fraction * 100]
    found: Texts = texts.view(f"S{_LAYOUT.itemsize}")
    return found


def _shortest(size: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Shortest digits that read back to a float, of these the closest: as a whole number, and its power of ten.

    A float is m / 2^s, and with p decimals it has 17 digits: m 5^p / 2^q, q = s - p. What reads back to it is at most
    5^p / 2^(q + 1) away; at exactly that distance, only to an even m.
    """
    bits = size.view(np.int64)
    exponent = (bits >> _FRACTION_BITS) - _EXPONENT_OF_ONE
    mantissa = (bits & ((1 << _FRACTION_BITS) - 1)) | (1 << _FRACTION_BITS)
    # log10(2) is about 77/256; the next power of ten may be below as well.
    place = (exponent * 77 >> 8) - _SMALLEST_POWER
    place += size >= _TENS[place + 1]
    power = _DIGITS - 1 - _SMALLEST_POWER - place
    five, shift = _POWERS_OF_FIVE[power], _FRACTION_BITS - exponent - power
    # The product's low 64 bits are exact, and a float has the others: together they are the product.
    low = mantissa.view(np.uint64) * five.view(np.uint64)
    digits = (size * _FLOATS_OF_TEN[power]).astype(np.int64)
    digits += ((low >> shift.view(np.uint64)).view(np.int64) - digits).astype(np.int16)
    rest = low.view(np.int64) & ((np.int64(1) << shift) - 1)
    nearest = five - (mantissa & 1)
    below, above = nearest - 2 * rest >> shift + 1, nearest + 2 * rest >> shift + 1
    return _rounded(digits, rest, below, above, half=np.int64(1) << shift - 1), power


def _rounded(digits: Any, rest: Any, below: Any, above: Any, *, half: Any) -> Any:
    """Round to 15 digits if that is not too far, else to 16, else to 17; halves to even digits."""
    hundreds = digits // 100
    off = digits - hundreds * 100
    tens = off // 10
    one = off - tens * 10
    up = (one > _HALF) | (one == _HALF) & ((rest > 0) | (tens & 1 == 1))
    sixteen = digits - one + 10 * up
    seventeen = digits + ((rest > half) | (rest == half) & (digits & 1 == 1))
    found = np.where(np.where(up, 10 - one <= above, one <= below), sixteen, seventeen)
    found = np.where(100 - off <= above, digits - off + 100, found)
    return np.where(off <= below, digits - off, found)
