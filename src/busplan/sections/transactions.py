"""The two transactions that a host has with each node in a cycle."""

from typing import Final, Literal

TransactionKind = Literal["read", "write"]
TRANSACTION_KINDS: Final[tuple[TransactionKind, ...]] = ("read", "write")
