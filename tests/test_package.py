"""The package as a whole: what its import loads, which part may import which, and life without compiled kernels."""

import ast
import functools
import graphlib
import json
import re
import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

import pytest
from source_trees import tree_of

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src"
MODULES = {
    ".".join(path.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__"): path
    for path in sorted(SOURCE.glob("diff3ds/**/*.py"))
}

# What each part (a module or folder right under the package) may import: cli -> tasks -> everything below; edges and
# pictures -> optimize, formats -> render -> project -> {bezier, camera, sketch}; guidance and metrics -> weights.
# "diff3ds" stands for the list of public names. A new part needs a line here.
HELPERS = {
    "_checks",
    "_detail",
    "_files",
    "_modes",
    "_settings",
    "_shapes",
    "_svg",
    "_shown",
    "_sketch_fields",
    "_tensor_files",
    "_units",
    "_version",
    "_with_torch",
}
SCENE = {"bezier", "camera", "chains", "sketch"} | HELPERS
ALLOWED = {
    "_checks": {"_shapes"},
    "_detail": {"_settings", "_shapes"},
    "_files": set(),
    "_modes": {"_shapes"},
    "_settings": set(),
    "_shapes": set(),
    "_shown": set(),
    "_sketch_fields": {"_checks", "_modes", "_shapes"},
    "_start": {"cli", "command_line"},
    "_svg": {"_shapes"},
    "_tensor_files": {"_files", "_shapes"},
    "_units": set(),
    "_version": set(),
    "_with_torch": set(),
    "command_line": {"_settings", "recognition", "tasks", "weights"},
    "bezier": {"_checks", "_modes", "_shapes"},
    "camera": HELPERS,
    "chains": {"_modes", "_shapes", "_with_torch"},
    "distortion": {"_shapes"},
    "frames": {"camera", "distortion", "formats"} | HELPERS,
    "transforms": {"camera", "distortion", "formats", "frames"} | HELPERS,
    "photogrammetry": {"camera", "distortion", "formats", "frames", "transforms"} | HELPERS,
    "sketch": {"bezier", "chains"} | HELPERS,
    "project": SCENE,
    "render": {"project"} | SCENE,
    "parallel": {"render"},
    "constraints": {"curves"} | SCENE,
    "curves": {"bezier", "chains", "sketch"} | HELPERS,
    "losses": SCENE,
    "library": SCENE,
    "weights": HELPERS,
    "metrics": {"detectors", "weights"} | SCENE,
    "detectors": HELPERS,
    "optimize": {"constraints", "render", "project", "losses"} | SCENE,
    "viewer": set(),
    "page": {"curves", "parallel", "render", "project"} | SCENE,
    "formats": {"curves", "page", "render", "project", "svg", "viewer"} | SCENE,
    "with_surface": {"formats", "render", "surfaces"} | SCENE,
    "notebook": {"formats", "render", "surfaces", "viewer"} | SCENE,
    "svg": HELPERS,
    "styles": {"curves", "page", "project", "render", "svg"} | SCENE,
    "pydiffvg": {"render", "svg"} | SCENE,
    "pictures": {"distortion", "formats", "parallel", "photogrammetry", "render", "transforms"} | SCENE,
    "edges": {"curves", "distortion", "optimize", "page", "parallel", "render", "project", "surfaces"} | SCENE,
    "recognition": {"edges", "library", "pictures", "render"} | SCENE,
    "surfaces": {"constraints", "curves", "formats", "optimize", "page", "parallel", "pictures", "project",
                 "render"} | SCENE,
    # Sees images and cameras, never strokes: a prior that must draw something is handed a function that draws.
    "guidance": {"camera", "weights"} | HELPERS,
    "diff3ds": {"constraints", "tasks", "optimize", "formats", "guidance", "library", "losses", "notebook", "render",
                "project", "pydiffvg", "styles", "surfaces", "transforms", "with_surface"} | SCENE,
    "tasks": {"constraints", "curves", "detectors", "distortion", "edges", "frames", "surfaces", "optimize", "pictures",
              "guidance", "weights", "losses", "formats", "metrics", "library", "page", "parallel", "photogrammetry",
              "recognition", "render", "project", "styles", "svg", "transforms", "viewer", "with_surface"} | SCENE,
    "cli": {"tasks", "command_line", "_version"},
}  # fmt: skip


# Modules that a folder may have, those that begin with an underscore apart.
MOST = 14


def _part(module: str) -> str:
    return module.split(".")[1] if "." in module else module


@functools.cache
def _nodes(path: Path) -> list[ast.AST]:
    return list(ast.walk(tree_of(path)))


@functools.cache
def _imports(path: Path) -> set[str]:
    """Modules of this package that a file imports, anywhere in it, for type checkers too, and those that it names.

    A name in a string is one that `import_module` can be given; what only finds a module's files has it as well. A
    program that is run (`-m`) is none.
    """
    found, programs = set(), set()
    for node in _nodes(path):
        if isinstance(node, ast.List) and any(getattr(each, "value", None) == "-m" for each in node.elts):
            programs |= set(map(id, node.elts))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in programs:
            if node.value in MODULES and node.value != "diff3ds":
                found.add(node.value)
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}, line {node.lineno}: imports are absolute here"
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                found.add(inner if inner in MODULES else str(node.module))
    return {name for name in found if name.split(".")[0] == "diff3ds"}


