"""What is done with the models: logs in, parameters and reports out; command line.

`load_controller("result.json")` and `plot_stop` take what `tune-abs` wrote.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tuning.controllers.load import load_controller, load_result, plot_stop

__all__ = ["load_controller", "load_result", "plot_stop"]


def __getattr__(name: str) -> Any:
    # Imported when asked for: the command line starts without them.
    if name in __all__:
        from tuning.controllers import load

        return getattr(load, name)
    raise AttributeError(f"module 'tuning' has no attribute {name!r}")
