"""What the report's path is coloured by."""

import numpy as np
from known_programs import feed, program, rapid

from cuspline.app.report_inputs import met_on_moves


def test_a_move_takes_the_most_of_its_own_places_else_those_of_the_nearest_of_its_operation():
    rng = np.random.default_rng(3)
    moves = [rapid(k, 0, 0) if k % 7 == 0 else feed(k, 0, 0) for k in range(60)]
    operation = np.repeat([0, 1, 2], 20)
    posted = program((0, 0, 5), moves, operation=operation, operations=("a", "b", "c"))
    rows = rng.choice([k for k in range(40) if k % 7], 25)          # nothing of the last operation is looked at
    depth = rng.uniform(0, 3, 25)
    found = met_on_moves(posted, {"row": rows, "depth_mm": depth})["depth_mm"]
    for k in range(60):
        mine = [j for j in rows if operation[j] == operation[k]]
        if k % 7 == 0 or not mine:
            assert np.isnan(found[k])
            continue
        away = min(abs(j - k) for j in mine)
        assert found[k] in [depth[rows == j].max() for j in mine if abs(j - k) == away]
    assert met_on_moves(posted, {}) == {}
