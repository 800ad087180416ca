"""Files of jobs: what is read from them, and what is refused before anything runs."""

import csv
import io
import json
from pathlib import Path

import pytest

from diff3ds.tasks.batch.batch_options import BatchOptions
from diff3ds.tasks.batch.claims import Claims, Outcome
from diff3ds.tasks.batch.job_file import read_jobs
from diff3ds.tasks.batch.machine import places
from diff3ds.tasks.batch.summary import JobState, states_of, write_summary


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def lines(folder: Path, *jobs: dict) -> Path:
    return written(folder, "jobs.jsonl", "\n".join(map(json.dumps, jobs)))


def test_one_job_in_three_formats_is_the_same_job(tmp_path):
    toml = """
        [defaults]
        command = "text"
        t_high = [0.9, 0.4]
        [[jobs]]
        phrase = "a chair"
        steps = 20
        no-such = 1
    """.replace("no-such = 1", "redraw = false")
    line = {"command": "text", "phrase": "a chair", "steps": 20, "t-high": [0.9, 0.4], "redraw": False}
    cells = 'command,phrase,steps,t_high,redraw,seed\ntext,"a chair",20,0.9 0.4,false,\n\n'
    (first,) = read_jobs(written(tmp_path, "jobs.toml", toml))
    (second,) = read_jobs(lines(tmp_path, line))
    (third,) = read_jobs(written(tmp_path, "jobs.csv", cells))
    assert first == second == third
    assert first.name.startswith("a_chair-")
    assert first.options == {"phrase": "a chair", "steps": 20, "t_high": [0.9, 0.4], "redraw": False}


PHRASE = 'a chair; with "arms",\nand a high back'


def spreadsheet(separator: str, decimal: str = ".", end: str = "\n", empty: int = 1) -> str:
    """A job as a program of tables writes it: in quotes what has separators, quotes or line ends in it."""
    out = io.StringIO()
    writer = csv.writer(out, delimiter=separator, lineterminator=end)
    writer.writerow(["command", "phrase", "t_high", "rate", "seed"])
    writer.writerow(["text", PHRASE, f"0{decimal}9 0{decimal}4", f"0{decimal}02"] + [""] * empty)
    writer.writerow([""] * empty)
    return out.getvalue()


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        (spreadsheet(","), "utf-8"),
        (spreadsheet(";", ",", "\r\n"), "utf-8-sig"),
        (spreadsheet("\t", ",", "\r\n"), "utf-16"),
        ("sep=,\n" + spreadsheet(",", ","), "utf-8"),
        ('"sep=;"\r\n' + spreadsheet(";", end="\r\n"), "utf-8-sig"),
        ("sep=|\n" + spreadsheet("|", ","), "utf-8"),
        (spreadsheet(";", ",", empty=4), "utf-8"),
        # As Excel does after a while where the last columns are empty.
        (spreadsheet(",", empty=0), "utf-8"),
    ],
)
def test_tables_of_spreadsheets_are_read_as_they_write_them(text, encoding, tmp_path):
    (tmp_path / "jobs.csv").write_bytes(text.encode(encoding))
    (job,) = read_jobs(tmp_path / "jobs.csv")
    assert job.options == {"phrase": PHRASE, "t_high": [0.9, 0.4], "rate": 0.02}


def test_colours_keep_their_commas(tmp_path):
    (tmp_path / "views").mkdir()
    for cells in (
        "command;source;background\nviews;views;0.5,0.5,0.5\n",
        'command,source,background\nviews,views,"1,0,0"',
    ):
        (job,) = read_jobs(written(tmp_path, "jobs.csv", cells))
        assert job.options["background"].count(",") == 2


def test_tables_in_the_letters_of_one_country_are_refused(tmp_path):
    (tmp_path / "jobs.csv").write_bytes("command;picture\nimage;Stühle/*.png\n".encode("cp1252"))
    with pytest.raises(ValueError, match=r"jobs\.csv: not a text file \(UTF-8\); .* take CSV UTF-8"):
        read_jobs(tmp_path / "jobs.csv")


def test_a_default_that_a_command_does_not_take_is_told_as_such(tmp_path):
    (tmp_path / "a.stl").touch()
    jobs = '\n[[jobs]]\ncommand = "text"\nphrase = "a chair"\n[[jobs]]\ncommand = "mesh"\nsource = "a.stl"\n'
    for default, said in (
        (
            'prior = "exemplar"',
            r"jobs\.toml, \[defaults\]: mesh has no option 'prior'.* Give prior to the jobs",
        ),
        ("strokes = 0", r"jobs\.toml, \[defaults\]: .*strokes must be"),
        ("size = 1.5", r"jobs\.toml, \[defaults\]: size must be"),
    ):
        with pytest.raises(ValueError, match=said):
            read_jobs(written(tmp_path, "jobs.toml", f"[defaults]\n{default}{jobs}"))
    # The job's own are the job's.
    with pytest.raises(ValueError, match=r"jobs\.toml, job 2: .*option 'prior'"):
        read_jobs(written(tmp_path, "jobs.toml", f'[defaults]\nstrokes = 9{jobs}prior = "exemplar"\n'))


