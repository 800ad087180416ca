"""sketch.json: bit for bit there and back, and errors that name the field and the stroke."""

import json
import math

import hypothesis
import pytest
import torch
from hypothesis import strategies as st

import diff3ds as ds
from diff3ds import _files

DTYPES = [torch.float16, torch.bfloat16, torch.float32, torch.float64]


def bits(tensor):
    return tensor.clone(memory_format=torch.contiguous_format).view(torch.uint8).tolist()


def assert_same(a, b):
    assert a.width_space == b.width_space
    for name, value in a.tensors().items():
        other = b.tensors()[name]
        assert value.dtype == other.dtype
        assert value.shape == other.shape
        assert bits(value) == bits(other), name


def random_sketch(controls, dtype, count=7, width_space="image"):
    g = torch.Generator().manual_seed(controls)

    def uniform(*shape):
        return torch.rand(*shape, generator=g, dtype=torch.float64).to(dtype)

    return ds.Sketch(
        uniform(count, controls, 3) - 0.5,
        0.01 + uniform(count, controls),
        width=uniform(count),
        color=uniform(count, 3),
        opacity=uniform(count),
        width_space=width_space,
    )


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("controls", [2, 3, 4])
@pytest.mark.parametrize("width_space", ["image", "world"])
def test_reads_back_the_same_bits(tmp_path, dtype, controls, width_space):
    sketch = random_sketch(controls, dtype, width_space=width_space)
    ds.save(tmp_path / "sketch.json", sketch)
    assert_same(ds.load(tmp_path / "sketch.json"), sketch)


@hypothesis.given(
    st.sampled_from([(torch.float32, 32), (torch.float64, 64)]).flatmap(
        lambda kind: st.tuples(
            st.just(kind[0]),
            st.lists(st.floats(allow_nan=False, allow_infinity=False, width=kind[1]), min_size=6, max_size=6),
        )
    )
)
def test_any_finite_coordinates_survive(tmp_path_factory, case):
    # Smallest subnormals, the largest numbers and -0 among them.
    dtype, numbers = case
    path = tmp_path_factory.mktemp("any") / "sketch.json"
    sketch = ds.Sketch(torch.tensor(numbers, dtype=dtype).reshape(1, 2, 3))
    ds.save(path, sketch)
    assert_same(ds.load(path), sketch)


def test_layout_is_the_documented_one(tmp_path):
    ds.save(tmp_path / "s.json", ds.Sketch(torch.arange(12.0).reshape(1, 4, 3), width=0.25))
    assert json.loads((tmp_path / "s.json").read_text()) == {
        "version": 1,
        "dtype": "float32",
        "width_space": "image",
        "points": [[[0, 1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 11]]],
        "weights": [[1, 1, 1, 1]],
        "width": [0.25],
        "color": [[0, 0, 0]],
        "opacity": [1],
    }


def test_names_are_kept_and_left_out_where_there_are_none(tmp_path):
    sketch = ds.Sketch(torch.rand(2, 4, 3), names=["deckel/Kante 3 ø", ""])
    ds.save(tmp_path / "s.json", sketch)
    assert ds.load(tmp_path / "s.json").names == ("deckel/Kante 3 ø", "")
    ds.save(tmp_path / "s.json", sketch[[1]])
    assert "names" not in json.loads((tmp_path / "s.json").read_text())


def test_importance_is_kept_and_left_out_where_it_is_not_known(tmp_path):
    file = tmp_path / "s.json"
    sketch = ds.Sketch(torch.rand(3, 4, 3), importance=torch.tensor([0.7, 0.2, 0.1]))
    ds.save(file, sketch)
    assert torch.equal(ds.load(file).importance, sketch.importance)
    whole = file.read_text()
    for wrong, message in (
        ("[0.7, 1]", "importance must be a list with one item a stroke, 3"),
        ("[-1, 0, 0]", "0 must be"),
    ):
        lines = [f'"importance": {wrong}' if "importance" in line else line for line in whole.splitlines()]
        file.write_text("\n".join(lines))
        with pytest.raises(ValueError, match=message):
            ds.load(file)
    ds.save(file, sketch.replace(importance=None))
    assert "importance" not in file.read_text()
    assert ds.load(file).importance is None


def test_marks_are_kept_and_left_out_where_there_are_none(tmp_path):
    lines = torch.tensor([[[0.0, 0, 0], [1, 0, 0]], [[1, 0, 0], [2, 0, 0]], [[3, 0, 0], [4, 0, 0]]])
    sketch = ds.Sketch(lines, chains=ds.Chains.of([2, 1]), fixed=torch.tensor([False, True]))
    ds.save(tmp_path / "s.json", sketch)
    assert json.loads((tmp_path / "s.json").read_text())["fixed"] == [False, True]
    assert ds.load(tmp_path / "s.json").fixed.tolist() == [False, True]
    (tmp_path / "s.json").write_text((tmp_path / "s.json").read_text().replace("[false, true]", "[false, false]"))
    assert ds.load(tmp_path / "s.json").fixed is None


def test_sketch_without_strokes(tmp_path):
    ds.save(tmp_path / "s.json", ds.Sketch(torch.zeros(0, 4, 3)))
    assert_same(ds.load(tmp_path / "s.json"), ds.Sketch(torch.zeros(0, 4, 3)))


def test_sketch_that_needs_gradients_is_saved(tmp_path):
    sketch = ds.Sketch(torch.rand(2, 4, 3, generator=torch.Generator().manual_seed(0)).requires_grad_())
    ds.save(tmp_path / "s.json", sketch)
    assert_same(ds.load(tmp_path / "s.json"), sketch.detach())


