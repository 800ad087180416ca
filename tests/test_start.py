"""The start and the end of the command `diff3ds`: Ctrl-C while it loads, and output that nobody reads or takes."""

import gc
import importlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from diff3ds.command_line.interrupt import importing

START = "from diff3ds._start import main; main()"
# Ctrl-C comes when the module that is named first is looked for.
INTERRUPTED = """
import os, signal, sys

wanted = sys.argv.pop(1)
signal.signal(signal.SIGINT, signal.default_int_handler)

class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == wanted:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupt())
from diff3ds._start import main
main()
"""


@pytest.mark.parametrize("module", ["diff3ds.cli", "rich", "torch", "numpy", "diff3ds.tasks.doctor.diagnosis"])
def test_ctrl_c_while_it_loads_ends_it_without_a_word(module):
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, module, "doctor"], capture_output=True, text=True, timeout=300, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


@pytest.mark.parametrize(
    "arguments", [["--help"], ["--version"], ["views", "--help"], pytest.param(["doctor"], marks=pytest.mark.slow)]
)
def test_output_that_nobody_reads_ends_it_as_shells_expect(arguments):
    reader, writer = os.pipe()
    os.close(reader)
    try:
        done = subprocess.run(
            [sys.executable, "-c", START, *arguments], stdout=writer, stderr=subprocess.PIPE, timeout=300, check=False
        )
    finally:
        os.close(writer)
    assert (done.returncode, done.stderr) == (141, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device here")
def test_output_on_a_full_disk_is_told():
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-c", START, "--version"], stdout=full, stderr=subprocess.PIPE, timeout=300, check=False
        )
    assert done.returncode == 1
    assert done.stderr == b"diff3ds: [Errno 28] No space left on device\n"


# What is answered, the exit code, and a part of the answer.
AT_ONCE = [
    ("", 2, "Missing subcommand"),
    ("--help", 0, "views"),
    ("--version", 0, "diff3ds 0"),
    *(
        (f"{command} --help", 0, f"diff3ds {command}")
        for command in ("views", "text", "image", "eval", "prior", "fetch")
    ),
    ("doctor --help", 0, "diff3ds doctor"),
    ("views --recipe 3doodle --help", 0, "--clip-weight"),
    ("sketch", 2, "sketch"),
    ("text", 2, "What to draw"),
    ("text chair --nosuch 1", 2, "--nosuch"),
    ("text chair --steps many", 1, "--steps must be a whole number"),
    ("text chair --steps 0", 1, "--steps must be positive"),
    ("text chair --elevation 30 0", 1, "--elevation must be (lowest, highest)"),
    ("text chair --t-low 2 2", 1, "--t-low"),
    ("text chair --seed -1", 1, "--seed must be a whole number"),
    ("text chair --prior zero123", 1, "this command needs one of mvdream"),
    ("text chair --weights somebody/something", 1, "weights are of a prior"),
    ("image cup.png --prior mvdreem", 1, "--prior must be one of zero123"),
    ("image cup.png --background brown", 1, "--background must be white, black"),
    ("image cup.png --view-elevation 90", 1, "--view-elevation must lie in"),
    ("views", 1, "give either a transforms.json"),
    ("views . --background brown", 1, "nor is there a picture or folder of this name"),
    ("views . --masks all", 2, "--masks"),
    ("views . --recipe 3doodle --width 0", 1, "--width must be positive"),
    ("eval runs --alexnet a", 1, "give --lpips-alex as well"),
    ("eval runs --fov nan", 1, "--fov must be finite"),
    ("prior train --patch 7", 1, "must be a multiple of patch"),
    ("fetch mvdreem", 1, "mvdreem"),
]


# Each line in a fork of one process, which has loaded what every command loads first, and in a folder of its own.
IN_FORKS = """
import atexit, json, os, sys
from diff3ds._start import main
import diff3ds.cli

codes = []
for folder, words in json.loads(sys.argv[1]):
    child = os.fork()
    if not child:
        break
    codes.append(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
else:
    print(json.dumps(codes))
    sys.exit()
os.chdir(folder)
for number, name in ((1, "out"), (2, "err")):
    os.dup2(os.open(f"{folder}.{name}", os.O_WRONLY | os.O_CREAT), number)
sys.argv = ["diff3ds", *words]
atexit.register(lambda: print("loaded", sorted({"torch", "numpy", "scipy", "PIL"} & set(sys.modules))))
main()
"""


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """Of each line its exit code, and the folder that it was run in."""
    if not hasattr(os, "fork"):
        pytest.skip("there are no forks here")
    folders = {line: tmp_path_factory.mktemp("line") for line, _, _ in AT_ONCE}
    jobs = json.dumps([(str(folder), line.split()) for line, folder in folders.items()])
    done = subprocess.run([sys.executable, "-c", IN_FORKS, jobs], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return dict(zip(folders, zip(json.loads(done.stdout), folders.values(), strict=True), strict=True))


@pytest.mark.parametrize(("line", "code", "answer"), AT_ONCE)
def test_what_needs_no_torch_is_answered_without_it(line, code, answer, answers):
    ended, folder = answers[line]
    said, error = (folder.with_name(f"{folder.name}.{name}").read_text() for name in ("out", "err"))
    assert ended == code, error
    assert answer in said + error
    assert said.endswith("loaded []\n")
    assert not list(folder.iterdir())


@pytest.mark.parametrize("enabled", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_nothing_looks_for_garbage_while_something_large_is_imported(enabled, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    name = f"large_{enabled}"
    (tmp_path / f"{name}.py").write_text("import gc\nenabled = gc.isenabled()\nkept = [[] for _ in range(1000)]\n")
    was, frozen = gc.isenabled(), gc.get_freeze_count()
    (gc.enable if enabled else gc.disable)()
    try:
        with importing():
            large = importlib.import_module(name)
        assert not large.enabled
        assert gc.isenabled() == enabled
        assert gc.get_freeze_count() >= frozen + len(large.kept)
        frozen = gc.get_freeze_count()
        with importing():
            importlib.import_module(name)
        assert gc.get_freeze_count() <= frozen
    finally:
        (gc.enable if was else gc.disable)()
        gc.unfreeze()
        # As it was before, or each search of the tests to come looks at all that collection has made.
        gc.freeze()
