"""The elements of an SVG file as a tree, read with bounds."""

from dataclasses import dataclass, field
from xml.parsers import expat

SPACES = ("http://www.w3.org/2000/svg", "")
# Nested deeper is no drawing.
DEEPEST = 64
# Letters of an entity: names of Illustrator are shorter. What refers to it grows so many times at most.
ENTITY = 100


@dataclass
class Element:
    """An element of SVG; those of other namespaces are not kept, nor attributes of theirs but "href" and "label"."""

    tag: str
    attributes: dict[str, str]
    children: "list[Element]" = field(default_factory=list)
    text: str = ""


def read_elements(content: bytes, most: int, *, entities: bool = False) -> Element:
    """The root of a file.

    Args:
        most: elements.
        entities: reads those that a document type declares as short texts; else they are refused.

    Raises:
        ValueError: not XML, not SVG, too many elements or too deep, entities that are refused.
    """
    reader = _Reader(most, entities)
    parser = expat.ParserCreate(namespace_separator="}")
    parser.StartElementHandler = reader.start
    parser.EndElementHandler = lambda _: reader.open.pop()
    parser.CharacterDataHandler = reader.characters
    parser.StartDoctypeDeclHandler = reader.doctype
    parser.EntityDeclHandler = reader.entity
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise ValueError(f"not an SVG file ({error})") from error
    return reader.root.children[0]


class _Reader:
    def __init__(self, most: int, entities: bool) -> None:
        self.root = Element("", {})
        self.open = [self.root]
        self.count = 0
        self.most = most
        self.entities = entities

    def start(self, name: str, attributes: dict[str, str]) -> None:
        space, _, tag = name.rpartition("}")
        self.count += 1
        if self.count == 1 and (tag != "svg" or space not in SPACES):
            raise ValueError(f"not an SVG file: it begins with the element {tag!r}")
        if self.count > self.most or len(self.open) > DEEPEST:
            raise ValueError(f"it has more than {self.most} elements, or some more than {DEEPEST} deep")
        plain = {
            key.rpartition("}")[2]: text
            for key, text in attributes.items()
            if "}" not in key or key.endswith(("}href", "}label"))
        }
        element = Element(tag, plain)
        # What is in elements of other namespaces is theirs.
        if space in SPACES:
            self.open[-1].children.append(element)
        self.open.append(element)

    def characters(self, text: str) -> None:
        self.open[-1].text += text

    def doctype(self, name: str, system: str | None, public: str | None, subset: int) -> None:
        """Refuses what could declare entities; what is outside of the file is not read."""
        if subset and not self.entities:
            raise ValueError("its document type declares entities, which are not read: save it as plain SVG")

    def entity(self, name: str, parameter: int, value: str | None, *place: str | None) -> None:
        """Refuses entities that are made of others, or lie outside of the file."""
        if parameter or value is None or len(value) > ENTITY or "&" in value or "%" in value:
            raise ValueError(f"its document type declares the entity {name!r}, which is not read: save it as plain SVG")
