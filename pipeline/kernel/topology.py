"""Parts of a shape, each once, in the kernel's stable order."""

from OCP.TopExp import TopExp
from OCP.TopTools import TopTools_IndexedMapOfShape


def indexed(shape, kind):
    """The kernel's index of a shape's parts of one kind (TopAbs_FACE, ...), numbered from 1."""
    table = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, kind, table)
    return table


def explore(shape, kind):
    """The same as a list."""
    table = indexed(shape, kind)
    return [table.FindKey(k) for k in range(1, table.Extent() + 1)]
