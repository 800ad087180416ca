"""Ten families of random parts, as a designer would build them: profiles, holes, bosses, pockets, fillets, bevels."""

import math

import numpy as np
from numpy.random import Generator
from OCP.TopoDS import TopoDS_Edge, TopoDS_Shape

from cad.boundary import dihedral, edge_curve, edges_and_faces
from cad.solids import (
    BuildError,
    arc,
    box,
    chamfer,
    common,
    cone,
    cut,
    cylinder,
    extrude,
    fillet,
    frustum,
    fuse,
    line,
    outline,
    polygon,
    revolve,
    spline,
    turn,
)

# Every part is about one unit long; a hole or a step is at least .08 of that, some ten pixels in the pictures.


def flat(points, z: float = 0.0) -> np.ndarray:
    """Points of the plane (n, 2) at the height z, (n, 3)."""
    points = np.asarray(points, float)
    return np.column_stack([points, np.full(len(points), z)])


def upright(points, y: float = 0.0) -> np.ndarray:
    """Points (n, 2) of the plane of x and z, (n, 3)."""
    points = np.asarray(points, float)
    return np.column_stack([points[:, 0], np.full(len(points), y), points[:, 1]])


def regular(count: int, radius: float, start: float = 0.0) -> np.ndarray:
    """Corners (count, 2) of a regular polygon."""
    angles = start + 2 * math.pi * np.arange(count) / count
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def straight_convex_edges(solid: TopoDS_Shape, shortest: float) -> list[TopoDS_Edge]:
    """Straight edges at least that long between faces at 60 to 120 degrees that stick out."""
    chosen = []
    for edge, faces in edges_and_faces(solid):
        curve = edge_curve(edge)
        if len(faces) == 2 and curve.type == "line" and curve.length >= shortest:
            angle = dihedral(edge, faces).mean()
            if 60 <= angle <= 120:
                chosen.append(edge)
    return chosen


def blended(rng: Generator, solid: TopoDS_Shape, count: int) -> TopoDS_Shape:
    """The solid with `count` of its straight edges rolled off or bevelled, one after the other."""
    for _ in range(count):
        edges = straight_convex_edges(solid, 0.2)
        if not edges:
            raise BuildError("no edge is left to blend")
        edge = edges[rng.integers(len(edges))]
        solid = (fillet if rng.random() < 0.6 else chamfer)(solid, [edge], rng.uniform(0.06, 0.12))
    return solid


def stepped(rng: Generator) -> TopoDS_Shape:
    """L, T, U and stair profiles, extruded; some with a hole, a notch or a bevel."""
    w, h, a, b = rng.uniform(0.7, 1), rng.uniform(0.5, 0.9), rng.uniform(0.15, 0.3), rng.uniform(0.15, 0.25)
    depth, third = rng.uniform(0.3, 0.8), w / 3
    profile = [
        [(0, 0), (w, 0), (w, a), (b, a), (b, h), (0, h)],
        [(0, 0), (w, 0), (w, h), (w - b, h), (w - b, a), (b, a), (b, h * 0.8), (0, h * 0.8)],
        [(0, 0), (w, 0), (w, a), (w / 2 + b, a), (w / 2 + b, h), (w / 2 - b, h), (w / 2 - b, a), (0, a)],
        [(0, 0), (w, 0), (w, a), (2 * third, a), (2 * third, 2 * a), (third, 2 * a), (third, 3 * a), (0, 3 * a)],
    ][rng.integers(4)]
    solid = extrude(polygon(upright(profile)), (0, depth, 0))
    if rng.random() < 0.6:
        solid = cut(solid, cylinder((b / 2 + 0.02, depth / 2, -1), rng.uniform(0.05, 0.35 * b + 0.02), 3))
    if rng.random() < 0.5:
        solid = cut(solid, box((w - rng.uniform(0.1, 0.14), -0.1, -0.1), (1, rng.uniform(0.2, 0.25), 3)))
    return blended(rng, solid, rng.integers(0, 3))


