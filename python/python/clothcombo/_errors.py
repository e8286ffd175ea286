"""What can go wrong."""


class Error(ValueError):
    """An input that cannot be used; the text is that of the programs: place, what is wrong, hint."""


class FileError(Error, OSError):
    """A file that cannot be read or written."""
