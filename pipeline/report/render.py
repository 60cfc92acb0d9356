"""The child process of pictures.py: arrays in, PNG files out, nothing but VTK and numpy.

    python -m cuspline.report.render scene.npz OUT_DIR

Parallel projection, normals of the exact surface, B-rep edges as lines, drawn at twice the size
and averaged down.
"""

import sys
from pathlib import Path

import numpy as np
import vtkmodules.vtkRenderingFreeType  # noqa: F401  registers the fonts
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  registers the renderer
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_UNSIGNED_CHAR, vtkLookupTable, vtkPoints, vtkVersion
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkImageData, vtkPolyData
from vtkmodules.vtkIOImage import vtkPNGWriter
from vtkmodules.vtkRenderingAnnotation import vtkScalarBarActor
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkBillboardTextActor3D,
    vtkLightKit,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkRenderWindow,
    vtkWindowToImageFilter,
)

WIDTH, HEIGHT, SUPERSAMPLING = 1400, 900, 2
COMPRESSION = 6         # of PNG: 9 takes three times as long and saves a twentieth
PART_SHARE = 0.88       # of the width, where a colour bar stands beside the part
ISO, TOP = ((1.0, -1.35, 1.05), (0.0, 0.0, 1.0)), ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0))    # (towards the eye, up)
SIDES = {"iso": ((-1.0, -0.9, 0.5), ISO[1]), "front": ((-1.0, 0.0, 0.0), ISO[1]), "side": ((0.0, -1.0, 0.0), ISO[1]),
         "back": ((1.0, -0.7, 0.4), ISO[1])}
BELOW_EYE, LABEL_SIZE = (-1.0, 1.35, -0.8), 15
STEEL, EDGE = (0.70, 0.75, 0.82), (0.06, 0.08, 0.12)
# deviation colours as in viewer.js: dark beyond the scale, blue gouged, pale at zero, red left
RAMP = ((-1.0, (0.13, 0.40, 0.78)), (0.0, (0.91, 0.93, 0.89)), (1.0, (0.85, 0.16, 0.12)))
BELOW, ABOVE, NOT_JUDGED = (0.07, 0.16, 0.42), (0.40, 0.03, 0.05), (0.62, 0.62, 0.62)


def render_all(scene, out_dir):
    """Writes iso.png, top.png, paths.png and deviation.png."""
    part = surface_actor(scene["vertices"], scene["normals"], scene["triangles"])
    edges = edge_actor(scene["edge_points"], scene["edge_lengths"])
    judged, bar = deviation_actor(scene)
    paths = path_actor(scene)
    shots = {"iso": photograph((part, edges), *ISO), "top": photograph((part, edges), *TOP),
             "paths": photograph((part, edges, paths), *ISO), "deviation": photograph((judged, edges), *ISO, bar)}
    for name, pixels in shots.items():
        write_png(pixels, Path(out_dir) / f"{name}.png")


def render_shape(scene, out_dir):
    """Writes a bare part from SIDES: iso.png, front.png and so on."""
    part = surface_actor(scene["vertices"], scene["normals"], scene["triangles"])
    for name, (towards_eye, up) in SIDES.items():
        write_png(photograph((part,), towards_eye, up), Path(out_dir) / f"{name}.png")


def render_faces(scene, out_dir):
    """Writes faces-above.png and faces-below.png: each face in a colour of its own, with its label."""
    part = surface_actor(scene["vertices"], scene["normals"], scene["triangles"])
    part.GetMapper().GetInput().GetCellData().SetScalars(_colours(scene["face_colours"]))
    part.GetMapper().SetScalarModeToUseCellData()
    part.GetMapper().ScalarVisibilityOn()
    edges = edge_actor(scene["edge_points"], scene["edge_lengths"])
    labels = [label_actor(str(text), place) for text, place in zip(scene["labels"], scene["label_places"])]
    for name, towards_eye in (("above", ISO[0]), ("below", BELOW_EYE)):
        write_png(photograph((part, edges, *labels), towards_eye, ISO[1]), Path(out_dir) / f"faces-{name}.png")


def label_actor(text, place):
    """A word at a place, towards the eye, hidden behind what stands before it."""
    label = vtkBillboardTextActor3D()
    label.SetInput(text)
    label.SetPosition(*map(float, place))
    letters = label.GetTextProperty()
    letters.SetFontSize(LABEL_SIZE * SUPERSAMPLING)
    letters.SetColor(*EDGE)
    letters.SetBackgroundColor(1, 1, 1)
    letters.SetBackgroundOpacity(0.75)
    letters.SetJustificationToCentered()
    letters.SetVerticalJustificationToCentered()
    return label