def rounded_plate(rng: Generator) -> TopoDS_Shape:
    """Plates of polygons with rounded corners, round holes, and a boss with a blind hole."""
    count, thick = int(rng.integers(3, 7)), rng.uniform(0.12, 0.3)
    corners = regular(count, 0.5, rng.uniform(0, 6)) * rng.uniform(0.85, 1.15, (count, 1))
    solid = extrude(polygon(flat(corners), rng.uniform(0.06, 0.12, count)), (0, 0, thick))
    for corner in corners[rng.permutation(count)[: rng.integers(1, 4)]]:
        x, y = corner * 0.58
        solid = cut(solid, cylinder((x, y, -0.1), rng.uniform(0.045, 0.08), 1))
    if rng.random() < 0.6:
        radius, height = rng.uniform(0.12, 0.17), rng.uniform(0.1, 0.3)
        solid = fuse(solid, cylinder((0, 0, thick / 2), radius, thick / 2 + height))
        if rng.random() < 0.7:
            deep = rng.uniform(0.08, 0.16)
            solid = cut(solid, cylinder((0, 0, thick + height - deep), radius - 0.06, 1))
    return solid


def shaft(rng: Generator) -> TopoDS_Shape:
    """Stacked cylinders and cones with a flat, a keyway, a cross hole or an oblique end."""
    count = int(rng.integers(3, 6))
    heights = rng.uniform(0.15, 0.35, count)
    radii = [rng.uniform(0.12, 0.3)]
    while len(radii) < count:
        radius = rng.uniform(0.1, 0.3)
        if abs(radius - radii[-1]) > 0.05:
            radii.append(radius)
    profile, z = [(0.0, 0.0)], 0.0
    for i in range(count):
        top = radii[i] * rng.uniform(0.6, 0.85) if rng.random() < 0.3 else radii[i]
        profile += [(radii[i], z), (top, z + heights[i])]
        z += heights[i]
    solid = revolve(polygon(upright([*profile, (0.0, z)])))
    middle = z - heights[-1] / 2
    kind = rng.integers(3)
    if kind == 0:
        solid = cut(solid, box((radii[-1] * 0.45, -1, z - heights[-1] * 0.7), (1, 2, 2)))
    if kind == 1:
        solid = cut(solid, cylinder((0, -1, middle), min(0.07, 0.4 * radii[-1]), 2, (0, 1, 0)))
    if kind == 2:
        wide = radii[0] * rng.uniform(0.4, 0.6)
        solid = cut(solid, box((radii[0] * 0.5, -wide / 2, -1), (1, wide, 1 + heights[0] * rng.uniform(0.5, 0.8))))
    if kind != 2 and rng.random() < 0.7:
        # A slanting cut right through the lowest cylinder leaves an ellipse.
        middle, slope = heights[0] * 0.45, 0.35 * heights[0] / radii[0]
        slant = polygon(upright([(-1, -3), (1, -3), (1, middle + slope), (-1, middle - slope)], -1))
        solid = cut(solid, extrude(slant, (0, 2, 0)))
    return solid


def pyramid(rng: Generator) -> TopoDS_Shape:
    """Frustums of pyramids, one on the other or with a plinth, drilled or with a cone on top."""
    count, height = int(rng.integers(3, 7)), rng.uniform(0.3, 0.7)
    base, start = rng.uniform(0.4, 0.5), rng.uniform(0, 6)
    taper, shift = rng.uniform(0.45, 0.75), rng.uniform(-0.1, 0.1, 2)
    lower = regular(count, base, start)
    solid = frustum(flat(lower), flat(lower * taper + shift, height))
    room = base * taper * math.cos(math.pi / count)
    if rng.random() < 0.6:
        plinth = lower * rng.uniform(1.15, 1.3)
        solid = fuse(solid, extrude(polygon(flat(plinth, -rng.uniform(0.1, 0.2))), (0, 0, rng.uniform(0.1, 0.2))))
    if rng.random() < 0.5:
        solid = cut(solid, cylinder((*shift, -1), rng.uniform(0.4, 0.7) * room, 3))
    else:
        radius = rng.uniform(0.5, 0.8) * room
        solid = fuse(solid, cone((*shift, height - 0.05), (radius, radius * 0.5), rng.uniform(0.2, 0.35)))
    return solid


