"""`RenderFunction`: scenes to pictures, with the arguments that DiffVG takes."""

import time
from collections.abc import Sequence
from typing import Any, NoReturn

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.pydiffvg import settings
from diff3ds.pydiffvg.scene_classes import FilterType, OutputType, PixelFilter
from diff3ds.pydiffvg.scene_layers import layers_of
from diff3ds.pydiffvg.scene_tables import Scene, read_scene
from diff3ds.render.areas import draw_layers

# px. Half a pixel: what a pixel sees is its own area.
BOX = 0.5


class RenderFunction:
    """Draws scenes: `serialize_scene` reads one, `apply` draws it."""

    @staticmethod
    def serialize_scene(
        canvas_width: float,
        canvas_height: float,
        shapes: Sequence[Any],
        shape_groups: Sequence[Any],
        filter: PixelFilter | None = None,
        output_type: OutputType = OutputType.color,
        use_prefiltering: bool = False,
        eval_positions: Tensor | None = None,
    ) -> list[Any]:
        """What `apply` takes after its own arguments.

        Args:
            canvas_width: of the coordinates of shapes, which `apply` scales to its picture.
            canvas_height: see there.
            filter: None or a box of radius .5, which is the area of a pixel.
            output_type: `color`.
            use_prefiltering: has no effect; what a pixel shows of a shape is measured exactly.
            eval_positions: None or empty.

        Raises:
            TypeError: what is no shape, no group, no tensor or no colour.
            ValueError: wrong numbers of points, widths or colours, groups of shapes that are not there, a canvas
                without an area.
            NotImplementedError: signed distances, `eval_positions`, another filter.
        """
        if output_type != OutputType.color:
            raise NotImplementedError(
                "signed distances (OutputType.sdf) are not drawn: draw colours, of whose alpha "
                "scipy.ndimage.distance_transform_edt gives distances, without gradients"
            )
        if eval_positions is not None and eval_positions.numel():
            raise NotImplementedError(
                "eval_positions are not drawn: draw the picture and take its pixels, between them with "
                "torch.nn.functional.grid_sample"
            )
        if filter is not None:
            _check_filter(filter)
        if not (canvas_width > 0 and canvas_height > 0):
            raise ValueError(f"a canvas has a positive width and height, got {canvas_width} and {canvas_height}")
        scene = read_scene((float(canvas_width), float(canvas_height)), shapes, shape_groups)
        return [canvas_width, canvas_height, len(shapes), len(shape_groups), output_type, use_prefiltering, scene]

    @staticmethod
    def apply(
        width: int,
        height: int,
        num_samples_x: int,
        num_samples_y: int,
        seed: int,
        background_image: Float[Tensor, "H W C"] | None,
        *args: Any,
    ) -> Float[Tensor, "H W 4"]:
        """Draws what `serialize_scene` read, on the device that `get_device` says.

        Args:
            width: of the picture, pixels, to which the canvas is scaled.
            height: see there.
            num_samples_x: has no effect; coverage is exact, and the same scene gives the same picture.
            num_samples_y: see there.
            seed: see there.
            background_image: RGBA or RGB to draw over, (height, width, 4) or (height, width, 3), or None.
            args: from `serialize_scene`.

        Returns:
            RGB and alpha of each pixel: colours as DiffVG averages them over the samples of a pixel, where those that
            hit nothing count as black. Over a white sheet it is `rgb * alpha + 1 - alpha`, as its users have it.

        Raises:
            ValueError: values that are not finite, a transform that is not affine, a background of another size, a
                picture without pixels, arguments that `serialize_scene` did not give.
        """
        if not args or not isinstance(args[-1], Scene):
            raise ValueError("apply takes what RenderFunction.serialize_scene returned, as *scene_args")
        width, height = int(width), int(height)
        if width < 1 or height < 1:
            raise ValueError(f"a picture has one pixel or more, got {width} x {height}")
        begin = time.perf_counter()
        drawn = _drawn(args[-1], width, height, background_image)
        if settings.print_timing:
            print(f"Forward pass, time: {time.perf_counter() - begin:.5f} s")
        return drawn

    @staticmethod
    def render_grad(*args: Any) -> NoReturn:
        """Refused: the gradient of a picture by its own shift, pixel by pixel."""
        raise NotImplementedError(
            "render_grad is not here: add an offset (2,) that requires gradients to the points of all shapes"
        )


def _check_filter(filter: PixelFilter) -> None:
    radius = float(torch.as_tensor(filter.radius).detach())
    if filter.type != FilterType.box or radius != BOX:
        raise NotImplementedError(
            f"pixels are filtered by their area, a box of radius {BOX:g}, got {FilterType(filter.type).name} of radius "
            f"{radius:g}: leave the filter out, or draw larger (apply takes any width and height) and average by it"
        )


def _drawn(scene: Scene, width: int, height: int, background: Tensor | None) -> Float[Tensor, "H W 4"]:
    device = settings.get_device()
    if background is not None:
        if background.shape not in ((height, width, 3), (height, width, 4)):
            wanted, got = (height, width, 4), tuple(background.shape)
            raise ValueError(f"background_image must have shape {wanted}, as the picture, got {got}")
        background = background.to(device)
        if background.shape[2] == 3:
            background = torch.cat([background, torch.ones_like(background[..., :1])], 2)
    if not len(scene.layers):
        return torch.zeros(height, width, 4, device=device) if background is None else background
    layers = layers_of(scene, width, height, device)
    return draw_layers(layers, width, height, None if background is None else background.to(layers.points))