@pytest.fixture
def data(tmp_path):
    ds.save(tmp_path / "good.json", random_sketch(4, torch.float32, count=3))
    return json.loads((tmp_path / "good.json").read_text())


def put(*keys):
    """A change of the file: put(key, index, ..., value)."""
    *inner, last, value = keys

    def change(data):
        for key in inner:
            data = data[key]
        data[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put("version", 3), r"version must be 1 or 2, got 3"),
        (put("version", "1"), r"version must be 1 or 2, got '1'"),
        (lambda d: d.pop("version"), r"not a sketch.json: .*'version'"),
        (put("dtype", "int8"), r"dtype must be one of float16, .*got 'int8'"),
        (put("dtype", ["float32"]), r"dtype must be"),
        (put("width_space", "pixel"), r'width_space must be "image" or "world", got \'pixel\''),
        (lambda d: d.pop("width_space"), r"width_space must be"),
        (lambda d: d.pop("points"), r"points must be a list"),
        (lambda d: d.pop("opacity"), r"opacity must be a list with one item a stroke, 3, got None"),
        (put("points", {}), r"points must be a list"),
        (put("points", 0, [[0, 0, 0]]), r"points of stroke 0 must be 2, 3 or 4 points"),
        (put("points", 2, 1, [0.0, 1.0]), r"points of stroke 2 must be 4 x 3 finite numbers"),
        (put("points", 1, 3, 2, math.nan), r"points of stroke 1 must be 4 x 3 finite numbers"),
        (put("points", 1, 3, 2, math.inf), r"points of stroke 1"),
        (put("points", 1, 3, 2, 10**400), r"points of stroke 1"),
        (put("points", 1, 3, 2, "1.0"), r"points of stroke 1"),
        (put("points", 1, 3, 2, True), r"points of stroke 1"),
        (put("points", 1, 3, 2, 1e39), r"points of stroke 1 must be finite, got inf"),
        (put("weights", 2, 0, 0.0), r"weights of stroke 2 must be finite and positive, got 0"),
        (put("weights", [[1, 1, 1, 1]]), r"weights must be a list with one item a stroke, 3, got 1 items"),
        (put("width", 1, -0.5), r"width of stroke 1 must be finite and not negative, got -0.5"),
        (put("width", 1, [0.5]), r"width of stroke 1 must be a finite number"),
        (put("color", 1, [0.5]), r"color of stroke 1 must be 3 finite numbers"),
        (put("names", ["a"]), r"names must be a list of texts, 3, got \['a'\]"),
        (put("names", ["a", "b", 7]), "names must be a list of texts, 3"),
        (put("fixed", [True]), r"fixed must be a list of true or false, 3, got \[True\]"),
        (put("fixed", [True, False, 1]), r"fixed must be a list of true or false, 3"),
        (put("fixed", None), r"fixed must be a list of true or false, 3, got None"),
        (put("opacity", 0, 1.5), r"opacity of stroke 0 must be in \[0, 1\], got 1.5"),
    ],
)
def test_errors_name_the_field_and_the_stroke(tmp_path, data, change, message):
    change(data)
    (tmp_path / "bad.json").write_text(json.dumps(data))
    with pytest.raises(ValueError, match=message) as error:
        ds.load(tmp_path / "bad.json")
    assert "bad.json" in str(error.value)


@pytest.mark.parametrize("text", ["", "[", "[1, 2]", "null", "3", "[" * 100_000, '{"version": 1'])
def test_other_files_are_refused(tmp_path, text):
    (tmp_path / "bad.json").write_text(text)
    with pytest.raises(ValueError, match=r"bad\.json"):
        ds.load(tmp_path / "bad.json")


def test_bytes_that_are_no_text_are_refused(tmp_path):
    (tmp_path / "bad.json").write_bytes(b"\xff{}")
    with pytest.raises(ValueError, match="UTF-8"):
        ds.load(tmp_path / "bad.json")


def test_giant_files_are_refused_unread(tmp_path, monkeypatch):
    ds.save(tmp_path / "s.json", random_sketch(4, torch.float32))
    monkeypatch.setattr(_files, "MAX_TEXT_BYTES", 100)
    with pytest.raises(ValueError, match="more than the 100 that are read"):
        ds.load(tmp_path / "s.json")


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        ds.load(tmp_path / "none.json")


@hypothesis.settings(max_examples=300)
@hypothesis.given(st.data())
def test_damaged_files_give_a_sketch_or_a_value_error(tmp_path_factory, data):
    text = json.dumps(
        {"version": 1, "width_space": "image", "points": [[[0, 0.5, -1e-3], [1, 2, 3]]] * 2, "weights": [[1, 2.5]] * 2}
        | {"width": [0.01, 1], "color": [[0, 0.5, 1]] * 2, "opacity": [1, 0.5]}
    )
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(text)))
        stop = data.draw(st.integers(start, min(start + 12, len(text))))
        filling = data.draw(
            st.sampled_from(["", "[", "]", ",", "null", "1e999", "NaN", "9" * 5000, '"', "{}", "-", "\0"])
        )
        text = text[:start] + filling + text[stop:]
    path = tmp_path_factory.mktemp("damaged") / "sketch.json"
    path.write_text(text)
    try:
        sketch = ds.load(path)
    except ValueError:
        return
    sketch.check_values()
