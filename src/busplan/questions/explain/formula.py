"""A computed number as text: its formula in symbols and in numbers, the lines behind it, and its inputs."""

from collections.abc import Iterator, Sequence
from inspect import signature
from typing import Final

from busplan.elementwise import CHOSEN, COMPARISON, FUNCTION, OPERATIONS, Number, Traced, TracedConstant, value_of
from busplan.sourced import DIGITS, SYMBOLS, Equation, Input, Sourced, constants_looked_up, input_of, short

_ATOM: Final = 4
_MOST_TERMS: Final = 24
"""Operands of a sum that is written out."""
_SHOWN_TERMS: Final = 3
"""Operands of a longer sum that are written, from its first."""
_MOST_DIGITS: Final = 17
"""Digits that distinguish any two floats."""
_SUPPORTS: Final = 1e-4
"""Largest relative error of a written difference, caused by the digits that it does not show."""


def against(left: float, sign: str, right: float) -> str:
    """Write a comparison with enough digits to see that it holds.

    Examples
    --------
    >>> against(205.917, "<=", 2000.0), against(205.91746955, ">", 205.91746954)
    ('205.917 <= 2000', '205.91746955 > 205.91746954')
    """
    digits = DIGITS
    while left != right and f"{left:.{digits}g}" == f"{right:.{digits}g}" and digits < _MOST_DIGITS:
        digits += 1
    return f"{left:.{digits}g} {sign} {right:.{digits}g}"


def less(left: float, right: float) -> str:
    """Write a difference with enough digits to reproduce its result.

    Examples
    --------
    >>> less(2000.0, 205.91747), less(320.00001432686, 320.0)
    ('2000 - 205.9175', '320.000014327 - 320')
    """
    digits = DIGITS
    while digits < _MOST_DIGITS:
        seen = float(f"{left:.{digits}g}") - float(f"{right:.{digits}g}")
        if abs(seen - (left - right)) <= _SUPPORTS * abs(left - right):
            break
        digits += 1
    return f"{left:.{digits}g} - {right:.{digits}g}"


def formula_text(operand: Number, *, in_numbers: bool) -> str:
    """Write the expression of a number in terms of named numbers.

    Parameters
    ----------
    operand
        A computed number.
    in_numbers
        If True, write values instead of symbols.

    Examples
    --------
    >>> nodes = Traced(2, given=Input("N", "bus.nodes", 2, "", "given", "profile", "nodes"))
    >>> delay = 0.25 * (nodes + 1)
    >>> formula_text(delay, in_numbers=False), formula_text(delay, in_numbers=True), delay.value
    ('0.25 (N + 1)', '0.25 * (2 + 1)', 0.75)
    """
    # An expression without a name that was chosen stands for the choice.
    while isinstance(operand, Traced) and operand.operation == CHOSEN:
        chosen = operand.parts[0]
        if not isinstance(chosen, Traced) or chosen.symbol:
            break
        operand = chosen
    if isinstance(operand, Traced) and not operand.operation:
        return operand.numbers if in_numbers else operand.formula
    if in_numbers and isinstance(operand, Traced) and all(_is_atom(part) for part in operand.parts):
        values = [value_of(part) for part in operand.parts]
        if operand.operation == "sub":
            return less(*map(float, values))
        if operand.operation in OPERATIONS and OPERATIONS[operand.operation].rank == COMPARISON:
            return against(values[0], OPERATIONS[operand.operation].sign, values[1])
    return _written(operand, in_numbers=in_numbers, top=True)[0]


def _written(operand: Number, *, in_numbers: bool, top: bool = False) -> tuple[str, int]:
    """Text of an operand, and its operator precedence."""
    if not isinstance(operand, Traced):
        symbol = operand.symbol if isinstance(operand, Sourced) and not in_numbers else ""
        return _atom(symbol or short(value_of(operand)))
    if not top and (operand.symbol or not operand.operation):
        return _atom(short(operand.value) if in_numbers or not operand.symbol else operand.symbol)
    if operand.operation == CHOSEN:
        chosen = operand.parts[0]
        if isinstance(chosen, TracedConstant) and not in_numbers:
            return _atom(chosen.constant.symbol or chosen.meaning)
        return _written(chosen, in_numbers=in_numbers)
    terms = _chained(operand)
    if len(terms) > _MOST_TERMS:
        return _shortened(operand.operation, terms, in_numbers=in_numbers)
    return _joined(operand, [_written(part, in_numbers=in_numbers) for part in operand.parts], in_numbers=in_numbers)