def _run(script: str, *arguments: str) -> str:
    """Output of a script in a fresh interpreter, outside the repository's tests."""
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


# Imports


IMPORT = """
import json, sys
def packages():
    return {name.split(".")[0] for name in sys.modules} - set(sys.stdlib_module_names)

before = packages()

import diff3ds as ds
early = sorted(packages() - before)
listed = [name for name in ds.__all__ if name not in dir(ds)]
import torch, numpy
before |= packages() - {"diff3ds"}
import diff3ds.optimize.fit, diff3ds.project, diff3ds.render  # modules do not take the functions' places
missing = [name for name in ds.__all__ if not hasattr(ds, name)]
print(json.dumps({
    "early": early,
    "late": sorted(packages() - before),
    "loaded": [name for name in sys.modules if name.startswith("diff3ds.")],
    "listed": listed,
    "missing": missing,
    "functions": [callable(ds.fit), callable(ds.project), callable(ds.render)],
}))
"""


@pytest.fixture(scope="module")
def imported() -> dict:
    """What a fresh process has loaded before and after all public names are asked for."""
    return json.loads(_run(IMPORT))


def test_import_needs_torch_and_numpy_only(imported):
    assert imported["late"] == ["diff3ds"]
    assert not {"cli", "edges"} & {_part(name) for name in imported["loaded"]}


def test_the_public_names_come_when_they_are_used(imported):
    assert imported["early"] == ["diff3ds"]
    assert imported["listed"] == imported["missing"] == []
    assert imported["functions"] == [True, True, True]


def test_the_allowed_arrows_point_one_way():
    graphlib.TopologicalSorter(ALLOWED).prepare()
    assert set().union(*ALLOWED.values()) <= set(ALLOWED)
    assert not ALLOWED["guidance"] & {"sketch", "project", "render", "bezier"}


def _arrows() -> set[tuple[str, str]]:
    """All imports of one module by another."""
    return {(module, name) for module, path in MODULES.items() for name in _imports(path) - {module}}


def test_imports_follow_the_arrows():
    assert {_part(module) for module in MODULES} <= set(ALLOWED), "say in ALLOWED what a new part may import"
    across = {(module, name) for module, name in _arrows() if _part(module) != _part(name)}
    assert {(module, name) for module, name in across if _part(name) not in ALLOWED[_part(module)]} == set()


def test_no_module_imports_itself_in_a_circle():
    graph: dict[str, set[str]] = {}
    for module, name in _arrows():
        graph.setdefault(module, set()).add(name)
    graphlib.TopologicalSorter(graph).prepare()


def _called(call: ast.Call) -> str:
    """The name of what is called, without what it belongs to."""
    return getattr(call.func, "attr", getattr(call.func, "id", ""))


def test_modules_are_imported_by_their_names_in_full():
    """What is put together from parts, no one can follow: a name for `import_module` is a whole string.

    But for the public names, which a table in the package's own file has, each checked where they are used.
    """
    for module, path in MODULES.items():
        for node in _nodes(path):
            if isinstance(node, ast.Call) and module != "diff3ds" and _called(node) == "import_module":
                assert not re.match("f?.diff3ds", ast.unparse(node.args[0])) or isinstance(node.args[0], ast.Constant)


def test_a_name_leads_to_one_file():
    """But for library/kinds, where a file has the name of the thing it draws."""
    names = Counter(path.stem for path in MODULES.values() if path.parent.name != "kinds" and path.stem != "__init__")
    assert {name: count for name, count in names.items() if count > 1} == {}


def test_no_folder_is_crowded():
    """But for library/kinds."""
    folders = Counter(path.parent for path in MODULES.values() if not path.stem.startswith("_"))
    crowded = {folder.relative_to(SOURCE / "diff3ds").as_posix() for folder, count in folders.items() if count > MOST}
    assert crowded == {"library/kinds"}


def _trusted_loads() -> list[ast.AST]:
    """torch.load in the one function that may have it: called once, and there with weights_only."""
    module = tree_of(MODULES["diff3ds.weights.read"])
    (function,) = (n for n in ast.walk(module) if isinstance(n, ast.FunctionDef) and n.name == "unpickle")
    (call,) = (n for n in ast.walk(function) if isinstance(n, ast.Call) and ast.unparse(n.func) == "torch.load")
    assert any(k.arg == "weights_only" and ast.unparse(k.value) == "True" for k in call.keywords)
    return [call.func]


