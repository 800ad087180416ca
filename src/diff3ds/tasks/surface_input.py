"""The surface that hides lines of a sketch on a page: of a file that is named, or of the folder of a run."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal

from diff3ds.surfaces.on_page import SurfaceOnPage
from diff3ds.surfaces.shape.load_surface import load_surface
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.results import SURFACE


class SurfaceInput:
    """A surface that is read anew when its file changes."""

    def __init__(self, source: Path, named: Path | None, up: Literal["y", "z"], say: Callable[[str], None]) -> None:
        """Reads nothing yet.

        Args:
            source: the sketch: where it is the folder of a run, its surface is taken.
            named: a file that is taken instead.
            up: the axis that points up in it.
            say: told what is wrong with the surface of a run: one wants to see its sketch all the same.
        """
        self._path = source / SURFACE if named is None else named
        self._may_lack, self._up, self._say = named is None, up, say
        self._seen = "unseen"
        self._read: TriangleMesh | None = None

    def now(self) -> tuple[str, TriangleMesh | None]:
        """Says which state of the file it is, and the surface; None where there is none.

        Raises:
            ValueError, OSError, ImportError: a file that is named is no surface that a page takes, and never was.
        """
        state = self._state()
        if state != self._seen:
            self._seen = state
            try:
                self._read = self._loaded()
            except (ValueError, OSError, ImportError) as error:
                if not self._may_lack and self._read is None:
                    raise
                shown = "no surface" if self._read is None else "the surface of before"
                self._say(f"warning: {error}; the page shows {shown}")
        return self._seen, self._read

    def _loaded(self) -> TriangleMesh | None:
        if self._may_lack and not self._path.exists():
            return None
        surface = load_surface(self._path, up=self._up)
        return SurfaceOnPage(surface).mesh

    def _state(self) -> str:
        try:
            found = self._path.stat()
        except OSError:
            return "nothing"
        return f"{found.st_mtime_ns}-{found.st_size}"
