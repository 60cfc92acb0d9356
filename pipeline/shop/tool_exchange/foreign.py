"""A foreign tool on its way in: what was used of it, what was dropped, what was assumed."""

from dataclasses import dataclass, field

from cuspline.shop.cutters import Holder
from cuspline.values.models import shortened

LARGEST = 1e9                   # no measure of a tool, in any unit


class SkippedTool(Exception):
    """A tool that has no counterpart here; the message is the reason in the report."""


@dataclass(frozen=True, kw_only=True)
class ForeignTool:
    """One tool of a foreign file, lengths in mm; None where the file does not say."""

    number: int | None
    name: str
    foreign_type: str
    unit: str
    cutter: dict                        # fields of cutters.Cutter, but the name; {} for a tool that is skipped
    holder: Holder | None
    stick_out_mm: float | None
    dropped: tuple[str, ...]
    assumed: tuple[str, ...]
    skipped_because: str = ""
    presets: tuple[dict, ...] = ()      # fields of presets.Preset


@dataclass
class Fields:
    """A nested document that remembers which of its fields were read."""

    document: dict
    used: set = field(default_factory=set)
    assumed: list = field(default_factory=list)

    def get(self, *path):
        """The value at a path, None where there is none."""
        value = self.document
        for key in path:
            value = value.get(key) if isinstance(value, dict) else None
        if value is not None:
            self.used.add(path)
        return value

    def number(self, *path, least=0.0):
        """A number above `least`, None where there is none.

        Raises:
            SkippedTool: the field holds something else.
        """
        value = self.get(*path)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not least < value < LARGEST:
            raise SkippedTool(f"{'.'.join(path)} is {shortened(value)}, it must be a number above {least:g}")
        return float(value)

    def needed(self, *path):
        """A positive number that must be there.

        Raises:
            SkippedTool: it is missing or no positive number.
        """
        value = self.number(*path)
        if value is None:
            raise SkippedTool(f"{'.'.join(path)} is missing")
        return value

    def assume(self, what):
        """Note what the file does not say and what is taken in its place."""
        self.assumed.append(what)

    def dropped(self):
        """Paths of the fields that nothing read; a branch that nothing entered is named once."""
        return tuple(sorted(self._unread(self.document, ())))

    def _unread(self, document, path):
        for key, value in document.items():
            here = (*path, key)
            if here in self.used:
                continue
            if isinstance(value, dict) and any(u[:len(here)] == here for u in self.used):
                yield from self._unread(value, here)
            else:
                yield ".".join(here)
