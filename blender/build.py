# SPDX-License-Identifier: GPL-3.0-or-later
"""Strokes as objects of Blender: NURBS curves, or Grease Pencil."""

from functools import cache

import bpy

from .strokes import Strokes, middle_and_radius, weighed

# Of the picture's height that a sketch fills whose widths are shares of it.
_FILLED = 0.9
# Chords that Blender draws a cubic with.
_STEPS = 24


def build(
    given: Strokes, name: str, pencil: bool, scale: float = 1.0, height: float | None = None
) -> bpy.types.Collection:
    """Makes strokes in a new collection of the open scene.

    Args:
        given: what is made.
        name: of the collection.
        pencil: in Grease Pencil in place of curves.
        scale: Blender units of a unit of the file.
        height: of the picture that widths are shares of, in units of the file; by default one that they fill.

    Raises:
        ValueError: this Blender has no Bézier strokes in Grease Pencil.
    """
    if pencil and bpy.app.version < (4, 5, 0):
        raise ValueError("Grease Pencil strokes need Blender 4.5 or newer: take curves")
    if height is None:
        height = 2 * middle_and_radius(given.strokes)[1] / _FILLED
    wide = scale * (height if given.of_picture else 1.0) / 2
    collection = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(collection)
    if pencil:
        _pencil(given.strokes, name, collection, scale, wide)
    else:
        _curves(given.strokes, collection, scale, wide)
    return collection


def _layers(name: str, kind: str) -> tuple:
    """The things that a stroke is part of, from the outermost on, and its kind."""
    things = [part for part in name.partition(", ")[0].split("/")[:-1] if part]
    return (*things, *([kind] if kind else [])) or ("strokes",)


