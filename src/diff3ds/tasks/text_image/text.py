"""A phrase to a 3D sketch: what `diff3ds text` does."""

from collections.abc import Callable, Sequence
from pathlib import Path

from diff3ds.render.backends import torch_on_one_thread
from diff3ds.sketch import Sketch
from diff3ds.tasks.exact_prior.exemplars import exemplars_in, exemplars_of
from diff3ds.tasks.exact_prior.sketch_folder import read_sketches
from diff3ds.tasks.progress import Report
from diff3ds.tasks.results import claim
from diff3ds.tasks.small_prior.small_prior import trained
from diff3ds.tasks.text_image.built_in import Chosen, check, run
from diff3ds.tasks.text_image.distill_options import DistillOptions
from diff3ds.tasks.text_image.distillation import CHECKPOINT, Commission, distill
from diff3ds.tasks.text_image.options import BUILT_IN, FOR_PHRASES, PriorOptions, TextOptions
from diff3ds.tasks.text_image.priors import best_for_phrases, load_for_phrase, loaded, named_prior

# The paper's weight of guidance for phrases.
GUIDANCE = 50.0


@torch_on_one_thread()
def run_text(
    phrase: str,
    out: Path,
    options: TextOptions | None = None,
    prior: PriorOptions | None = None,
    settings: DistillOptions | None = None,
    report: Report = lambda progress: None,
    say: Callable[[str], None] = lambda line: None,
) -> Sketch:
    """Makes a sketch of a phrase and writes the folder of the run.

    Args:
        phrase: such as "a chair".
        out: folder of the results and of the checkpoint.
        options: of this command; by default those of its class, as the next two.
        prior: which prior, and its weights.
        settings: of the distillation.
        report: called after every step.
        say: told which prior is taken and why, and its licence.

    Raises:
        ValueError, OSError: as `claim`, the prior's loader, and `distill`.
    """
    options, prior, settings = options or TextOptions(), prior or PriorOptions(), settings or DistillOptions()
    claim(out, out / CHECKPOINT, settings.resume, settings.overwrite)
    if prior.prior is None:
        name, reason = best_for_phrases(prior.device)
        say(f"prior: {reason}")
    else:
        name = named_prior(prior, (*FOR_PHRASES, *BUILT_IN))
    about: dict[str, object] = {"phrase": phrase, "prior": name}
    if name in BUILT_IN:
        return _built_in(phrase, out, options, prior, settings, about, report, say)
    if options.negative and settings.method == "csd":
        raise ValueError("csd compares the phrase with no phrase at all, not with a negative one: leave --negative out")
    denoiser = load_for_phrase(name, phrase, options.negative, options.perp_neg, prior, settings.work(), options.suffix)
    about |= {"negative": options.negative, "suffix": options.suffix, "perp_neg": options.perp_neg}
    wanted = Commission(about, GUIDANCE, network=loaded(name, prior, denoiser.unet))
    return distill(denoiser, settings, out, wanted, report)


def _built_in(
    phrase: str,
    out: Path,
    options: TextOptions,
    prior: PriorOptions,
    settings: DistillOptions,
    about: dict[str, object],
    report: Report,
    say: Callable[[str], None],
) -> Sketch:
    if options.negative or options.perp_neg:
        raise ValueError("negative phrases are for mvdream and stable-diffusion: the built-in priors have none")
    if options.suffix:
        raise ValueError(
            "a suffix is for mvdream and stable-diffusion: the built-in priors know the words of their list"
        )
    check(settings)
    if about["prior"] == "small":
        small = trained(prior)
        request = small.understood(phrase)
        _say_ignored(request.ignored, say)
        chosen = Chosen.of_network(small.asked(request), small.about, request.color)
        return run(chosen, about, GUIDANCE, settings, out, report)
    folder = None if prior.library is None else read_sketches(prior.library, prior.up)
    known = exemplars_of(phrase, settings.seed) if folder is None else exemplars_in(folder, phrase)
    _say_ignored(known.ignored, say)
    if folder is not None:
        for warning in folder.warnings:
            say(warning)
        say(f"library: {folder}; the phrase means {sum(known.fitting)} of them")
    return run(Chosen.of_members(known, folder, settings), about, GUIDANCE, settings, out, report)


def _say_ignored(words: Sequence[str], say: Callable[[str], None]) -> None:
    for word in words:
        say(f"{word!r} changes nothing: every sketch fills the same ball")
