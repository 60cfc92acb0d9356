"""STEP files, and the colours and names of faces that travel with a solid into them and out of them.

A face's own colour stands before its body's.  Colours are sRGB, 0 to 1.
"""

import errno
import os
import re
import signal
import time
import warnings
from dataclasses import dataclass
from pathlib import Path

from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.IFSelect import IFSelect_RetDone
from OCP.Interface import Interface_Static
from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor
from OCP.ShapeFix import ShapeFix_Solid
from OCP.STEPCAFControl import STEPCAFControl_Reader, STEPCAFControl_Writer
from OCP.STEPConstruct import STEPConstruct
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.StepShape import StepShape_AdvancedFace
from OCP.TCollection import TCollection_ExtendedString, TCollection_HAsciiString
from OCP.TDF import TDF_LabelSequence
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Compound, TopoDS_Solid
from OCP.TopTools import TopTools_IndexedMapOfShape
from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool

from cuspline.kernel.topology import explore, indexed
from cuspline.values.amounts import counted
from cuspline.values.errors import InputError
from cuspline.values.input_files import refuse_irregular

LARGEST_STEP_BYTES = 1 << 30
READ_S, READ_BYTES_PER_S = 30.0, 1e5        # a busy machine reads some megabytes a second
CHILD_POLL_S = 0.005
STEP_END = "END-ISO-10303-21;"
STEP_DATE = "2000-01-01T00:00:00"     # same inputs, same bytes: STEP files carry no clock
SRGB = Quantity_TypeOfColor.Quantity_TOC_sRGB
COLOR_KINDS = (XCAFDoc_ColorType.XCAFDoc_ColorSurf, XCAFDoc_ColorType.XCAFDoc_ColorGen)


@dataclass(frozen=True)
class FaceMark:
    """What a STEP file or a design says of one face beside its shape."""

    name: str = ""
    color: tuple[float, float, float] | None = None     # sRGB, 0 to 1


class MarkedSolid(TopoDS_Solid):
    """A solid that remembers its faces' marks, in the order of `brep.explore`."""

    def __init__(self, solid, marks):
        super().__init__()
        self.TShape(solid.TShape())
        self.Location(solid.Location())
        self.Orientation(solid.Orientation())
        self.face_marks = tuple(marks)


@dataclass(frozen=True, eq=False)
class MarkedShape:
    """A shape out of a file with its faces' marks."""

    wrapped: object         # TopoDS_Shape
    face_marks: tuple       # FaceMark of each face, in the order of `brep.explore`


def marks_of(shape, faces):
    """FaceMarks of some faces, as the shape that holds them has them; None: it has none.

    Args:
        shape: MarkedSolid, MarkedShape, or anything else.
        faces: TopoDS_Faces of it.
    """
    marks = getattr(shape, "face_marks", None)
    if marks is None:
        return None
    table = face_map(getattr(shape, "wrapped", shape))
    return tuple(marks[table.FindIndex(f) - 1] for f in faces)


def face_map(shape):
    """The kernel's index of a shape's faces, in the order of `brep.explore`, from 1."""
    return indexed(shape, TopAbs_FACE)


def write_step(solid, path, name):
    """STEP (AP214, millimetres) with fixed header and product name: same solid, same bytes."""
    path = Path(path)
    Interface_Static.SetCVal_s("write.step.schema", "AP214IS")
    Interface_Static.SetCVal_s("write.step.unit", "MM")
    Interface_Static.SetCVal_s("write.step.product.name", name)
    scratch = path.with_suffix(".step.part")
    if any(mark != FaceMark() for mark in getattr(solid, "face_marks", ())):
        is_written = _write_marked(solid, scratch)
    else:
        writer = STEPControl_Writer()
        writer.Transfer(solid, STEPControl_AsIs)
        is_written = writer.Write(str(scratch)) == IFSelect_RetDone
    text = scratch.read_text(encoding="latin-1") if scratch.exists() else ""
    if not is_written or not text.rstrip().endswith(STEP_END):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))      # the kernel does not tell why
    text = re.sub(r"FILE_NAME\(.*?\);", f"FILE_NAME('{name}','{STEP_DATE}',(''),(''),'cuspline','cuspline','');",
                  text, count=1, flags=re.S)
    text = re.sub(r"PRODUCT\('[^']*',\s*'[^']*'", f"PRODUCT('{name}','{name}'", text)
    scratch.write_text(text, encoding="latin-1")
    scratch.replace(path)


