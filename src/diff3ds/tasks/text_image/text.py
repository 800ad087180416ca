"""A phrase to a 3D sketch: what `diff3ds text` does."""

from collections.abc import Callable, Sequence
from pathlib import Path

from diff3ds.library.phrase import Request
from diff3ds.library.scene import Scene, parse_scene
from diff3ds.library.vocabulary import SIZES, STRETCHES
from diff3ds.library.wording import understood_scene
from diff3ds.render.backends import torch_on_one_thread
from diff3ds.sketch import Sketch
from diff3ds.tasks.exact_prior.exemplars import exemplars_in, exemplars_of
from diff3ds.tasks.exact_prior.sketch_folder import read_sketches
from diff3ds.tasks.progress import Report
from diff3ds.tasks.results import check_output_folder
from diff3ds.tasks.run_log import logged
from diff3ds.tasks.small_prior.small_prior import Trained, trained
from diff3ds.tasks.text_image.conditioned_prior import ConditionedPrior
from diff3ds.tasks.text_image.distillation import CHECKPOINT, distill
from diff3ds.tasks.text_image.prior_options import BUILT_IN, FOR_PHRASES
from diff3ds.tasks.text_image.priors import choose_prior, load_for_phrase, loaded
from diff3ds.tasks.text_image.run_spec import RunSpec
from diff3ds.tasks.text_image.subject import Phrase
from diff3ds.tasks.text_image.text_scene import PLAN, forget_scene, run_scene


@torch_on_one_thread()
def run_text(
    spec: RunSpec[Phrase],
    out: Path,
    report: Report = lambda progress: None,
    say: Callable[[str], None] = lambda line: None,
) -> Sketch:
    """Makes a sketch of a phrase and writes the folder of the run.

    Args:
        spec: the phrase, and how it is drawn.
        out: folder of the results and of the checkpoint.
        report: called after every step.
        say: told which prior is taken and why, and its licence.

    Raises:
        ValueError, OSError: as `check_output_folder`, the prior's loader, and `distill`.
    """
    checkpoint = out / (PLAN if (out / PLAN).exists() else CHECKPOINT)
    check_output_folder(out, checkpoint, spec.output.resume, spec.output.overwrite)
    with logged(out, report, say) as (report, say):
        return _made(spec, out, report, say)


def _made(spec: RunSpec[Phrase], out: Path, report: Report, say: Callable[[str], None]) -> Sketch:
    """Chooses the prior, tells it the phrase, and draws."""
    name = choose_prior(spec.prior, FOR_PHRASES, say)
    if name not in BUILT_IN:
        return _by_network(name, spec, out, report, say)
    _check_built_in(spec)
    small = trained(spec.prior.weights, spec.prior.device) if name == "small" else None
    if spec.prior.library is not None or (small and not small.is_of_the_library):
        return distill(_of_folder(small, spec, say), spec, out, report)
    scene = understood_scene(spec.subject.phrase)
    alone = len(scene.things) == 1 and scene.things[0].count == 1
    for thing in scene.things:
        for note in noted(thing.request, alone):
            say(note)
        if small:
            # Before the first thing is drawn.
            small.told(thing.request)

    def prior(one: RunSpec[Phrase], request: Request) -> ConditionedPrior:
        if small:
            return ConditionedPrior.of_small(small, small.asked(request), request.color)
        return ConditionedPrior.of_exemplars(exemplars_of(request, one.descent.seed), None, one)

    if spec.strokes.start is not None and not alone:
        raise ValueError("--from goes on with one thing, and this phrase asks for several: ask for one")
    if alone:
        forget_scene(out)
        return distill(prior(spec, scene.things[0].request), spec, out, report)
    return run_scene(scene, prior, spec, out, report)


def _by_network(name: str, spec: RunSpec[Phrase], out: Path, report: Report, say: Callable[[str], None]) -> Sketch:
    """Draws a phrase by a network: as a whole, or each of the things that it names."""
    scene = None if spec.subject.whole else _several(spec.subject.phrase)
    if scene is None:
        forget_scene(out)
        return distill(_network(name, spec), spec, out, report)
    things = ", ".join(repr(thing.one) for thing in scene.things)
    say(f"{things}: drawn one after the other, then placed; --whole tells the network the whole phrase instead")
    return run_scene(scene, lambda one, _: _network(name, one), spec, out, report)


def _several(phrase: str) -> Scene | None:
    """The scene that a phrase describes, if it is one of several kinds that the library knows by just these words."""
    try:
        scene = parse_scene(phrase)
    except ValueError:
        # A network may know what the library does not.
        return None
    alone = len(scene.things) == 1 and scene.things[0].count == 1
    return None if alone or any(thing.request.corrected for thing in scene.things) else scene


def _network(name: str, spec: RunSpec[Phrase]) -> ConditionedPrior:
    """A network with weights, told the phrase."""
    subject = spec.subject
    if subject.negative and spec.score.method == "csd":
        raise ValueError("csd compares the phrase with no phrase at all, not with a negative one: leave --negative out")
    denoiser = load_for_phrase(name, subject, spec.prior, spec.work())
    told = {"negative": subject.negative, "suffix": subject.suffix, "perp_neg": subject.perp_neg}
    return ConditionedPrior(name, denoiser, told, loaded(name, spec.prior, denoiser.unet))


def _check_built_in(spec: RunSpec[Phrase]) -> None:
    """Raises ValueError for what the priors that are built in cannot do."""
    if spec.subject.negative or spec.subject.perp_neg:
        raise ValueError("negative phrases are for mvdream and stable-diffusion: the built-in priors have none")
    if spec.subject.suffix:
        raise ValueError(
            "a suffix is for mvdream and stable-diffusion: the built-in priors know the words of their list"
        )
    if spec.subject.whole:
        raise ValueError("--whole is for networks: the built-in priors know single things")
    spec.check_built_in()


def _of_folder(small: Trained | None, spec: RunSpec[Phrase], say: Callable[[str], None]) -> ConditionedPrior:
    """The prior of the user's own library, told the phrase: the exact one, or the small network trained on it."""
    phrase = spec.subject.phrase
    if small:
        request = small.understood(phrase)
        for note in noted(request, True):
            say(note)
        return ConditionedPrior.of_small(small, small.asked(request), request.color)
    assert spec.prior.library is not None
    folder = read_sketches(spec.prior.library, spec.prior.up)
    known = exemplars_in(folder, phrase)
    for note in _unseen(known.ignored):
        say(note)
    for warning in folder.warnings:
        say(warning)
    say(f"library: {folder}; the phrase means {sum(known.fitting)} of them")
    return ConditionedPrior.of_exemplars(known, folder, spec)


def noted(request: Request, alone: bool) -> list[str]:
    """What was taken otherwise than it stands in the phrase, or not at all, a sentence each.

    Args:
        request: what the phrase asks for.
        alone: whether it speaks of this thing alone.
    """
    slips = [f"{word!r} is taken for {meant!r}" for word, meant in request.corrected]
    # In a scene a big chair is bigger than a chair.
    return slips + _unseen([word for word in request.ignored if alone or word not in SIZES])


def _unseen(words: Sequence[str]) -> list[str]:
    notes = []
    for word in words:
        why = "every sketch fills the same ball" if word in SIZES else "lines do not show it"
        if " " in word and word.split()[0] in {*SIZES, *STRETCHES}:
            why = "the sizes of parts are the library's"
        notes.append(f"{word!r} changes nothing: {why}")
    return notes
