"""The start and the end of the command `diff3ds`: Ctrl-C while it loads, and output that nobody reads or takes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

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


@pytest.mark.parametrize("module", ["diff3ds.cli", "numpy", "diff3ds.tasks.views.run"])
def test_ctrl_c_while_it_loads_ends_it_without_a_word(module):
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, module, "doctor"], capture_output=True, text=True, timeout=300, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["doctor"], ["views", "--help"]])
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