def test_sweeps_are_all_combinations_and_names_say_settings(tmp_path):
    job = {"command": "text", "phrase": "a chair", "sweep": {"seed": [0, 1, 2], "strokes": [8, 16]}}
    jobs = read_jobs(lines(tmp_path, job))
    assert [(j.options["seed"], j.options["strokes"]) for j in jobs] == [(s, n) for s in (0, 1, 2) for n in (8, 16)]
    assert len({j.name for j in jobs}) == 6
    # The same settings have the same folder, whatever stands around them.
    (alone,) = read_jobs(lines(tmp_path, {"phrase": "a chair", "strokes": 16, "seed": 1, "command": "text"}))
    assert alone.name == jobs[3].name


def test_patterns_are_a_job_a_file_unless_they_are_a_file(tmp_path):
    for name in ("b.stl", "a.stl", "sub/c.stl", "[x].stl"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    path = lines(tmp_path, {"command": "mesh", "source": "?.stl", "method": "plain"})
    assert [j.options["source"] for j in read_jobs(path)] == ["a.stl", "b.stl"]
    assert all(j.name.startswith("plain/") for j in read_jobs(path))
    path = lines(tmp_path, {"command": "mesh", "source": "**/*.stl"})
    assert len(read_jobs(path)) == 4
    path = lines(tmp_path, {"command": "mesh", "source": "[x].stl"})
    assert [j.options["source"] for j in read_jobs(path)] == ["[x].stl"]


REFUSED = {
    "command must be one of text, image, views, mesh, points, got 'paint'": {"command": "paint"},
    "text needs a phrase, got None": {"command": "text"},
    "text has no option 'stepz'": {"command": "text", "phrase": "a chair", "stepz": 3},
    "steps must be": {"command": "text", "phrase": "a chair", "steps": 0},
    "steps must be a whole number or None, got '9'": {"command": "text", "phrase": "a chair", "steps": "9"},
    "prior must be": {"command": "text", "phrase": "a chair", "prior": "exemplary"},
    "does not know 'zorblax'": {"command": "text", "phrase": "a zorblax", "prior": "exemplar"},
    "resume is for the batch": {"command": "text", "phrase": "a chair", "resume": True},
    "no such file": {"command": "mesh", "source": "missing.stl"},
    "no file fits": {"command": "mesh", "source": "*.stl"},
    "seed is both given and swept": {"command": "text", "phrase": "a chair", "seed": 1, "sweep": {"seed": [1]}},
    "a list of values": {"command": "text", "phrase": "a chair", "sweep": {"seed": 4}},
    "command must be one of text, image, views, mesh, points, got ['text']": {"command": ["text"]},
    "final_rate is given twice, with - and with _": {"command": "text", "final-rate": 0.1, "final_rate": 0.2},
    "t_low is given twice": {"command": "text", "phrase": "a chair", "sweep": {"t-low": [0.1], "t_low": [0.2]}},
    "method 'attempts' is what the batch writes": {"command": "text", "phrase": "a chair", "method": "attempts"},
    "method 'Summary.csv' is what the batch": {"command": "text", "phrase": "a chair", "method": "Summary.csv"},
    "method names a folder": {"command": "text", "phrase": "a chair", "method": "../up"},
    "must lie in width_range": {"command": "text", "phrase": "a chair", "optimize": ["width"], "width": 0.5},
}


@pytest.mark.parametrize("said", REFUSED)
def test_what_is_wrong_is_said_with_its_place_before_anything_runs(said, tmp_path):
    path = lines(tmp_path, {"command": "text", "phrase": "a table"}, REFUSED[said])
    with pytest.raises(ValueError, match="line 2: ") as caught:
        read_jobs(path)
    assert said in str(caught.value)


def test_files_that_are_none(tmp_path):
    for name, text, said in (
        ("jobs.toml", "jobs = 3", "wants a"),
        ("jobs.toml", "[[jobs]\n", "not a TOML file"),
        ("jobs.toml", 'other = 1\n[[jobs]]\ncommand = "text"', "it has 'other'"),
        ("jobs.jsonl", "[1]", "wants an object"),
        ("jobs.jsonl", "\n\n", "no jobs in it"),
        ("jobs.jsonl", '{"command": "text", "seed": 1, "seed": 2}', "line 1: .*seed is given twice"),
        ("jobs.toml", "[[jobs]]\nfinal-rate = 1\nfinal_rate = 2", "job 1: final_rate is given twice"),
        ("jobs.csv", "command,phrase\ntext\n", "line 2: text needs a phrase"),
        ("jobs.csv", "command,phrase\ntext,a chair, red\n", "line 2: 3 cells for 2 columns"),
        ("jobs.csv", "sep=;\ncommand;phrase\n\ntext;a;b\n", "line 4: 3 cells for 2 columns"),
        ("jobs.csv", "command,phrase,steps\ntext,a chair,many\n", "steps must be a whole number, got 'many'"),
        ("jobs.csv", "command,phrase,redraw\ntext,a chair,yes\n", "redraw must be true or false"),
        ("jobs.yaml", "", "is .toml, .jsonl or .csv"),
    ):
        with pytest.raises(ValueError, match=said):
            read_jobs(written(tmp_path, name, text))
    same = {"command": "text", "phrase": "a chair"}
    with pytest.raises(ValueError, match="line 2: the same job as line 1"):
        read_jobs(lines(tmp_path, same, same))


def test_paths_are_relative_to_the_file(tmp_path):
    from diff3ds.tasks.batch.commands import spec_of

    (tmp_path / "mine").mkdir()
    (tmp_path / "white").mkdir()
    spec = spec_of("text", {"phrase": "a chair", "library": "mine"}, tmp_path)
    assert spec.prior.library == tmp_path / "mine"
    assert spec_of("views", {"source": "x", "background": "white"}, tmp_path).background == "white"
    assert spec_of("views", {"source": "x", "background": "mine"}, tmp_path).background == str(tmp_path / "mine")


def test_gpus_are_dealt_out_one_a_job(monkeypatch):
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "3,5")
    monkeypatch.setattr("diff3ds.tasks.batch.machine.cores", lambda: 8)
    assert [(p.gpu, p.threads) for p in places(None, None, "auto")] == [("3", 4), ("5", 4)]
    assert [(p.gpu, p.threads) for p in places(None, None, "none")] == [("", 1)] * 8
    assert [(p.gpu, p.threads) for p in places(1, 2, "1,7")] == [("1", 2)]
    assert len(places(None, 3, "none")) == 2
    with pytest.raises(ValueError, match="3 workers for 2 GPUs"):
        places(3, None, "auto")


