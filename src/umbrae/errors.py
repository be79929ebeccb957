"""Every error Umbrae raises on purpose.

    UmbraeError                 catch this one to catch them all
    ├── InputError              also a ValueError: an argument or a file that cannot be used
    │   ├── ModelError          a model file: missing, unreadable, malformed, empty
    │   ├── OptionError         an unknown method, option or combination
    │   └── OutputError         a path that cannot be written
    ├── CapacityError           the work would not fit into memory; says how much it would take
    └── GraphicsError           no OpenGL 4.5, or it failed; says what is missing and what works without

Messages are one line. They name what is wrong, where, and what was wanted. The command line prints them on stderr
and exits with status 2.
"""


class UmbraeError(Exception):
    """Base of all errors raised by Umbrae."""


class InputError(UmbraeError, ValueError):
    """An argument that cannot be used."""


class ModelError(InputError):
    """A model file that cannot be read as triangles."""


class OptionError(InputError):
    """An unknown method, option, or combination of options."""


class OutputError(InputError):
    """An output path that cannot be written."""


class CapacityError(UmbraeError):
    """Work that would not fit into memory; the message carries the estimate."""


class GraphicsError(UmbraeError):
    """No OpenGL context, or one that failed: the message names what is missing, and the way out."""


class RecentredWarning(UserWarning):
    """Coordinates far from zero were moved to the scene's own origin; lights, cameras and points must follow."""
