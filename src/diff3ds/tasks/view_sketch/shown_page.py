"""The page of a file or a run as the server gives it: its text, its sketch as it is now, and what saving does."""

import json
from collections.abc import Callable
from pathlib import Path
from threading import Lock

import torch

from diff3ds.formats.scenes.html import sketch_page, start_of
from diff3ds.formats.sketch_json import json_text
from diff3ds.sketch import Sketch
from diff3ds.surfaces.on_page import SurfaceOnPage
from diff3ds.tasks.sketch_input import load_sketch, name_of
from diff3ds.tasks.surface_input import SurfaceInput
from diff3ds.tasks.view_sketch import saving
from diff3ds.tasks.view_sketch.run_folder import told_by
from diff3ds.viewer.page import Served


class ShownPage:
    """The page of a file, made anew when that changes; of a file that has become no sketch, the one before."""

    def __init__(
        self,
        source: Path,
        say: Callable[[str], None],
        surface: SurfaceInput | None = None,
        waits: bool = False,
        beside: "ShownPage | None" = None,
        title: str = "",
        in_studio: bool = False,
    ) -> None:
        self.called, self.in_studio = title, in_studio
        self.source, self.say, self.waits, self.beside = source, say, waits, beside
        self.surface = surface or SurfaceInput(source, None, "z", say)
        self.is_run = waits or source.is_dir()
        self.lock = Lock()
        self.read: tuple[str, Sketch] | None = None
        self.seen = ""
        self.refused = ""

    @property
    def title(self) -> str:
        """What the page calls the sketch."""
        if self.called:
            return self.called
        return self.source.resolve().name if self.is_run else name_of(self.source)

    def version(self) -> str:
        """Says which state of the file the page shows, after a look at it."""
        return self.now()[0]

    def text(self) -> str:
        """The page.

        Raises:
            ValueError, OSError, ImportError: as `now`.
        """
        version, sketch = self.now()
        state, solid = self.solid()
        served = Served(version, state, self.is_run, self.in_studio)
        if self.beside is None:
            return sketch_page(self.title, sketch, served, surface=solid)
        other = self.beside.title, self.beside.now()[1]
        return sketch_page(self.title, sketch, served, other, surface=solid, surface_beside=self.beside.solid()[1])

    def sketch(self) -> str:
        """What a page shows another state of the file by, as JSON."""
        version, sketch = self.now()
        sketches = [sketch] if self.beside is None else [sketch, self.beside.now()[1]]
        state, solid = self.solid()
        solids = [solid] if self.beside is None else [solid, self.beside.solid()[1]]
        start = {**start_of(*sketches, surfaces=solids), "version": version, "page": state}
        bare = json.dumps({} if solid is None else solid.bare_creases(sketch))
        return f'{{"page": "{state}", "start": {json.dumps(start)}, "sketch": {json_text(sketch)}, "bare": {bare}}}'

    def solid(self) -> tuple[str, SurfaceOnPage | None]:
        """Which state of the surface the page shows, and the surface.

        Raises:
            ValueError, OSError, ImportError: as `SurfaceInput.now`.
        """
        with self.lock:
            state, mesh = self.surface.now()
            return state, SurfaceOnPage.of(mesh)

    @property
    def shown(self) -> Path:
        """The file that is shown."""
        return self.source / "sketch.json" if self.is_run else self.source

    def save(self, text: str, loaded: str) -> str:
        """Writes the sketch of a page to the file, and says its name and new version as JSON.

        Raises:
            ChangedError, ValueError, OSError: as `saving.save_over`.
        """
        with self.lock:
            target = saving.save_over(self.shown, text, loaded)
            if target != self.shown:
                self.source = target
            self.say(f"saved {target}")
        return json.dumps({"version": self.now()[0], "name": target.name})

    def run(self) -> str | None:
        """What there is to see of the run, as JSON; None where it is none."""
        return json.dumps(told_by(self.source)) if self.is_run else None

    def now(self) -> tuple[str, Sketch]:
        """The sketch that the page shows, after a look at the file, and which state of it that is.

        Raises:
            ValueError, OSError, ImportError: as `load_sketch`, where there is none from before.
        """
        with self.lock:
            if self.waits and self.read is None and not (self.source / "sketch.json").is_file():
                return "nothing", Sketch(torch.zeros(0, 4, 3))
            try:
                state = self._state()
                if state not in (self.seen, self.refused):
                    version = saving.digest_of(self.shown)
                    sketch = load_sketch(self.source).detach()
                    # A file that changed in between is read at the next look.
                    self.read, self.refused = (version, sketch), ""
                    self.seen = state if self._state() == state else ""
            except (ValueError, OSError, ImportError) as error:
                if self.read is None:
                    raise
                # Once, and not at every question; a file in the middle of being written is another one soon.
                if (state := self._state_or_nothing()) != self.refused:
                    self.refused = state
                    self.say(f"warning: {error}; the page shows what there was")
            assert self.read is not None
            return self.read

    def _state(self) -> str:
        found = self.shown.stat()
        return f"{found.st_mtime_ns}-{found.st_size}"

    def _state_or_nothing(self) -> str:
        try:
            return self._state()
        except OSError:
            return "nothing"