def spline_profile(rng: Generator) -> TopoDS_Shape:
    """Extruded outlines with one or two spline sides, or of one closed spline with holes."""
    depth = rng.uniform(0.25, 0.6)
    if rng.random() < 0.35:
        radii = rng.uniform(0.32, 0.5, 7)
        loop = spline(flat(regular(7, 1.0) * radii[:, None]), closed=True)
        solid = extrude(outline([loop]), (0, 0, depth))
        for angle in (0.0, 2.1, 4.2)[: rng.integers(2, 4)]:
            x, y = 0.19 * math.cos(angle), 0.19 * math.sin(angle)
            solid = cut(solid, cylinder((x, y, -1), rng.uniform(0.05, 0.09), 3))
        return cut(solid, box((-1, -1, depth - 0.1), (rng.uniform(0.8, 1), 2, 1)))
    w, h = rng.uniform(0.8, 1), rng.uniform(0.35, 0.6)
    xs = np.linspace(w, 0, 5)
    top = spline(upright(np.column_stack([xs, h + rng.uniform(-0.12, 0.12, 5)])))
    ends = [edge_curve(top).points[0], edge_curve(top).points[-1]]
    low = upright([(0, 0), (w, 0)])
    bottom = line(*low)
    if rng.random() < 0.4:
        bottom = spline(upright(np.column_stack([xs[::-1], [0, *rng.uniform(-0.08, 0.08, 3), 0]])))
    solid = extrude(outline([bottom, line(low[1], ends[0]), top, line(ends[1], low[0])]), (0, depth, 0))
    if rng.random() < 0.7:
        solid = cut(solid, cylinder((w * rng.uniform(0.35, 0.65), -1, h * 0.45), rng.uniform(0.06, 0.1), 3, (0, 1, 0)))
    if rng.random() < 0.4:
        solid = cut(solid, box((w * 0.75, -0.1, -1), (1, depth * 0.5, 3)))
    return solid


def pocketed(rng: Generator) -> TopoDS_Shape:
    """Blocks with rounded pockets, some with a rolled floor, and rounded or bevelled outer edges."""
    w, d, h = rng.uniform(0.8, 1), rng.uniform(0.5, 0.8), rng.uniform(0.2, 0.45)
    solid = box((0, 0, 0), (w, d, h))
    wall, deep, radius = rng.uniform(0.08, 0.14), h * rng.uniform(0.3, 0.6), rng.uniform(0.06, 0.1)
    split = w * rng.uniform(0.45, 0.6)
    spans = [(wall, split - wall / 2), (split + wall / 2, w - wall)] if rng.random() < 0.4 else [(wall, w - wall)]
    for x0, x1 in spans:
        corners = flat([(x0, wall), (x1, wall), (x1, d - wall), (x0, d - wall)], h - deep)
        tool = extrude(polygon(corners, radius), (0, 0, 1))
        if rng.random() < 0.5:
            floor = [edge for edge, _ in edges_and_faces(tool) if np.ptp(edge_curve(edge).points[:, 2]) < 1e-9]
            floor = [edge for edge in floor if edge_curve(edge).points[0, 2] < h]
            tool = fillet(tool, floor, rng.uniform(0.5, 0.8) * radius)
        solid = cut(solid, tool)
    verticals = [
        edge
        for edge in straight_convex_edges(solid, h * 0.9)
        if np.ptp(edge_curve(edge).points[:, :2], axis=0).max() < 1e-9
    ]
    if rng.random() < 0.6 and verticals:
        solid = (fillet if rng.random() < 0.6 else chamfer)(solid, verticals, rng.uniform(0.05, 0.08))
    return solid


def flange(rng: Generator) -> TopoDS_Shape:
    """Discs with a ring of holes, a hub and a bore."""
    thick, count = rng.uniform(0.1, 0.2), int(rng.integers(3, 7))
    hub, tall, bore = rng.uniform(0.17, 0.24), rng.uniform(0.15, 0.45), rng.uniform(0.07, 0.11)
    solid = cylinder((0, 0, 0), 0.5, thick)
    top = hub * rng.uniform(0.75, 0.9) if rng.random() < 0.4 else hub
    neck = cone((0, 0, thick), (hub, top), tall) if top < hub else cylinder((0, 0, thick), hub, tall)
    solid = fuse(solid, neck)
    if rng.random() < 0.4:
        ring = [edge for edge, _ in edges_and_faces(solid) if _is_ring(edge, hub, thick)]
        solid = fillet(solid, ring, rng.uniform(0.04, 0.07))
    solid = cut(solid, cylinder((0, 0, -1), bore, 3))
    hole = rng.uniform(0.04, 0.06)
    for x, y in regular(count, 0.375, rng.uniform(0, 6)):
        solid = cut(solid, cylinder((x, y, -1), hole, 3))
    if rng.random() < 0.4:
        solid = cut(solid, box((0.5 - rng.uniform(0.03, 0.05), -1, -1), (1, 2, 3)))
    return solid


def _is_ring(edge: TopoDS_Edge, radius: float, height: float) -> bool:
    curve = edge_curve(edge)
    return curve.type == "circle" and abs(curve.radius - radius) < 1e-6 and abs(curve.points[0, 2] - height) < 1e-6


