"""Materials, textures and buffers that a mesh file names: read only from its own folder, and only up to a size."""

from pathlib import Path
from urllib.parse import unquote


class FilesBeside:
    """Files in the folder of a mesh file, and below it.

    Attributes:
        missing: names that were asked for and are not there.
    """

    def __init__(self, path: Path, most: int) -> None:
        """Reads nothing yet.

        Args:
            path: the file that names others.
            most: bytes that are read of each.
        """
        self._folder, self._most = path.resolve().parent, most
        self.missing: list[str] = []

    def find(self, name: str) -> bytes | None:
        """The bytes of a file that is named as programs of any system leave names; None where there is none.

        Paths of other systems and absolute ones mean the file of this name in the folder; capitals do not count where
        no file has the very name.

        Raises:
            ValueError: it is larger than what is read.
        """
        plain = name.strip().strip('"').replace("\\", "/")
        for given in (plain, plain.rsplit("/", 1)[-1]):
            path = self._inside(given)
            if path is not None:
                return self._read(path)
        self.missing.append(name.strip())
        return None

    def at(self, uri: str) -> bytes:
        """The bytes of a file at a relative URI, as glTF has them.

        Raises:
            ValueError: it leaves the folder or goes to another machine, there is no such file, or it is larger than
                what is read.
        """
        name = unquote(uri)
        if ":" in name.split("/")[0] or name.startswith(("/", "\\")) or ".." in name.replace("\\", "/").split("/"):
            raise ValueError(f"{uri[:200]!r} is not in its folder: only files beside it, or in folders there, are read")
        path = self._inside(name) or self._inside(uri)
        if path is None:
            raise ValueError(f"{uri[:200]!r} is not beside it")
        return self._read(path)

    def _inside(self, name: str) -> Path | None:
        """The file of this name in the folder or below, whatever its capitals."""
        path = self._folder
        try:
            for part in name.split("/"):
                there = path / part
                if not there.exists():
                    there = next((p for p in sorted(path.iterdir()) if p.name.lower() == part.lower()), there)
                path = there
            path = path.resolve()
            return path if path.is_relative_to(self._folder) and path.is_file() else None
        # Names that no file can have.
        except (OSError, ValueError):
            return None

    def _read(self, path: Path) -> bytes:
        if path.stat().st_size > self._most:
            raise ValueError(f"{path.name} has more than the {self._most} bytes that are read")
        return path.read_bytes()
