"""A network of one node for rembg, for which the object is what is red: its own is nothing that tests fetch."""

import pytest


def red_network(folder, monkeypatch):
    """Makes rembg load it."""
    pytest.importorskip("rembg", reason="rembg is not installed")
    onnx = pytest.importorskip("onnx", reason="onnx is not installed")
    shape = [1, 3, 320, 320]
    red, places = (onnx.helper.make_tensor(n, onnx.TensorProto.INT64, [1], [v]) for n, v in (("start", 0), ("end", 1)))
    axis = onnx.helper.make_tensor("axis", onnx.TensorProto.INT64, [1], [1])
    graph = onnx.helper.make_graph(
        [onnx.helper.make_node("Slice", ["in", "start", "end", "axis"], ["out"])],
        "red",
        [onnx.helper.make_tensor_value_info("in", onnx.TensorProto.FLOAT, shape)],
        [onnx.helper.make_tensor_value_info("out", onnx.TensorProto.FLOAT, [1, 1, 320, 320])],
        [red, places, axis],
    )
    home = folder / "models" / "u2net"
    home.mkdir(parents=True)
    onnx.save(onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 13)]), home / "u2net.onnx")
    for name in ("REMBG_HOME", "U2NET_HOME"):
        monkeypatch.setenv(name, str(folder))
