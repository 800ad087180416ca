"""What a picture shows, among a user's own sketches: the sketch and pose whose lines are most like its own."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.library.phrase import Request
from diff3ds.recognition.network import AZIMUTHS, ELEVATIONS
from diff3ds.recognition.picture_lines import Lines
from diff3ds.recognition.recognise import GUESSES, Guess
from diff3ds.recognition.side_seen import (
    LEAST_CONFIDENCE,
    REFINED,
    STEPS_AROUND,
    STEPS_UP,
    cameras_at,
    confidence,
    described,
    descriptors,
    gap,
    pieces,
)
from diff3ds.sketch import Sketch
from diff3ds.tasks.exact_prior.exemplars import FITTING, Exemplars, arranged, exemplars_among
from diff3ds.tasks.exact_prior.folder_phrase import asked_of, fits
from diff3ds.tasks.exact_prior.sketch_folder import SketchFolder

# So many of the best kinds are refined.
CANDIDATES = 4
# Members whose scores are so near to the best one's are drawn like it. Of 64 members of the built-in library, the six
# most like a view of another one lie within .006 in nine of ten cases.
ALIKE = 0.01

Pose = tuple[float, float]


@dataclass(frozen=True)
class _Seen:
    """A member from a pose (azimuth and elevation, degrees), and how like the picture that is."""

    score: float
    member: int
    pose: Pose


def recognise_in(folder: SketchFolder, lines: Lines, shows: str | None = None) -> tuple[Guess, Exemplars]:
    """Finds what lines show, and the members most like them.

    Args:
        shows: a phrase for it, if it is known; the confidence is 1 then, and in a folder of one kind of thing.

    Raises:
        ValueError: nothing there is like it; the phrase is not understood, or means several things.
    """
    request = None if shows is None else asked_of(folder.names, shows, str(folder.path))
    if request is not None and request.count != 1:
        raise ValueError(f"{shows!r}: the built-in prior looks for one thing in a picture")
    if request is not None and request.ignored:
        raise ValueError(f"{shows!r}: the size is the picture's own: leave words such as big out")
    sketches = _candidates(folder, request)
    wanted = described(lines)
    best = _best_of_nouns(folder, sketches, wanted)
    scores = [(noun, seen.score) for noun, seen in best.items()]
    noun, seen = next(iter(best.items()))
    away = gap(lines, sketches[seen.member], cameras_at([seen.pose]))
    sure = 1.0 if len(best) == 1 else confidence(seen.score, scores[1][1], away)
    if sure < LEAST_CONFIDENCE:
        raise ValueError(
            f"the {lines.kind} is not recognised: of what {folder.path} has it is most like "
            f"{', '.join(f'{one} ({score:.2f})' for one, score in scores[:GUESSES])}, but may be none of them. "
            f'If it shows one of them, say so: --shows "{scores[0][0]}"'
        )
    name = folder.names[seen.member]
    found = Guess(noun, name.words, *seen.pose, sure, name.said)
    of_noun = {i: sketch for i, sketch in sketches.items() if folder.names[i].noun == noun}
    return found, exemplars_among(folder, _alike(of_noun, found, wanted), request.color if request else None)


def _candidates(folder: SketchFolder, request: Request | None) -> dict[int, Sketch]:
    """All members by their places, or those that a phrase means, in the proportions that it says."""
    members = dict(enumerate(folder.members))
    if request is None:
        return {i: member.sketch for i, member in members.items()}
    return {i: arranged(member.sketch, request) for i, member in members.items() if fits(member.name, request)}


def _best_of_nouns(
    folder: SketchFolder, sketches: Mapping[int, Sketch], wanted: Float[Tensor, " D"]
) -> dict[str, _Seen]:
    """The best view of every kind, the best kind first; views of the best kinds are refined."""
    poses = [(a, e) for a in AZIMUTHS for e in ELEVATIONS]
    seen: dict[str, list[_Seen]] = {}
    for i, sketch in sketches.items():
        seen.setdefault(folder.names[i].noun, []).extend(_views(i, sketch, poses, wanted))
    best = {noun: max(views, key=lambda view: view.score) for noun, views in seen.items()}
    for noun in islice(_by_score(best), CANDIDATES):
        for view in sorted(seen[noun], key=lambda view: -view.score)[:REFINED]:
            a, e = view.pose
            beside = [((a + x) % 360, max(0.0, e + y)) for x in STEPS_AROUND for y in STEPS_UP]
            found = _views(view.member, sketches[view.member], beside, wanted)
            best[noun] = max(best[noun], *found, key=lambda view: view.score)
    return _by_score(best)


def _by_score(best: Mapping[str, _Seen]) -> dict[str, _Seen]:
    return dict(sorted(best.items(), key=lambda item: -item[1].score))


def _views(i: int, sketch: Sketch, poses: list[Pose], wanted: Float[Tensor, " D"]) -> list[_Seen]:
    scores = descriptors(*pieces(sketch, cameras_at(poses))) @ wanted
    return [_Seen(float(score), i, pose) for score, pose in zip(scores, poses, strict=True)]


def _alike(sketches: Mapping[int, Sketch], found: Guess, wanted: Float[Tensor, " D"]) -> dict[int, Sketch]:
    """The sketches most like the picture from where it was taken; the best first."""
    scores = torch.stack([descriptors(*pieces(s, found.camera))[0] for s in sketches.values()]) @ wanted
    places = [*sketches]
    best = scores.topk(min(FITTING, len(places)))
    alike = best.indices[best.values >= best.values[0] - ALIKE]
    return {places[i]: sketches[places[i]] for i in alike.tolist()}
