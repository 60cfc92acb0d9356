"""What a command came to, as its last lines tell it; apart from the stages, which take seconds to load."""

from dataclasses import dataclass
from pathlib import Path

from cuspline.values.errors import InputError
from cuspline.values.finding_kinds import KINDS
from cuspline.values.models import no_such, shortened


@dataclass(frozen=True, kw_only=True)
class Result:
    """What came of a build or of a verdict on its files."""

    folder: Path
    is_ok: bool
    findings: tuple
    left_out: str = ""          # what could not be made here, in words; "" nothing
    told: str = ""              # what the build came to, where it is not the stage that was asked for
    figures: str = ""           # gouge, cusp, bound in words; "" where nothing was verified
    accepted: tuple = ()        # findings that were accepted by name


def refuse_unknown_kinds(accept):
    """
    Raises:
        InputError: a kind that no finding has.
    """
    for kind in sorted(set(accept) - set(KINDS)):
        raise InputError(f"--accept {shortened(kind)}: {no_such(kind, KINDS)}; `cuspline findings` says what each means")
