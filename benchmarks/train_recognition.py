"""Trains the network that recognises drawings, on drawings by people and on made ones.

    python benchmarks/train_recognition.py FOLDER MORE ICONS --out tuned.safetensors
    python benchmarks/train_recognition.py FOLDER MORE ICONS --like tuned.safetensors --out drawings.safetensors

FOLDER and MORE hold drawings by people, WORD.json each, of kinds and of other things, ICONS icons:
docs/reference/recognition.md says from where. The first command keeps those of validation apart and chooses temperature
and threshold on them; the second trains on them as well, and takes both from the first. Neither sees what is the
test's. The network keeps the list of its kinds: nothing changes for it when the library grows. Every word that is no
kind is a class of its own while it learns: it must tell them apart, and "none of the kinds" is what they are together.
"""

import argparse
import math
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from doodles import DOODLES, FOR_TEST, FOR_VALIDATION
from hand_drawn import Drawing, Pool, chimera, cluttered, moved, picture_of, read_drawings, read_nothings, worn
from icons import icon_picture, read_icons
from symbols_wishes import KINDS, SYMBOLS, is_doodle

from diff3ds.recognition.network import AZIMUTHS, ELEVATIONS, DrawingNetwork, Trained, read_network, write_network

# Shares of a batch: drawings by people of kinds and of what is none, members of the library, symbols; the rest is none
# of the kinds. Last: the shares of doodles and of icons in that rest, which has strokes of several drawings too.
PEOPLE, OTHERS, LIBRARY, SYMBOLIC, DOODLED, ICONIC = 0.36, 0.2, 0.22, 0.1, 0.4, 0.4
BATCH, RATE, DECAY, SMOOTHING, OF_POSE = 64, 3e-3, 1e-2, 0.05, 0.25
# Members a kind; pictures of each doodle that validation counts.
MEMBERS, EACH = 60, 10
# Of the drawings that are taken, and of pictures of nothing that are.
MOST_WRONG, MOST_NOTHING = 0.05, 0.04
Batch = tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]


class Examples:
    """Pictures with what they show, by a generator of chance."""

    def __init__(
        self,
        drawings: list[Drawing],
        nothings: list[Drawing],
        words: list[str],
        doodles: list[str],
        icons: list[np.ndarray],
        seed: int,
    ) -> None:
        """Takes what is drawn from; words are the classes after the kinds and after nothing."""
        self.chance = np.random.default_rng(seed)
        self.pool = Pool(MEMBERS, KINDS)
        self.all = drawings
        self.strokes = [line for drawing in drawings for line in drawing.lines if len(line) > 1]
        self.by_kind: dict[str, list[Drawing]] = {}
        for drawing in drawings:
            if drawing.understood is not False:
                self.by_kind.setdefault(drawing.kind, []).append(drawing)
        self.kinds, self.doodles, self.icons, self.nothings = list(self.by_kind), doodles, icons, nothings
        self.places = {word: len(KINDS) + 1 + i for i, word in enumerate(words)}

    def one(self) -> tuple[np.ndarray, int, float, float]:
        """A picture, the place of its class, azimuth and elevation, or NaN."""
        chance, which = self.chance, self.chance.random()
        kind, azimuth, elevation = len(KINDS), math.nan, math.nan
        if which < PEOPLE:
            name = self.kinds[int(chance.integers(len(self.kinds)))]
            drawing = self.by_kind[name][int(chance.integers(len(self.by_kind[name])))]
            lines, kind = self._by_hand(drawing.lines), KINDS.index(name)
        elif which < PEOPLE + OTHERS:
            drawing = self.nothings[int(chance.integers(len(self.nothings)))]
            lines, kind = self._by_hand(drawing.lines), self.places.get(drawing.kind, kind)
        elif which < PEOPLE + OTHERS + LIBRARY:
            seen = self.pool.drawn(chance)
            lines, kind, azimuth, elevation = seen.lines, KINDS.index(seen.kind), seen.azimuth, seen.elevation
        elif which < PEOPLE + OTHERS + LIBRARY + SYMBOLIC:
            name = str(chance.choice(list(SYMBOLS)))
            lines, kind = self._by_hand(SYMBOLS[name](chance)), KINDS.index(name)
        elif (which := chance.random()) < ICONIC:
            icon = self.icons[int(chance.integers(len(self.icons)))]
            return icon_picture(icon, chance), kind, azimuth, elevation
        elif which < ICONIC + DOODLED:
            lines = moved(DOODLES[str(chance.choice(self.doodles))](chance), chance)
        else:
            lines = moved(chimera(self.all, chance), chance)
        if chance.random() < 0.08:
            lines = cluttered(lines, self.strokes, chance)
        return picture_of(lines, chance), kind, azimuth, elevation

    def _by_hand(self, lines: list[np.ndarray]) -> list[np.ndarray]:
        """The lines as another hand draws them, or mirrored."""
        mirror = (-1 if self.chance.random() < 0.5 else 1, 1)
        return worn(moved([line * mirror for line in lines], self.chance), self.chance) or lines

    def batches(self) -> Iterator[Batch]:
        """Batches without end: pictures, kinds, azimuths and elevations."""
        while True:
            pictures, kinds, azimuths, elevations = zip(*(self.one() for _ in range(BATCH)), strict=True)
            yield (torch.from_numpy(np.stack(pictures))[:, None], torch.tensor(kinds),
                   torch.tensor(azimuths), torch.tensor(elevations))  # fmt: skip


