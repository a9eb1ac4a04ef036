"""The one exception that means "the user can mend this"."""


class InputError(ValueError):
    """Input that cannot be used: what it is, the value, what is allowed, the mend, in one line.

    The command line prints it as it stands and exits with status 2; nothing is written before it is raised.
    """