def _chained(operand: Traced) -> list[Number]:
    """The operands of a sum, or of the largest or smallest of several; of other operations none."""
    if operand.operation not in ("add", "larger", "smaller"):
        return []
    operands: list[Number] = []
    left: Number = operand
    while isinstance(left, Traced) and left.operation == operand.operation and (left is operand or not left.symbol):
        left, right = left.parts
        operands.append(right)
    return [left, *reversed(operands)]


def _shortened(name: str, terms: Sequence[Number], *, in_numbers: bool) -> tuple[str, int]:
    """The first operands and the last: nobody reads a sum of hundreds."""
    operation = OPERATIONS[name]
    written = [_written(term, in_numbers=in_numbers)[0] for term in (*terms[:_SHOWN_TERMS], terms[-1])]
    written.insert(-1, f"... {len(terms) - len(written)} more ...")
    if operation.rank == FUNCTION:
        return f"{operation.sign}({', '.join(written)})", FUNCTION
    return f" {operation.sign} ".join(written), operation.rank


def _joined(operand: Traced, parts: list[tuple[str, int]], *, in_numbers: bool) -> tuple[str, int]:
    """Text and precedence of an operation, from those of its operands."""
    operation = OPERATIONS[operand.operation]
    if operation.rank == FUNCTION:
        return f"{operation.sign}({', '.join(text for text, _ in parts)})", FUNCTION
    (left, left_rank), (right, right_rank) = parts
    left = f"({left})" if left_rank < operation.rank else left
    # The right operand of -, / and ^ needs brackets at the same precedence, too.
    tighter = operation.rank + (operation.sign in "-/^")
    right = f"({right})" if right_rank < tighter else right
    if operation.sign == "*" and not in_numbers and not right[0].isdigit():
        return f"{left} {right}", operation.rank
    return f"{left} {operation.sign} {right}", operation.rank


def _is_atom(operand: Number) -> bool:
    return not isinstance(operand, Traced) or bool(operand.symbol) or not operand.operation


def _atom(text: str) -> tuple[str, int]:
    rank = 1 if " + " in text or text.startswith("-") else 2 if " " in text else _ATOM
    return text, rank


def formula_of(equation: Equation) -> str:
    """Write an equation in symbols by computing it with traced numbers.

    Examples
    --------
    >>> from busplan.sourced import EQUATIONS
    >>> formula_of(EQUATIONS["acknowledge_phase_us"])
    'hop H + 0.25'
    """
    names = list(signature(equation.function).parameters)
    # Any number but 0 and 1, which truth values equal.
    first, *rest = (Traced(2.0, given=Input(SYMBOLS[name], name, 2.0, "", "given", "", "")) for name in names)
    with constants_looked_up(TracedConstant):
        result = equation.function(first, **dict(zip(names[1:], rest, strict=True)))
    return result.symbol if result is first else formula_text(result, in_numbers=False)


def lines(figure: Traced) -> Iterator[Traced]:
    """Every named number behind a figure, in the order of computation; the figure is last."""
    yield from (number for number in _visit(figure) if not number.given and (number.symbol or number is figure))


def inputs(figure: Traced) -> Iterator[Input]:
    """Inputs of a figure: keys of the profile and constants, each once."""
    leaves: dict[tuple[str, str], Input] = {}
    for number in _visit(figure):
        for leaf in (number.given, *(input_of(part) for part in number.parts if isinstance(part, Sourced))):
            if leaf is not None:
                leaves.setdefault((leaf.name, leaf.symbol), leaf)
    yield from leaves.values()


def _visit(figure: Traced) -> Iterator[Traced]:
    """Every number behind a figure once, its parts before it; a sum of thousands is deeper than Python recurses."""
    seen: set[int] = set()
    waiting = [(figure, False)]
    while waiting:
        number, has_parts_behind = waiting.pop()
        if has_parts_behind:
            yield number
        elif id(number) not in seen:
            seen.add(id(number))
            waiting.append((number, True))
            waiting.extend((part, False) for part in reversed(number.parts) if isinstance(part, Traced))
