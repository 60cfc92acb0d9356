"""What of a machine turns with the part or carries it, seen from the part: tables, trunnions, pallets; and what goes with the tool.

Of the former only what rotary axes alone lie between: a body that X, Y or Z carry past the part stands elsewhere in every
block, and is held against tool and part in verification/body_clearance.py.
"""

import os
from functools import lru_cache

import numpy as np

from cuspline.kernel import brep
from cuspline.kernel.tessellation import tessellate
from cuspline.replay.clearance import stacked_head
from cuspline.replay.scene import SolidFixture
from cuspline.shop.kinematics import LINEARS
from cuspline.shop.machines import BED, ROTARIES, Box, Cylinder
from cuspline.shop.rotary_way import shortest_way
from cuspline.stock.shapes import BoxShape, CylinderShape
from cuspline.values import fixed_math as fixed

STEP_MM = 0.1           # of the triangles of a body out of a STEP file


def rotary_links(machine):
    """Links that only rotary axes lie between the part and, from the part: letters, and perhaps "bed"."""
    found = []
    for link in machine.chain:
        if link not in ROTARIES and link != BED:
            break
        found.append(link)
        if link == BED:
            break
    return tuple(found)


def bodies_at(machine, rotary_deg, frame, held, links=None):
    """SolidFixture of every such body at rest in an indexed position.

    Args:
        machine: Machine.   rotary_deg: (r,) where its rotaries stand.
        frame: values.frames.Frame of the position.   held: of the clamping's WCS; both seen from the part.
        links: that count; None: `rotary_links`.
    """
    found, links = [], rotary_links(machine) if links is None else links
    for body in machine.bodies:
        if body.link in links:
            vertices, triangles = mesh_of(body)
            turned = from_link(machine, body.link, np.radians(np.tile(rotary_deg, (len(vertices), 1))), vertices)
            wcs = turned - np.array(machine.wcs_origin_mm)
            found.append(SolidFixture(body.name, frame.into(held.out(wcs)), triangles))
    return tuple(found)


def bodies_with_part(machine, frame, held):
    """SolidFixture of every body on the link that carries the part: no axis moves the one past the other.  Arguments as there."""
    return bodies_at(machine, np.zeros(len(machine.rotaries)), frame, held, machine.chain[:1])


def together(meshes):
    """(v, 3) vertices and (t, 3) triangles of several meshes as one."""
    first = np.cumsum([0, *(len(v) for v, _ in meshes)])
    return np.vstack([v for v, _ in meshes]), np.vstack([t + n for (_, t), n in zip(meshes, first)])


def turned_to(machine, held, way):
    """(r,) where the rotaries stand, rad, with the tool along a direction.

    Args:
        machine: Machine with rotaries.   held: Frame of the clamping's WCS, seen from the part.   way: (3,) unit, part coordinates.
    Raises:
        PostError: the machine does not turn there.
    """
    return shortest_way(machine.kinematics, held.turn_into(np.array([way]))).angles[0]


def what_holds(machine, turned_rad, frame, held, fixtures):
    """((v, 3) vertices, (t, 3) triangles), mm, seen from the frame, of fixtures and `bodies_at`; None: there is nothing.

    Args:
        machine, frame, held: as there.   turned_rad: (r,) where its rotaries stand.   fixtures: of design.fixtures.Placed there.
    """
    bodies = bodies_at(machine, np.degrees(turned_rad), frame, held)
    found = [*(f.mesh for f in fixtures), *((b.vertices_mm, b.triangles) for b in bodies)]
    return together(found) if found else None


def round_the_spindle(machine):
    """((z0, r0, z1, r1), ...) cylinders round the spindle's axis that hold all that moves with the tool, mm above the gauge line.

    The spindle head, and every body on the axis next to the tool; a machine that states neither has none.
    """
    rows, along = stacked_head(machine.spindle_head, 0.0), np.array(machine.spindle_direction)
    along = along / fixed.length(along)
    for body in machine.bodies:
        if body.link == machine.chain[-1]:
            vertices = mesh_of(body)[0]
            above = fixed.matmul(vertices, along)
            away = vertices - above[:, None] * along
            wide = float(np.sqrt((away * away).sum(axis=1)).max())
            rows.append((float(above.min()), wide, float(above.max()), wide))
    return tuple(rows)