def bracket(rng: Generator) -> TopoDS_Shape:
    """Angle brackets with a rolled inner corner, rounded ends, holes, and a rib."""
    w, h, d, t = rng.uniform(0.7, 1), rng.uniform(0.5, 0.9), rng.uniform(0.4, 0.7), rng.uniform(0.1, 0.16)
    radius = rng.uniform(0.08, 0.15) if rng.random() < 0.6 else 0.0
    solid = extrude(
        polygon(upright([(0, 0), (w, 0), (w, t), (t, t), (t, h), (0, h)]), [0, 0, 0, radius, 0, 0]), (0, d, 0)
    )
    ends = [
        edge
        for edge in straight_convex_edges(solid, t * 0.9)
        if edge_curve(edge).length < t * 1.1 and edge_curve(edge).points[0, 0] + edge_curve(edge).points[0, 2] > t * 1.5
    ]
    if rng.random() < 0.6:
        solid = fillet(solid, ends, rng.uniform(0.08, 0.15))
    else:
        solid = chamfer(solid, ends[:2], rng.uniform(0.08, 0.12))
    if rng.random() < 0.5:
        rib = [(t / 2, t / 2), (w * 0.6, t / 2), (w * 0.6, t), (t, h * 0.6), (t / 2, h * 0.6)]
        solid = fuse(solid, extrude(polygon(upright(rib, d * 0.4)), (0, d * 0.2, 0)))
    else:
        solid = cut(solid, cylinder((-1, d / 2, (h + t) / 2), rng.uniform(0.06, 0.1), 3, (1, 0, 0)))
    y = d * rng.uniform(0.4, 0.6)
    return cut(solid, cylinder((w * 0.8, y, -1), rng.uniform(0.045, 0.07), 3))


def turned(rng: Generator) -> TopoDS_Shape:
    """Turned parts with a spline or arc for a side, cut open by a sector or a slot."""
    h, hollow = rng.uniform(0.6, 1), rng.uniform(0.1, 0.16)
    sides = rng.uniform(0.25, 0.5, 4)
    heights = np.array([0, h * 0.33, h * 0.66, h])
    if rng.random() < 0.5:
        side = spline(upright(np.column_stack([sides, heights])))
    else:
        a, b = (sides[0], 0), (sides[-1], h)
        side = arc(*upright([a, ((a[0] + b[0]) / 2 + rng.uniform(0.05, 0.15), h / 2), b]))
    inner = 0.0 if rng.random() < 0.3 else hollow
    corners = upright([(inner, 0), (sides[0], 0), (sides[-1], h), (inner, h)])
    face = outline([line(corners[0], corners[1]), side, line(corners[2], corners[3]), line(corners[3], corners[0])])
    if rng.random() < 0.6:
        return revolve(face, rng.uniform(0.5, 1.6) * math.pi)
    solid, wide = revolve(face), rng.uniform(0.1, 0.18)
    solid = cut(solid, box((-1, -wide / 2, h * rng.uniform(0.6, 0.8)), (2, wide, 2)))
    return cut(solid, cylinder((0, -1, h * 0.35), rng.uniform(0.05, 0.08), 2, (0, 1, 0)))


def rolled(rng: Generator) -> TopoDS_Shape:
    """One or two boxes with rolled and bevelled edges, and a boss whose top is cut aslant."""
    w, d, h = rng.uniform(0.7, 1), rng.uniform(0.4, 0.8), rng.uniform(0.25, 0.6)
    solid = box((0, 0, 0), (w, d, h))
    if rng.random() < 0.5:
        part = box((w * 0.5, d * 0.2, h * 0.5), (w * 0.35, d * 0.5, h * 0.5 + rng.uniform(0.15, 0.3)))
        solid = fuse(solid, turn(part, rng.uniform(-8, 8)))
    solid = blended(rng, solid, rng.integers(2, 5))
    radius, height = rng.uniform(0.09, 0.14), rng.uniform(0.2, 0.35)
    boss = cylinder((w * 0.25, d * 0.5, h * 0.8), radius, h * 0.2 + height)
    if rng.random() < 0.8:
        low, high = h + height * 0.4, h + height * 0.9
        slope = (high - low) / (2 * radius)
        keep = upright([(-2, -2), (2, -2), (2, high + slope * 2), (-2, low - slope * 2)], -2)
        boss = common(boss, extrude(polygon(keep), (0, 4, 0)))
    return fuse(solid, boss)


FAMILIES = (
    stepped,
    rounded_plate,
    shaft,
    pyramid,
    spline_profile,
    pocketed,
    flange,
    bracket,
    turned,
    rolled,
)
