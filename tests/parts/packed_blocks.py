"""What the report packs for its viewer, taken apart as the viewer does."""

import numpy as np


class Reader:
    """The viewer's BlockReader in Python."""

    def __init__(self, raw):
        self.raw, self.offset = raw, 0

    def take(self, dtype, count):
        found = np.frombuffer(self.raw, dtype, count, self.offset)
        self.offset += -(-found.nbytes // 4) * 4
        return found

    def take_delta(self, dtype, count):
        return np.cumsum(self.take(dtype, count), dtype=dtype)
