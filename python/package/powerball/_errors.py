"""Why something was not done: the commands' words as exceptions."""


class Error(Exception):
    """Any error of this package except wrong arguments, which are ``ValueError``."""


class RefusedError(Error):
    """The input was read, but the data or the arm have no answer (exit code 1 of the commands)."""


class InputError(Error, ValueError):
    """Wrong use, or an input that cannot be read (exit code 2 of the commands)."""
