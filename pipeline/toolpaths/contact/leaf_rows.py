"""What is known of a leaf of a part's tree, a box of one patch or of one edge: columns, and what a search leaves behind."""

from typing import NamedTuple

import numpy as np

MIDDLE_S, HALF_S, MIDDLE_T, HALF_T = range(4)                       # columns of a leaf's row: its box, local parameters
REACH_S, REACH_T, REACH_SS, REACH_ST, REACH_TT, REACH_SSS, REACH_SST, REACH_STT, REACH_TTT = range(4, 13)   # of derivatives
NORMAL_CHANGE, NORMALS, TOP_NZ, REACH_Z = 13, 14, 22, 23            # NORMALS: eight columns of `patch_bounds.cone_box`
PATCH, KIND, STATE, SHAPE = range(4)                                # of its tag
AT_S, AT_T, CERTAINTY = range(3)                                    # of what a climb leaves: where, and how sure


class PartArrays(NamedTuple):
    """Faces and edges of a part as kernels take them, see `drop.exact_drop.ExactPart`."""

    coefficients: np.ndarray
    patch: np.ndarray
    span: np.ndarray
    kind: np.ndarray
    sign: np.ndarray
    rows: np.ndarray
    tags: np.ndarray
    nodes: np.ndarray
    first: np.ndarray
    trims: tuple