def beside_the_spindle(machine, turned_rad, held):
    """((v, 3) vertices, (t, 3) triangles), mm, of bodies that go with the tool while rotaries stand still, but for those that
    `round_the_spindle` holds: as a part sees them, from the spindle's gauge point; None: there are none.

    Args:
        machine: Machine.   turned_rad: (r,) where its rotaries stand.   held: Frame of the clamping's WCS, seen from the part.
    """
    carried = machine.chain[machine.chain.index(BED) + 1:]          # from the bed to the tool
    last_linear = max((k for k, link in enumerate(carried) if link not in ROTARIES), default=0)
    turned = lambda link, points: _head_turned(machine, carried[:carried.index(link) + 1], turned_rad, points)
    found = []
    for body in machine.bodies:
        if body.link in carried[last_linear:-1]:
            vertices, triangles = mesh_of(body)
            found.append((turned(body.link, vertices), triangles))
    if not found:
        return None
    vertices, triangles = together(found)
    from_gauge = vertices - turned(carried[-1], np.zeros((1, 3)))
    angles = np.tile(turned_rad, (len(vertices), 1))
    return held.turn_out(from_link(machine, BED, angles, from_gauge, is_direction=True)), triangles


def _head_turned(machine, links, turned_rad, points):
    """(n, 3) points of the last of links, from the bed, at the zero pose, where they are with the rotaries at (r,) angles."""
    chain = machine.kinematics
    for letter in links[::-1]:
        if letter in ROTARIES:
            c = chain.letters.index(letter)
            pivot, angle = chain.pivot_mm[c], np.full(len(points), turned_rad[c - LINEARS])
            points = _turned(points - pivot, chain.direction[c], angle) + pivot
    return points


def mesh_of(body):
    """(v, 3) vertices, machine coordinates at the zero pose, and (t, 3) triangles of a closed mesh."""
    shape = body.shape
    if isinstance(shape, Box):
        return BoxShape(min_mm=shape.low_mm, max_mm=shape.high_mm).mesh
    if isinstance(shape, Cylinder):
        foot, axis = np.array(shape.foot_mm), np.array(shape.axis)
        top = foot + shape.height_mm * axis / fixed.length(axis)
        return CylinderShape(from_mm=foot, to_mm=top, radius_mm=shape.diameter_mm / 2).mesh
    return _mesh_of_step(shape.step, os.stat(shape.step).st_mtime_ns)


@lru_cache(maxsize=16)
def _mesh_of_step(path, changed_ns):
    """The same of a STEP file, read once as long as it is not changed."""
    mesh = tessellate(brep.the_solid(brep.read_step(path), path), STEP_MM)
    return mesh.vertices_mm, mesh.triangles


def from_link(machine, link, angles_rad, points_mm, is_direction=False):
    """(n, 3) points of a link, at the zero pose, or directions, as the part sees them while the rotaries stand at angles (n, r)."""
    return _through(machine, link, angles_rad, points_mm, is_inward=False, is_direction=is_direction)


def into_link(machine, link, angles_rad, points_mm, is_direction=False):
    """The other way round: (n, 3) points, or directions, seen from the part, as the link sees them."""
    return _through(machine, link, angles_rad, points_mm, is_inward=True, is_direction=is_direction)


def _through(machine, link, angles_rad, points_mm, is_inward, is_direction=False):
    chain, points = machine.kinematics, np.array(points_mm, float)
    links, between = chain.links, machine.chain[:machine.chain.index(link)]     # its own axis moves it and the part alike
    columns = [chain.letters.index(letter) for letter in between if letter in ROTARIES or not is_direction]
    for c in columns if is_inward else columns[::-1]:
        pivot = 0.0 if is_direction else links.pivot[c]
        angle = angles_rad[:, c - LINEARS] * (-1.0 if is_inward else 1.0)
        points = _turned(points - pivot, links.direction[c], angle) + pivot
    return points


def _turned(points, u, angle):
    """(n, 3) turned about the unit vector u by angles (n,)."""
    sine, cosine = fixed.sin(angle)[:, None], fixed.cos(angle)[:, None]
    along = (points * u).sum(axis=1)[:, None] * u
    return points * cosine + np.cross(u, points) * sine + along * (1.0 - cosine)
