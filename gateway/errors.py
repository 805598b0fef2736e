"""The errors that a person is told: one line with the place and the mend, exit code 2."""


class PlumblineError(Exception):
    """Something that the user can mend; the text says what, where and how, in one line."""


class InputError(PlumblineError, ValueError):
    """Bad input to a command: a file, an option, a recording."""