def refuse_unreadable(path):
    """Read a STEP file of somebody else's in a child process first: the kernel may crash or loop on one that is damaged.

    Raises:
        InputError: the child did not come back, or the file is missing, empty or too large.
    """
    path = Path(path)
    refuse_irregular(path, "STEP file")
    try:
        size = path.stat().st_size if path.is_file() else None
    except (OSError, ValueError):
        size = None
    if size is None:
        raise InputError(f"STEP file {path} does not exist")
    if size > LARGEST_STEP_BYTES:
        raise InputError(f"STEP file {path} is larger than {LARGEST_STEP_BYTES >> 20} MiB: split the assembly")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)     # threads of the kernels sleep while the child begins
        child = os.fork()
    if child == 0:
        _try_to_read(path)
    if not _came_back(child, READ_S + size / READ_BYTES_PER_S):
        raise InputError(f"STEP file {path} is damaged: the CAD kernel breaks down on it; export it anew")


def _try_to_read(path):
    """In the child: read, check, measure; ends the process."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        shape, _ = _read_marked(path)
        if shape is not None and not shape.IsNull():
            BRepCheck_Analyzer(shape).IsValid()
            BRepBndLib.AddOptimal_s(shape, Bnd_Box(), False, False)
    except BaseException:       # the parent meets it again, and tells it
        pass
    finally:
        os._exit(0)


def _came_back(child, seconds):
    """Whether a child ended by itself and in time."""
    until = time.monotonic() + seconds
    try:
        while time.monotonic() < until:
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                return os.WIFEXITED(status)
            time.sleep(CHILD_POLL_S)
    except BaseException:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        raise
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return False


def read_step(path):
    """The shape in a STEP file, with colours and names of its faces where it has such.

    Raises:
        InputError: missing, unreadable, or without a solid.
    """
    path = Path(path)
    refuse_irregular(path, "STEP file")
    if not path.is_file():
        raise InputError(f"STEP file {path} does not exist")
    shape, marks = _read_marked(path)
    if shape is None or shape.IsNull():
        raise InputError(f"{path} is not a readable STEP file")
    if not TopExp_Explorer(shape, TopAbs_SOLID).More():
        filled = _filled(shape)
        marks = marks_of(MarkedShape(shape, marks), explore(filled, TopAbs_FACE))
        shape = filled
    if not TopExp_Explorer(shape, TopAbs_SOLID).More():
        faces = face_map(shape).Extent()
        raise InputError(f"{path} holds no solid, its surfaces ({counted(faces, 'face')}) enclose none: sew them to a closed "
                         "solid in the CAD program, and export that")
    return MarkedShape(shape, marks) if any(mark != FaceMark() for mark in marks) else shape


def _filled(shape):
    """The solids that a shape's closed shells enclose, as a compound: some programs write a solid's shell without the solid."""
    made = TopoDS_Compound()
    BRep_Builder().MakeCompound(made)
    for shell in map(TopoDS.Shell_s, explore(shape, TopAbs_SHELL)):
        if BRep_Tool.IsClosed_s(shell):
            BRep_Builder().Add(made, ShapeFix_Solid().SolidFromShell(shell))
    return made if made.NbChildren() else shape


def _read_marked(path):
    """(TopoDS_Shape, FaceMarks of its faces) of a STEP file; (None, ()) where it cannot be read."""
    reader, document = STEPCAFControl_Reader(), _document()
    reader.SetColorMode(True)
    if reader.ReadFile(str(path)) != IFSelect_RetDone or not reader.Transfer(document):
        return None, ()
    inner = reader.ChangeReader()
    shape = inner.OneShape()
    table = face_map(shape)
    faces = [table.FindKey(k) for k in range(1, table.Extent() + 1)]
    names, colors = _names(inner.WS(), faces), _colors(document, faces)
    return shape, tuple(FaceMark(name=n, color=c) for n, c in zip(names, colors))


def _write_marked(solid, path):
    """Write a MarkedSolid; whether it went well."""
    document, writer = _document(), STEPCAFControl_Writer()
    shapes, colors = (tool(document.Main()) for tool in (
        XCAFDoc_DocumentTool.ShapeTool_s, XCAFDoc_DocumentTool.ColorTool_s))
    body = shapes.NewShape()
    shapes.SetShape(body, solid)
    table = face_map(solid)
    for k, mark in enumerate(solid.face_marks, 1):
        if mark.color is not None:
            label = shapes.AddSubShape(body, table.FindKey(k))
            colors.SetColor(label, Quantity_Color(*mark.color, SRGB), COLOR_KINDS[0])
    writer.SetColorMode(True)
    writer.SetNameMode(False)
    if not writer.Transfer(document, STEPControl_AsIs):
        return False
    found = writer.ChangeWriter().WS().TransferWriter().FinderProcess()
    for k, mark in enumerate(solid.face_marks, 1):
        if mark.name:
            entity = STEPConstruct.FindEntity_s(found, table.FindKey(k), TopLoc_Location())
            entity.SetName(TCollection_HAsciiString(mark.name))
    return writer.Write(str(path)) == IFSelect_RetDone


def _document():
    return TDocStd_Document(TCollection_ExtendedString("XmlOcaf"))


def _names(session, faces):
    """Name of each face's entity; asking for an entity is slow, so only where some face has a name."""
    model, transfer = session.Model(), session.TransferReader()
    entities = (model.Value(k) for k in range(1, model.NbEntities() + 1))
    if not any(isinstance(e, StepShape_AdvancedFace) and _text(e) for e in entities):
        return [""] * len(faces)
    return [_text(transfer.EntityFromShapeResult(f, 1)) for f in faces]


