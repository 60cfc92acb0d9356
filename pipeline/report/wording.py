"""Numbers as a machinist reads them; what is missing becomes a dash, never a crash."""

import math
from dataclasses import dataclass

from cuspline.values import amounts
from cuspline.values.units import MM

DASH, GROUP = "–", "\N{NARROW NO-BREAK SPACE}"


def number(value):
    """The value as a finite float, or None where there is no number.

    >>> number("0.5"), number(float("nan")), number(None)
    (0.5, None, None)
    """
    try:
        found = float(value)
    except (TypeError, ValueError):
        return None
    return found if math.isfinite(found) else None


def decimal(value, decimals=3, unit=""):
    """Fixed decimals with a unit.

    >>> decimal(0.00125, 4, "mm"), decimal(None)
    ('0.0013 mm', '–')
    """
    found = number(value)
    if found is None:
        return DASH
    text = f"{found:.{decimals}f}"
    text = text.replace("-", "−") if float(text) else text.lstrip("-")
    return f"{text} {unit}" if unit else text


def grouped(value, unit=""):
    r"""A whole number with thin groups of three.

    >>> print(grouped(1234567.2, "mm²").replace("\N{NARROW NO-BREAK SPACE}", " "))
    1 234 567 mm²
    """
    found = number(value)
    if found is None:
        return DASH
    text = f"{round(found):,}".replace(",", GROUP).replace("-", "−")
    return f"{text} {unit}" if unit else text


def short(value, unit=""):
    """Up to three decimals, trailing zeros left off, for sizes.

    >>> short(120.0), short(0.5, "mm")
    ('120', '0.5 mm')
    """
    found = number(value)
    if found is None:
        return DASH
    text = decimal(found).rstrip("0").rstrip(".")
    return f"{text} {unit}" if unit else text


def short_of_length(value_mm, unit=""):
    """A small length as short as it can be written to a tenth of a micrometre.

    >>> short_of_length(0.0124, "mm"), short_of_length(0.01), short_of_length(0.0030000001)
    ('0.0124 mm', '0.01', '0.003')
    """
    found = number(value_mm)
    if found is None:
        return DASH
    text = decimal(found, 4).rstrip("0").rstrip(".")
    return f"{text} {unit}" if unit else text


def counted(count, noun):
    """A number of things, with thin groups of three.

    >>> counted(1, "move"), counted(12, "move")
    ('1 move', '12 moves')
    """
    return amounts.counted(round(count), noun).replace(",", GROUP)


def duration(seconds):
    """Hours, minutes and seconds.

    >>> duration(3487.2), duration(None)
    ('58 min 07 s', '–')
    """
    found = number(seconds)
    if found is None:
        return DASH
    minutes, second = divmod(round(found), 60)
    hours, minute = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minute:02d} min"
    return f"{minute} min {second:02d} s" if minute else f"{second} s"


def percent(part, whole, decimals=1):
    """Share of the whole; a share just below 100 % is never rounded up to it.

    >>> percent(99.99, 100), percent(1, 0)
    ('99.9 %', '–')
    """
    part, whole = number(part), number(whole)
    if part is None or not whole:
        return DASH
    share = 100 * part / whole
    if part < whole:
        share = min(share, 100 - 10 ** -decimals)
    return f"{share:.{decimals}f} %"


def place(point_mm):
    """A point in words.

    >>> place((1, 2.5, -3))
    'X 1.000  Y 2.500  Z −3.000'
    """
    if point_mm is None or len(point_mm) != 3 or any(number(v) is None for v in point_mm):
        return DASH
    return "  ".join(f"{axis} {decimal(v)}" for axis, v in zip("XYZ", point_mm))


def box_size(box_mm):
    """Length × width × height of a (min, max) box.

    >>> box_size(((0, 0, 0), (120, 80, 40.5)))
    '120 × 80 × 40.5 mm'
    """
    low, high = box_mm
    return " × ".join(short(b - a) for a, b in zip(low, high)) + " mm"


@dataclass(frozen=True)
class Lengths:
    """Lengths, given in mm, as a control's operator reads them: inches have a decimal more.

    >>> Lengths("inch").decimal(12.7), Lengths("mm").decimal(12.7), Lengths("inch").short(25.4), Lengths("inch").decimal(None)
    ('0.5000', '12.700', '1', '–')
    """

    units: str          # "mm" or "inch"

    def decimal(self, value_mm, decimals=3):
        """Fixed decimals."""
        found = number(value_mm)
        return decimal(found, decimals) if self.units == "mm" or found is None else decimal(found / MM[self.units], decimals + 1)

    def short(self, value_mm):
        """Without useless zeros, for sizes."""
        found = number(value_mm)
        return short(found) if self.units == "mm" or found is None else self.decimal(found).rstrip("0").rstrip(".")

    def box_size(self, box_mm):
        """Length × width × height of a (min, max) box."""
        low, high = box_mm
        return " × ".join(self.short(b - a) for a, b in zip(low, high)) + f" {self.units}"


def file_size(count):
    """Bytes for a person.

    >>> file_size(1234567)
    '1.2 MB'
    """
    found = number(count)
    if found is None:
        return DASH
    for unit, size in (("MB", 1e6), ("kB", 1e3)):
        if found >= size:
            return f"{found / size:.1f} {unit}"
    return f"{found:.0f} bytes"


def tool_name(tool):
    """One line for a tool out of plan.json: a dict, a number or a name.

    >>> tool_name({"number": 3, "type": "ball", "diameter_mm": 10})
    'T3 ball ∅10'
    """
    if not isinstance(tool, dict):
        return f"T{tool}" if isinstance(tool, int) else str(tool or DASH)
    words = [f"T{tool['number']}"] if "number" in tool else []
    words += [str(tool["type"]).replace("_", " ")] if "type" in tool else []
    words += [f"∅{short(tool['diameter_mm'])}"] if "diameter_mm" in tool else []
    if tool.get("type") == "bull_nose" and "corner_radius_mm" in tool:
        words.append(f"R{short(tool['corner_radius_mm'])}")
    return " ".join(words) or str(tool.get("name", DASH))
