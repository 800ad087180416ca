"""Options of `diff3ds views` and of its recipe 3doodle."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args

from tyro.conf import arg

from diff3ds._settings import check_level, check_seed, require_finite
from diff3ds.photogrammetry.scale_options import check_scale
from diff3ds.pictures.picture_options import Masks, Target, parse_color, parse_color_or_path
from diff3ds.tasks.render.page_options import NO_PAGE, PageOptions

Init = Literal["carve", "random"]
# Which way is up in the sketch: as photographs were held, or as cameras have it.
Up = Literal["keep", "auto"]
# Where curves of edges are looked for.
Bound = Literal["auto", "none"]
# What finds edges in coloured pictures: the gradient of their colours, or a network.
Detector = Literal["gradients", "hed"]
# [px] Size of pictures.
SIZE = 512
# Of the distance of VGG16 that 3Doodle fits in; `diff3ds.metrics.vgg_distance` says what they are.
Variant = Literal["3doodle", "standard"]


@dataclass(frozen=True)
class ViewsOptions:
    """Options of `diff3ds views`.

    Attributes:
        target: edges (edge maps, line drawings), color, or color-edges (the edges of coloured pictures); edges or color
            is found by itself if not given.
        edges: a folder with an edge map of each picture, white on black or black on white, by the pictures' names: of a
            detector that you have run. Edges are taken from there.
        detector: what finds edges in coloured pictures: the gradients of their colours, or hed, a network that draws as
            people do, whose maps are kept in the folder edges_hed of the results.
        init: where edges start: carve (curves through 3D points on which the views agree), or random curves.
        strokes: so many strokes at most. Of a coloured sketch by default as many, from 64 to 1024, as its details need;
            of edges the most important ones, by default all; random curves for edges, by default 128.
        detail: from 0 (one stroke) to 1 (all): the most important strokes alone, of which there are the more the
            higher it is.
        steps: gradient steps from random curves or for colour; by default 1200.
        batch: views of such a step; by default 10 for edges, 5 for colour.
        background: what lies behind the object in coloured pictures: white, black or R,G,B, each from 0 to 1; a
            picture, scaled to each view; or a folder with each view without the object, by the file names of the
            pictures. By default alpha says where nothing is, or else the colour that nearly all of the borders have.
        masks: what the black pixels of a mask_path are: ignore leaves them out of the loss and the scores, as
            nerfstudio does; object takes them for background, so that masks cut the object out.
        cut_out: have rembg's network find the object in each photograph, whatever is around it; its masks are kept in
            the folder masks_rembg of the results.
        refine_cameras: cameras are moved, and focal lengths scaled by one factor, until the edges of all pictures
            agree best. Those that were found from photographs, here or by "diff3ds cameras", always are.
        keep_cameras: not even those are moved.
        bound: edges: auto looks for curves where most cameras look, by the points of the reconstruction that found the
            cameras, where pictures show surroundings all over; none looks wherever pictures show something.
        up: auto turns the sketch so that z points up, as the photographs were held, and along its own lines where these
            follow axes; keep leaves it in the world of the cameras.
        scale: with --between, a distance in units of yours, such as millimetres.
        between: what lies so far apart: two cameras by the names of their pictures, two points as X,Y,Z, or two corners
            of printed ArUco markers as aruco:7:0 (marker 7, corner 0 to 3).
        contours: the pictures' silhouettes, alpha or what the outlines of drawings close in, give a coarse surface as
            well, surface.glb, which hides lines and has contours: in the preview, and with "diff3ds render --hidden".
        size: larger pictures are reduced to this many pixels along the longer side; by default 512, and with --target
            color-edges and gradients more where there are fewer than 22 pictures, up to 1024 of 11 and fewer.
        start: a sketch to go on from (a file, or the folder of a run), in the world of the cameras, by a gradient
            descent alone. Strokes keep their number; those that are marked as fixed stay as they are.
        seed: of all random draws.
        page: that the views of sketch.svg and preview.png lie on.
        resume: go on from the checkpoint in the output folder, if there is one.
        overwrite: the run in the output folder may be lost.
    """

    target: Target | None = None
    edges: Path | None = None
    detector: Detector = "gradients"
    init: Init = "carve"
    strokes: int | None = None
    detail: float = 1.0
    steps: int | None = None
    batch: int | None = None
    background: str | None = None
    masks: Masks = "ignore"
    cut_out: bool = False
    refine_cameras: bool = False
    keep_cameras: bool = False
    bound: Bound = "auto"
    up: Up = "keep"
    scale: float | None = None
    between: tuple[str, str] | None = None
    contours: bool = False
    size: int | None = None
    start: Annotated[Path | None, arg(name="from")] = None
    seed: int = 0
    page: PageOptions = NO_PAGE
    resume: bool = False
    overwrite: bool = False

    def __post_init__(self) -> None:
        self.page.check_previews()
        if self.edges is not None and self.target not in (None, "edges"):
            raise ValueError(f"--edges gives edge maps, for --target edges: leave --target {self.target} out")
        if self.detector == "hed" and (self.edges is not None or self.target not in (None, "color-edges")):
            given = "--edges" if self.edges is not None else f"--target {self.target}"
            raise ValueError(f"--detector hed finds the edges of coloured pictures: leave {given} out")
        if self.cut_out and (self.background is not None or self.masks == "object"):
            given = f"--background {self.background}" if self.background is not None else "--masks object"
            raise ValueError(f"--cut-out or {given}? Each tells where the object is: give one of them")
        if self.cut_out and self.pictures == "edges":
            raise ValueError(
                "--cut-out finds objects in photographs, and --target edges is line drawings: leave it out"
            )
        if self.refine_cameras and self.keep_cameras:
            raise ValueError("--refine-cameras or --keep-cameras? Give one of them")
        require_finite(self)
        check_scale(self.scale, self.between)
        if self.start is not None and (self.up == "auto" or self.scale is not None):
            raise ValueError("--from goes on in the world of its sketch: leave --up and --scale out")
        check_level(self.detail, None)
        if self.start is not None and (self.strokes is not None or self.init == "random" or self.detail < 1):
            given = "--strokes" if self.strokes is not None else "--detail" if self.detail < 1 else "--init random"
            raise ValueError(f"--from gives the strokes, as they are: leave {given} out")
        for name in ("strokes", "steps", "batch", "size"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ValueError(f"{name} must be positive, got {value}")
        check_seed(self.seed)
        if self.background is not None:
            parse_color_or_path(self.background)

    @property
    def pictures(self) -> Target | None:
        """What the pictures of the project are, from which edge maps may be apart."""
        return self.target if self.edges is None and self.detector == "gradients" else "color"

    @property
    def longest(self) -> int:
        """Pixels along the longer side of the pictures, at most."""
        return self.size or SIZE

    def refining(self, target: Target, estimated: bool) -> bool:
        """Whether cameras are moved.

        Args:
            target: what the pictures are.
            estimated: whether their cameras were found from photographs.
        """
        looked_for = (target == "color" or self.init == "carve") and self.start is None
        return self.refine_cameras or (estimated and looked_for and not self.keep_cameras)

    def unused(self, target: Target) -> list[str]:
        """Lists the options that were given and change nothing for pictures of this target: `--steps 500`."""
        if target == "color":
            unmoved = self.refine_cameras and self.start is not None
            given = {"--init random": self.init == "random", "--refine-cameras": unmoved}
            return [option for option, chosen in given.items() if chosen]
        descends = self.init == "random" or self.start is not None
        without = ["background", *([] if descends else ["steps", "batch"])]
        unused = [f"--{name} {getattr(self, name)}" for name in without if getattr(self, name) is not None]
        return [*unused, "--refine-cameras"] if self.refine_cameras and descends else unused


@dataclass(frozen=True)
class DoodleOptions:
    """Options of `diff3ds views --recipe 3doodle`. The defaults are those that 3Doodle published for its curves.

    Attributes:
        clip_rn101: weights of CLIP's RN101 by OpenAI's names: a safetensors file, or a folder or repository of the hub
            with open_clip_model.safetensors.
        vgg16: weights of torchvision's VGG16: a safetensors file, or a folder or repository with model.safetensors.
        vgg: 3doodle, whose code has ImageNet's mean and deviation exchanged; or standard.
        clip_weight: of 1 - cosine of CLIP's embeddings.
        vgg_weight: of the distance of VGG16's features.
        augmentations: random warps of both images that are compared beside the images themselves.
        strokes: black cubics.
        steps: gradient steps.
        batch: views a step.
        size: larger pictures are reduced to this many pixels along the longer side.
        width: of the strokes, pixels of the reduced pictures.
        rate: learning rate of control points, in radii of the scene a step.
        background: what lies behind the object in pictures without alpha: white, black or R,G,B, each from 0 to 1.
        masks: what the black pixels of a mask_path are: ignore leaves them out of the loss, as nerfstudio does; object
            takes them for background, so that masks cut the object out.
        device: of the networks: cpu, cuda, mps, or auto.
        allow_pickle: these files of weights are read although they are pickles, which can run code of whoever made
            them; only their tensors are.
        seed: of all random draws.
        page: that the views of sketch.svg and preview.png lie on.
        resume: go on from the checkpoint in the output folder.
        overwrite: the run in the output folder may be lost.
    """

    clip_rn101: str = "timm/resnet101_clip.openai"
    vgg16: str = "timm/vgg16.tv_in1k"
    vgg: Variant = "3doodle"
    clip_weight: float = 75.0
    vgg_weight: float = 1.0
    augmentations: int = 4
    strokes: int = 32
    steps: int = 20_000
    batch: int = 1
    size: int = 400
    width: float = 3.0
    rate: float = 0.001
    background: str | None = None
    masks: Masks = "ignore"
    device: str = "auto"
    allow_pickle: tuple[Path, ...] = ()
    seed: int = 0
    page: PageOptions = NO_PAGE
    resume: bool = False
    overwrite: bool = False

    def __post_init__(self) -> None:
        self.page.check_previews()
        require_finite(self)
        for name in ("strokes", "steps", "batch", "size", "width", "rate"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")
        if self.augmentations < 0:
            raise ValueError(f"augmentations must not be negative, got {self.augmentations}")
        if not (min(self.clip_weight, self.vgg_weight) >= 0 < max(self.clip_weight, self.vgg_weight)):
            raise ValueError("clip_weight and vgg_weight must not be negative, and one of them positive")
        if self.vgg not in get_args(Variant):
            raise ValueError(f"vgg must be one of {', '.join(get_args(Variant))}, got {self.vgg!r}")
        if self.background is not None:
            parse_color(self.background)
