"""What a release hangs on, as far as it can be tried here: one version, the workflows, the recipe, the Dockerfile."""

import re
import runpy
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
SAID = ("src/diff3ds/_version.py", "CITATION.cff", "conda/recipe.yaml", "docs/reference/stability.md")
DISAGREEMENTS = runpy.run_path(str(ROOT / ".ci/version"))["disagreements"]


@pytest.fixture
def root(tmp_path):
    """A copy of all files that say the version."""
    for name in ("pyproject.toml", "CHANGELOG.md", *SAID):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


def replaced(path, old, new):
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


def test_one_version_is_said_everywhere():
    assert DISAGREEMENTS(ROOT) == []


@pytest.mark.parametrize("name", SAID)
def test_a_place_that_says_another_version_is_named(root, name):
    replaced(root / name, PROJECT["version"], "9.9.9")
    (found,) = DISAGREEMENTS(root)
    assert found == f"{name} does not say {PROJECT['version']}, which pyproject.toml says"


def test_a_release_has_a_tag_and_a_heading_with_its_date(root):
    version = PROJECT["version"]
    assert "first heading of CHANGELOG.md" in DISAGREEMENTS(root, f"v{version}")[0]
    text = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    changelog = re.sub(r"## Unreleased\n\nWhat .* brings:\n", f"## {version} - 2027-01-31\n", text)
    (root / "CHANGELOG.md").write_text(changelog, encoding="utf-8")
    assert DISAGREEMENTS(root, f"v{version}") == DISAGREEMENTS(root) == []
    (other,) = DISAGREEMENTS(root, "v9.9.9")
    assert other == f"the tag is v9.9.9, and pyproject.toml says {version}: it should be v{version}"
    (root / "CHANGELOG.md").write_text(f"# Changelog\n\n## {version} - soon\n", encoding="utf-8")
    assert len(DISAGREEMENTS(root)) == 1


def test_the_script_ends_with_one_where_they_disagree():
    done = subprocess.run([sys.executable, ROOT / ".ci/version", "v9"], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "it should be v" in done.stdout


def test_workflows_try_every_python_and_run_what_exists():
    pythons = re.findall(r":: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
    tests = (ROOT / ".github/workflows/tests.yml").read_text()
    assert re.findall(r'"(3\.\d+)"', tests) == pythons
    assert "run: .ci/run" in tests
    for workflow in (ROOT / ".github/workflows").iterdir():
        for script in re.findall(r"\.ci/\w+", workflow.read_text()):
            assert (ROOT / script).is_file()


def test_the_recipe_for_conda_needs_what_the_package_needs():
    yaml = pytest.importorskip("yaml", reason="the extra docs is not installed")
    recipe = yaml.safe_load((ROOT / "conda/recipe.yaml").read_text(encoding="utf-8"))
    needed = {re.sub(r"(\w+)>=", r"\1 >=", line).replace("torch ", "pytorch ") for line in PROJECT["dependencies"]}
    assert {*recipe["requirements"]["run"]} == {"python", *needed}
    built = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]
    assert {line.replace(">=", " >=") for line in built} <= {*recipe["requirements"]["host"]}
    (script,) = recipe["build"]["python"]["entry_points"]
    assert script == f"diff3ds = {PROJECT['scripts']['diff3ds']}"
    assert (recipe["about"]["summary"], recipe["about"]["license"]) == (PROJECT["description"], PROJECT["license"])


def test_the_image_is_built_of_files_that_are_there_and_let_in():
    copied = re.findall(r"^COPY (?!--from)(.*) \S+$", (ROOT / "Dockerfile").read_text(), re.MULTILINE)
    names = " ".join(copied).split()
    let_in = re.findall(r"^!(.*)$", (ROOT / ".dockerignore").read_text(), re.MULTILINE)
    assert {*names} == {*let_in}
    assert all((ROOT / name).exists() for name in names)
    sdist = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["scikit-build"]["sdist"]["include"]
    # Else the wheel that is built there would lack something.
    assert {name.strip("/") for name in sdist} <= {*names}
    extras = re.search(r"^ARG EXTRAS=(.*)$", (ROOT / "Dockerfile").read_text(), re.MULTILINE)[1].split(",")
    assert {*extras} <= PROJECT["optional-dependencies"].keys()


@pytest.mark.slow
def test_the_image_draws_a_chair():
    docker = shutil.which("docker")
    if docker is None or subprocess.run([docker, "info"], capture_output=True, check=False).returncode:
        pytest.skip("no docker is running here")
    subprocess.run([docker, "build", "-t", "diff3ds:tried", ROOT], check=True, timeout=1800)
    run = [docker, "run", "--rm", "--network", "none", "--tmpfs", "/sketches:mode=1777", "diff3ds:tried"]
    subprocess.run([*run, "text", "a chair", "--steps", "20", "-o", "chair"], check=True, timeout=600)
