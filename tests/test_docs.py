"""The documents: citations, links and numbers agree with the code; what they show runs."""

import ast
import builtins
import contextlib
import functools
import importlib.util
import io
import keyword
import re
import runpy
import shlex
import sys
import tomllib
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from source_trees import tree_of

import diff3ds as ds
from diff3ds import cli
from diff3ds.command_line.read_options import read_options
from diff3ds.library import member

ROOT = Path(__file__).parent.parent
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("**/*.md")])
SOURCES = sorted([*(ROOT / "src").glob("**/*.py"), *(p for p in (ROOT / "csrc").glob("**/*") if p.is_file())])
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
# What the documents show is what the examples draw.
PICTURES = {"first_render.py": "first_render.png", "crossing_figure.py": "crossing.png", "helix.py": "helix.png"}
CAPABILITIES = tomllib.loads((ROOT / "tests/capabilities.toml").read_text(encoding="utf-8"))
MATHEMATICS = (ROOT / "docs/explanation/mathematics.md").read_text(encoding="utf-8")

CITATION = re.compile(r"\beqs?\. *((?:\d+[a-z]?(?: *(?:,|-|–|to|and) *(?=\d))?)+)")
# Comments and docstrings, and of them and of documents what is in back-quotes, or has the name of a source file.
PROSE = {"py": r'"""[\s\S]*?"""|#.*', "js": r"//.*"}
QUOTED = re.compile(r"`([^`\n]+)`|(?<![\w./-])((?:\w+/)*\w+\.(?:py|js|h|cuh|cu|cpp))\b")
A_FILE = re.compile(r"(?:[\w.-]+/)*[\w-]+\.(?:py|js|h|cuh|cu|cpp|css|html|md|toml)")
A_NAME = re.compile(r"_?[A-Za-z]\w*(?:\.\w+)*")
# Names in back-quotes that nothing here has: those of other programs and packages, of weights in files, of what a user
# may write, and of commits.
FOREIGN = {
    "ICONS", "Ks", "MORE", "Shift", "analysis.md", "b63b41e", "curv", "dynamic_mask_NAME.png", "embreex",
    "features.0.weight", "library/kinds/kite.py", "lin0.model.1.weight", "model_large.pth", "pypi", "rast",
    "stroke_width", "summary.md",
    "use_prefiltering", "viewmats", "wheels.yml",
}  # fmt: skip
A_COMMIT = re.compile(r"(?=.*\d)[0-9a-f]{7,12}")
LINK = re.compile(r"\]\(([^()\s]+)\)")
FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def relative(path: Path) -> str:
    return str(path.relative_to(ROOT))


def cited(text: str) -> set[str]:
    """Numbers of equations in a text: "eq. 3", "eq. 11, 12", "eq. 10 to 12", "eq. 10-12"."""
    numbers: set[str] = set()
    for match in CITATION.finditer(text):
        for part in re.split(r" *(?:,|and) *", match[1].strip()):
            first, *last = re.split(r" *(?:-|–|to) *", part)
            numbers |= {str(n) for n in range(int(first), int(last[0]) + 1)} if last else {first}
    return numbers


def anchors(path: Path) -> set[str]:
    """Anchors of a document's headings, as GitHub makes them."""
    text = FENCE.sub("", path.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}


def blocks(path: Path) -> list[tuple[str, str]]:
    """Fenced blocks of a document: language and text."""
    return FENCE.findall(path.read_text(encoding="utf-8"))


def python_blocks(path: Path) -> str:
    return "\n".join(code for language, code in blocks(path) if language == "python")


def test_citations_are_read_in_all_their_forms():
    text = "(docs eq. 7) and eq. 10 to 12; (eq. 4, 5), eq. 1-2. eq. 6a"
    assert cited(text) == {"1", "2", "4", "5", "6a", "7", "10", "11", "12"}


def test_every_cited_equation_exists():
    tags = re.findall(r"\\tag\{(\w+)\}", MATHEMATICS)
    assert len(tags) == len(set(tags))
    sources = {relative(path): cited(path.read_text(encoding="utf-8")) for path in SOURCES}
    assert {"3", "7", "9", "12"} <= set.union(*sources.values())
    assert {name: numbers - set(tags) for name, numbers in sources.items() if numbers - set(tags)} == {}