def surface_actor(vertices, normals, triangles):
    """Shaded triangles with given vertex normals."""
    data = vtkPolyData()
    data.SetPoints(_points(vertices))
    data.SetPolys(_cells([np.full(len(triangles), 3), *np.transpose(triangles)]))
    data.GetPointData().SetNormals(numpy_to_vtk(np.ascontiguousarray(normals, dtype=np.float32), deep=True))
    actor = _actor(data)
    actor.GetProperty().SetColor(*STEEL)
    for put, value in (("SetAmbient", 0.15), ("SetDiffuse", 0.85), ("SetSpecular", 0.2), ("SetSpecularPower", 30)):
        getattr(actor.GetProperty(), put)(value)
    return actor


def deviation_actor(scene):
    """(the part coloured by deviation, its colour bar); a facet with one unjudged corner is grey."""
    scale = float(scene["scale_um"])
    corner = scene["triangles"]
    deviation = scene["deviation_um"][corner]
    # a colour a facet: interpolating "not judged" would paint values that nobody measured
    colours = np.where(np.isnan(deviation).any(axis=1)[:, None], NOT_JUDGED,
                       deviation_colours(np.nan_to_num(deviation).mean(axis=1) / scale))
    actor = surface_actor(scene["vertices"], scene["normals"], corner)
    data = actor.GetMapper().GetInput()
    data.GetCellData().SetScalars(_colours(colours))
    actor.GetMapper().SetScalarModeToUseCellData()
    actor.GetMapper().ScalarVisibilityOn()
    return actor, colour_bar(scale)


def deviation_colours(share):
    """(n, 3) colours for deviations given as shares of the scale."""
    at = [s for s, _ in RAMP]
    inside = np.column_stack([np.interp(share, at, [c[k] for _, c in RAMP]) for k in range(3)])
    return np.where(share[:, None] <= -1, BELOW, np.where(share[:, None] >= 1, ABOVE, inside))


def colour_bar(scale_um):
    """The legend of the deviation colours."""
    table = vtkLookupTable()
    table.SetNumberOfTableValues(256)
    table.SetRange(-scale_um, scale_um)
    for row, colour in enumerate(deviation_colours(np.linspace(-0.999, 0.999, 256))):
        table.SetTableValue(row, *colour, 1.0)
    bar = vtkScalarBarActor()
    bar.SetLookupTable(table)
    bar.SetTitle("deviation µm\ngrey: not\njudged\n ")
    bar.SetNumberOfLabels(7)
    bar.SetLabelFormat("{:+.1f}" if vtkVersion.GetVTKMajorVersion() * 100 + vtkVersion.GetVTKMinorVersion() >= 906
                       else "%+.1f")            # VTK 9.6 went over from printf formats to std::format ones
    bar.SetPosition(0.05, 0.18)
    bar.SetWidth(0.9)
    bar.SetHeight(0.62)
    bar.SetUnconstrainedFontSize(True)
    for text in (bar.GetTitleTextProperty(), bar.GetLabelTextProperty()):
        text.SetColor(*EDGE)
        text.SetFontSize(15 * SUPERSAMPLING)
        text.BoldOff()
        text.ItalicOff()
        text.ShadowOff()
    return bar


def edge_actor(points, lengths):
    """Polylines, unlit."""
    first = np.concatenate([[0], np.cumsum(lengths)[:-1]])
    rows = [np.arange(a, a + n) for a, n in zip(first, lengths)]
    data = vtkPolyData()
    data.SetPoints(_points(points))
    data.SetLines(_ragged_cells(rows))
    return _line_actor(data, 1.6)


def path_actor(scene):
    """Path segments in their own colours."""
    data = vtkPolyData()
    data.SetPoints(_points(scene["path_points"]))
    data.SetLines(_cells([np.full(len(scene["path_links"]), 2), *np.transpose(scene["path_links"])]))
    data.GetCellData().SetScalars(_colours(scene["path_colours"] / 255))
    actor = _line_actor(data, 0.7)
    actor.GetMapper().SetScalarModeToUseCellData()
    actor.GetMapper().ScalarVisibilityOn()
    return actor


