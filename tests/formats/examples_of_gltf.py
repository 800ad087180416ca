"""glTF files with one feature each, for the tables of docs/reference/formats-read.md."""

import json
import struct

import numpy as np
from gltf_maker import FACES, SQUARE, UV, Gltf
from read_example import Example

RED, GREEN = (255, 0, 0), (0, 255, 0)
HALVES = [[RED, GREEN]] * 2


def spans(found) -> list[float]:
    """How far triangles reach along our x, y and z, which are glTF's z, x and y."""
    points = found.vertices[found.faces].reshape(-1, 3)
    return np.round(np.ptp(points, axis=0), 4).tolist()


def low(found) -> list[float]:
    return np.round(found.vertices[found.faces].reshape(-1, 3).min(0), 4).tolist()


def color(found, face: int = 0) -> list[float]:
    """The colour in the middle of a triangle."""
    return np.round(found.colors.at(np.array([face]), np.full((1, 3), 1 / 3))[0], 2).tolist()


def is_square(found) -> bool:
    """Both of its triangles look at us."""
    a, b, c = found.vertices[found.faces].transpose(1, 0, 2)
    return spans(found) == [0, 2, 2] and np.cross(b - a, c - a).tolist() == [[4, 0, 0]] * 2


def made(change=lambda g: None, right=is_square, words: str = "", how: str = "glb", **square) -> Example:
    """A file with the square, of which something is changed."""

    def make(folder):
        g = Gltf()
        given = {name: value(g) if callable(value) else value for name, value in square.items()}
        g.square(**given)
        change(g)
        return g.write(folder, how)

    return Example(make, right, words)


def painted(change=lambda g: None, right=lambda f: True, words: str = "", kind="PNG", uv=UV, moved=None, **sampler):
    """The square with a texture whose left half is red and whose right half is green."""

    def paint(g: Gltf):
        info = g.picture(HALVES, kind, **sampler)
        if moved is not None:
            info["extensions"] = {"KHR_texture_transform": moved}
        g.json["materials"] = [{"name": "m", "pbrMetallicRoughness": {"baseColorTexture": info}}]
        g.json["meshes"][0]["primitives"][0]["material"] = 0
        change(g)

    return made(paint, right, words, uv=np.array(uv, np.float32))


def _sparse(g):
    g.json["accessors"][0]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": 2, "componentType": 5121},
        "values": {"bufferView": 3},
    }
    g.add(np.array([2], np.uint8))
    g.add(np.array([[2, 5, 0]], np.float32))


def _nodes(g):
    turn = [0, 0, 2**-0.5, 2**-0.5]
    move = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 0, 0, 1]
    g.json["nodes"] = [{"mesh": 0, "children": [1], "matrix": move}, {"mesh": 0, "rotation": turn, "scale": [3, 1, 1]}]
    g.json["scenes"] = [{"nodes": [0]}]


def _scenes(g):
    g.json["nodes"] = [{"mesh": 0, "scale": [9, 9, 9]}, {"mesh": 0}, {"mesh": 0, "translation": [5, 5, 5]}]
    g.json |= {"scene": 1, "scenes": [{"nodes": [0]}, {"nodes": [1]}]}


def _skin(g):
    attributes = g.json["meshes"][0]["primitives"][0]["attributes"]
    attributes["JOINTS_0"] = g.add(np.tile(np.array([0, 1, 0, 0], np.uint8), (4, 1)))
    attributes["WEIGHTS_0"] = g.add(np.tile(np.array([128, 127, 0, 0], np.uint8), (4, 1)), normalized=True)
    inverse = np.eye(4, dtype=np.float32)
    inverse[3, 0] = -1
    matrices = g.add(np.stack([inverse.ravel(), inverse.ravel()]))
    # One joint stays, one moves by 10 of glTF's y; the place of the mesh's own node counts for nothing.
    g.json["nodes"] = [
        {"mesh": 0, "skin": 0, "scale": [100, 100, 100]},
        {"translation": [1, 0, 0]},
        {"translation": [1, 10 * 255 / 127, 0]},
    ]
    g.json["scenes"] = [{"nodes": [0, 1, 2]}]
    g.json["skins"] = [{"joints": [1, 2], "inverseBindMatrices": matrices}]