def _linear(value: float) -> float:
    """Light of an sRGB value."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def _points(stroke: tuple, wide: float) -> tuple:
    """Control points of all cubics with weights that go on at joints, and their radii."""
    points, radii, factor = [], [], 1.0
    for cubic, widths in zip(stroke.segments, stroke.widths, strict=True):
        factor = points[-1][3] / cubic[0][3] if points else 1.0
        rows = zip(cubic, weighed(widths, cubic), strict=True)
        for n, (point, width) in enumerate(rows):
            if n or not points:
                points.append((*point[:3], factor * point[3]))
                radii.append(wide * width)
    return points, radii


def _curves(strokes: list, collection: bpy.types.Collection, scale: float, wide: float) -> None:
    """An object a stroke, with exact weights."""

    @cache
    def within(layers: tuple) -> bpy.types.Collection:
        if not layers:
            return collection
        made = bpy.data.collections.new(layers[-1])
        within(layers[:-1]).children.link(made)
        return made

    @cache
    def material(color: tuple, opacity: float) -> bpy.types.Material:
        made = bpy.data.materials.new("stroke")
        made.use_nodes = True
        surface = made.node_tree.nodes["Principled BSDF"]
        surface.inputs["Base Color"].default_value = (*map(_linear, color), 1.0)
        surface.inputs["Alpha"].default_value = opacity
        made.diffuse_color = (*color, opacity)
        return made

    for number, stroke in enumerate(strokes):
        name = stroke.name or f"stroke {number}"
        curve = bpy.data.curves.new(name, "CURVE")
        curve.dimensions, curve.bevel_depth, curve.use_fill_caps, curve.resolution_u = "3D", 1.0, True, _STEPS
        spline = curve.splines.new("NURBS")
        points, radii = _points(stroke, wide)
        spline.points.add(len(points) - 1)
        spline.points.foreach_set("co", [v for x, y, z, w in points for v in (scale * x, scale * y, scale * z, w)])
        spline.points.foreach_set("radius", radii)
        spline.order_u, spline.use_endpoint_u, spline.use_bezier_u = 4, True, True
        curve.materials.append(material(stroke.color, stroke.opacity))
        within(_layers(stroke.name, stroke.kind)).objects.link(bpy.data.objects.new(name, curve))


def _pencil(strokes: list, name: str, collection: bpy.types.Collection, scale: float, wide: float) -> None:
    """One object with a layer a thing and kind; its data were called otherwise before Blender 5.0."""
    data = getattr(bpy.data, "grease_pencils_v3" if bpy.app.version < (5, 0, 0) else "grease_pencils").new(name)
    data.stroke_depth_order = "3D"
    layers: dict = {}
    for stroke in strokes:
        layers.setdefault(" - ".join(_layers(stroke.name, stroke.kind)), []).append(stroke)
    materials: dict = {}
    for layer, some in layers.items():
        made = data.layers.new(layer)
        made.use_lights = False
        looks = [materials.setdefault(stroke.color, len(materials)) for stroke in some]
        _draw(made.frames.new(bpy.context.scene.frame_current).drawing, some, looks, scale, wide)
    for color in materials:
        material = bpy.data.materials.new("stroke")
        bpy.data.materials.create_gpencil_data(material)
        material.grease_pencil.color = (*map(_linear, color), 1.0)
        data.materials.append(material)
    collection.objects.link(bpy.data.objects.new(name, data))


def _draw(drawing: object, strokes: list, looks: list, scale: float, wide: float) -> None:
    """Bézier strokes; where weights differ NURBS strokes, which keep them."""
    rows = [_points(stroke, wide) if stroke.bent else _knots(stroke, wide) for stroke in strokes]
    drawing.add_strokes([len(radii) for _, radii in rows])
    bent = [n for n, stroke in enumerate(strokes) if stroke.bent]
    others = [n for n, stroke in enumerate(strokes) if not stroke.bent]
    for kind, which in (("NURBS", bent), ("BEZIER", others)):
        if which:
            drawing.set_types(type=kind, indices=tuple(which))

    def keep(name: str, kind: str, domain: str, values: list, key: str = "value") -> None:
        attribute = drawing.attributes.get(name) or drawing.attributes.new(name, kind, domain)
        attribute.data.foreach_set(key, values)

    # (handle before, point, handle after) with a weight; of NURBS strokes all three are one.
    places = [
        place if stroke.bent is False else (place,) * 3
        for stroke, (some, _) in zip(strokes, rows, strict=True)
        for place in some
    ]
    for part, name in enumerate(("handle_left", "position", "handle_right")):
        values = [scale * value for place in places for value in place[part][:3]]
        keep(name, "FLOAT_VECTOR", "POINT", values, "vector")
        if part != 1:
            keep(name.replace("handle", "handle_type"), "INT8", "POINT", [0] * len(places))
    keep("nurbs_weight", "FLOAT", "POINT", [place[1][3] for place in places])
    keep("radius", "FLOAT", "POINT", [radius for _, radii in rows for radius in radii])
    keep("opacity", "FLOAT", "POINT", [s.opacity for s, (_, radii) in zip(strokes, rows, strict=True) for _ in radii])
    keep("nurbs_order", "INT8", "CURVE", [4] * len(strokes))
    # Knots that make each cubic one of Bézier's, with ends that are its points.
    keep("knots_mode", "INT8", "CURVE", [3] * len(strokes))
    keep("resolution", "INT", "CURVE", [_STEPS] * len(strokes))
    keep("cyclic", "BOOLEAN", "CURVE", [stroke.closed and not stroke.bent for stroke in strokes])
    keep("material_index", "INT", "CURVE", looks)
    drawing.tag_positions_changed()


def _knots(stroke: tuple, wide: float) -> tuple:
    """The points of cubics without weights, each with both handles, and radii there."""
    cubics = stroke.segments
    knots = [[cubic[0], cubic[0], cubic[1]] for cubic in cubics] + [[cubics[-1][2], cubics[-1][3], cubics[-1][3]]]
    for before, knot in zip(cubics, knots[1:], strict=True):
        knot[0] = before[2]
    radii = [wide * widths[0] for widths in stroke.widths] + [wide * stroke.widths[-1][3]]
    if stroke.closed:
        knots[0][0] = knots.pop()[0]
        radii.pop()
    return [tuple(knot) for knot in knots], radii