def photograph(actors, towards_eye, up, bar=None):
    """(HEIGHT, WIDTH, 3) uint8 picture, first row at the top; a colour bar gets a strip of its own."""
    renderer = vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    lights = vtkLightKit()
    lights.SetKeyToFillRatio(1.6)
    lights.SetKeyToHeadRatio(2.2)
    lights.AddLightsToRenderer(renderer)
    for actor in actors:
        renderer.AddViewProp(actor)
    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)                    # supersampling smooths; MSAA differs between drivers
    window.SetSize(WIDTH * SUPERSAMPLING, HEIGHT * SUPERSAMPLING)
    window.AddRenderer(renderer)
    if bar is not None:
        renderer.SetViewport(0, 0, PART_SHARE, 1)
        strip = vtkRenderer()
        strip.SetViewport(PART_SHARE, 0, 1, 1)
        strip.SetBackground(1, 1, 1)
        strip.AddViewProp(bar)
        window.AddRenderer(strip)
    aim(renderer, np.array(towards_eye), np.array(up), WIDTH * (PART_SHARE if bar is not None else 1.0) / HEIGHT)
    window.Render()
    grab = vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    grab.ShouldRerenderOff()
    grab.Update()
    pixels = vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars())
    pixels = pixels.reshape(HEIGHT, SUPERSAMPLING, WIDTH, SUPERSAMPLING, -1)[..., :3]
    window.Finalize()
    return averaged(pixels)[::-1]


def averaged(pixels):
    """(height, width, 3) uint8 means of pixels (height, s, width, s, 3) uint8, halves to the even neighbour."""
    total, parts = np.zeros(pixels.shape[::2], np.uint16), pixels.shape[1] * pixels.shape[3]
    for j in range(pixels.shape[1]):
        for i in range(pixels.shape[3]):
            total += pixels[:, j, :, i]
    whole, rest = np.divmod(total, np.uint16(parts))
    up = (2 * rest > parts) | ((2 * rest == parts) & (whole % 2 == 1))
    return (whole + up).astype(np.uint8)


def aim(renderer, towards_eye, up, aspect):
    """Parallel projection that holds everything with a small margin."""
    low, high = np.reshape(renderer.ComputeVisiblePropBounds(), (3, 2)).T
    back = towards_eye / _length(towards_eye)
    right = np.cross(up, back) / _length(np.cross(up, back))
    reach = lambda axis: (np.abs(axis) * (high - low)).sum() / 2
    camera = renderer.GetActiveCamera()
    camera.SetFocalPoint(*(low + high) / 2)
    camera.SetPosition(*((low + high) / 2 + back * _length(high - low)))
    camera.SetViewUp(*up)
    camera.ParallelProjectionOn()
    camera.SetParallelScale(1.04 * max(reach(np.cross(back, right)), reach(right) / aspect))
    renderer.ResetCameraClippingRange()


def _length(vector):
    """As fixed_math has it; that would bring the compiler along, which takes as long as a picture."""
    return np.sqrt((vector * vector).sum())


def write_png(pixels, path):
    """Writes (height, width, 3) uint8 as PNG."""
    image = vtkImageData()
    image.SetDimensions(pixels.shape[1], pixels.shape[0], 1)
    image.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(pixels[::-1].reshape(-1, 3)), deep=True,
                                                 array_type=VTK_UNSIGNED_CHAR))
    writer = vtkPNGWriter()
    writer.SetCompressionLevel(COMPRESSION)
    writer.SetFileName(str(path))
    writer.SetInputData(image)
    writer.Write()


def _points(points):
    found = vtkPoints()
    found.SetData(numpy_to_vtk(np.ascontiguousarray(points, dtype=np.float32), deep=True))
    return found


def _cells(columns):
    """Cells of one size: a column of sizes, then one of indices per corner."""
    return _legacy(np.column_stack(columns).ravel())


def _ragged_cells(rows):
    return _legacy(np.concatenate([np.r_[len(row), row] for row in rows]))


def _legacy(numbers):
    cells = vtkCellArray()
    cells.ImportLegacyFormat(numpy_to_vtkIdTypeArray(numbers.astype(np.int64), deep=True))
    return cells


def _colours(colours):
    return numpy_to_vtk(np.round(np.asarray(colours) * 255).astype(np.uint8), deep=True, array_type=VTK_UNSIGNED_CHAR)


def _actor(data):
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(data)
    mapper.ScalarVisibilityOff()
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    actor = vtkActor()
    actor.SetMapper(mapper)
    return actor


def _line_actor(data, width):
    actor = _actor(data)
    actor.GetProperty().SetColor(*EDGE)
    actor.GetProperty().SetLineWidth(width * SUPERSAMPLING)
    actor.GetProperty().LightingOff()
    return actor


if __name__ == "__main__":
    given = dict(np.load(sys.argv[1]))
    draw = render_all if "scale_um" in given else render_faces if "labels" in given else render_shape
    draw(given, sys.argv[2])