def _text(entity):
    """An entity's name; exporters write NONE where there is none."""
    name = entity.Name() if hasattr(entity, "Name") else None
    text = "" if name is None else name.ToCString()
    return "" if text == "NONE" else text


def _colors(document, faces):
    """Colour of each face, its own or its body's, or None."""
    shapes, colors = (tool(document.Main()) for tool in (
        XCAFDoc_DocumentTool.ShapeTool_s, XCAFDoc_DocumentTool.ColorTool_s))
    table = TopTools_IndexedMapOfShape()
    for face in faces:
        table.Add(_unplaced(face))
    own, bodies = {}, {}
    for label in _labels(shapes.GetShapes):
        color = _color(colors, label)
        inside = face_map(shapes.GetShape_s(label))
        if color is not None:
            bodies |= {table.FindIndex(_unplaced(inside.FindKey(k))): color for k in range(1, inside.Extent() + 1)}
        for sub in _labels(lambda row: shapes.GetSubShapes_s(label, row)):
            color, inside = _color(colors, sub), face_map(shapes.GetShape_s(sub))
            if color is not None:
                kept = own if inside.Extent() == 1 else bodies
                kept |= {table.FindIndex(_unplaced(inside.FindKey(k))): color for k in range(1, inside.Extent() + 1)}
    rows = [table.FindIndex(_unplaced(f)) for f in faces]
    return [own.get(k, bodies.get(k)) for k in rows]


def _unplaced(face):
    """The face where its body was drawn: an assembly moves bodies, colours stay with them."""
    return face.Located(TopLoc_Location())


def _labels(fill):
    row = TDF_LabelSequence()
    fill(row)
    return [row.Value(k) for k in range(1, row.Length() + 1)]


def _color(colors, label):
    for kind in COLOR_KINDS:
        found = Quantity_Color()
        if colors.GetColor_s(label, kind, found):
            return tuple(round(v, 6) for v in found.Values(SRGB))
    return None
