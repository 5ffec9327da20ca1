"""Errors that a user can mend; the command line prints them as one line and exits with code 2."""

from __future__ import annotations


class InputError(Exception):
    """Bad input: one clear line that names the file, the key, the value and what was expected.

    Only `problem` is compulsory; parts that do not exist are left out of the line:
    ``FILE: KEY: PROBLEM: VALUE; expected EXPECTED (HINT)``.
    """

    def __init__(
        self,
        problem: str,
        *,
        file: object = None,
        key: str | None = None,
        value: object = None,
        expected: str | None = None,
        hint: str | None = None,
    ) -> None:
        self.problem, self.file, self.key = problem, file, key
        self.value, self.expected, self.hint = value, expected, hint
        where = ": ".join(str(part) for part in (file, key) if part is not None)
        line = f"{where}: {problem}" if where else problem
        if value is not None:
            line += f": {value!r}"
        if expected is not None:
            line += f"; expected {expected}"
        if hint is not None:
            line += f" ({hint})"
        super().__init__(" ".join(line.split()))


class RecordingError(InputError):
    """A recording could not be written on, for example because the disk is full; what was written stays readable.

    path: the file that holds what was saved; messages: how many messages it holds.
    """

    def __init__(self, problem: str, *, path: object, messages: int, hint: str | None = None) -> None:
        super().__init__(problem, file=path, hint=hint)
        self.path, self.messages = path, messages