def test_section_numbers_are_equation_numbers():
    sections = re.findall(r"^## (\d+)\. (.*?)(?=^## )", MATHEMATICS, re.MULTILINE | re.DOTALL)
    assert len(sections) > 10
    for number, body in sections:
        assert set(re.findall(r"\\tag\{(\d+)[a-z]?\}", body)) == {number}


def test_cited_sections_exist():
    headings = set(re.findall(r"^## (.*)$", MATHEMATICS, re.MULTILINE))
    quoted = {name for path in SOURCES for name in re.findall(r'section "([^"]+)"', path.read_text(encoding="utf-8"))}
    assert quoted
    assert quoted <= headings


def test_constants_have_the_values_that_the_mathematics_gives():
    defined: dict[str, set[float]] = {}
    for path in SOURCES:
        code = path.read_text(encoding="utf-8")
        for name, number in re.findall(r"\b([A-Z][A-Z_0-9]+)(?:: \w+)? = (\.?\d[\d.e-]*)", code):
            defined.setdefault(name, set()).add(float(number))
    stated = re.findall(r"`([A-Z][A-Z_0-9]+)` = (\d[\d.e-]*\d|\d)", MATHEMATICS)
    assert len(stated) > 10
    for name, value in stated:
        assert defined.get(name) == {float(value)}, name


def test_constants_that_the_mathematics_names_exist():
    code = "\n".join(path.read_text(encoding="utf-8") for path in SOURCES)
    for name in set(re.findall(r"`([A-Z][A-Z_0-9]+)`", MATHEMATICS)):
        assert re.search(rf"\b{name}\b.* = ", code), name


@pytest.mark.parametrize("path", DOCUMENTS, ids=relative)
def test_links_lead_somewhere(path):
    broken = []
    for target in LINK.findall(FENCE.sub("", path.read_text(encoding="utf-8"))):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        file = path.parent / name if name else path
        if not file.exists() or (anchor and anchor not in anchors(file)):
            broken.append(target)
    assert broken == []


def test_documents_that_files_name_exist():
    files = [*SOURCES, *EXAMPLES, *(ROOT / "benchmarks").glob("*.py"), ROOT / "pyproject.toml", *DOCUMENTS]
    named = {name for file in files for name in re.findall(r"\bdocs/[\w/-]+\.md\b", file.read_text(encoding="utf-8"))}
    assert {"docs/explanation/mathematics.md", "docs/howto/evaluate.md"} <= named
    assert {name for name in named if not (ROOT / name).exists()} == set()


def words_of_code(paths: list[Path]) -> set[str]:
    """All names, and words in strings, that code has outside of its comments and docstrings."""
    code = (re.sub(PROSE["py" if p.suffix == ".py" else "js"], "", p.read_text(encoding="utf-8")) for p in paths)
    return set(re.findall(r"[A-Za-z_]\w*", "\n".join(code)))


