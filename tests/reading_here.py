"""Libraries that read files in the process of the tests, which loads them once and not again for each file."""

import json
from unittest.mock import patch

from diff3ds.formats.reader_process import answer_of


def reading_here():
    """Within it `ds.load` and `ds.load_surface` start no processes. Not for files that may crash libraries."""
    # There and back, as the answer of a process goes.
    return patch(
        "diff3ds.formats.apart._answer",
        lambda path, reader, program, kind, told: json.loads(json.dumps(answer_of(reader, str(path.resolve()), told))),
    )
