"""What verification discovers: values that add up, each one something to act on."""

from dataclasses import asdict, dataclass

KINDS = ("gouge", "excess", "missing_area", "rapid_through_stock", "holder_contact", "shank_contact",
         "fixture_contact", "travel_exceeded", "no_spindle", "no_length_offset", "unknown_start", "not_ended",
         "program_too_long", "verifiers_disagree")


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One thing wrong with a posted program.

    `kind` is one of KINDS.
    """

    kind: str
    amount_mm: float                                # how much; 0 where a length makes no sense
    place_mm: tuple[float, float, float] | None     # part coordinates
    operation: str                                  # "" where it belongs to none
    line: int                                       # line of the posted text; 0 unknown
    setup: str
    advice: str                                     # one sentence: how to mend it

    def as_dict(self):
        """For verify.json."""
        return asdict(self)
