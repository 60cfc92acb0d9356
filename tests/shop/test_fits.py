"""ISO 286 classes against figures of the standard's own tables 6 to 32 (ISO 286-2), and what is refused."""

import pytest

from cuspline.shop.fits import ABOVE_UM, BELOW_UM, GRADES_UM, UP_TO_MM, limits_mm


@pytest.mark.parametrize("size, name, low, high", [
    (25, "H7", 0, 21), (25, "g6", -20, -7), (25, "K7", -15, 6), (25, "N7", -28, -7), (25, "P7", -35, -14), (25, "M7", -21, 0),
    (50, "k6", 2, 18), (8, "js9", -18, 18), (100, "f7", -71, -36), (2, "N7", -14, -4), (40, "p6", 26, 42), (8, "JS7", -7.5, 7.5),
    (30, "H8", 0, 33), (30.001, "H8", 0, 39), (3, "h6", -6, 0), (3.001, "h6", -8, 0), (6, "E9", 20, 50)])
def test_limits_are_those_of_the_standard(size, name, low, high):
    assert [round(1000 * v, 3) for v in limits_mm(size, name)] == [low, high]


def test_every_row_has_every_range_and_grows_with_the_size():
    for row in (*GRADES_UM.values(), *BELOW_UM.values(), *ABOVE_UM.values()):
        assert len(row) == len(UP_TO_MM) and list(row) == sorted(row)


def test_a_grade_is_wider_by_about_the_standard_ratio():
    """From IT6 on each fifth grade is ten times as wide: ISO 286-1, clause 4.1.2, to the rounding of its table."""
    for k in range(len(UP_TO_MM)):
        assert 0.9 < GRADES_UM[11][k] / GRADES_UM[6][k] / 10 < 1.1


@pytest.mark.parametrize("size, name", [(25, "H"), (25, "X7"), (25, "H3"), (501, "H7"), (25, "K9"), (25, "P8"), (0.0, "H7")])
def test_what_is_not_in_the_tables_is_refused(size, name):
    with pytest.raises(ValueError, match="known"):
        limits_mm(size, name)
