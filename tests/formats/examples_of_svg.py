"""SVG files with one feature each, for the tables of docs/reference/formats-read.md."""

from read_curves import reaches, text
from read_example import Example

LINE = '<line x1="10" y1="20" x2="40" y2="20"/>'


def svg(inside: str, root: str = 'width="100" height="80"', before: str = ""):
    """Black strokes without fillings, unless elements say otherwise."""
    style = 'fill="none" stroke="#000"'
    return text("a.svg", f'{before}<svg xmlns="http://www.w3.org/2000/svg" {root} {style}>{inside}</svg>')


def line_at(x0: float, y0: float, x1: float, y1: float, **more):
    return reaches([x0, y0, 0], [x1, y1, 0], **more)


def said(inside: str, words: str) -> Example:
    return Example(svg(LINE + inside), line_at(10, 20, 40, 20, count=1), words)


SVG = {
    "paths: all commands but arcs, absolute and relative": Example(
        svg('<path d="M10,20 h30 v10 l-30,0 z m0,20 c5,0 10,0 15,0 s5,0 15,0 q-10,0 -15,0 t-15,0"/>'),
        line_at(10, 20, 40, 40),
    ),
    "arcs of ellipses in paths": Example(
        svg('<path d="M30,20 a10,10 0 1 1 -20,0"/>'),
        lambda found: (
            abs(float(found.points[..., 1].min()) - 10) < 0.01 or abs(float(found.points[..., 1].max()) - 30) < 0.01
        ),
    ),
    "lines, polylines, polygons": Example(
        svg(LINE + '<polyline points="10,30 20,30 20,40"/><polygon points="30,30 40,30 40,40"/>'),
        line_at(10, 20, 40, 40, count=3),
    ),
    "rectangles, also with round corners": Example(
        svg('<rect x="10" y="20" width="30" height="10"/><rect x="50" y="20" width="30" height="10" rx="3"/>'),
        line_at(10, 20, 80, 30),
    ),
    "circles and ellipses": Example(
        svg('<circle cx="30" cy="30" r="10"/><ellipse cx="60" cy="30" rx="10" ry="5"/>'), line_at(20, 20, 70, 40)
    ),
    "groups, transforms of all kinds": Example(
        svg(f'<g transform="translate(5,5) scale(2)"><g transform="rotate(90) skewX(0)">{LINE}</g></g>'),
        line_at(-35, 25, -35, 85),
    ),
    "clones (`use`) and symbols": Example(
        svg(f'<defs><g id="a">{LINE}</g></defs><use href="#a"/><use href="#a" x="50" y="10"/>'),
        line_at(10, 20, 90, 30, count=2),
    ),
    "units of length": Example(
        svg('<line x1="1in" y1="15mm" x2="2in" y2="15mm"/>'), line_at(96, 15 / 25.4 * 96, 192, 15 / 25.4 * 96)
    ),
    "`viewBox`": Example(svg(LINE, 'width="200px" height="2in" viewBox="0 0 100 96"'), line_at(10, 20, 40, 20)),
    "attributes, `style`, style sheets": Example(
        svg(
            '<style>.r {stroke: #f00}</style><line class="r" style="stroke-width: 3" x1="10" y1="20" x2="40" y2="20"/>'
        ),
        lambda found: line_at(10, 20, 40, 20, color=[[1, 0, 0]])(found) and float(found.width) == 3,
    ),
    "gradients of colours, of strokes": Example(
        svg(
            '<linearGradient id="g" gradientUnits="userSpaceOnUse" x1="10" x2="40"><stop stop-color="#f00"/>'
            '<stop offset="1" stop-color="#00f"/></linearGradient>' + LINE.replace("/>", ' stroke="url(#g)"/>')
        ),
        line_at(10, 20, 40, 20, color=[[0.5, 0, 0.5]]),
    ),
    "opacity": Example(svg(f'<g opacity=".5">{LINE}</g>'), lambda found: abs(float(found.opacity) - 0.5) < 1e-6),
    "what is hidden (`display`, `visibility`)": Example(
        svg(LINE + '<g display="none"><line x2="90"/></g><line x2="90" visibility="hidden"/>'),
        line_at(10, 20, 40, 20, count=1),
    ),
    "filled shapes without a stroke": said('<rect width="5" height="5" fill="#000" stroke="none"/>', "1 filled shape"),
    "texts": said('<text x="5" y="9">a</text>', "text elements"),
    "pictures": said('<image width="5" height="5" href="a.png"/>', "image elements"),
    "clips and masks": said('<g clip-path="url(#c)"/>', "clip-path"),
    "dashes: whole strokes are read": Example(
        svg(LINE.replace("/>", ' stroke-dasharray="2"/>')), line_at(10, 20, 40, 20, count=1), "dash"
    ),
    "clones of what is not there": said('<use href="#nothing"/>', "clones of what is not there"),
    "patterns as paints": said('<pattern id="p"/><rect width="5" height="5" stroke="url(#p)"/>', "no gradients"),
    "entities of text, as Illustrator writes them": Example(
        svg(LINE.replace("10", "&a;"), before='<!DOCTYPE svg [<!ENTITY a "10">]>'), line_at(10, 20, 40, 20)
    ),
    "entities in entities, entities of files": Example(
        svg(LINE, before='<!DOCTYPE svg [<!ENTITY a SYSTEM "file:///etc/hostname">]>'), words="entit"
    ),
    "no stroke at all": Example(svg('<rect width="5" height="5" fill="#000" stroke="none"/>'), words="a stroke"),
    "neither a size nor a `viewBox`": Example(svg(LINE, ""), words="no size"),
}
