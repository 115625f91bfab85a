"""The one error whose text is meant for a person."""


class InputError(ValueError):
    """What the user gave cannot be used.

    The message is one sentence that says what is wrong, where, and what to do. The command
    line prints it and exits with 2; anything else that escapes is a bug and keeps its traceback.
    """


def readable(typed: str) -> str:
    """Text from the command line as UTF-8 can hold it, whatever bytes and locale it came in."""
    return typed.encode(errors="surrogateescape").decode(errors="replace")
