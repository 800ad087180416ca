"""Finds cameras with pycolmap in a process of its own: `python colmap_process.py JOB.json` answers in lines of JSON.

A process of its own, because pycolmap damages the memory of libraries that are loaded beside it (Pillow writes PNG
files with a crash then), and because what it does in C++ cannot be interrupted. It imports nothing of the package.
"""

import contextlib
import json
import os
import sys
from pathlib import Path
from typing import Any

# Pictures, and pairs of them, that are worked on between two reports.
PICTURES, PAIRS = 4, 50


def main(job_file: str) -> None:
    """Prints {"stage", "done", "total"} as it goes on, at last {"models": [...]} or {"error": message}."""
    # The library reports to both outputs: the answer goes to the real one, all else to the error output.
    answer = os.fdopen(os.dup(1), "w", encoding="utf-8", buffering=1)
    os.dup2(2, 1)

    def tell(**what: Any) -> None:
        answer.write(json.dumps(what) + "\n")

    try:
        tell(models=_found(json.loads(Path(job_file).read_text(encoding="utf-8")), tell))
    # The library's exceptions have no common class but this.
    except Exception as error:
        tell(error=str(error).strip() or type(error).__name__)


def _found(job: dict[str, Any], tell: Any) -> list[dict[str, Any]]:
    import pycolmap

    database, pictures, out = job["database"], job["pictures"], Path(job["out"])
    extract = pycolmap.FeatureExtractionOptions()
    extract.use_gpu, extract.num_threads, extract.sift.max_num_features = False, job["threads"], job["features"]
    reader = pycolmap.ImageReaderOptions()
    reader.camera_model = job["camera_model"]
    if job["parameters"]:
        reader.camera_params = ",".join(map(str, job["parameters"]))
    if job["masks"]:
        reader.mask_path = job["masks"]
    mode = pycolmap.CameraMode.SINGLE if job["one_camera"] else pycolmap.CameraMode.PER_IMAGE
    names = job["names"]
    tell(stage="features", done=0, total=len(names))
    # Threads end in another order each time, and pictures have numbers in that order unless they have them before.
    pycolmap.Database.open(database).close()
    pycolmap.import_images(database, pictures, mode, names, reader)
    for first in range(0, len(names), PICTURES):
        pycolmap.extract_features(database, pictures, names[first : first + PICTURES], mode, reader, extract)
        tell(stage="features", done=min(first + PICTURES, len(names)), total=len(names))
    match = pycolmap.FeatureMatchingOptions()
    match.use_gpu, match.num_threads = False, job["threads"]
    # Else it draws other samples each time.
    verify = pycolmap.TwoViewGeometryOptions()
    verify.ransac.random_seed = 0
    pairs, listed = job["pairs"], out / "pairs.txt"
    tell(stage="matches", done=0, total=len(pairs))
    for first in range(0, len(pairs), PAIRS):
        listed.write_text("".join(f"{a} {b}\n" for a, b in pairs[first : first + PAIRS]), encoding="utf-8")
        imported = pycolmap.ImportedPairingOptions()
        imported.match_list_path = str(listed)
        pycolmap.match_image_pairs(database, match, imported, verify)
        tell(stage="matches", done=min(first + PAIRS, len(pairs)), total=len(pairs))
    options = pycolmap.IncrementalPipelineOptions()
    # In one thread: several add up in another order.
    options.num_threads, options.min_model_size, options.random_seed = 1, 3, 0
    options.mapper.num_threads, options.mapper.random_seed = 1, 0
    options.ba_global_frames_ratio = options.ba_global_points_ratio = job["again"]
    placed = 0

    def one_more() -> None:
        nonlocal placed
        placed = min(placed + 1, len(names))
        tell(stage="cameras", done=placed, total=len(names))

    tell(stage="cameras", done=0, total=len(names))
    models = pycolmap.incremental_mapping(database, pictures, out, options, next_image_callback=one_more)
    found = []
    for number, model in models.items():
        folder = out / f"model-{number}"
        with contextlib.suppress(FileExistsError):
            folder.mkdir()
        model.write_text(str(folder))
        error = model.compute_mean_reprojection_error()
        found.append({"folder": str(folder), "registered": model.num_reg_images(), "reprojection_error": error})
    return found


if __name__ == "__main__":
    main(sys.argv[1])
