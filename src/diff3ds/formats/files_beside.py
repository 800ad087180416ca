"""Materials and textures that a mesh file names: read only from the folder of that file, and only up to a size."""

import io
from pathlib import Path


class FilesBeside:
    """Files in the folder of a mesh file, as trimesh asks for them.

    Attributes:
        missing: names that were asked for and are not there, or are no pictures.
    """

    def __init__(self, path: Path, most: int) -> None:
        """Reads nothing yet.

        Args:
            path: the file that names others.
            most: bytes that are read of each.
        """
        self._folder, self._most = path.resolve().parent, most
        self.missing: list[str] = []

    def get(self, name: str) -> bytes:
        """The bytes of a file.

        Paths of other systems and absolute ones, as exporters leave them, mean the file of this name in the folder;
        options before a name, as MTL files have them, are passed over.

        Raises:
            ValueError: there is none within the folder, it is larger than what is read, or it is no picture.
        """
        try:
            return self._read(name.strip().replace("\\", "/"))
        except (OSError, ValueError):
            self.missing.append(name.strip())
            raise

    __getitem__ = get

    def _read(self, name: str) -> bytes:
        from PIL import Image

        for given in (name, name.rsplit("/", 1)[-1], *name.split()[-1:]):
            path = (self._folder / given).resolve()
            if not (given and path.is_relative_to(self._folder) and path.is_file()):
                continue
            if path.stat().st_size > self._most:
                raise ValueError(f"{path}: more than the {self._most} bytes that are read")
            content = path.read_bytes()
            if path.suffix.lower() != ".mtl":
                # trimesh passes over what is no picture without a word.
                Image.open(io.BytesIO(content)).close()
            return content
        raise FileNotFoundError(f"{name} is not in the folder {self._folder}")
