"""Predicates for faces that somebody points at: what single faces are, in the words of FacePredicate.

A selection is made on a shape in code; what is planned and judged is the STEP file.  So it is kept as what the faces
are: each gets the shortest predicate that matches it and no other face of the part.
"""

import numpy as np

from cuspline.design.design import FacePredicate
from cuspline.kernel import brep
from cuspline.values.amounts import counted
from cuspline.values.errors import DesignError

AROUND_MM = 0.05            # of a face's middle and its box: what STEP and rounding may move it
AREA_SHARE = 0.01           # that its area may be off
SAME_MM = 1e-3              # middles that are the same
DECIMALS = 3


def predicates_of(solid, chosen):
    """FacePredicate values of {name: selection}.

    Args:
        solid: the part, of CadQuery, build123d or the kernel.
        chosen: {name: a FacePredicate, or faces of that part: a Face, a list of them, a build123d ShapeList, a CadQuery
            Workplane}.
    Raises:
        DesignError: a selection without faces, or with one that the part has not.
    """
    faces, found = brep.faces_of(brep.the_solid(solid)), []
    for name, selection in chosen.items():
        if isinstance(selection, FacePredicate):
            found.append(selection.model_copy(update={"name": name}))
            continue
        rows = sorted({_row_of(faces, shape, name) for shape in _shapes_of(selection)})
        if not rows:
            raise DesignError(f"faces {name!r}: the selection holds no face: look at its selector")
        found += [predicate_for(faces, k, name) for k in rows]
    return tuple(found)


def predicate_for(faces, row, name):
    """The shortest FacePredicate that matches one of a part's faces alone.

    Args:
        faces: all brep.Face values of the part.   row: which of them.   name: what it is to be called.
    Raises:
        DesignError: another face is the same in all that a predicate can say.
    """
    for conditions in _conditions(faces[row]):
        predicate = FacePredicate(name=name, count=1, **conditions)
        if [k for k, f in enumerate(faces) if brep.matches(f, predicate)] == [row]:
            return predicate
    raise DesignError(f"face {row + 1} of {len(faces)} cannot be told from another one by kind, normal, place and area: name or "
                      "colour it (`cuspline.kernel.brep.marked`), or choose both with one predicate")


def _conditions(face):
    """What may be said of a face, shortest first."""
    normal, place = (np.round(v[0], DECIMALS) + 0.0 for v in (face.middle.normal, face.middle.point_mm))
    kind = {"kinds": (face.kind,)}
    toward = {"normal": tuple(normal.tolist())} if np.isfinite(normal).all() and normal.any() else {}
    box = {"center_min_mm": tuple((place - AROUND_MM).round(DECIMALS).tolist()),
           "center_max_mm": tuple((place + AROUND_MM).round(DECIMALS).tolist())}
    area = {"area_min_mm2": round(face.area_mm2 * (1.0 - AREA_SHARE), DECIMALS),
            "area_max_mm2": round(face.area_mm2 * (1.0 + AREA_SHARE), DECIMALS)}
    if face.mark.name:
        yield {"face_name": face.mark.name}
    if face.mark.color is not None:
        yield {"color": face.mark.color}
    yield kind
    yield {**kind, **toward}
    yield {**kind, **box}
    yield {**kind, **toward, **box}
    yield {**kind, **toward, **box, **area}


def _shapes_of(selection):
    """The faces in a selection, one by one."""
    inside = selection.vals() if hasattr(selection, "vals") else selection
    for item in inside if isinstance(inside, (list, tuple)) else [inside]:
        yield from brep.explore(brep.wrapped(item), brep.TopAbs_FACE)


def _row_of(faces, shape, name):
    """Which of the part's faces a shape is: the same, or one that lies where it lies."""
    for k, face in enumerate(faces):
        if face.shape.IsSame(shape):
            return k
    alike = brep.Face(brep.TopoDS.Face_s(shape))
    place, area = alike.middle.point_mm[0], alike.area_mm2
    near = [k for k, f in enumerate(faces) if np.abs(f.middle.point_mm[0] - place).max() < SAME_MM
            and abs(f.area_mm2 - area) < AREA_SHARE * area]
    if len(near) != 1:
        raise DesignError(f"faces {name!r}: a selected face at {place.round(3).tolist()} is no face of the part "
                          f"({len(near)} of its {counted(len(faces), 'face')} lie there): select on the finished shape")
    return near[0]


def in_python(predicate):
    """A FacePredicate as it is pasted into a design."""
    said = _said(predicate)
    return f"FacePredicate({', '.join(f'{k}={v!r}' for k, v in said.items())})"


def in_toml(predicate):
    """A FacePredicate as it is pasted into a job file."""
    said = _said(predicate)
    quoted = lambda v: f'"{v}"' if isinstance(v, str) else (
        f"[{', '.join(map(quoted, v))}]" if isinstance(v, tuple) else repr(v))
    return "[[faces]]\n" + "\n".join(f"{k} = {quoted(v)}" for k, v in said.items())


def _said(predicate):
    """{condition: value} that it was made with."""
    return {k: getattr(predicate, k) for k in type(predicate).model_fields if k in predicate.model_fields_set}