def near(angles: torch.Tensor, bins: tuple[float, ...], turn: float) -> torch.Tensor:
    """How much of each angle belongs to which bin, (B, bins): it is shared between the two beside it."""
    apart = angles[:, None] - torch.tensor(bins)
    if turn:
        apart = (apart + turn / 2) % turn - turn / 2
    share = (1 - apart.abs() / (bins[1] - bins[0])).clamp(min=0)
    return share / share.sum(1, keepdim=True).clamp(min=1e-6)


def loss_of(network: DrawingNetwork, batch: Batch) -> torch.Tensor:
    """Cross entropies of kind and, where it is known, of the pose."""
    pictures, kinds, azimuths, elevations = batch
    with torch.autocast("cpu", torch.bfloat16):
        kind, azimuth, elevation = network(pictures.to(memory_format=torch.channels_last))
    loss = torch.nn.functional.cross_entropy(kind.float(), kinds, label_smoothing=SMOOTHING)
    known = ~azimuths.isnan()
    if known.any():
        a = near(azimuths[known], AZIMUTHS, 360.0)
        e = near(elevations[known].clamp(max=ELEVATIONS[-1]), ELEVATIONS, 0.0)
        entropies = (a * azimuth[known].float().log_softmax(1)).sum(1) + (
            e * elevation[known].float().log_softmax(1)
        ).sum(1)
        loss = loss - OF_POSE * entropies.sum() / len(kinds) / LIBRARY
    return loss