def test_shards_are_parts(tmp_path):
    assert BatchOptions(shard="3/16").part() == (2, 16)
    for shard in ("0/4", "5/4", "1", "a/b"):
        with pytest.raises(ValueError, match="shard must be one part"):
            BatchOptions(shard=shard)


def test_a_missing_file_of_jobs_is_said(tmp_path):
    with pytest.raises(ValueError, match=r"jobs\.toml is not there: give a file of jobs"):
        read_jobs(tmp_path / "jobs.toml")


def test_an_option_called_as_a_result_has_a_column_of_its_own(tmp_path):
    jobs = read_jobs(lines(tmp_path, *({"command": "text", "phrase": "a chair", "strokes": n} for n in (8, 16))))
    write_summary(tmp_path, [JobState(job, "done", 1, strokes=found) for job, found in zip(jobs, (7, 15), strict=True)])
    with (tmp_path / "summary.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["--strokes"], row["strokes"]) for row in rows] == [("8", "7"), ("16", "15")]


def test_the_times_of_all_tries_count_and_what_is_nearly_empty_is_marked(tmp_path):
    jobs = read_jobs(lines(tmp_path, *({"command": "text", "phrase": f"a {name}"} for name in ("chair", "mug", "bus"))))
    claims = Claims(tmp_path / "attempts")
    for job, ends in zip(jobs, (("killed", "timeout", "done"), ("done",), ("failed", "failed")), strict=True):
        for state in ends:
            claim = claims.claim(job.name)
            assert claim is not None
            claim.end(Outcome(state, seconds=10.0))
    for job, strokes in zip(jobs[:2], (30, 3), strict=True):
        (tmp_path / job.name).mkdir()
        record = {"stopped_early": False, "strokes_left": strokes, "seconds": {"distill": 1.5, "scores": 0.5}}
        (tmp_path / job.name / "run.json").write_text(json.dumps(record))
    states = states_of(jobs, tmp_path, claims, {})
    assert [state.seconds for state in states] == [22.0, 2.0, 20.0]
    assert [state.message for state in states[:2]] == ["", "nearly empty: 3 strokes"]
    write_summary(tmp_path, states)
    assert "nearly empty: 3 strokes" in (tmp_path / "summary.md").read_text()


def test_points_are_a_command_of_jobs(tmp_path):
    """Done as `diff3ds points` does them: a cube's cloud has its twelve edges."""
    import numpy as np

    import diff3ds as ds
    from diff3ds.tasks.batch.commands import run_command

    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 24), np.linspace(-1, 1, 24)), -1).reshape(-1, 2)
    faces = [np.insert(grid, axis, side, axis=1) for axis in range(3) for side in (-1.0, 1.0)]
    np.savetxt(tmp_path / "cube.xyz", np.concatenate(faces))
    (job,) = read_jobs(lines(tmp_path, {"command": "points", "source": "cube.xyz", "size": 64}))
    run_command(job.command, job.options, job.base, tmp_path / "out", lambda _: None, lambda _: None)
    assert len(ds.load(tmp_path / "out")) == 12
    with pytest.raises(ValueError, match="size must be from 1"):
        read_jobs(lines(tmp_path, {"command": "points", "source": "cube.xyz", "size": 0}))
