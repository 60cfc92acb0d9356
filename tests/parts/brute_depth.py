"""How deep a part lies inside a moving cutter, by dense sampling and zooming in: shares nothing with the proof."""

import numpy as np
from exact_parts import BruteDrop
from OCP.BRepAdaptor import BRepAdaptor_Curve

TIMES = 21
SPAN = 0.06             # of the move, looked at round the best sample


def depth_of(points, R, rc):
    """(...,) depth of points (..., 3) as seen from the tip; negative: minus the distance."""
    e, f = np.hypot(points[..., 0], points[..., 1]) - (R - rc), rc - points[..., 2]
    return rc - np.where((e > 0) & (f > 0), np.hypot(e, f), np.maximum(e, f))


class BruteDepth(BruteDrop):
    """A lower bound of the true depth, in all but the nastiest places the depth itself."""

    def deepest(self, a, b, R, rc):
        times = np.linspace(0, 1, TIMES)
        tips = a + times[:, None] * (b - a)
        low, high = np.minimum(a, b) - R - 1, np.maximum(a, b) + R + 1
        best = 0.0
        for face, (u, v, points, step) in zip(self.faces, self.samples):
            near = ((points[:, :2] > low[:2]) & (points[:, :2] < high[:2])).all(axis=1) & (points[:, 2] > low[2] + R)
            if near.any():
                u, v, h = u[near], v[near], depth_of(points[near][:, None] - tips, R, rc)
                for k in self._starts(u, v, h.max(axis=1), step, best, count=4):
                    best = max(best, self._zoom_move(face, u[k], v[k], times[h[k].argmax()], step, a, b, R, rc))
        for edge, points in zip(self.edges, self.lines):
            best = max(best, self._on_edge(edge, depth_of(points[:, None] - tips, R, rc), times, a, b, R, rc))
        return best

    @staticmethod
    def _zoom_move(face, u, v, t, step, a, b, R, rc):
        u0, u1, v0, v1 = face.nurbs.domain
        hu, hv, ht, g, top = 1.6 * step[0], 1.6 * step[1], SPAN, np.linspace(-1, 1, 7), -np.inf
        for _ in range(26):
            uu, vv = (w.ravel() for w in np.meshgrid(np.clip(u + hu * g, u0, u1), np.clip(v + hv * g, v0, v1)))
            inside = face.is_inside(uu, vv)
            if not inside.any():
                break
            uu, vv, tt = uu[inside], vv[inside], np.clip(t + ht * g, 0, 1)
            h = depth_of(face.nurbs.derivatives(uu, vv)[:, :1] - (a + tt[:, None] * (b - a)), R, rc)
            i, j = np.unravel_index(h.argmax(), h.shape)
            top, u, v, t = max(top, h[i, j]), uu[i], vv[i], tt[j]
            hu, hv, ht = 0.62 * hu, 0.62 * hv, 0.62 * ht
        return top

    @staticmethod
    def _on_edge(edge, h, times, a, b, R, rc):
        f = h.max(axis=1)
        best = f.max()
        if best < -0.2:
            return best
        curve = BRepAdaptor_Curve(edge)
        p0, p1 = curve.FirstParameter(), curve.LastParameter()
        peaks = np.flatnonzero((f >= np.r_[-np.inf, f[:-1]]) & (f >= np.r_[f[1:], -np.inf]))
        for k in peaks[np.argsort(-f[peaks])][:3]:
            p, t = p0 + (p1 - p0) * k / (len(f) - 1), times[h[k].argmax()]
            hp, ht = 1.5 * (p1 - p0) / (len(f) - 1), SPAN
            for _ in range(26):
                pp, tt = np.clip(np.linspace(p - hp, p + hp, 9), p0, p1), np.clip(np.linspace(t - ht, t + ht, 9), 0, 1)
                points = np.array([[q.X(), q.Y(), q.Z()] for q in (curve.Value(s) for s in pp.tolist())])
                depths = depth_of(points[:, None] - (a + tt[:, None] * (b - a)), R, rc)
                i, j = np.unravel_index(depths.argmax(), depths.shape)
                best, p, t, hp, ht = max(best, depths[i, j]), pp[i], tt[j], 0.6 * hp, 0.6 * ht
        return best