def quoted_names(path: Path) -> set[str]:
    """What is in back-quotes in the comments of a file, or in a document, and the source files that comments name."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        return {quoted for quoted, _ in QUOTED.findall(FENCE.sub("", text)) if quoted}
    prose = "\n".join(re.findall(PROSE["py" if path.suffix == ".py" else "js"], text))
    return {quoted or file for quoted, file in QUOTED.findall(prose)}


def is_public(name: str) -> bool:
    """Whether a name with dots, from the package on, leads to something."""
    _, *parts = name.split(".")
    value: object = ds
    for depth, part in enumerate(parts):
        if (value is ds and part not in ds.__all__) or not hasattr(value, part):
            module = ".".join(["diff3ds", *parts[: depth + 1]])
            if importlib.util.find_spec(module) is None:
                return part in getattr(value, "__annotations__", {})
            value = importlib.import_module(module)
        else:
            value = getattr(value, part)
    return True


def test_names_in_back_quotes_exist():
    """A module, file or name that comments, docstrings and documents speak of is there."""
    scripts = [p for room in ("src", "benchmarks") for kind in ("py", "js") for p in (ROOT / room).rglob(f"*.{kind}")]
    prose = [*scripts, *SOURCES, *DOCUMENTS, *(ROOT / "examples").glob("*.py")]
    others = [*(ROOT / "tests").rglob("*.py"), *ROOT.glob("*/pyproject.toml"), ROOT / "CMakeLists.txt"]
    words = words_of_code([p for p in [*prose, *others] if p.suffix != ".md"]) | {*dir(builtins), *keyword.kwlist}
    rooms = [p for room in ("src", "docs") for p in (ROOT / room).rglob("*.*")]
    files = {relative(p) for p in [*prose, *others, *rooms, *ROOT.glob("*.*")]}
    parts = {file[i + 1 :] for file in files for i, letter in enumerate(file) if letter == "/"} | files
    unknown = {}
    for path in prose:
        for name in quoted_names(path) - FOREIGN:
            if name in parts or A_FILE.fullmatch(name):
                exists = name in parts
            elif re.fullmatch(r"(?:ds|diff3ds)\.[\w.]+", name):
                exists = is_public(name)
            else:
                exists = not A_NAME.fullmatch(name) or set(name.split(".")) <= words or A_COMMIT.fullmatch(name)
            if not exists:
                unknown.setdefault(relative(path), set()).add(name)
    assert unknown == {}


# Hatching of four tones takes three seconds; its options have tests of their own.
@pytest.mark.parametrize(
    "path",
    [pytest.param(p, marks=[pytest.mark.slow] * (p.stem == "hatching")) for p in DOCUMENTS if python_blocks(p)],
    ids=relative,
)
def test_python_blocks_run(path, tmp_path, monkeypatch):
    """All blocks of a document, one after the other, in a folder with what its commands would have written."""
    monkeypatch.chdir(tmp_path)
    for file in re.findall(r'ds\.load\("(.*?/sketch.json)"\)', python_blocks(path)):
        (tmp_path / file).parent.mkdir()
        ds.save(tmp_path / file, member("chair", torch.Generator().manual_seed(0)).sketch)
    exec(compile(python_blocks(path), relative(path), "exec"), {"__name__": "__main__"})


def promises(name: str) -> list[str]:
    """Bullets and rows of tables, but for bullets that begin with a link: those are about other projects."""
    lines = FENCE.sub("", (ROOT / name).read_text(encoding="utf-8")).splitlines()
    headings = {number - 1 for number, line in enumerate(lines) if line.startswith("|---")}
    rows = [line for number, line in enumerate(lines) if re.match(r"\| |\* (?!\[)", line) and number not in headings]
    return [row for row in rows if not row.startswith("|---")]


@functools.cache
def parsed(file: str) -> ast.Module:
    return tree_of(ROOT / file) if (ROOT / file).is_file() else ast.Module([], [])


@functools.cache
def is_quick(test: str) -> bool:
    """Whether a function of a file of tests, FILE::NAME, is there and runs with the quick ones."""
    file, _, name = test.partition("::")
    tree = parsed(file)
    marks = [mark for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == name
             for mark in [ast.Constant(name), *node.decorator_list]]  # fmt: skip
    whole = [n.value for n in tree.body if isinstance(n, ast.Assign) and "pytestmark" in ast.unparse(n)]
    return bool(marks) and not any(map(leaves_out, marks + whole))


def leaves_out(mark: ast.expr) -> bool:
    """Whether a mark leaves its test out of the quick ones; one of many cases does if it leaves out each of them."""
    if isinstance(mark, ast.Call) and mark.args and isinstance(mark.args[-1], ast.List) and mark.args[-1].elts:
        return all(map(leaves_out, mark.args[-1].elts))
    return bool(re.search(r"mark\.(slow|gpu|xfail|skip\b)|\bskip\(", ast.unparse(mark)))


@pytest.mark.parametrize("name", CAPABILITIES)
def test_every_promise_is_held_by_a_quick_test(name):
    """In the table tests/capabilities.toml; a new line in CHANGELOG.md needs one there, and mostly a new test."""
    table, lines = CAPABILITIES[name], promises(name)
    assert len(lines) > 30
    without = [line[:90] for line in lines if not any(words in line for words in table)]
    assert without == [], "give each of these a line in tests/capabilities.toml: words of it, and a quick test"
    found = {words: sum(words in line for line in lines) for words in table}
    assert {words: count for words, count in found.items() if count != 1} == {}, "lines with these words: one each"
    named = {words: [tests] if isinstance(tests, str) else tests for words, tests in table.items()}
    assert {words: tests for words, tests in named.items() if not tests or not all(map(is_quick, tests))} == {}


def test_slow_skipped_and_missing_tests_are_not_quick():
    assert is_quick("tests/test_docs.py::test_slow_skipped_and_missing_tests_are_not_quick")
    assert not is_quick("tests/test_docs.py::test_that_is_not_there")
    assert not is_quick("tests/test_that_is_not_there.py::test_any")
    assert not is_quick("tests/tasks/test_prior_training.py::test_a_network_learns")
    # One of its four cases is slow.
    assert is_quick("tests/test_start.py::test_output_that_nobody_reads_ends_it_as_shells_expect")


class UnderstoodError(Exception):
    """The options of a command were read."""


def test_commands_have_the_options_that_documents_give(monkeypatch):
    def read(*arguments):
        read_options(*arguments)
        raise UnderstoodError

    monkeypatch.setattr(cli, "read_options", read)
    shown = [
        line
        for path in DOCUMENTS
        for language, code in blocks(path)
        if language == "bash"
        for line in code.splitlines()
    ]
    commands = {found[1] for line in shown if (found := re.search(r"(?:^|&& )(?:\.venv/bin/)?diff3ds (.*)", line))}
    assert len(commands) > 20
    for command in sorted(commands):
        with pytest.raises(UnderstoodError):
            cli.main(shlex.split(command, comments=True))


def test_sketch_json_of_the_files_page_is_a_quarter_of_a_circle(tmp_path):
    (text,) = [code for language, code in blocks(ROOT / "docs/reference/files.md") if language == "json"]
    (tmp_path / "quarter.json").write_text(text, encoding="utf-8")
    sketch = ds.load(tmp_path / "quarter.json")
    on_curve = ds.bezier.evaluate(sketch.points[0], sketch.weights[0], torch.linspace(0, 1, 9))
    torch.testing.assert_close(torch.linalg.vector_norm(on_curve, dim=-1), torch.ones(9))
    assert on_curve[[0, -1]].tolist() == [[1, 0, 0], [0, 1, 0]]


@pytest.fixture(scope="module")
def run_example(tmp_path_factory):
    """Runs an example once: (what it printed, folder it wrote to)."""

    @functools.cache
    def run(path: Path) -> tuple[str, Path]:
        folder, printed = tmp_path_factory.mktemp(path.stem), io.StringIO()
        with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
            patch.chdir(folder)
            patch.setattr(sys, "argv", [str(path), str(folder)])
            runpy.run_path(str(path), run_name="__main__")
        return printed.getvalue(), folder

    return run


# Those that take longer than five seconds.
SLOW = ("phrases.py", "stool_film.py", "optimise.py", "helix.py", "sixteen_strokes.py")


def with_slow(examples: Iterable[str]) -> list:
    """Examples as parameters."""
    return [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in examples]


@pytest.mark.parametrize("name", with_slow(path.name for path in EXAMPLES))
def test_examples_draw_something(name, run_example):
    pictures = [p for p in run_example(ROOT / "examples" / name)[1].iterdir() if p.suffix in (".png", ".webp")]
    assert pictures
    for picture in pictures:
        ink = 255 - np.asarray(Image.open(picture).convert("L")).astype(float)
        assert 0.005 < ink.mean() / 255 < 0.9, picture.name


@pytest.mark.parametrize("name", with_slow(PICTURES))
def test_pictures_of_the_documents_are_what_examples_draw(name, run_example):
    folders = (run_example(ROOT / "examples" / name)[1], ROOT / "docs/pictures")
    drawn, shown = (np.asarray(Image.open(f / PICTURES[name]).convert("RGB")).astype(int) for f in folders)
    assert drawn.shape == shown.shape
    # Processors round differently: it shows where one stroke barely hides another. A changed one shows all over.
    assert (np.abs(drawn - shown).max(-1) > 2).mean() < 1e-3


@pytest.mark.slow
def test_the_optimisation_example_finds_its_target(run_example):
    printed, _ = run_example(ROOT / "examples/optimise.py")
    losses = [float(line.split()[-1]) for line in printed.splitlines() if line.startswith("step")]
    assert losses[-1] < losses[0] / 20


def test_the_modes_agree_in_the_monte_carlo_example(run_example):
    printed, _ = run_example(ROOT / "examples/monte_carlo.py")
    cosines = [float(line.split()[-1]) for line in printed.splitlines()]
    # One run has noise; what is left of the mean is the analytic coverage's error on diagonals and ends.
    assert len(cosines) == 2
    assert 0.98 < cosines[0] < cosines[1]
    assert cosines[1] > 0.998
