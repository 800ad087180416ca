"""Pictures that a small prior makes by itself, without strokes: what it has learned so far."""

import itertools
from collections.abc import Sequence
from pathlib import Path

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras, orbit
from diff3ds.formats import save_png, tile_images
from diff3ds.guidance import formulas
from diff3ds.guidance.built_in.small import GROUP, SmallDenoiser, Vocabulary
from diff3ds.guidance.built_in.small_network import SmallNetwork

STEPS, GUIDANCE, SEED = 30, 3.0, 0
AZIMUTH, ELEVATION, DISTANCE = 30.0, 15.0, 1.9


def sample(denoiser: SmallDenoiser, cameras: Cameras, generator: torch.Generator) -> Float[Tensor, "4 H W 3"]:
    """Pictures of one object from four cameras (DDIM, Song et al. 2021) with guidance."""
    latents = torch.randn(GROUP, 1, denoiser.size, denoiser.size, generator=generator).to(denoiser.device)
    times = torch.linspace(980, 0, STEPS + 1).round().long()
    for now, then in itertools.pairwise(times):
        conditional, baseline = denoiser.predict(latents, now.expand(GROUP), cameras, ("conditional", "unconditional"))
        epsilon = formulas.guided(conditional, baseline, GUIDANCE)
        start, end = (denoiser.schedule.alpha_bar(t.expand(GROUP), latents) for t in (now, then))
        # Ink lies between 0 and 1; what is outside is an error that would grow.
        seen = denoiser.decode(formulas.clean_from_epsilon(epsilon, latents, start))
        clean = denoiser.encode(seen, generator)
        latents = formulas.ddim_step(latents, formulas.epsilon_from_clean(clean, latents, start), start, end)
    return denoiser.decode(latents)


def sample_sheet(
    path: Path,
    network: SmallNetwork,
    vocabulary: Vocabulary,
    shown: Sequence[dict[str, float]],
    device: torch.device,
) -> None:
    """Writes a picture: four views for each of what is asked for, in the words of `prior_data.Subjects`."""
    cameras = orbit([AZIMUTH + 90 * i for i in range(GROUP)], ELEVATION, DISTANCE, size=network.shape.size)
    rows = []
    for values in shown:
        denoiser = SmallDenoiser(network, vocabulary, vocabulary.said(values), device=device)
        rows.append(sample(denoiser, cameras, torch.Generator().manual_seed(SEED)))
    path.parent.mkdir(parents=True, exist_ok=True)
    save_png(path, tile_images(torch.cat(rows), 2 * GROUP))
