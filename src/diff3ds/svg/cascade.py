"""Which values the properties of SVG elements have: attributes, rules of style sheets, style attributes."""

import re
from dataclasses import dataclass, field

from diff3ds.svg.elements import Element

# How many ids, classes and tags a selector has, and its place in the file: the greatest one wins.
Rank = tuple[int, int, bool, int]
# Rules of a file: more is taken for a mistake or an attack.
MOST_RULES = 100_000
_SELECTOR = re.compile(r"(\*|[\w-]+)?((?:[.#][\w-]+)*)")
_COMMENT = re.compile(r"/\*.*?(?:\*/|\Z)", re.DOTALL)
_RULE = re.compile(r"([^{}]*)\{([^{}]*)\}")


def declarations(text: str) -> dict[str, str]:
    """The properties of a style attribute or of a rule."""
    pairs = (part.partition(":") for part in _COMMENT.sub("", text).split(";"))
    return {name.strip(): value.replace("!important", "").strip() for name, colon, value in pairs if colon}


@dataclass
class StyleSheet:
    """Rules for tags, classes and ids, and what all of these say together; others are not read.

    Attributes:
        unread: the selectors that are not.
    """

    unread: list[str] = field(default_factory=list)
    rules: dict[str, list[tuple[Rank, set[str], dict[str, str]]]] = field(default_factory=dict)
    count: int = 0

    def add(self, text: str) -> None:
        """Adds the text of a style element.

        Raises:
            ValueError: too many rules.
        """
        for rule in _RULE.finditer(_COMMENT.sub("", text.replace("<!--", "").replace("-->", ""))):
            values = declarations(rule[2])
            for selector in rule[1].split(","):
                self.count += 1
                if self.count > MOST_RULES:
                    raise ValueError(f"its style sheets have more than {MOST_RULES} rules: simplify it")
                self._add(selector.strip(), values)

    def of(self, element: Element) -> dict[str, str]:
        """The values of an element's own properties, inherited ones apart."""
        names = {"*", element.tag, "#" + element.attributes.get("id", "")}
        names |= {"." + name for name in element.attributes.get("class", "").split()}
        met = [rule for name in names for rule in self.rules.get(name, ()) if rule[1] <= names]
        values = dict(element.attributes)
        for _, _, found in sorted(met, key=lambda rule: rule[0]):
            values.update(found)
        return values | declarations(element.attributes.get("style", ""))

    def _add(self, selector: str, values: dict[str, str]) -> None:
        found = _SELECTOR.fullmatch(selector)
        if not selector or not found:
            self.unread.append(selector)
            return
        names = {*re.findall(r"[.#][\w-]+", found[2]), *([found[1]] if found[1] else [])}
        ids, classes = (sum(name[0] == first for name in names) for first in "#.")
        # It is looked for by the rarest of its names.
        key = max(names, key=lambda name: (name[0] == "#", name[0] == "."))
        self.rules.setdefault(key, []).append(((ids, classes, found[1] not in (None, "*"), self.count), names, values))
