"""Options of a command line, read by tyro into dataclasses; what is wrong with them, in the words of their user."""

import contextlib
import io
import re
import sys
import traceback
from collections.abc import Mapping
from typing import Any

import tyro

from diff3ds._settings import option_hints

_COLORS = re.compile(r"\x1b\[[\d;]*m")
# By what tyro calls the values of options.
_NUMBERS = {"INT": "a whole number", "FLOAT FLOAT": "two numbers", "FLOAT": "a number"}


def read_options(commands: Mapping[str, type], arguments: list[str], description: str) -> Any:
    """The command that arguments name, with its options.

    Raises:
        ValueError: as the dataclasses of options themselves; tyro would name their fields in it.
        SystemExit: arguments that tyro does not understand, which it has said; --help.
    """
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return _read(commands, arguments, description)
    except SystemExit as ended:
        plain = _COLORS.sub("", said.getvalue())
        fault = _own_fault(ended) or _no_number(plain)
        if fault is None:
            sys.stderr.write(said.getvalue())
            if "Unrecognized options" in plain:
                sys.stderr.write(_meant(arguments))
            raise
    raise fault


def _read(commands: Mapping[str, type], arguments: list[str], description: str) -> Any:
    config = (tyro.conf.FlagCreatePairsOff,)
    name, *rest = arguments or [""]
    if name not in commands:
        return tyro.extras.subcommand_cli_from_dict(
            dict(commands), prog="diff3ds", description=description, args=arguments, config=config
        )
    # tyro's help leaves out what is given before it: "train".
    rest = ["--help"] if {"-h", "--help"} & {*rest} else rest
    # As a program of its own: what it says of faults names its options and its help, and no other command's.
    return tyro.cli(commands[name], prog=f"diff3ds {name}", args=rest, config=config)


def _meant(arguments: list[str]) -> str:
    """What may be at the bottom of options that are not known."""
    if arguments[0] == "text" and " " not in arguments[1]:
        return 'A phrase of several words stands in quotes: diff3ds text "a chair with armrests"\n'
    if any(word.startswith("--recipe") for word in arguments):
        return "A recipe has options of its own: diff3ds views --recipe 3doodle --help\n"
    return ""


def as_typed(message: str, command: type | None) -> str:
    """A message about fields of a command's options with the fields named as they are typed: --color-rate.

    Fields of one word are words of other sentences as well: they are options where they "must" be something, and where
    a run that is to be resumed "had" another one.
    """
    names = [*option_hints(command)] if command is not None else []
    joined, single = ("|".join(n for n in names if ("_" in n) is wanted) for wanted in (True, False))
    patterns = [rf"(?<![\w./-])({joined})(?!\w|[./-]\w)"] if joined else []
    patterns += [rf"^({single})(?= must\b)", rf"(?<=\bhad )({single})(?==)"] if single else []
    for pattern in patterns:
        message = re.sub(pattern, lambda found: "--" + found[0].replace("_", "-"), message)
    return message


def _no_number(said: str) -> ValueError | None:
    """The fault of words where tyro wants numbers, which it tells as Python does; None if it says something else."""
    kinds = "|".join(_NUMBERS)
    pattern = rf"Error parsing (--[\w-]+):.*?('.*?'(?:, '.*?')*).*helptext:\W+\1 ({{None}}\|)?({kinds})\b"
    found = re.search(pattern, said, re.DOTALL)
    return ValueError(f"{found[1]} must be {_NUMBERS[found[4]]}, got {found[2]}") if found else None


def _own_fault(ended: SystemExit) -> ValueError | None:
    """The error of one of our dataclasses for which tyro gave up; None if it gave up by itself."""
    error: BaseException | None = ended
    while error is not None:
        frames = list(traceback.walk_tb(error.__traceback__))
        if isinstance(error, ValueError) and frames[-1][0].f_globals["__name__"].startswith("diff3ds."):
            return error
        error = error.__context__
    return None