def _morph(g):
    primitive, mesh = g.json["meshes"][0]["primitives"][0], g.json["meshes"][0]
    primitive["targets"] = [{"POSITION": g.add(SQUARE)}, {"POSITION": g.add(7 * SQUARE)}]
    mesh["weights"] = [0.5, 0]


def _instances(g):
    g.require("EXT_mesh_gpu_instancing")
    places = g.add(np.array([[0, 0, 0], [6, 0, 0], [12, 0, 0]], np.float32))
    g.json["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}}


def _hidden(g):
    g.require("KHR_node_visibility")
    hidden = {"mesh": 0, "translation": [5, 0, 0], "extensions": {"KHR_node_visibility": {"visible": False}}}
    g.json["nodes"] = [{"mesh": 0}, hidden]


def _material(**material):
    def change(g):
        g.json["materials"] = [material]
        g.json["meshes"][0]["primitives"][0]["material"] = 0

    return change


def _glossy(g):
    info = g.json["materials"][0].pop("pbrMetallicRoughness")["baseColorTexture"]
    g.json["materials"][0]["extensions"] = {"KHR_materials_pbrSpecularGlossiness": {"diffuseTexture": info}}
    g.require("KHR_materials_pbrSpecularGlossiness")


def _webp(g):
    g.require("EXT_texture_webp")
    g.json["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 0}}}]


def _second_uv(g):
    attributes = g.json["meshes"][0]["primitives"][0]["attributes"]
    attributes["TEXCOORD_1"] = attributes["TEXCOORD_0"]
    attributes["TEXCOORD_0"] = g.add(np.zeros((4, 2), np.float32))
    g.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = 1


def _rest(g):
    g.require("KHR_materials_variants", "KHR_lights_punctual", "KHR_materials_clearcoat")
    g.json["animations"] = [{"channels": [], "samplers": []}]
    g.json["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}]
    g.json["nodes"].append({"camera": 0})
    g.json["extensions"] = {"KHR_materials_variants": {"variants": [{"name": "x"}]}}
    attributes = g.json["meshes"][0]["primitives"][0]["attributes"]
    attributes["NORMAL"] = g.add(np.tile(np.array([0, 0, 1], np.float32), (4, 1)))


def _lines(g):
    primitives = g.json["meshes"][0]["primitives"]
    primitives.append({"attributes": primitives[0]["attributes"], "mode": 1})


def _bounds(low, high):
    def give(g):
        g.json["accessors"][0] |= {"min": low, "max": high}

    return give


def _lost(g):
    g.json["images"] = [{"uri": "none.png"}]


def _basisu(g):
    g.json["textures"] = [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]


def _draco(g):
    g.require("KHR_draco_mesh_compression")


def _fallback(g):
    """Draco that is not required has the numbers beside it, but not here."""
    g.json["extensionsUsed"] = ["KHR_draco_mesh_compression"]
    g.json["meshes"][0]["primitives"][0]["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": 0}}
    del g.json["accessors"][0]["bufferView"]


def _required(name):
    return lambda g: g.require(name)


def _at(uri):
    def make(folder):
        path = made(how="data").make(folder)
        content = json.loads(path.read_text())
        content["buffers"][0]["uri"] = uri
        path.write_text(json.dumps(content))
        return path

    return make


def _old(folder):
    (folder / "a.glb").write_bytes(b"glTF" + struct.pack("<IIII", 1, 20, 0, 0))
    return folder / "a.glb"


HALF = np.float32(SQUARE) / 2
NORMALISED = np.round(HALF * 32767).astype(np.int16)
EXAMPLES = {
    "a buffer beside a `.gltf`": made(how="beside"),
    "a buffer in the JSON of a `.gltf`": made(how="data"),
    "indices of each type, and none": made(faces=None, positions=SQUARE[[0, 1, 2, 0, 2, 3]]),
    "byte strides": made(stride=20),
    "normalised and quantised numbers": made(
        _required("KHR_mesh_quantization"),
        lambda f: spans(f) == [0, 1, 1],
        positions=NORMALISED,
        normalized=True,
        stride=8,
    ),
    "sparse accessors": made(_sparse, lambda f: spans(f) == [0, 2, 5]),
    "nodes in nodes: matrices, turns and scales": made(_nodes, lambda f: spans(f) == [0, 4, 6] and low(f) == [0, 5, 0]),
    "the default scene of several": made(_scenes),
    "skins": made(_skin, lambda f: spans(f) == [0, 2, 2] and low(f) == [0, 0, 10]),
    "morph targets, by the file's weights": made(_morph, lambda f: spans(f) == [0, 3, 3]),
    "strips of triangles": made(faces=np.array([0, 1, 3, 2], np.uint8), mode=5),
    "fans of triangles": made(faces=np.array([0, 1, 2, 3], np.uint32), mode=6),
    "EXT_mesh_gpu_instancing": made(_instances, lambda f: spans(f) == [0, 14, 2] and len(f.faces) == 6),
    "KHR_node_visibility": made(_hidden),
    "base colour factors, linear light": made(
        _material(pbrMetallicRoughness={"baseColorFactor": [0.5, 0, 1, 1]}), lambda f: color(f) == [0.74, 0, 1]
    ),
    "colours of vertices, linear light": made(
        COLOR_0=lambda g: g.add(np.tile(np.array([0, 32768, 0, 65535], np.uint16), (4, 1)), normalized=True),
        right=lambda f: color(f) == [0, 0.74, 0],
    ),
    "textures": painted(right=lambda f: color(f) == [0, 1, 0] and color(f, 1) == [1, 0, 0]),
    "further sets of texture coordinates": painted(_second_uv, lambda f: color(f) == [0, 1, 0]),
    "KHR_texture_transform": painted(
        _required("KHR_texture_transform"),
        lambda f: color(f) == [1, 0, 0] and color(f, 1) == [0, 1, 0],
        moved={"offset": [1, 0], "scale": [-1, 1], "rotation": 0},
    ),
    "samplers that clamp or mirror": painted(
        right=lambda f: color(f) == [0, 1, 0], uv=np.full((4, 2), 1.25), wrapS=33071, wrapT=33648
    ),
    "KHR_materials_pbrSpecularGlossiness": painted(_glossy, lambda f: color(f) == [0, 1, 0]),
    "EXT_texture_webp": painted(_webp, lambda f: color(f) == [0, 1, 0], kind="WEBP"),
    "normals, animations, cameras, lights, variants, other maps and KHR_materials_...": made(_rest),
    "points and lines beside triangles": made(_lines, words="left out: 1 set of points or lines"),
    "bounds of vertices: `min` and `max`": made(_bounds([0, 0, 0], [2, 2, 0]), lambda f: spans(f) == [0, 2, 2]),
    "vertices beyond their bounds": made(
        _bounds([0, 0, 0], [2, 1.9, 0]), words="vertices lie outside of the bounds that the file gives for them"
    ),
    "transparency: alphaMode": made(
        _material(name="glass", alphaMode="BLEND"), words="left out: transparency of the material 'glass'"
    ),
    "textures that are not there": painted(_lost, words="the texture of material 'm'"),
    "textures in KTX2 without a fallback": painted(_basisu, words="the texture of material 'm'"),
    "KHR_texture_basisu, required": made(_required("KHR_texture_basisu"), words="needs KHR_texture_basisu"),
    "KHR_draco_mesh_compression": made(_draco, words="needs KHR_draco_mesh_compression"),
    "Draco alone, where it is not required": made(_fallback, words="needs KHR_draco_mesh_compression"),
    "EXT_meshopt_compression": made(_required("EXT_meshopt_compression"), words="needs EXT_meshopt_compression"),
    "any other extension that is required": made(_required("XYZ_shape"), words="needs XYZ_shape"),
    "points and lines alone": made(mode=1, words="points and lines alone"),
    "buffers on other machines": Example(_at("https://example.org/a.bin"), words="is not in its folder"),
    "buffers outside of the folder": Example(_at("../a.bin"), words="is not in its folder"),
    "glTF 1.0": Example(_old, words="glTF of version 1 is not read"),
    "faces of vertices that there are not": made(faces=FACES + 3, words="a face has vertex"),
}
