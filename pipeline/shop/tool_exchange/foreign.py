"""A foreign tool on its way in: what was used of it, what was dropped, what was assumed."""

from dataclasses import dataclass, field, replace

from pydantic import ValidationError

from cuspline.shop.cutters import Holder
from cuspline.shop.presets import Preset
from cuspline.values.models import complaints, shortened

LARGEST = 1e9                   # no measure of a tool, in any unit
OWN = "cuspline"                # key of what the format cannot say of a tool; other programs pass over it
OF_A_TOOL = ("cutter", "holder", "stick_out_mm", "head", "chatter", "presets")


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
    presets: tuple[Preset, ...] = ()
    more: dict = field(default_factory=dict)        # fields of cutters.Tool that no foreign format has
    skipped_because: str = ""

    def with_own(self, own):
        """The same with what stands under OWN: fields of a tool, None for one that it has not.

        Raises:
            SkippedTool: it is not understood.
        """
        if own is None:
            return self
        if not isinstance(own, dict) or not set(own) <= set(OF_A_TOOL) or not isinstance(own.get("cutter", {}), dict):
            raise SkippedTool(f"{OWN} is {shortened(own)}, it must hold some of {', '.join(OF_A_TOOL)}")
        rest = {k: v for k, v in own.items() if k not in ("cutter", "presets")}
        cutter = {k: v for k, v in {**self.cutter, **own.get("cutter", {})}.items() if v is not None}
        try:
            holder = Holder.model_validate(rest.pop("holder")) if rest.get("holder") else self.holder
            presets = tuple(map(Preset.model_validate, own["presets"] or ())) if "presets" in own else self.presets
        except (ValidationError, TypeError) as error:
            raise SkippedTool(f"{OWN}: {complaints(error) if isinstance(error, ValidationError) else error}") from None
        stick_out_mm = rest.pop("stick_out_mm", self.stick_out_mm)
        return replace(self, cutter=cutter, holder=holder, presets=presets, stick_out_mm=stick_out_mm, more=rest)


def preset_or_none(**said):
    """A Preset of what is known; None where that is nothing, or what no preset can say."""
    try:
        return Preset(**{k: v for k, v in said.items() if v is not None})
    except ValidationError:
        return None


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
