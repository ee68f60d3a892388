"""What a command says of itself, for its report. Commands name it, so that it needs nothing that is slow to import."""

from collections.abc import Mapping
from typing import NamedTuple


class About(NamedTuple):
    """What a command says of itself to a reader who was not there."""

    title: str
    did: str
    """what it takes, does and gives, in sentences"""
    captions: Mapping[str, str] = {}
    """what tables and figures show, by a part of the table's title or of the figure's file name; where several are part
    of it, the one that comes first in it counts"""

    def caption(self, name: str) -> str:
        """Of a table or figure; empty if there is none."""
        parts = [part for part in self.captions if part in name]
        return self.captions[min(parts, key=name.index)] if parts else ""