def test_nothing_is_unpickled():
    """No file can run code: no pickle in any form, nothing evaluated.

    But for one function, which reads the tensors, and only those, of a file that the user has said to trust, and for
    what copies of this process tell it, which is no file.
    """
    allowed = _trusted_loads()
    for module, path in MODULES.items():
        if module == "diff3ds.parallel.in_copies":
            continue
        for node in _nodes(path):
            where = f"{path}, line {getattr(node, 'lineno', 0)}"
            # What torch raises has no other name.
            if (
                isinstance(node, ast.Import | ast.ImportFrom)
                and ast.unparse(node) != "from pickle import UnpicklingError"
            ):
                names = {a.name for a in node.names} | {getattr(node, "module", None)}
                assert not names & {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "shelve", "marshal"}, where
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                assert (node.value.id, node.attr) not in {("torch", "load"), ("torch", "save")} or node in allowed, (
                    where
                )
            if isinstance(node, ast.keyword) and node.arg == "allow_pickle":
                assert isinstance(node.value, ast.Constant), where
                assert node.value.value is False, where
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in {"eval", "exec", "__import__"}, where


# Without compiled kernels

NO_KERNELS = """
import json, sys, warnings
# The sources alone: what an installation without a compiler holds.
sys.meta_path[:] = [f for f in sys.meta_path if not type(f).__module__.startswith("_editable")]
sys.path.insert(0, sys.argv[1])
import torch
import diff3ds as ds

def error(call):
    try:
        call()
    except ValueError as error:
        return str(error)

sketch = ds.Sketch(torch.tensor([[[0.0, -0.5, 0], [0, 0.5, 0]]]), width=0.2)
cameras = ds.orbit([0.0, 90.0], size=16)
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    explicit = ds.render(sketch, cameras, backend="reference")
    silent = len(caught)
    images = [ds.render(sketch, cameras) for _ in range(3)]
    learned = ds.Sketch(sketch.points.clone().requires_grad_(), width=0.2)
    ds.render(learned, cameras).alpha.sum().backward()
print(json.dumps({
    "backends": ds.available_backends(),
    "silent": silent,
    "warnings": [[w.category.__name__, str(w.message), w.filename] for w in caught],
    "same": all(torch.equal(image.color, explicit.color) for image in images),
    "ink": float(explicit.alpha.sum()),
    "gradient": bool(learned.points.grad.isfinite().all()),
    "cpu": error(lambda: ds.render(sketch, cameras, backend="cpu")),
}))
"""


@pytest.fixture(scope="module")
def without_kernels() -> dict:
    """What a user meets who has no compiler."""
    return json.loads(_run(NO_KERNELS, str(SOURCE)))


def test_without_kernels_the_reference_renders(without_kernels):
    assert without_kernels["backends"] == ["reference"]
    assert without_kernels["same"]
    assert without_kernels["ink"] > 20
    assert without_kernels["gradient"]


def test_without_kernels_there_is_one_warning_that_says_what_to_do(without_kernels):
    assert without_kernels["silent"] == 0
    ((category, message, filename),) = without_kernels["warnings"]
    assert category == "RuntimeWarning"
    assert "without its compiled kernels" in message
    assert "Install a C++20 compiler" in message
    assert "pip install" in message
    # It points at the line of the user that renders.
    assert filename == "<string>"


def test_without_kernels_the_cpu_backend_is_refused(without_kernels):
    assert 'backend "cpu" is not installed. Install a C++20 compiler' in without_kernels["cpu"]


def test_no_two_files_of_tests_have_the_same_name():
    """Pytest imports them by name alone, and refuses the second one only where both are run."""
    names = [path.name for path in Path(__file__).parent.rglob("test_*.py")]
    assert sorted(names) == sorted(set(names))


# What is said of the package's set-up


def test_the_same_pythons_are_named_wherever_they_are():
    """In the classifiers, the wheels, and both scripts that try them."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    named = [re.search(r"Python :: 3\.(\d+)$", line) for line in project["project"]["classifiers"]]
    minors = [found[1] for found in named if found]
    assert project["project"]["requires-python"] == f">=3.{minors[0]}"
    (wheels,) = re.findall(r"\{(.*)\}", project["tool"]["cibuildwheel"]["build"])
    assert [f"1{minor}" for minor in wheels.split(",")] == minors
    scripts = {name: (ROOT / ".ci" / name).read_text(encoding="utf-8") for name in ("pythons", "resolve")}
    assert f"set -- {' '.join(f'3.{minor}' for minor in minors)}\n" in scripts["pythons"]
    assert f"for minor in {' '.join(minors)}; do" in scripts["resolve"]


def test_constraints_leave_to_torch_what_it_brings():
    """PyTorch's builds for CUDA ask for the one NVRTC that they were built with: another one is a contradiction."""
    named = re.findall(r"^[\w-]+", (ROOT / "constraints-cpu.txt").read_text(encoding="utf-8"), re.MULTILINE)
    assert "torch" in named
    assert [name for name in named if "nvidia" in name] == []


def test_what_lands_has_passed_all_tests():
    """It ends with the README's command, the slow tests, and first cases of quick ones with annotations checked."""
    *_, quick, slow, checked = (ROOT / ".ci/run").read_text(encoding="utf-8").splitlines()
    assert f"&& {quick}\n" in (ROOT / "README.md").read_text(encoding="utf-8")
    assert slow == f"{quick} -m slow"
    assert checked == f"exec {quick} --first-cases --jaxtyping-packages=diff3ds,annotations.checked"
    options = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["pytest"]["ini_options"]
    assert '-m "not slow" -n auto' in options["addopts"]
