"""The one family of errors that a caller of the engine has to know.

Every error says what is wrong, where, and how to mend it, in one line: the command prints it as it is.
"""

from __future__ import annotations


class OasisError(Exception):
    """Base of all errors that a user can mend; ``str(error)`` is one finished line."""

    def __init__(self, what: str, hint: str = "") -> None:
        self.what = what.rstrip(".")
        self.hint = hint.rstrip(".")
        super().__init__(f"{self.what}: {self.hint}" if self.hint else self.what)


class InputError(OasisError):
    """The given archive, result or option is wrong (exit code 2 of the command)."""


class SceneMismatchError(InputError):
    """The two sessions never look at the same place."""


class ResultError(InputError):
    """A result folder is missing, incomplete, or of another schema version."""


class StorageError(OasisError):
    """Writing failed (disk full, no permission); nothing half-written is left behind."""
