"""Version of the installed project, for the results it writes."""

from importlib.metadata import PackageNotFoundError, version

try:
    VERSION = version("absjax")
except PackageNotFoundError:
    VERSION = "not installed"
