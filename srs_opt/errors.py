"""The one family of exceptions that users meet.

Every message says what was wrong, where, what was expected and, where it
helps, what to try. Commands turn `InputError` into exit status 2 and
`NoAnswerError` into exit status 1; anything else is a bug.
"""

from __future__ import annotations


class SrsError(Exception):
    """Root of all errors that srs-opt raises on purpose."""


class InputError(SrsError, ValueError):
    """The input is at fault: a file, a key, an option (exit status 2)."""


class NoAnswerError(SrsError, RuntimeError):
    """The question is well posed and has no good answer (exit status 1)."""


class UnsupportedEffectError(InputError, NotImplementedError):
    """A robot file names an effect that the model in use does not contain."""


class OutOfReachError(NoAnswerError):
    """A wanted motion lies outside what the robot's gaits can do."""
