"""What trying a prior has shown, for people, as a table to send with a report, and for programs."""

import dataclasses
import json

from rich.console import Group
from rich.text import Text

from diff3ds.tasks.doctor.diagnosis import Finding, added, packages_of, software, table
from diff3ds.tasks.doctor.trial import Cost, Trial

MEANING = (
    "Drawings come back from latents: of their variance. Noise is found in them: its error against that of the best "
    "multiple of the noisy picture. A blurred chair is sharpened: the cosine between the pull and the way to the sharp "
    "one. Views agree: the error with the cameras of other views against that with their own."
)
VERDICTS = {True: "sound", False: "NOT SOUND", None: "not known"}


def trial_as_json(trial: Trial) -> str:
    """The trial, its verdict and the software, for programs."""
    about = [dataclasses.asdict(finding) for finding in _software()]
    return json.dumps({**dataclasses.asdict(trial), "sound": trial.sound, "software": about}, indent=1, default=str)


def trial_as_tables(trial: Trial) -> Group:
    """The trial for people, to be printed by rich; 80 columns do."""
    checks = table("check", "found", "wanted", "")
    for check in trial.checks:
        added(checks, check.name, check.found, check.wanted, VERDICTS[check.sound])
    about = table(trial.prior, "")
    for name, value in trial.network.items():
        added(about, name, str(value))
    for name, value in _costs(trial.cost, trial.loading):
        added(about, name, value)
    for finding in _software():
        added(about, finding.name, finding.found or "not here")
    return Group(about, "", checks, "", Text(f"{trial.prior}: {verdict(trial)}"), Text(MEANING))


def verdict(trial: Trial) -> str:
    """The outcome in a sentence."""
    if trial.sound:
        return "this installation is sound"
    bad = [check.name for check in trial.checks if check.sound is False]
    if not bad:
        return "what could be tried is sound, but two minutes were too short for all of it: take a GPU"
    advice = "fetch its weights again, or try --precision float32, and report the table if that does not help"
    return f"not sound, for {len(bad)} of {len(trial.checks)} checks fail: {advice}"


def _costs(cost: Cost, loading: float) -> list[tuple[str, str]]:
    memory = "not known" if cost.memory is None else f"{cost.memory / 1e9:.1f} GB"
    run = f"{cost.steps} steps, about {cost.step * cost.steps / 60:.0f} minutes"
    return [("loaded in", f"{loading:.1f} s"), ("memory", memory), ("step", f"{cost.step:.2f} s"), ("run", run)]


def _software() -> tuple[Finding, ...]:
    return (*software(), *packages_of("diffusion"))