def validation(
    drawings: list[Drawing], nothings: list[Drawing], icons: list[np.ndarray], seed: int
) -> tuple[torch.Tensor, torch.Tensor]:
    """Pictures and places of kinds: drawings as they are, doodles, strokes of several drawings, and icons."""
    chance = np.random.default_rng(seed)
    pictures = [picture_of(drawing.lines) for drawing in drawings]
    kinds = [KINDS.index(drawing.kind) for drawing in drawings]
    names = [name for name in FOR_VALIDATION if is_doodle(name, KINDS)]
    nothing = [moved(DOODLES[name](chance), chance) for name in names for _ in range(EACH)]
    nothing += [moved(chimera(drawings, chance), chance) for _ in range(len(nothing) // 3)]
    pictures += [picture_of(lines) for lines in nothing]
    pictures += [icon_picture(icon, chance) for icon in icons[:: max(1, len(icons) // len(nothing))]]
    pictures += [picture_of(drawing.lines) for drawing in nothings[:: max(1, len(nothings) // len(nothing))]]
    return torch.from_numpy(np.stack(pictures))[:, None], torch.tensor(
        kinds + [len(KINDS)] * (len(pictures) - len(kinds))
    )


def calibrated(logits: torch.Tensor, kinds: torch.Tensor) -> float:
    """The temperature at which the right kinds are most likely."""
    temperatures = torch.linspace(0.3, 3.0, 109)
    losses = [torch.nn.functional.cross_entropy(logits / t, kinds) for t in temperatures]
    return float(temperatures[int(torch.stack(losses).argmin())])


def thresholds(logits: torch.Tensor, kinds: torch.Tensor, understood: torch.Tensor) -> list[tuple[float, ...]]:
    """Of each threshold: shares of understood drawings taken, of these wrong, and of what is nothing taken."""
    sure, best = logits.softmax(1)[:, :-1].max(1)
    rows = []
    for threshold in torch.arange(0.3, 0.96, 0.02).tolist():
        taken = sure >= threshold
        both = taken & understood
        wrong = (best != kinds)[both].float().mean().nan_to_num()
        nothing = taken[kinds == len(KINDS)].float().mean()
        rows.append((threshold, *(float(share) for share in (taken[understood].float().mean(), wrong, nothing))))
    return rows


def chosen_threshold(rows: list[tuple[float, ...]]) -> float:
    """The least at which few are wrong; the one with the fewest, if there is none."""
    good = [row[0] for row in rows if row[2] <= MOST_WRONG and row[3] <= MOST_NOTHING]
    return min(good) if good else max(rows, key=lambda row: row[0])[0]


def counted(logits: torch.Tensor, kinds: torch.Tensor, understood: torch.Tensor) -> None:
    """Prints shares on the drawings, and what thresholds let through."""
    order = logits[:, :-1].argsort(1, descending=True)
    right = order[:, :3] == kinds[:, None]
    for name, which in (("all", kinds < len(KINDS)), ("understood", understood)):
        first, three = right[which, 0].float().mean(), right[which].any(1).float().mean()
        print(f"  {name}: first {first:.3f} three {three:.3f}", end=";")
    rows = thresholds(logits, kinds, understood)
    print(f" threshold {chosen_threshold(rows):.2f}")
    for threshold, taken, wrong, nothing in rows[5::5]:
        print(f"  {threshold:.2f}: taken {taken:.3f} wrong {wrong:.3f} nothing {nothing:.3f}", flush=True)


def train(chosen: argparse.Namespace) -> None:
    """Trains and writes the network."""
    torch.manual_seed(chosen.seed)
    parts, more, nothings = read_drawings(chosen.folder), read_drawings(chosen.more), read_nothings(chosen.more)
    parts = {part: drawings + more[part] for part, drawings in parts.items()}
    # Without validation nothing is chosen, but taken from a network that was trained with it.
    kept, used = ((), ("train", "validation")) if chosen.like else (FOR_VALIDATION, ("train",))
    doodles = [name for name in DOODLES if name not in (*FOR_TEST, *kept) and is_doodle(name, KINDS)]
    icons = read_icons(chosen.icons, KINDS)
    drawings, others, signs = ([x for part in used for x in all_of[part]] for all_of in (parts, nothings, icons))
    words = sorted({drawing.kind for drawing in nothings["train"]})
    examples = Examples(drawings, others, words, doodles, signs, chosen.seed)
    pictures, kinds = validation(parts["validation"], nothings["validation"], icons["validation"], chosen.seed + 1)
    understood = torch.zeros(len(kinds), dtype=torch.bool)
    understood[: len(parts["validation"])] = torch.tensor([d.understood is True for d in parts["validation"]])
    network = DrawingNetwork(len(KINDS) + 1 + len(words)).to(memory_format=torch.channels_last)
    if chosen.start:
        network.load_state_dict(read_network(chosen.start).network.state_dict())
    optimizer = torch.optim.AdamW(network.parameters(), RATE, weight_decay=DECAY)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, RATE, total_steps=chosen.steps, pct_start=0.15)
    trained = Trained(network, KINDS, 1.0, 1.0)
    for step, batch in zip(range(1, chosen.steps + 1), examples.batches(), strict=False):
        network.train()
        loss = loss_of(network, batch)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
        if step % chosen.every == 0 or step == chosen.steps:
            network.eval()
            logits = trained.logits(pictures)[0]
            temperature = calibrated(logits, kinds)
            logits = logits / temperature
            trained = Trained(network, KINDS, temperature, chosen_threshold(thresholds(logits, kinds, understood)))
            print(f"step {step}: {time.process_time():.0f} s, loss {loss.item():.3f}, temperature {temperature:.2f}")
            counted(logits, kinds, understood)
            if chosen.like:
                # Read now: it may have been trained meanwhile.
                like = read_network(chosen.like)
                trained = Trained(network, KINDS, like.temperature, like.threshold)
            write_network(chosen.out, trained, {"seed": chosen.seed, "steps": step, "drawings": len(drawings)})


def main() -> None:
    """Reads the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("more", type=Path)
    parser.add_argument("icons", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument(
        "--like", type=Path, help="weights of the first command, whose temperature and threshold are taken"
    )
    parser.add_argument("--start", type=Path, help="weights to go on from, instead of none")
    parser.add_argument("--steps", type=int, default=9000)
    parser.add_argument("--every", type=int, default=1000, help="steps between counts")
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    train(chosen)


if __name__ == "__main__":
    main()
