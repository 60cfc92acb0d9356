"""ISO 286 tolerance classes: the limits of a size by its class, H7, g6, js9.

Grades and fundamental deviations are those of ISO 286-1:2010, tables 1 to 5, for nominal sizes up to 500 mm, micrometres; of the
holes K, M, N and P those of shafts with the standard's delta.
"""

import re

UP_TO_MM = (3, 6, 10, 18, 30, 50, 80, 120, 180, 250, 315, 400, 500)
# grade -> its tolerance in each range of sizes: table 1
GRADES_UM = {
    5: (4, 5, 6, 8, 9, 11, 13, 15, 18, 20, 23, 25, 27), 6: (6, 8, 9, 11, 13, 16, 19, 22, 25, 29, 32, 36, 40),
    7: (10, 12, 15, 18, 21, 25, 30, 35, 40, 46, 52, 57, 63), 8: (14, 18, 22, 27, 33, 39, 46, 54, 63, 72, 81, 89, 97),
    9: (25, 30, 36, 43, 52, 62, 74, 87, 100, 115, 130, 140, 155), 10: (40, 48, 58, 70, 84, 100, 120, 140, 160, 185, 210, 230, 250),
    11: (60, 75, 90, 110, 130, 160, 190, 220, 250, 290, 320, 360, 400),
    12: (100, 120, 150, 180, 210, 250, 300, 350, 400, 460, 520, 570, 630),
    13: (140, 180, 220, 270, 330, 390, 460, 540, 630, 720, 810, 890, 970), 4: (3, 4, 4, 5, 6, 7, 8, 10, 12, 14, 16, 18, 20)}
# how far the limit next to the nominal size is from it: shafts d to h below (tables 2 and 4), k to p above (table 5)
BELOW_UM = {"d": (20, 30, 40, 50, 65, 80, 100, 120, 145, 170, 190, 210, 230),
            "e": (14, 20, 25, 32, 40, 50, 60, 72, 85, 100, 110, 125, 135), "f": (6, 10, 13, 16, 20, 25, 30, 36, 43, 50, 56, 62, 68),
            "g": (2, 4, 5, 6, 7, 9, 10, 12, 14, 15, 17, 18, 20), "h": (0,) * 13}
ABOVE_UM = {"k": (0, 1, 1, 1, 2, 2, 2, 3, 3, 4, 4, 4, 5), "m": (2, 4, 6, 7, 8, 9, 11, 13, 15, 17, 20, 21, 23),
            "n": (4, 8, 10, 12, 15, 17, 20, 23, 27, 31, 34, 37, 40), "p": (6, 12, 15, 18, 22, 26, 32, 37, 43, 50, 56, 62, 68)}
TRANSITION = {"K": 8, "M": 8, "N": 8, "P": 7}       # holes: up to this grade the delta of table 3 counts
SHAFT_K = range(4, 8)                               # k of other grades begins at the nominal size
CLASS = re.compile(r"(?P<letter>[d-h]|js|[kmnp]|[D-H]|JS|[KMNP])(?P<grade>\d{1,2})")
MM = 1e-3


def limits_mm(nominal_mm, tolerance_class):
    """(lower, upper) deviation from a nominal size, mm.

    Raises:
        ValueError: a class or a size that the tables here do not have.

    >>> limits_mm(25.0, "H7"), limits_mm(25.0, "g6"), limits_mm(25.0, "K7")
    ((0.0, 0.021), (-0.02, -0.007), (-0.015, 0.006))
    """
    found = CLASS.fullmatch(tolerance_class)
    if not found or int(found["grade"]) not in GRADES_UM:
        raise ValueError(f"tolerance class {tolerance_class!r} is not known: letters d e f g h js k m n p (shafts), D to H, JS, K, "
                         f"M, N, P (holes) and grades {min(GRADES_UM)} to {max(GRADES_UM)}, as in H7; or state "
                         "lower_mm and upper_mm")
    if not 0 < nominal_mm <= UP_TO_MM[-1]:
        raise ValueError(f"classes are known for sizes up to {UP_TO_MM[-1]} mm, not for {nominal_mm:g}: state lower_mm and "
                         "upper_mm")
    k = next(k for k, most in enumerate(UP_TO_MM) if nominal_mm <= most)
    low, high = _limits_um(found["letter"], int(found["grade"]), k, tolerance_class)
    return round(low * MM, 6) + 0.0, round(high * MM, 6) + 0.0


def _limits_um(letter, grade, k, name):
    width, own = GRADES_UM[grade][k], letter.lower()
    if own == "js":
        return -width / 2, width / 2
    if own in BELOW_UM:
        away = BELOW_UM[own][k]
        return (-away - width, -away) if letter == own else (away, away + width)
    if letter == own:
        away = ABOVE_UM[own][k] if own != "k" or grade in SHAFT_K else 0
        return away, away + width
    if grade > TRANSITION[letter] or grade - 1 not in GRADES_UM:
        raise ValueError(f"tolerance class {name!r}: {letter} is known from grade {min(GRADES_UM) + 1} to {TRANSITION[letter]}: "
                         "state lower_mm and upper_mm")
    delta = width - GRADES_UM[grade - 1][k] if k > 0 else 0
    high = -ABOVE_UM[own][k] + delta
    return high - width, high
