"""Moving pictures: frames to WebP and GIF by Pillow, to MP4 by PyAV (the extra `video`)."""

import importlib.util
import io
import itertools
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from diff3ds._files import replacing, write_bytes
from diff3ds._shapes import Float, Tensor
from diff3ds.formats.png import as_pillow

# x264's measure of quality: 18 looks like the original. [its authors' advice]
QUALITY = 18


def save_movie(path: str | Path, frames: Iterable[Float[Tensor, "H W C"]], count: int, fps: int) -> None:
    """Writes a film that is played over and over (WebP, GIF) or once (MP4), whole or not at all.

    Args:
        frames: pictures of one size, RGB or (for WebP) straight RGBA in [0, 1]; they are taken one by one.
        count: how many there are.
        fps: frames a second. A GIF counts hundredths of seconds: its frames are a hundredth longer or shorter.

    Raises:
        ImportError: an MP4 file, and the extra `video` is not installed.
        ValueError: another suffix; for MP4 a size that is not even.
        OSError: the file cannot be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".mp4":
        _save_mp4(path, frames, fps)
        return
    if suffix not in (".webp", ".gif"):
        raise ValueError(f"{path}: cannot save a film as {suffix!r}, only as .mp4, .webp, .gif")
    pictures = map(as_pillow, frames)
    # From the start of a frame to that of the next, rounded so that the whole has the right length.
    unit = 10 if suffix == ".gif" else 1
    starts = [round(1000 * i / fps / unit) * unit for i in range(count + 1)]
    durations = [stop - start for start, stop in itertools.pairwise(starts)]
    options: dict[str, Any] = {"lossless": True, "minimize_size": False} if suffix == ".webp" else {"disposal": 1}
    file = io.BytesIO()
    next(pictures).save(
        file, suffix[1:].upper(), save_all=True, append_images=pictures, duration=durations, loop=0, **options
    )
    write_bytes(path, file.getvalue())


def _save_mp4(path: Path, frames: Iterable[Tensor], fps: int) -> None:
    """H.264 with 4:2:0 colours, which every player shows."""
    if importlib.util.find_spec("av") is None:
        raise ImportError(
            f"{path}: writing MP4 takes PyAV: install it with pip install 'diff3ds[video]', or write a .webp or .gif"
        )
    import av

    with replacing(path) as temporary, av.open(str(temporary), "w", format="mp4") as container:
        stream: Any = None
        for frame in frames:
            height, width = frame.shape[:2]
            if stream is None:
                if height % 2 or width % 2:
                    raise ValueError(f"{path}: MP4 has even sizes only, got {width}x{height}")
                stream = container.add_stream("libx264", rate=Fraction(fps), options={"crf": str(QUALITY)})
                stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.asarray(as_pillow(frame)), "rgb24")))
        if stream is not None:
            container.mux(stream.encode())
