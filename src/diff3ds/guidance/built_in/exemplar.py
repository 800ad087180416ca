"""A prior whose score is known exactly: it has seen a finite set of objects, from every side, and nothing else."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch

from diff3ds._shapes import Bool, Float, Int, Tensor
from diff3ds.camera import Cameras, orbit
from diff3ds.guidance import formulas
from diff3ds.guidance.denoiser import Branch, check_groups
from diff3ds.guidance.schedule import NoiseSchedule

# Draws all M members as V cameras see them.
Draw = Callable[[Cameras], Float[Tensor, "M V H W 3"]]

# Views whose pixels give the mean and the spread of what the members look like: the paper's range of cameras.
TYPICAL_VIEWS, TYPICAL_ELEVATION, TYPICAL_DISTANCE = 8, 15.0, 1.9


class ExemplarDenoiser:
    """The exact posterior mean over the renderings of a finite set of members, in pixel space.

    The best possible denoiser of a finite set of images weighs them by how likely each is to have become the noisy one:
    ẑ₀ = Σ pᵢ xᵢ, pᵢ ∝ exp(-|z_t - √ᾱ xᵢ|² / (2 (1 - ᾱ))). Here xᵢ is what all cameras of a group see of member i, so
    views are consistent by construction. Conditional: over the members that fit; unconditional: over all.
    Latents are pixels brought to mean 0 and variance 1.

    Attributes:
        schedule: of the noise.
        size: of the images, pixels.
        group: views of an object.
    """

    def __init__(self, draw: Draw, fitting: Bool[Tensor, " M"], size: int = 64, group: int = 4) -> None:
        """Takes a set of members.

        Args:
            draw: renders all members; called with the cameras of every step, resized to `size`.
            fitting: members that the phrase describes.
            size: of the images, pixels.
            group: views of an object.

        Raises:
            ValueError: no member fits.
        """
        if not bool(fitting.any()):
            raise ValueError("none of the members fits: a conditional prior needs at least one")
        self.schedule = NoiseSchedule.scaled_linear()
        self.size = size
        self.group = group
        self._draw = draw
        self._fitting = fitting
        azimuths = [360 * i / TYPICAL_VIEWS for i in range(TYPICAL_VIEWS)]
        typical = draw(orbit(azimuths, TYPICAL_ELEVATION, TYPICAL_DISTANCE, size=size))
        # Summed by numpy, whose sums do not depend on the number of threads.
        ink = typical.cpu().numpy()
        self._mean, self._spread = float(ink.mean(dtype="float64")), float(ink.std(dtype="float64", ddof=1))
        self._seen: tuple[Cameras, Members] | None = None

    def encode(self, images: Float[Tensor, "B H W 3"], generator: torch.Generator) -> Float[Tensor, "B 3 h w"]:
        """Pixels, standardised, with gradients; images of another size are resampled."""
        latents = (images.movedim(-1, 1).float() - self._mean) / self._spread
        if latents.shape[-2:] == (self.size, self.size):
            return latents
        size = (self.size, self.size)
        return torch.nn.functional.interpolate(latents, size, mode="bilinear", antialias=True)

    def decode(self, latents: Float[Tensor, "B 3 h w"]) -> Float[Tensor, "B H W 3"]:
        """Images in [0, 1]."""
        return (latents * self._spread + self._mean).movedim(1, -1).clamp(0, 1)

    def predict(
        self,
        noisy: Float[Tensor, "B 3 h w"],
        timesteps: Int[Tensor, " B"],
        cameras: Cameras,
        branches: Sequence[Branch],
    ) -> Float[Tensor, "R B 3 h w"]:
        """The exact noise of every branch; the negative one is the unconditional one.

        Raises:
            ValueError: the number of views is no multiple of the group.
        """
        check_groups(len(noisy), self.group)
        members = self._members(cameras)
        kept = self.schedule.alpha_bar(timesteps, noisy)
        likely = self.likelihood(noisy, kept, members)
        fitting = likely.masked_fill(~self._fitting, -torch.inf)
        fractions = torch.stack([(fitting if branch == "conditional" else likely).softmax(1) for branch in branches])
        means = torch.einsum("rgm,mgd->rgd", fractions, members.pixels).reshape(len(branches), *noisy.shape)
        return torch.stack([formulas.epsilon_from_clean(mean, noisy, kept) for mean in means])

    def likelihood(
        self, noisy: Float[Tensor, "B 3 h w"], kept: Float[Tensor, "B 1 1 1"], members: "Members"
    ) -> Float[Tensor, "G M"]:
        """Logarithm of how likely each group of views is a noisy version of each member, up to a constant.

        -|z - a x|² / (2 σ²) with the square written out: |z|² is the same for all members.
        """
        groups = members.pixels.shape[1]
        noise = 1 - kept.reshape(groups, self.group)
        scale = kept.sqrt().reshape(groups, self.group)
        pixels = members.pixels.reshape(len(members.pixels), groups, self.group, -1)
        along = torch.einsum("mgvd,gvd->gmv", pixels, noisy.reshape(groups, self.group, -1))
        terms = scale[:, None] * along - scale[:, None].square() * members.squares / 2
        return (terms / noise[:, None]).sum(2)

    def _members(self, cameras: Cameras) -> "Members":
        """Draws the members, and keeps the pictures for the next call: most methods ask several times in a step."""
        if self._seen is None or self._seen[0] is not cameras:
            with torch.no_grad():
                drawn = self._draw(cameras.resize(self.size)).movedim(-1, 2)
                latents = ((drawn - self._mean) / self._spread).contiguous()
            views = latents.reshape(len(latents), -1, self.group, latents[0, 0].numel())
            squares = torch.einsum("mgvd,mgvd->gmv", views, views)
            self._seen = (cameras, Members(views.flatten(2), squares))
        return self._seen[1]


@dataclass(frozen=True, eq=False)
class Members:
    """M members as G groups of V views see them.

    Attributes:
        pixels: latents of all views of a group in a row.
        squares: sums of their squares, by view.
    """

    pixels: Float[Tensor, "M G D"]
    squares: Float[Tensor, "G M V"]
