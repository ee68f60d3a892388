"""How a command was called: its name, its help, its words as they were typed, and its options with their values."""

import shlex
from contextvars import ContextVar
from typing import Any, NamedTuple

from typer.core import TyperCommand


class Call(NamedTuple):
    """A call of a command."""

    command: str
    purpose: str
    """the first lines of its help"""
    line: str
    """as it is typed"""
    options: dict[str, Any]
    """values by name, defaults included"""


CALL: ContextVar[Call | None] = ContextVar("call", default=None)
"""The call that is at work; None outside the command line."""
WORDS = "tuning.words"


class ToldCommand(TyperCommand):
    """A command that tells, while it is at work, how it was called."""

    def parse_args(self, ctx, args):
        """Keep the words before they are parsed."""
        ctx.meta[WORDS] = list(args)
        return super().parse_args(ctx, args)

    def invoke(self, ctx):
        """Do the work, the call told."""
        name = ctx.info_name or ""
        line = shlex.join(["python", "-m", "tuning", name, *ctx.meta[WORDS]])
        names = {parameter.name: parameter.opts[0] for parameter in self.params}
        options = {names[key]: value for key, value in ctx.params.items() if key in names}
        token = CALL.set(Call(name, " ".join((self.help or "").split("\n\n")[0].split()), line, options))
        try:
            return super().invoke(ctx)
        finally:
            CALL.reset(token)
