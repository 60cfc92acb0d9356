"""What `cuspline faces` tells of a part: each face by what it is, a predicate for it alone, pictures with their numbers."""

from pathlib import Path

import numpy as np

from cuspline.app import catalogue
from cuspline.app.report_inputs import shape_of
from cuspline.design.face_selection import in_python, in_toml, predicate_for
from cuspline.kernel import brep
from cuspline.report.pictures import render_faces
from cuspline.surfaces.holes import cone_angle_deg, holes_of
from cuspline.surfaces.prismatic_features import features_of
from cuspline.values.errors import DesignError, InputError

STEP_FILES = (".step", ".stp")
DECIMALS = 4


def solid_of(part, assignments):
    """The solid of a STEP file, or of a design by name, Python file or job file with ["name=value", ...].

    Raises:
        InputError, DesignError: there is none such; says why.
    """
    path = Path(part)
    if path.suffix.lower() in STEP_FILES:
        brep.refuse_unreadable(path)
        return brep.the_solid(brep.read_step(path), path.name)
    design = catalogue.make_design(catalogue.find_design(part), assignments)
    return brep.the_solid(design.solid, f"design {design.name}")


def face_rows(solid):
    """One dict a face, in the part's own order, numbered from 1; walls of holes tell of their hole, faces of pockets, steps,
    bosses and chamfers of theirs."""
    faces = brep.faces_of(solid)
    holes = {k: hole for hole in holes_of(faces) for k in (*hole.faces, *hole.floor)}
    features = _feature_rows(faces)
    return [_row(faces, k, holes.get(k), features.get(k)) for k in range(len(faces))]


def _feature_rows(faces):
    """{index of a face: what is told of its feature}, numbered kind by kind; a wall of two belongs to the first."""
    rows, counts = {}, {}
    for feature in features_of(faces):
        counts[feature.kind] = number = counts.get(feature.kind, 0) + 1
        name = f"{feature.kind} {number}"
        for k in feature.faces:
            rows.setdefault(k, {"name": name, "kind": feature.kind, "is_floor": k == feature.faces[0],
                                "size_mm": round(feature.size_mm, DECIMALS),
                                "axis": (np.round(feature.axis, DECIMALS) + 0.0).tolist()})
    return rows


def _hole_row(hole, k):
    """What is told of a hole at one of its faces; None for no hole."""
    if hole is None:
        return None
    wall = next((w for w in hole.walls if k in w.faces), None)
    listed = lambda v: (np.round(v, DECIMALS) + 0.0).tolist()
    return {"kind": hole.kind, "depth_mm": round(hole.depth_mm, DECIMALS), "mouth_mm": listed(hole.mouth_mm),
            "axis": listed(hole.axis),
            "diameter_mm": None if wall is None or wall.kind != "cylinder" else round(2 * wall.low_radius_mm, DECIMALS),
            "angle_deg": None if wall is None or wall.kind != "cone" else round(cone_angle_deg(wall), DECIMALS)}


def _name_of(hole, feature, k):
    """Faces of one name make one selection: all walls of the same diameter, all faces of one feature."""
    if hole and hole["diameter_mm"]:
        return f"holes {hole['diameter_mm']:g} mm"
    return feature["name"] if feature else f"face {k + 1}"


def _row(faces, k, hole, feature):
    face, hole = faces[k], _hole_row(hole, k)
    listed = lambda v: (np.round(v[0], DECIMALS) + 0.0).tolist() if np.isfinite(v).all() else None
    try:
        predicate = predicate_for(faces, k, _name_of(hole, feature, k))
        python, toml = in_python(predicate), in_toml(predicate)
    except DesignError as error:
        python = toml = f"# {error}"
    return {"number": k + 1, "kind": face.kind, "area_mm2": round(face.area_mm2, DECIMALS), "normal": listed(face.middle.normal),
            "middle_mm": listed(face.middle.point_mm), "name": face.mark.name,
            "color": None if face.mark.color is None else list(face.mark.color), "hole": hole, "feature": feature,
            "python": python, "toml": toml}


def draw_faces(solid, folder):
    """Pictures into a folder; what came of them, in words.

    Raises:
        InputError: the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        failure = render_faces(shape_of(solid), folder)
    except OSError as error:
        raise InputError(f"--pictures {folder}: cannot be written ({error.strerror}); name another folder") from None
    return failure or f"{folder / 'faces-above.png'} and {folder / 'faces-below.png'} written"
