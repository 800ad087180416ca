"""What the studio understands of a phrase while it is typed."""

import functools
from collections.abc import Sequence
from typing import Any

from diff3ds.library.scene import Relation, Scene, parse_scene
from diff3ds.library.wording import wording_that_works
from diff3ds.tasks.text_image.prior_options import BUILT_IN, FOR_PHRASES, PriorOptions
from diff3ds.tasks.text_image.priors import choose_prior
from diff3ds.tasks.text_image.text import noted

# Letters of a phrase; more is none.
MOST_LETTERS = 500


def understood(phrase: str) -> dict[str, Any]:
    """What a phrase asks for: `things` in words, `notes` on what was taken otherwise; or `refused`, why not.

    Where another wording would be understood, it is `instead`.
    """
    if not phrase.strip():
        return _told()
    if len(phrase) > MOST_LETTERS:
        return _told(refused=f"a phrase has at most {MOST_LETTERS} letters")
    try:
        scene = parse_scene(phrase)
    except ValueError as error:
        if _by_network():
            return _told([phrase.strip()])
        return _told(refused=str(error), instead=wording_that_works(phrase))
    alone = len(scene.things) == 1 and scene.things[0].count == 1
    notes = [note for thing in scene.things for note in noted(thing.request, alone)]
    return _told([_placed(scene, index) for index in range(len(scene.things))], notes)


def _told(
    things: Sequence[str] = (), notes: Sequence[str] = (), refused: str = "", instead: str = ""
) -> dict[str, Any]:
    return {"things": [*things], "notes": [*notes], "refused": refused, "instead": instead}


@functools.cache
def _by_network() -> bool:
    """Whether phrases are drawn by a network with weights, to which any words mean something."""
    return choose_prior(PriorOptions(), FOR_PHRASES, lambda line: None) not in BUILT_IN


def _placed(scene: Scene, index: int) -> str:
    """A thing and where it stands, in words."""
    where = [_words(scene, relation) for relation in scene.relations if relation.thing == index]
    return ", ".join([scene.things[index].said, *where])


def _words(scene: Scene, relation: Relation) -> str:
    targets = " and ".join(scene.things[target].said for target in relation.targets)
    return f"{relation.kind} {targets}"
