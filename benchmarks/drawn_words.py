"""What the words of Quick, Draw! mean in the library: a kind, none of them, or perhaps one.

Drawings of words that are no kind are real examples of nothing that is known. Whole words are kept apart for
validation and for the test, so that what is counted there is a thing that the network has never seen.
"""

from functools import cache

from diff3ds.library import CATEGORIES

# Kinds of words that the library's phrases do not name so.
ALSO = {
    "alarm clock": "clock", "palm tree": "tree", "police car": "car", "teddy-bear": "teddy bear", "baseball": "ball",
    "basketball": "ball", "bear": "teddy bear",
}  # fmt: skip
# Drawings of these may well be taken for a kind, or not: they are no example of either.
UNCERTAIN = {
    "aircraft carrier", "ambulance", "angel", "animal migration", "barn", "beach", "bench", "bulldozer", "bush",
    "canoe", "chandelier", "circle", "flamingo", "garden", "helmet", "hospital", "house plant", "jail", "lantern",
    "mermaid", "owl", "panda", "popsicle", "shark", "skyscraper", "speedboat", "streetlight", "swan", "van",
    "wristwatch", "yoga",
}  # fmt: skip
# Of the words that are no kind, in the order of the alphabet: every sixth is the test's, every sixth validation's.
SHARE = 6


@cache
def _by_noun() -> dict[str, str]:
    """Kinds by the nouns that phrases name them with."""
    return {
        noun.lower(): name
        for name, category in CATEGORIES.items()
        for noun in (name, *category.synonyms, *(noun for part in category.attributes for noun in part.nouns))
    }


def kind_of(word: str) -> str | None:
    """The kind that a word means; None if it is none of them, or if it is uncertain."""
    return None if word in UNCERTAIN else ALSO.get(word) or _by_noun().get(word)


def nothings(words: list[str]) -> dict[str, list[str]]:
    """Of these words those that are no kind, in three parts: "train", "validation" and "test"."""
    none = sorted(word for word in words if word not in UNCERTAIN and kind_of(word) is None)
    test, validation = none[::SHARE], none[1::SHARE]
    return {"test": test, "validation": validation, "train": [w for i, w in enumerate(none) if i % SHARE > 1]}
