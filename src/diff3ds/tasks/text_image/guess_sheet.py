"""The guesses of a picture as a picture: each as it would be seen, with the words that say it is right."""

from pathlib import Path
from textwrap import fill

import numpy as np
import torch

from diff3ds._files import existing_folder
from diff3ds._shapes import Float, Tensor
from diff3ds.formats import save_png
from diff3ds.formats.png import as_pillow
from diff3ds.recognition.recognise import Recognition

NAME = "guesses.png"
# Pixels: the side of each small picture, the height of the words under it and of their letters.
SIDE, WORDS, LETTERS = 200, 62, 12
# Letters in a line of words.
LINE = 30


def guess_sheet(found: Recognition) -> Float[Tensor, "H W 1"]:
    """The guesses side by side, the best first."""
    from PIL import Image, ImageDraw, ImageFont

    sheet = Image.new("L", (SIDE * len(found.guesses), SIDE + WORDS), 255)
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(LETTERS)
    for i, guess in enumerate(found.guesses):
        sheet.paste(as_pillow(guess.picture(SIDE)).convert("L"), (i * SIDE, 0))
        words = f"{i + 1}. {guess.confidence:.0%}\n" + fill(f'--shows "{guess.caption}"', LINE)
        pen.multiline_text((i * SIDE + SIDE / 2, SIDE), words, 0, font, "ma", align="center", spacing=1)
    return torch.from_numpy(np.asarray(sheet, np.float32)[..., None] / 255)


def write_guesses(folder: Path, found: Recognition) -> Path:
    """Writes the sheet of the guesses into a folder, which is made if it is not there.

    Raises:
        OSError: it cannot be written.
    """
    existing_folder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    save_png(folder / NAME, guess_sheet(found))
    return folder / NAME
